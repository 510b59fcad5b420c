"""Factor on the step for ends of short pipes, with which no pipe and no network grows."""

from math import factorial

import numpy as np
import pytest
from reference.scenes import NO_FRICTION, junction, lake, pipe, scene

import fvsolve
from fvsolve.core.schemes import SCHEMES, end_rate_factor
from fvsolve.core.step_limits.advection_limit import advection_limit
from fvsolve.core.step_limits.grid_limits import pipe_limit
from fvsolve.core.step_limits.step_notices import step_limits
from fvsolve.core.step_limits.symbol import WEIGHTS

STAGES = {"ssp-rk3": 3, "rk4": 4}
LENGTH, SPEED = 100.0, 1000.0


def amplification(method: str, z: np.ndarray) -> np.ndarray:
    return np.abs(sum(z**k / factorial(k) for k in range(STAGES[method] + 1)))


def spectrum(scheme: str, cells: int, end: dict) -> np.ndarray:
    """Eigenvalues of a pipe between a lake and an end, times the travel time of a cell [-]."""
    nodes, links = {"lake": lake(50.0), "end": end}, {}
    links["main"] = pipe("lake", "end", LENGTH, 0.3, SPEED, cells, friction=NO_FRICTION)
    numerics = {"scheme": scheme, "method": "rk4", "courant": 0.5}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, numerics, ["lake.pressure"], 0.1)))
    columns = [model.rhs(0.0, unit) for unit in np.eye(model.y_size)]
    return np.linalg.eigvals(np.array(columns).T) * LENGTH / cells / SPEED


def stepping(scheme: str, cells: int, end: dict, courant: float):
    """h J of a pipe at a Courant number, and its model."""
    nodes, links = (
        {"lake": lake(50.0), "end": end},
        {"main": pipe("lake", "end", LENGTH, 0.3, SPEED, cells)},
    )
    numerics = {"scheme": scheme, "method": "ssp-rk3", "step": courant * LENGTH / cells / SPEED}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 10.0, numerics, ["lake.pressure"], 0.1)))
    return numerics["step"] * np.array(
        [model.rhs(0.0, unit) for unit in np.eye(model.y_size)]
    ).T, model


def powered(z: np.ndarray) -> float:
    """Norm of the matrix of a thousand steps of ssp-rk3."""
    one = np.eye(len(z))
    return np.linalg.norm(
        np.linalg.matrix_power(one + z @ (one + z / 2.0 @ (one + z / 3.0)), 1000), 2
    )


def courant_limit(scheme: str, cells: int, method: str) -> float:
    """Greatest Courant number below that at which a mode of an open or closed pipe grows, in steps of 0.01."""
    found = np.concatenate([spectrum(scheme, cells, end) for end in (lake(50.0), junction())])
    tried = np.arange(0.01, 2.0, 0.01)
    grows = [c for c in tried if np.max(amplification(method, c * found)) > 1 + 1e-9]
    return grows[0] - 0.01 if grows else 2.0


@pytest.mark.parametrize("scheme", ["linear-upwind", "fromm", "central", "upwind3", "upwind5"])
def test_the_factor_is_exactly_that_of_the_ends(scheme):
    inside = 0.9 * min(1.0, advection_limit(scheme, "ssp-rk3").limit)
    for cells in range(1, 13):
        asked = max(1.0, inside / courant_limit(scheme, cells, "ssp-rk3"))
        assert asked <= end_rate_factor(scheme, cells) <= asked * 1.06, cells
        assert inside / end_rate_factor(scheme, cells) <= courant_limit(scheme, cells, "rk4")


@pytest.mark.parametrize("scheme", WEIGHTS)
def test_a_short_pipe_decays_below_its_limit_and_grows_beyond_it_with_a_notice(scheme):
    """The limit of a short pipe between reflecting ends separates decay and growth of the powers of its step.

    The ends are two lakes, or a lake and an inflow.
    """
    for cells in range(1, 9):
        for end, returned in ((lake(50.0), 1.0), ({"type": "inflow", "flow": 0.0}, -1.0)):
            limit = pipe_limit(scheme, "ssp-rk3", cells, (returned,))
            z, model = stepping(scheme, cells, end, 1.05 * limit)
            assert powered(z * 0.99 / 1.05) < 10.0 and powered(z) > 1e6, cells
            (one,) = step_limits(model)
            assert not one.ok and one.limit <= limit * (1 + 1e-9) and "links.main" in one.text


@pytest.mark.parametrize("limiter", ["minmod", "van-leer", "monotonized-central"])
def test_a_limiter_tolerates_a_little_more_than_its_smooth_limit(limiter):
    """With a limiter noise does not grow below the limit of `fromm`, and grows at 1.5 times this limit."""
    rng = np.random.default_rng(5)
    for cells in (2, 3, 4, 5, 8):
        limit = pipe_limit("fromm", "ssp-rk3", cells)
        for factor, grows in ((0.99, False), (1.5, True)):
            h = factor * limit * LENGTH / cells / SPEED
            nodes = {"lake": lake(50.0), "end": junction()}
            links = {"p": pipe("lake", "end", LENGTH, 0.3, SPEED, cells)}
            numerics = {"scheme": "muscl", "limiter": limiter, "method": "ssp-rk3", "step": h}
            model = fvsolve.build(
                fvsolve.load(scene(nodes, links, 150 * h, numerics, ["lake.pressure"], 0.1))
            )
            state = fvsolve.initial_state(model)
            state.y[:] = rng.normal(size=len(state.y))
            after = fvsolve.advance(model, state, 150 * h)
            assert bool(np.abs(after.y).max() > 100.0 * np.abs(state.y).max()) is grows, cells
            assert [one.ok for one in step_limits(model)] == ([False] if grows else [])


def test_a_short_pipe_without_returning_waves_is_only_doubtful():
    """Four cells at Courant number 0.55 grow between two lakes; between long pipes the notice does not fail the run."""
    found = []
    for far in (False, True):
        nodes = {"a": lake(50.0), "b": junction() if far else lake(50.0)}
        links = {"main": pipe("b" if far else "a", "c" if far else "b", LENGTH, 0.3, SPEED, 4)}
        if far:
            nodes |= {"c": junction(), "d": junction()}
            links |= {
                "one": pipe("a", "b", 1500.0, 0.3, SPEED, 45),
                "two": pipe("c", "d", 1500.0, 0.3, SPEED, 45),
            }
        numerics = {
            "scheme": "linear-upwind",
            "method": "ssp-rk3",
            "step": 0.55 * LENGTH / 4 / SPEED,
        }
        case = scene(nodes, links, 20.0, numerics, ["main.flow"], 0.1)
        case["nodes"]["a"]["head"] = {"time": [0.0, 1.0], "value": [50.0, 40.0], "kind": "step"}
        result = fvsolve.run(case)
        found.append(
            (result.ok, [one.place for one in result.warnings if one.kind == "step-limit"])
        )
    assert found == [(False, ["links.main"]), (True, ["links.main"])]


@pytest.mark.parametrize("cells", [5, 12, 30, 39])
@pytest.mark.parametrize("turned", [False, True])
def test_a_proved_limit_of_few_cells_separates_growth(cells, turned):
    """The proved limit 1 of upwind with Euler also holds for few cells, before growth is visible.

    Twenty steps at Courant number 1.05 multiply the shortest wave by seven.
    """
    found = []
    for courant in (1.0, 1.05):
        h = courant * LENGTH / cells / SPEED
        nodes = {"lake": lake(50.0), "end": {"type": "inflow", "flow": 0.0}}
        links = {
            "main": pipe(
                *(("end", "lake") if turned else ("lake", "end")), LENGTH, 0.3, SPEED, cells
            )
        }
        result = fvsolve.run(
            scene(nodes, links, 20 * h, {"scheme": "upwind", "method": "euler", "step": h}, [], h)
        )
        found.append(
            (
                result.ok,
                [(one.place, one.limit) for one in result.warnings if one.kind == "step-limit"],
            )
        )
    assert found == [(True, []), (False, [("links.main", pytest.approx(1.0))])]


def test_upwind_retains_its_step_so_that_courant_1_stays_exact():
    assert not SCHEMES["upwind"].end_factors
    assert all(end_rate_factor("upwind", cells) == 1.0 for cells in range(1, 20))


@pytest.mark.in_turn
@pytest.mark.parametrize("method", ["ssp-rk3", "rk4"])
@pytest.mark.parametrize("scheme", ["muscl", "weno5", "upwind5", "upwind3"])
def test_noise_in_short_pipes_does_not_grow_at_courant_nine_tenths(scheme, method):
    rng = np.random.default_rng(3)
    for cells in (1, 2, 3, 4, 5, 6, 8):
        nodes = {"lake": lake(50.0), "tee": junction(), "blind": junction(), "shut": junction()}
        links = {
            "one": pipe("lake", "tee", 100.0, 0.3, 1000.0, cells, friction=NO_FRICTION),
            "two": pipe("tee", "blind", 80.0, 0.2, 900.0, cells, friction=NO_FRICTION),
            "three": pipe(
                "tee", "shut", 130.0, 0.4, 1200.0, max(1, cells - 1), friction=NO_FRICTION
            ),
        }
        numerics = {"scheme": scheme, "method": method, "courant": 0.9}
        model = fvsolve.build(
            fvsolve.load(scene(nodes, links, 1.0, numerics, ["tee.pressure"], 0.1))
        )
        state = fvsolve.initial_state(model)
        state.y[:] = rng.normal(size=len(state.y))
        before = np.max(np.abs(state.y))
        state = fvsolve.advance(model, state, 200.0)
        assert np.max(np.abs(state.y)) < 1.5 * before, cells
