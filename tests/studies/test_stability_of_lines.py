"""Stability with delay lines: the linear system equals the steps of the program, and runs fail at its limits."""

import numpy as np
import pytest
from model.test_delay_lines import short, vessel
from reference.delays import main, turned

import fvsolve
from fvsolve import studies
from fvsolve.errors import FvsolveError
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.operating_point import with_held_schedules
from fvsolve.studies.stability.delay_line_limits import DelayLineLimits, DelayLineRuns, DelayLineSystem, read_history


def system(case: dict, method: str, h: float) -> DelayLineSystem:
    """Linear system of the steps of a case, with step h [s]."""
    case["numerics"] |= {"method": method, "step": h}
    model = fvsolve.build(fvsolve.load(case))
    return DelayLineSystem(with_held_schedules(model, 0.0), method_named(method), h)


@pytest.mark.parametrize("method", ["euler", "rk4", "ssp-rk3", "trapezoid", "gauss-4"])
@pytest.mark.parametrize("scene", ["vessel", "short", "rough"])
def test_a_step_of_the_linear_system_is_one_of_the_program(method, scene):
    """40 steps from given waves: with a chamber, with lines shorter than steps and a valve, and with friction."""
    rough = main(friction={"model": "steady", "factor": 0.1}, numerics={"delay_tolerance": 0.02})
    case = {"vessel": vessel(method, 0.01, volume=0.15), "short": short("delay-line"), "rough": rough}[scene]
    one = system(case, method, 0.01)
    x, before = (part[..., :1] * 1e-6 for part in one.starts())  # a start that moves all states
    runs = DelayLineRuns.__new__(DelayLineRuns)
    runs.steps = 40
    moved, still = (runs.start_run(one, width * x[:, 0], width * before[..., 0]) for width in (1.0, 0.0))
    for run in (moved, still):
        run.run(40.0)
    _, _, x, before = one.propagate(x, before, 40, np.inf)
    found = read_history(moved.run_data.past, one) - read_history(still.run_data.past, one)
    assert found == pytest.approx(before[..., 0], abs=1e-6 * np.abs(before).max())
    assert moved.now[one.states] - still.now[one.states] == pytest.approx(
        x[:, 0], abs=1e-6 * np.abs(x).max(initial=0.0)
    )


@pytest.mark.parametrize("method", ["euler", "implicit-midpoint"])
def test_runs_fail_at_the_step_that_is_predicted(method):
    """A wave fills the chamber of 0.15 m3 within 10 ms; the reversed pipe has an equal limit."""
    row = studies.stability(vessel("rk4", 0.01, volume=0.15), methods=[method], steps=200).rows[0]
    assert row.lines and row.rate == 0.0 and row.where == "neck" and abs(row.difference) < 0.01
    other = studies.stability(turned(vessel("rk4", 0.01, volume=0.15)), methods=[method], steps=200).rows[0]
    assert other.predicted == pytest.approx(row.predicted, rel=1e-6)


def test_what_check_tells_to_grow_has_a_limit_below_the_step():
    """Runs that tests/step_limits/test_lines.py compares with `check`, with steps of 10 ms for 30 s."""
    for method, volume, grows in (("euler", 0.6, True), ("ssp-rk3", 0.15, True), ("rk4", 0.15, False)):
        made = DelayLineLimits(
            fvsolve.load(vessel(method, 0.01, 30.0, volume)), "upwind", method_named(method), 3000, 30.0
        )
        assert made.fails(0.01) == grows


def test_where_no_store_is_no_step_fails():
    row = studies.stability(main(2.0), methods=["rk4"], steps=50).rows[0]
    assert np.isinf(row.predicted) and np.isinf(row.measured) and "slowest line" in row.notes[0]
    with pytest.raises(FvsolveError, match="stability of delay lines is computed about the start"):
        studies.stability(main(2.0), at=1.0)
