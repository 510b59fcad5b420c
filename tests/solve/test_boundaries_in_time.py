"""Kinks and jumps within few rounding errors of a boundary of a run or advance do not cause extremely short steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.folders import CASES
from reference.scenes import AMBIENT, RHO, chamber, reservoir, scene, valve

import fvsolve

WAYS = [{"method": name, "step": 2e-4} for name in ("rk4", "trapezoid", "rodas-5p", "radau-iia-5", "implicit-euler")]
WAYS += [{"method": name, "rtol": 1e-8} for name in ("dormand-prince", "rodas-5p", "radau-iia-5", "auto")]
ROUNDINGS = (-5, -2, -1, 0, 1, 2, 5)


def beside(t: float, roundings: int) -> float:
    for _ in range(abs(roundings)):
        t = float(np.nextafter(t, math.copysign(math.inf, roundings)))
    return t


def filling(at: float, kind: str, numerics: dict) -> dict:
    """Case of a chamber between two valves, with one kink or jump of the supply pressure."""
    fed = {"time": [0.0, at], "value": [3e5, 3.1e5], "kind": "step"}
    if kind == "kink":
        fed = {"time": [0.0, at, at + 0.1], "value": [3e5, 3e5, 3.2e5]}
    nodes = {"fed": reservoir(fed), "c": chamber(0.05, 2.2e5), "sink": reservoir(AMBIENT)}
    links = {"in": valve("fed", "c", 1e-5), "out": valve("c", "sink", 1e-5)}
    return scene(nodes, links, 0.02, numerics, ["c.pressure"], 0.005)


@pytest.mark.parametrize("kind", ["kink", "jump"])
@pytest.mark.parametrize("numerics", WAYS, ids=lambda way: " ".join(map(str, way.values())))
def test_a_break_beside_a_boundary_is_as_good_as_on_it(kind, numerics):
    ends = []
    for roundings in ROUNDINGS:
        for boundary in (0.01, 0.02):
            case = filling(beside(boundary, roundings), kind, numerics)
            result = fvsolve.run(case)
            assert result.ok, result.reason
            model = fvsolve.build(fvsolve.load(case))
            state = fvsolve.initial_state(model)
            for until in (0.01, 0.02):
                state = fvsolve.advance(model, state, until)
                assert state.t == until
            if boundary == 0.01:
                ends += [result["c.pressure"][-1], 2.2e5 + state.y[0] * 2.2e9 / (RHO * 0.05)]
    assert np.ptp(ends) <= 1e-6 * ends[0]


def test_the_loop_of_the_manual_goes_through_a_shipped_drive():
    """A loop of advances by 1 ms passes the corners of the spool's schedule, one rounding error away from its sums."""
    model = fvsolve.build(fvsolve.load(CASES / "hydraulic-drive.toml"))
    state = fvsolve.initial_state(model)
    while state.t < 0.2:
        state = fvsolve.advance(model, state, state.t + 1e-3)
    assert state.t == pytest.approx(0.2, abs=1e-3)
