"""What the ends of a short pipe cost: a known factor on the step, with which no pipe and no network grows."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from truth.scenes import NO_FRICTION, junction, lake, pipe, scene

import fvsolve
from fvsolve.model.schemes import QUICKER, quicker

STAGES = {"ssp-rk3": 3, "rk4": 4}
LENGTH, SPEED = 100.0, 1000.0


def amplification(method: str, z: np.ndarray) -> np.ndarray:
    return np.abs(sum(z**k / factorial(k) for k in range(STAGES[method] + 1)))


def spectrum(scheme: str, cells: int, end: dict) -> np.ndarray:
    """Eigenvalues of a pipe from a lake to an end, in travel times of a cell."""
    nodes, links = {"lake": lake(50.0), "end": end}, {}
    links["main"] = pipe("lake", "end", LENGTH, 0.3, SPEED, cells, friction=NO_FRICTION)
    numerics = {"scheme": scheme, "method": "rk4", "courant": 0.5}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, numerics, ["lake.pressure"], 0.1)))
    columns = [model.rhs(0.0, unit) for unit in np.eye(model.y_size)]
    return np.linalg.eigvals(np.array(columns).T) * LENGTH / cells / SPEED


def courant_limit(scheme: str, cells: int, method: str) -> float:
    """Least Courant number at which some mode of an open or shut pipe grows."""
    found = np.concatenate([spectrum(scheme, cells, end) for end in (lake(50.0), junction())])
    tried = np.arange(0.01, 2.0, 0.01)
    grows = [c for c in tried if np.max(amplification(method, c * found)) > 1 + 1e-9]
    return grows[0] - 0.01 if grows else 2.0


@pytest.mark.parametrize("scheme", ["fromm", "upwind3", "upwind5"])
def test_the_factor_is_what_the_ends_ask_for_and_no_more(scheme):
    for cells in range(1, 13):
        asked = max(1.0, 0.9 / courant_limit(scheme, cells, "ssp-rk3"))
        assert asked <= quicker(scheme, cells) <= asked * 1.06, cells
        assert 0.9 / quicker(scheme, cells) <= courant_limit(scheme, cells, "rk4")


def test_upwind_keeps_its_step_so_that_courant_one_stays_exact():
    assert "upwind" not in QUICKER
    assert all(quicker("upwind", cells) == 1.0 for cells in range(1, 20))


@pytest.mark.parametrize("method", ["ssp-rk3", "rk4"])
@pytest.mark.parametrize("scheme", ["muscl", "weno5", "upwind5", "upwind3"])
def test_noise_in_short_pipes_does_not_grow_at_courant_nine_tenths(scheme, method):
    rng = np.random.default_rng(3)
    for cells in (1, 2, 3, 4, 5, 6, 8):
        nodes = {"lake": lake(50.0), "tee": junction(), "blind": junction(), "shut": junction()}
        links = {
            "one": pipe("lake", "tee", 100.0, 0.3, 1000.0, cells, friction=NO_FRICTION),
            "two": pipe("tee", "blind", 80.0, 0.2, 900.0, cells, friction=NO_FRICTION),
            "three": pipe("tee", "shut", 130.0, 0.4, 1200.0, max(1, cells - 1), friction=NO_FRICTION),
        }
        numerics = {"scheme": scheme, "method": method, "courant": 0.9}
        model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, numerics, ["tee.pressure"], 0.1)))
        state = fvsolve.initial_state(model)
        state.y[:] = rng.normal(size=len(state.y))
        before = np.max(np.abs(state.y))
        state = fvsolve.advance(model, state, 200.0)
        assert np.max(np.abs(state.y)) < 1.5 * before, cells
