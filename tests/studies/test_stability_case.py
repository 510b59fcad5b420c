"""Stability of cases: prediction against exact growth and real runs, and bounds that mislead."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from reference.delays import main, turned
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    area,
    chamber,
    junction,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)
from reference.short_lines import short, vessel
from scipy.optimize import brentq

import fvsolve
from fvsolve import build, load, studies
from fvsolve.core.model.energy_norm import energy_form
from fvsolve.core.steppers import METHODS, method_named, stability_function
from fvsolve.errors import FvsolveError
from fvsolve.features.delay_lines.feature import history_of
from fvsolve.studies import work_limit
from fvsolve.studies.linearise import linearise, linearise_at
from fvsolve.studies.operating_point import operating_point, with_held_schedules
from fvsolve.studies.stability.delay_line_limits import (
    DelayLineLimits,
    DelayLineRuns,
    DelayLineSystem,
    read_history,
)
from fvsolve.studies.stability.growth import (
    DenseGrowth,
    VectorGrowth,
    growth_method,
    matrix_powers,
    norm_exceeds,
    norm_near,
    power_growth,
    predicted_limit,
    step_function,
    step_matrix,
)
from fvsolve.studies.stability.real_runs import RealRuns
from fvsolve.studies.stability.stability import LinearSystem, stability
from fvsolve.studies.stability.stability_row import field_of_values, region_limit

NUMERICS = {"method": "rk4", "step": 1e-3}
IMPLICIT = [
    "implicit-euler",
    "trapezoid",
    "gauss-4",
    "radau-iia-5",
    "lobatto-iiic-4",
    "tr-bdf2",
    "rodas-5p",
]


def shut(cells, scheme):
    """Case of a pipe between a shut valve and a dead end."""
    nodes = {"A": reservoir(1e6), "a": junction(), "b": junction()}
    links = {"v": valve("A", "a", 1e-3, 0.0), "p": pipe("a", "b", 100.0, 0.3, 1000.0, cells)}
    return scene(nodes, links, 1.0, {**NUMERICS, "scheme": scheme})


def through(cells, scheme):
    """Case of a pipe without reflection: its valves have the slope of the pipe, dM/dp = A / a."""
    flow, admittance = 10.0, area(0.3) / 1000.0
    conductance = 2 * flow * admittance  # M |M| = G dp
    opened, drop = math.sqrt(conductance / (2 * RHO)), flow**2 / conductance
    nodes = {"A": reservoir(1e6 + 2 * drop), "a": junction(), "b": junction(), "B": reservoir(1e6)}
    links = {
        "p": pipe("a", "b", 100.0, 0.3, 1000.0, cells),
        "v": valve("A", "a", opened),
        "w": valve("b", "B", opened),
    }
    return scene(nodes, links, 1.0, {**NUMERICS, "scheme": scheme})


def branches(cells, scheme):
    """Case of three pipes that join, with a reservoir, a flowing valve and a dead end."""
    nodes = {
        "A": reservoir(1.2e6),
        "t": junction(),
        "g": junction(),
        "B": reservoir(1e6),
        "d": junction(),
    }
    links = {
        "p": pipe("A", "t", 100.0, 0.3, 1000.0, cells),
        "q": pipe("t", "g", 60.0, 0.2, 1100.0, 5),
        "r": pipe("t", "d", 80.0, 0.25, 900.0, 7),
        "v": valve("g", "B", 2e-3),
    }
    return scene(nodes, links, 1.0, {**NUMERICS, "scheme": scheme})


def chambers(count, scheme="upwind"):
    """Case of a chain of chambers and flowing valves between two pressures."""
    nodes = {
        "in": reservoir(2e6),
        **{f"c{k}": chamber(1e-3 * (1 + k % 3)) for k in range(count)},
        "out": reservoir(1e6),
    }
    names = list(nodes)
    links = {f"v{k}": valve(names[k], names[k + 1], 1e-5) for k in range(count + 1)}
    return scene(nodes, links, 1.0, NUMERICS)


def matrix(case):
    """Jacobian J of a case in its energy norm."""
    at = operating_point(case)
    return energy_form(at.model).seen(linearise_at(at).a)


def test_powers_are_powers_and_hold_the_last():
    m = np.array([[0.9, 0.3], [-0.2, 1.0]])
    for steps in (1, 2, 33, 999, 1000, 1024):
        found = dict(matrix_powers(m, steps))
        assert max(found) == steps and set(range(1, min(steps, 64) + 1)) <= set(found)
        assert all(
            np.allclose(p, np.linalg.matrix_power(m, n), rtol=1e-10) for n, p in found.items()
        )
        assert set(dict(matrix_powers(m, steps, few=True))) <= set(found)


@pytest.mark.parametrize("name", [name for name, m in METHODS.items() if name == m.name])
def test_a_step_matrix_is_the_stability_function_of_its_eigenvalues(name):
    method, rng = method_named(name), np.random.default_rng(1)
    rotated = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    blocks = np.array(
        [[-0.3, 0.7, 0, 0], [-0.7, -0.3, 0, 0], [0, 0, -2.0, 0.5], [0, 0, -0.5, -2.0]]
    )
    found = np.linalg.eigvals(step_matrix(method, rotated @ blocks @ rotated.T))
    exact = stability_function(method)(np.array([-0.3 + 0.7j, -0.3 - 0.7j, -2 + 0.5j, -2 - 0.5j]))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(exact), abs=1e-12)


@pytest.mark.parametrize(
    "name", [name for name, m in METHODS.items() if name == m.name and m.explicit]
)
def test_a_step_of_the_program_is_the_step_matrix_to_round_off(name):
    case = branches(5, "upwind5")
    del case["nodes"]["B"], case["links"]["v"]  # exactly linear without its valve
    assert step_error(case, name, 0.01) < 1e-10


@pytest.mark.parametrize("name", IMPLICIT)
def test_an_implicit_step_of_the_program_is_the_step_matrix(name):
    assert step_error(shut(5, "upwind3"), name, 0.05) < 1e-7


def step_error(case, name, h):
    """Greatest difference between steps of unit vectors in the program and R(h J), relative to R(h J)."""
    at = operating_point(case)
    a = linearise_at(at).a
    runs = RealRuns(at, name, energy_form(at.model), a=a)
    size = 1e-6
    columns = []
    for unit in np.eye(len(a)):
        run = runs.loop(size * unit, h)
        run.run(1.0)
        columns.append(run.now / size)
    exact = step_matrix(method_named(name), h * a)
    return np.max(np.abs(np.array(columns).T - exact)) / np.max(np.abs(exact))


@pytest.mark.parametrize("steps", [100, 1000])
def test_limits_of_a_single_mode_are_those_of_its_powers(steps):
    decay = predicted_limit(DenseGrowth(method_named("euler"), np.array([[-5.0]]), steps))
    assert decay.step == pytest.approx((1 + 1000 ** (1 / steps)) / 5.0, rel=2e-4)
    swing = predicted_limit(
        DenseGrowth(method_named("euler"), np.array([[0.0, 3.0], [-3.0, 0.0]]), steps)
    )
    assert swing.step == pytest.approx(math.sqrt(1000 ** (2 / steps) - 1) / 3.0, rel=2e-4)
    assert (
        predicted_limit(DenseGrowth(method_named("radau-iia-5"), np.array([[-5.0]]), steps)).step
        == math.inf
    )


def test_the_greatest_growth_is_not_missed_between_the_powers_looked_at():
    for cells, courant in ((20, 1.2), (40, 1.1), (60, 1.07)):
        m = step_matrix(method_named("euler"), courant * (np.eye(cells, k=-1) - np.eye(cells)))
        power, most = np.eye(cells), 0.0
        for _ in range(400):
            power = power @ m
            most = max(most, np.linalg.norm(power, 2))
        found = power_growth(m, 400)
        assert 0.99 * most <= found.size <= most * (1 + 1e-9)
        assert np.linalg.norm(
            np.linalg.matrix_power(m, found.steps) @ found.start
        ) == pytest.approx(found.size, rel=1e-6)


def test_an_inflow_pipe_grows_at_courant_numbers_far_below_the_limit_of_its_eigenvalues():
    for cells in (30, 100):
        e = 10.0 * cells * (np.eye(cells, k=-1) - np.eye(cells))
        euler = method_named("euler")
        found = predicted_limit(DenseGrowth(euler, e, 400)).step * 10.0 * cells
        assert found == pytest.approx(least_courant_number(cells, 400), rel=1e-3)
        assert found < 1.15
        assert region_limit(euler, np.diag(e)) * 10.0 * cells == pytest.approx(2.0, rel=1e-6)
        field = region_limit(euler, field_of_values(e)) * 10.0 * cells
        assert field == pytest.approx(1.0, abs=0.006)


def least_courant_number(cells, steps):
    """Least Courant number at which a power of (1 - C) I + C S exceeds norm 1000, S the shift; all powers by NumPy."""
    low, high = 1.0, 1.3
    while high - low > 2e-4:
        middle, power, fails = (low + high) / 2, np.eye(cells), False
        for _ in range(steps):
            shifted = np.vstack([np.zeros(cells), power[:-1]])
            power = (1 - middle) * power + middle * shifted
            if np.linalg.norm(power) > 1e3 and np.linalg.norm(power, 2) > 1e3:
                fails = True
                break
        low, high = (low, middle) if fails else (middle, high)
    return low


def test_vectors_carried_along_find_the_limit_of_squaring():
    from scipy.sparse import csr_array

    for case, name in ((through(20, "upwind"), "euler"), (shut(20, "upwind5"), "rk4")):
        e, method = matrix(case), method_named(name)
        exact, found = (
            predicted_limit(kind(method, part, 300)).step
            for kind, part in ((DenseGrowth, e), (VectorGrowth, csr_array(e)))
        )
        assert found == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("name", ["rk4", "radau-iia-5", "tr-bdf2"])
def test_a_vector_carried_along_takes_the_same_step_as_the_matrix(name):
    from scipy.sparse import csr_array

    e, rng = matrix(shut(6, "upwind5")), np.random.default_rng(2)
    v = rng.standard_normal((e.shape[0], 2))
    found = step_function(method_named(name), 0.01, csr_array(e))[0](v)
    assert found == pytest.approx(step_matrix(method_named(name), 0.01 * e) @ v, abs=1e-11)


def test_norms_that_cheap_bounds_do_not_decide_are_those_of_singular_values():
    rng = np.random.default_rng(4)
    for n in (1, 7, 90):
        m = rng.standard_normal((n, n))
        exact = np.linalg.norm(m, 2)
        assert norm_exceeds(m, 0.999 * exact) and not norm_exceeds(m, 1.001 * exact)
        assert norm_near(m, rng.standard_normal(n))[0] == pytest.approx(exact, rel=2e-6)
    assert norm_exceeds(np.array([[np.inf]]), 1e3) and not norm_exceeds(np.zeros((2, 2)), 1.0)


def test_steps_of_a_lossless_pipe_are_those_of_its_eigenvalues_though_pivots_could_grow():
    """With all states of a stage together, elimination met a pivot of 1e-76 at this step: an internal error."""
    skew = np.eye(500, k=1) - np.eye(500, k=-1)
    c = 11.24554069519575 / np.linalg.norm(skew, 2)
    values, vectors = np.linalg.eigh(1j * skew)
    r = stability_function(method_named("radau-iia-5"))(-1j * c * values)
    exact = (vectors * r @ vectors.conj().T).real
    assert step_matrix(method_named("radau-iia-5"), c * skew) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("states", [90, 600])
def test_both_ways_to_a_prediction_spend_a_common_limit(states, monkeypatch):
    e = 10.0 * (np.eye(states, k=-1) - np.eye(states))
    growth = growth_method(method_named("rk4"), e, 50)
    assert isinstance(growth, DenseGrowth if states < 500 else VectorGrowth)
    growth.fails(0.01)
    assert 0.0 < growth.work.spent < 1.0
    monkeypatch.setattr(work_limit, "TIME_LIMIT", growth.work.spent)
    with pytest.raises(
        FvsolveError, match=f"{states} states and 50 steps take longer.*fewer cells.*fewer --steps"
    ):
        growth.fails(0.02)


def test_a_basin_of_384_states_is_predicted_within_the_limit():
    """As many products of matrices as powers are checked, not as many singular values; runs confirm the limit."""
    pool = {
        "type": "basin",
        "physics": "liquid",
        "size": [2.0, 1.0],
        "cells": [16, 8],
        "thickness": 0.1,
        "pressure": 5e5,
        "patches": {"port": {"side": "west", "span": [0.25, 0.75]}},
    }
    hole = {
        "type": "orifice",
        "laminar_reynolds": 1e6,
        "from": "pool.port",
        "to": "o",
        "area": 0.004,
    }
    case = scene(
        {"o": reservoir(5e5), "pool": pool},
        {"g": hole},
        0.004,
        {"scheme": "upwind", "method": "rk4", "courant": 0.8},
    )
    side = LinearSystem(operating_point(case))
    growth = growth_method(method_named("rk4"), side.e, 100)
    found = predicted_limit(growth)
    assert side.e.shape == (384, 384) and growth.work.spent < 10.0
    small, large = (
        np.linalg.matrix_power(growth.matrix(h), 100) for h in (0.9 * found.step, 1.1 * found.fails)
    )
    assert np.linalg.norm(small, 2) < 1e3 < np.linalg.norm(large, 2)


def test_powers_below_a_bound_are_not_computed(monkeypatch):
    """A step matrix of norm 1 needs one check, and its powers none."""
    rotation = np.array([[0.0, 3.0], [-3.0, 0.0]])
    growth, seen = DenseGrowth(method_named("implicit-midpoint"), rotation, 1000), []
    monkeypatch.setattr(
        growth,
        "powers",
        lambda m, few: (seen.append(n) or (n, p) for n, p in matrix_powers(m, 1000)),
    )
    assert not growth.fails(0.5) and seen == [1]


PAIRS = [
    (shut, "upwind", "euler"),
    (shut, "fromm", "heun"),
    (shut, "central", "rk4"),
    (shut, "upwind5", "ssp-rk3"),
    (through, "upwind", "euler"),
    (through, "upwind", "rk4"),
    (through, "upwind3", "ssp-rk2"),
    (through, "upwind5", "dormand-prince"),
    (branches, "linear-upwind", "bogacki-shampine"),
    (branches, "upwind5", "rk4"),
    (branches, "upwind", "tsitouras"),
    (chambers, "upwind", "euler"),
    (through, "linear-upwind", "dormand-prince"),
    (chambers, "upwind", "rk4"),
    (chambers, "upwind", "dormand-prince"),
]


@pytest.mark.parametrize("make, scheme, method", PAIRS)
def test_prediction_and_measurement_agree_to_1_percent(make, scheme, method):
    (row,) = stability(make(16, scheme), [scheme], [method], steps=300).rows
    assert abs(row.difference) < 0.005
    if make is not chambers:
        assert row.courant(row.predicted) == row.predicted * row.rate > 0.05


def test_misleading_bounds_are_reported_with_the_reason():
    (row,) = stability(through(30, "upwind"), ["upwind"], ["euler"], steps=300).rows
    assert row.courant(row.eigenvalues) == pytest.approx(2.0, rel=1e-6)
    assert row.courant(row.predicted) < 1.2
    assert any("eigenvalues are misleading" in note for note in row.notes)
    (row,) = stability(shut(12, "upwind5"), ["upwind5"], ["rk4"], steps=300).rows
    assert row.field_of_values == 0.0 and row.predicted > 0.0
    assert any("field of values allows no step" in note for note in row.notes)


def test_a_closed_chamber_and_a_tank_are_slower_than_any_bound():
    (row,) = stability(chambers(3), None, ["implicit-midpoint"], steps=100).rows
    assert math.isinf(row.predicted) and math.isinf(row.measured) and math.isinf(row.eigenvalues)
    assert row.plain()["predicted"] == "none"


def test_limited_schemes_are_measured_between_limits_of_their_frozen_weights():
    (row,) = stability(shut(20, "muscl"), ["muscl"], ["euler"], steps=200).rows
    assert math.isnan(row.predicted) and {"upwind", "fromm"} < set(row.frozen)
    assert min(row.frozen.values()) < row.measured < max(row.frozen.values())
    assert row.longer < row.measured
    (plain,) = stability(shut(20, "upwind"), ["upwind"], ["euler"], steps=200).rows
    assert row.frozen["upwind"] == pytest.approx(plain.predicted, rel=2e-4)
    assert any("no sharp limit" in note for note in row.notes)


def test_rows_that_are_finished_are_reused(tmp_path):
    first = stability(chambers(3), None, ["euler"], steps=100, out=tmp_path).rows
    before = (tmp_path / "points.jsonl").read_text()
    again = stability(chambers(3), None, ["euler"], steps=100, out=tmp_path).rows
    assert (
        again[0].plain() == first[0].plain() and (tmp_path / "points.jsonl").read_text() == before
    )


def test_unanswerable_requests_are_reported():
    case = scene(
        {"a": reservoir(2e6), "b": reservoir(1e6)}, {"v": valve("a", "b", 1e-4)}, 1.0, NUMERICS
    )
    with pytest.raises(FvsolveError, match="has no state"):
        stability(case)
    with pytest.raises(FvsolveError, match="at least 10 steps"):
        stability(chambers(2), steps=3)
    with pytest.raises(FvsolveError, match='did you mean "rk4"'):
        stability(chambers(2), methods=["rk44"])


def test_the_command_prints_a_single_json_object_and_draws(tmp_path, monkeypatch, fvs):
    monkeypatch.chdir(tmp_path)
    code, out, _ = fvs("stability", "chamber-chain", "--method", "rk4", "--steps", "100", "--json")
    assert code == 0
    found = json.loads(out)
    (row,) = found["rows"]
    assert abs(row["difference"]) < 0.01 and row["eigenvalues"] < row["predicted"]
    folder = tmp_path / "runs" / "chamber-chain.stability"
    assert {path.name for path in folder.iterdir()} == {
        "points.jsonl",
        "stability.csv",
        "spectrum-rk4.png",
    }


def test_without_a_case_the_command_answers_for_a_periodic_grid(fvs):
    code, out, _ = fvs("stability", "--scheme", "upwind", "--method", "euler", "--json")
    assert code == 0 and json.loads(out)["limits"][0]["limit"] == 1.0


def carried(method="rk4", ends=("lake", "end"), **scalar):
    """Case of a pipe with ten cells of 10 m and a dye; `vessel`, a tank without dye, may be at either end."""
    nodes = {
        "lake": reservoir(3e5, scalars={"dye": 1.0}),
        "end": reservoir(2.99e5),
        "vessel": tank(1.0, 20.0, scalars={"dye": 0.0}),
    }
    friction = {"model": "steady", "factor": 0.02}
    links = {"main": pipe(*ends, 100.0, 0.1, 1000.0, 10, friction=friction)}
    used = {name: node for name, node in nodes.items() if name in ends}
    numerics = {"scheme": "upwind", "method": method, "courant": 0.8}
    return scene(used, links, 1.0, numerics, scalars={"dye": {"initial": 0.5, **scalar}})


def spread(model, diffusivity):
    """Eigenvalues of diffusion in a pipe with given end values: D u'' by three cells, half a cell at the ends."""
    n, dx = model.pipes[0].cells, model.pipes[0].length / model.pipes[0].cells
    a = np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    a[0, 0] = a[-1, -1] = -3.0
    return np.linalg.eigvalsh(diffusivity / dx**2 * a)


def real_end(method, low, high):
    """Real x with |R(-x)| = 1, with R as its series."""
    r = {"euler": lambda z: 1 + z, "rk4": lambda z: 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24}[method]
    return brentq(lambda x: abs(r(-x)) - 1.0, low, high)


@pytest.mark.in_turn
@pytest.mark.parametrize(("method", "low", "high"), [("euler", 1.5, 2.5), ("rk4", 2.0, 3.5)])
@pytest.mark.parametrize("quick", [{"decay": 800.0}, {"diffusivity": 30000.0}])
def test_scalars_of_pipes_bound_the_step_in_powers_eigenvalues_and_real_runs(
    method, low, high, quick
):
    case = carried(method, **quick)
    fastest = quick.get("decay") or -spread(build(load(case)), quick["diffusivity"]).min()
    row = stability(case).rows[0]
    truth = real_end(method, low, high) / fastest
    assert row.eigenvalues == pytest.approx(truth, rel=1e-3)  # the flow adds little
    # growth by 1000 in 1000 steps needs a longer step
    assert row.predicted == pytest.approx(truth, rel=6e-3)
    assert row.measured == pytest.approx(row.predicted, rel=2e-3)


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "upwind5"])
@pytest.mark.parametrize("ends", [("lake", "vessel"), ("vessel", "end"), ("end", "vessel")])
def test_a_vessel_that_starts_without_a_scalar_is_no_kink(scheme, ends):
    case = carried(ends=ends, decay=0.25)
    case["nodes"].get("end", {})["pressure"] = 2.0e5
    case["numerics"]["scheme"] = scheme
    found = linearise(case)
    i = found.states.index("vessel.dye")
    drop = AMBIENT + 20.0 * RHO * GRAVITY - 2.0e5  # pressure drop from the vessel to the end
    leaves = area(0.1) * math.sqrt(2 * RHO * drop * 0.1 / (0.02 * 100.0)) if "end" in ends else 0.0
    assert found.a[i, i] == pytest.approx(-0.25 - leaves / (20.0 * RHO), rel=1e-3)


# ----------------------------------------------------------------------------------------------------------------------
# Stability with delay lines: the linear system equals the steps of the program, and runs fail at its limits.


def system(case: dict, method: str, h: float) -> DelayLineSystem:
    """Linear system of the steps of a case, with step h [s]."""
    case["numerics"] |= {"method": method, "step": h}
    model = fvsolve.build(fvsolve.load(case))
    return DelayLineSystem(with_held_schedules(model, 0.0), method_named(method), h)


@pytest.mark.parametrize("method", ["euler", "rk4", "ssp-rk3", "trapezoid", "gauss-4"])
@pytest.mark.parametrize("scene", ["vessel", "short", "rough"])
def test_a_step_of_the_linear_system_is_a_step_of_the_program(method, scene):
    """40 steps from given waves: with a chamber, with lines shorter than steps and a valve, and with friction."""
    rough = main(friction={"model": "steady", "factor": 0.1}, numerics={"delay_tolerance": 0.02})
    case = {
        "vessel": vessel(method, 0.01, volume=0.15),
        "short": short("delay-line"),
        "rough": rough,
    }[scene]
    one = system(case, method, 0.01)
    x, before = (part[..., :1] * 1e-6 for part in one.starts())  # a start that moves all states
    runs = DelayLineRuns.__new__(DelayLineRuns)
    runs.steps = 40
    moved, still = (
        runs.start_run(one, width * x[:, 0], width * before[..., 0]) for width in (1.0, 0.0)
    )
    for run in (moved, still):
        run.run(40.0)
    _, _, x, before = one.propagate(x, before, 40, np.inf)
    found = read_history(history_of(moved.run_data), one) - read_history(
        history_of(still.run_data), one
    )
    assert found == pytest.approx(before[..., 0], abs=1e-6 * np.abs(before).max())
    assert moved.now[one.states] - still.now[one.states] == pytest.approx(
        x[:, 0], abs=1e-6 * np.abs(x).max(initial=0.0)
    )


@pytest.mark.parametrize("method", ["euler", "implicit-midpoint"])
def test_runs_fail_at_the_step_that_is_predicted(method):
    """A wave fills the chamber of 0.15 m3 within 10 ms; waves grow equally in the reversed pipe."""
    row = studies.stability(vessel("rk4", 0.01, volume=0.15), methods=[method], steps=100).rows[0]
    assert row.lines and row.rate == 0.0 and row.where == "neck" and abs(row.difference) < 0.01
    cases = vessel("rk4", 0.01, volume=0.15), turned(vessel("rk4", 0.01, volume=0.15))
    for h in (row.predicted, 1.01 * row.predicted):
        one, other = (system(case, method, h).growth(row.steps, np.inf).size for case in cases)
        assert other == pytest.approx(one, rel=1e-6) and one > 100.0


def test_a_notice_of_growth_by_check_has_a_limit_below_the_step():
    """Runs that tests/features/test_growth_in_lines.py compares with `check`, with steps of 10 ms for 30 s."""
    for method, volume, grows in (
        ("euler", 0.6, True),
        ("ssp-rk3", 0.15, True),
        ("rk4", 0.15, False),
    ):
        made = DelayLineLimits(
            fvsolve.load(vessel(method, 0.01, 30.0, volume)),
            "upwind",
            method_named(method),
            3000,
            30.0,
        )
        assert made.fails(0.01) == grows


def test_the_energy_of_waves_in_lines_is_summed_as_they_enter_and_leave():
    """From a random start the growth after 60 steps, of the running sum, is the energy of the whole history."""
    made = system(vessel("rk4", 0.01, volume=0.15), "rk4", 0.01)
    x, before = made.starts()
    for steps in (1, 7, 60):
        size, after, end, history = made.propagate(x, before, steps, np.inf)
        if after == steps:
            growth = made.size(end, history) / made.size(x, before)
            assert growth.max() == pytest.approx(size[np.argmax(growth)], rel=1e-9)
    assert made.propagate(x, before, 1, np.inf)[1] <= 1


def test_lines_next_to_a_small_chamber_are_refused_before_their_waves_are_stored():
    """0.1 s of a line in steps for a chamber of 1e-8 m3: 1e10 past waves, for which there is no memory."""
    with pytest.raises(
        FvsolveError, match="states and 1000 steps take longer than.*as of a small chamber"
    ):
        studies.stability(vessel("rk4", 0.01, volume=1e-8), methods=["rk4"])


def test_where_no_store_is_no_step_fails():
    row = studies.stability(main(2.0), methods=["rk4"], steps=50).rows[0]
    assert np.isinf(row.predicted) and np.isinf(row.measured) and "slowest line" in row.notes[0]
    with pytest.raises(FvsolveError, match="stability of delay lines is computed about the start"):
        studies.stability(main(2.0), at=1.0)


# ----------------------------------------------------------------------------------------------------------------------
# Real runs of servo axes in `stability`: rounding and the end of a case are not taken as failed steps.


ARM = Path(__file__).parents[1] / "reference" / "servo-arm.toml"
OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.4e9, "viscosity": 46e-6, "law": "linear"}
# |R| = 1.5 at infinity, |R| > 1 beyond |h lambda| = 10
THETA = "0 | 0 0\n 1 | 3/5 2/5\n ---\n | 3/5 2/5"


@pytest.fixture(scope="module")
def arm():
    """Linear system of the moving arm; hoses near zero drop have laws that are linear over 1e-11 of the pressures."""
    return LinearSystem(operating_point(ARM, {"numerics.method": "radau-iia-5"}, 0.7))


def runs(side, method):
    """Real runs of a method without an end in time."""
    found = RealRuns(side.at, method, side.form, a=side.linear.a)
    found.latest = np.inf
    return found


@pytest.mark.parametrize("method", ["rodas-5p", "radau-iia-5", "tr-bdf2"])
def test_residuals_of_newton_and_rounding_are_no_growth(arm, method):
    """Deviations start at 1e-14 here; runs at 0.2 ms are right to five digits, as the next test shows."""
    assert not any(runs(arm, method).fails(h) for h in (4e-5, 2e-4))


@pytest.fixture(scope="module")
def truth():
    return swing("radau-iia-5")


def swing(method, step=None):
    """Angle [deg] and pressure [bar] of the arm every 2 ms until 1.9 s, in motion until 1.2 s : float64[2, n]."""
    steps = {} if step is None else {"numerics.step": step}
    case = fvsolve.load(ARM)
    raw = {**case.raw, "numerics": {"end": "1.9 s"} | ({"rtol": 1e-8} if step is None else {})}
    run = fvsolve.run(raw, {"numerics.method": method, **steps})
    return np.array([run["arm.angle"], run["lift.A.gauge_pressure"]])


def test_steps_stated_to_be_safe_are_right(truth):
    at = round(1.2 / 2e-3)
    assert swing("rodas-5p", 2e-4)[:, at] == pytest.approx(truth[:, at], rel=1e-5)


@pytest.mark.parametrize("method, step", [("rk4", 2e-4), ("rodas-5p", 4e-2)])
def test_steps_that_fail_are_detected(arm, truth, method, step):
    """Explicit steps fail in motion; linearly implicit steps fail where the arm stops, with pressures 18 bar off."""
    assert runs(arm, method).fails(step)
    if method == "rodas-5p":
        assert np.abs(swing(method, step) - truth)[1].max() > 10.0


def test_an_implicit_method_that_fails_is_detected_at_its_predicted_place():
    """Chambers and flowing valves: |R| of this method exceeds 1 beyond h = 10 / |lambda|."""
    fvsolve.tableau("theta-4-10", THETA)
    nodes = {"in": reservoir(2e6), "a": chamber(1e-3), "b": chamber(2e-3), "out": reservoir(1e6)}
    links = {
        f"v{k}": valve(*pair, 1e-5)
        for k, pair in enumerate((("in", "a"), ("a", "b"), ("b", "out")))
    }
    (row,) = stability(scene(nodes, links, 1.0, {"method": "theta-4-10", "step": 1e-6})).rows
    assert row.measured == pytest.approx(row.predicted, rel=1e-3)
    assert row.eigenvalues < row.predicted < 1.1 * row.eigenvalues


def pushed():
    """Case of a cylinder that a spool valve moves to its end in 1.5 s, where its model ends."""
    nodes = {
        "P": reservoir(2e7),
        "T": reservoir(3e5),
        "A": chamber(4e-4),
        "B": chamber(4e-4),
        "post": {"type": "frame"},
        "load": {"type": "mass", "mass": 350.0, "initial_position": 1.0},
    }
    links = {
        "spool": {
            "type": "spool-valve",
            "ports": {port: port for port in "PTAB"},
            "area": 2e-5,
            "position": 0.4,
        },
        "hoseA": valve("A", "lift.A", area(9e-3)),
        "hoseB": valve("B", "lift.B", area(9e-3)),
        "lift": {
            "type": "cylinder",
            "ports": {"rod": "load", "case": "post"},
            "closed_length": 0.8,
            "stroke": 0.6,
            "piston_diameter": 63e-3,
            "rod_diameter": 36e-3,
            "dead_volume_A": 60e-6,
            "dead_volume_B": 60e-6,
            "initial_pressure_B": 4e6,
        },
    }
    return scene(nodes, links, 1.0, {"method": "radau-iia-5", "rtol": 1e-6}, fluid=OIL)


def test_a_scene_that_ends_is_no_step_that_fails():
    """1000 steps of 1.4 ms or more reach the end of the cylinder with any method."""
    (row,) = stability(pushed(), methods=["radau-iia-5"], at=0.1).rows
    assert row.measured == np.inf and row.steps * row.measured_up_to > 2.0
    (quick,) = stability(pushed(), methods=["rk4"], at=0.1).rows
    assert quick.measured == pytest.approx(quick.predicted, rel=0.1)
