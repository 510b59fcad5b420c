"""Studies of cases with delay lines: orders, against cells and rays, and exact results."""

import math

import pytest
from model.test_delay_lines import vessel
from reference import pulses
from reference.delays import fork, main, turned

from fvsolve import studies
from fvsolve.errors import FvsolveError


def rough(**numerics) -> dict:
    """Case of a pulse of demand in one delay line with large friction."""
    case = pulses.case(exact=False, points=pulses.FEW)
    case["links"]["main"]["friction"] = {"model": "steady", "factor": 0.5}
    demand = case["nodes"]["gate"]["demand"]
    demand["value"] = [one + 0.2 for one in demand["value"]]
    given = {"pipe_model": "delay-line", "method": "euler", "step": 0.00125, "delay_tolerance": 0.01, **numerics}
    return case | {"numerics": {"end": pulses.END, **given}}


def test_friction_of_lines_is_of_second_order_beside_cells():
    found = studies.order(rough())
    assert found.kind == "finer" and found.words.startswith("upwind5 on 2560 cells")
    for probe in ("gate.pressure", "main.pressure@0.37"):
        assert found.fits[probe]["L1"].order == pytest.approx(2.0, abs=0.1)
    stretched = studies.order(rough(step=0.0002), refine="space")
    assert stretched.fits["gate.pressure"]["L1"].order == pytest.approx(2.0, abs=0.2)
    assert [row.level.size for row in stretched.rows] == pytest.approx([0.1 / n for n in (6, 11, 21, 41)])


def test_drawn_the_other_way_or_by_two_the_study_is_the_same():
    one, other = studies.order(rough(), levels=2), studies.order(turned(rough()), levels=2)
    two = studies.order(rough(), levels=2, jobs=2)
    for row, same, as_well in zip(one.rows, two.rows, other.rows, strict=True):
        assert same.errors == row.errors
        for name in ("pressure", "flow", "gate.pressure"):
            assert as_well.errors[name] == pytest.approx(row.errors[name], rel=1e-8)


def test_smooth_waves_between_steps_are_of_sixth_order():
    """Against rays in the middle of a pipe; at the gate, waves return after whole steps and are exact."""
    case = pulses.case(pipe_model="delay-line", method="euler", courant=0.9)
    found = studies.order(case, levels=3)
    errors = [row.errors["main.pressure@0.37"]["L1"] for row in found.rows]
    assert found.kind == "exact" and errors[0] > 30.0 * errors[1] > 30.0**2 * errors[2]
    assert max(row.errors["gate.pressure"]["max"] for row in found.rows) < 1e-6


def test_what_is_exact_at_any_step_is_said_to_be():
    found = studies.order(main(4.0), levels=3)
    assert found.words.startswith("upwind on") and any("exact here, at any step" in note for note in found.notes)
    with pytest.raises(FvsolveError, match="no delay line of this case into more stretches: there is no friction"):
        studies.order(main(4.0), refine="space")
    with pytest.raises(FvsolveError, match="functions along pipes need cells, but main would be"):
        studies.order(main(4.0), source=lambda pipe, x, t: (0.0 * x, 0.0 * x))


def test_lines_beside_cells_are_refined_with_them():
    case = fork(
        {"scheme": "upwind5", "method": "rk4", "courant": 0.9},
        every=0.0499,
        friction={"model": "steady", "factor": 0.05},
    )
    case["links"]["up"]["pipe_model"] = "auto"
    case["nodes"]["gate"]["demand"] |= {"time": [0.0, 0.5, 1.5], "value": [0.03, 0.03, 0.0], "kind": "smooth"}
    found = studies.order(case, levels=3)
    assert [row.level.cells for row in found.rows] == [5, 10, 20]
    errors = [row.errors["gate.pressure"]["L1"] for row in found.rows]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]


def test_a_chart_of_lines_is_judged_by_cells():
    """Shorter steps help until the error of friction remains; four times the stretches divide it by fourteen."""
    steps, methods = [0.013, 0.0031, 0.00078], ["euler"]
    found = studies.chart(rough(delay_tolerance=0.005), methods=methods, step=steps)
    assert found.reference.startswith("upwind5 on") and found.floor["trajectory"] < 1e-6 and found.default == "rk4"
    errors = [point.trajectory for point in found.curves()["euler"]]
    assert errors[0] > 20.0 * errors[1] > 20.0 * errors[2]
    finer = studies.chart(rough(delay_tolerance=0.00125), methods=methods, step=[0.00078])
    assert finer.curves()["euler"][0].trajectory == pytest.approx(errors[2] * (11.0 / 41.0) ** 2, rel=0.2)
    other = turned(rough(delay_tolerance=0.005))
    other["output"]["probes"] = ["gate.pressure", "main.pressure@0.63"]
    two = studies.chart(other, methods=methods, step=steps, jobs=2)
    assert [one.trajectory for one in two.points] == pytest.approx([one.trajectory for one in found.points], rel=1e-8)


def test_a_chart_of_lines_has_steps_and_no_more():
    for asked in ({"schemes": ["upwind"]}, {"cells": [10]}, {"rtol": [1e-3]}):
        with pytest.raises(FvsolveError, match="Use step for their resolution"):
            studies.chart(rough(), **asked)
    with pytest.raises(FvsolveError, match="if delay lines are exact, any step is accurate"):
        studies.chart(main(2.0, every=0.0499), methods=["euler"], step=[0.05])


def test_a_chart_of_lines_beside_cells_refines_the_cells():
    case = fork({"scheme": "upwind5", "method": "rk4", "courant": 0.9}, 2.0, every=0.0499)
    case["links"]["up"]["pipe_model"] = "delay-line"
    case["nodes"]["gate"]["demand"] |= {"time": [0.0, 0.5, 1.5], "value": [0.03, 0.03, 0.0], "kind": "smooth"}
    found = studies.chart(case, schemes=["upwind5"], methods=["rk4"], cells=[6, 12, 24])
    errors = [one.trajectory for one in found.curves()["upwind5 rk4"]]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2] and math.isfinite(found.floor["trajectory"])
    assert "links.up.cells" not in found.points[0].setting.keys and found.default == "weno5 rk4"


def test_a_map_of_lines_says_at_which_step_a_store_makes_waves_grow():
    """A chamber that fills within 10 ms at a line of 0.1 s: the limit, and runs on both sides of it."""
    case = vessel("rk4", 0.01, 6.0, 0.15, 60)
    found = studies.failure_map(case, methods=["rk4", "implicit-midpoint", "rodas-5p"], steps=[0.0034, 0.0207, 0.068])
    assert found.wave_rate is None and found.reference.startswith("upwind5")
    for method, safe in (("rk4", 2), ("implicit-midpoint", 1)):
        row = found.row("weno5", method)
        assert [one.step <= one.limit for one in row] == [True] * safe + [False] * (3 - safe)
        assert [one.verdict == "blown up" for one in row] == [False] * safe + [True] * (3 - safe)
    assert found.row("weno5", "rodas-5p")[0].limit is None
    with pytest.raises(FvsolveError, match="Courant numbers need pipes with cells"):
        studies.failure_map(case, courants=[0.5])


def test_a_map_of_lines_without_stores_predicts_no_limit():
    case = main(2.0, every=0.0499)
    case["output"]["probes"] = ["gate.pressure"]
    found = studies.failure_map(case, methods=["euler"], steps=[0.03, 0.11])
    assert [one.verdict for one in found.squares] == ["stable", "stable"]
    assert all(math.isinf(one.limit) for one in found.squares)
    two = studies.failure_map(turned(case), methods=["euler"], steps=[0.03, 0.11], jobs=2)
    assert [one.measures.error for one in two.squares] == [one.measures.error for one in found.squares]
