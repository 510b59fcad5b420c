"""Probes along a pipe: independent of the direction of the pipe, and exact for polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from reference.scenes import WATER, junction, pipe, reservoir, scene, valve

import fvsolve
from fvsolve.assembly.scheme_codes import cells_around
from fvsolve.schemes import SCHEMES

CELLS = 10
PLACES = (0.05, 0.1, 0.15, 0.3, 0.37, 0.45, 0.5, 0.6, 0.65, 0.7, 0.9, 0.95)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("n", [7, 8, 10, 30])
def test_a_place_is_read_with_the_same_weights_from_either_end(degree, n):
    """The weights of a place are equal from both ends and exact for polynomials.

    They do not depend on rounding of n times the fraction at a face or a centre.
    """
    for k in range(1, 4 * n):
        there, back = (cells_around(k / (4 * n) * n, degree, n), cells_around((1.0 - k / (4 * n)) * n, degree, n))
        assert there[0] == n - back[0] - back[1].size
        assert there[1] == pytest.approx(back[1][::-1], abs=1e-11)
        cells = there[0] + np.arange(there[1].size)
        power = np.arange(degree + 1)[:, None]
        averages = ((cells + 1.0) ** (power + 1) - cells ** (power + 1.0)) / (power + 1) / n**power
        assert averages @ there[1] == pytest.approx((k / (4 * n)) ** power[:, 0], rel=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_pipe_drawn_the_other_way_reads_the_same(scheme, law):
    """A reversed pipe gives the same pressures and opposite flows, to rounding, at faces, centres and between."""
    nodes = {"lake": reservoir(6e5), "gate": junction(), "sink": reservoir(2e5)}
    shuts = {"start": 0.0, "duration": 0.02, "value": [1.0, 0.3]}
    friction = {"model": "quasi-steady", "roughness": 1e-4}
    numerics = {"scheme": scheme, "method": "rk4", "step": 1e-3, "start": 0.0}
    found = []
    for start, end, side in (("lake", "gate", 1), ("gate", "lake", -1)):
        links = {
            "line": pipe(start, end, 100.0, 0.1, 1000.0, CELLS, friction=friction),
            "valve": valve("gate", "sink", 1e-3, opening=shuts),
        }
        at = PLACES if side > 0 else [1.0 - x for x in PLACES]
        probes = [f"line.{what}@{x!r}" for what in ("pressure", "flow") for x in at]
        result = fvsolve.run(scene(nodes, links, 0.15, numerics, probes, fluid=WATER | {"law": law}))
        flow = ["flow" in probe for probe in probes]
        found.append(np.array([result[probe] for probe in probes]) * np.where(flow, side, 1)[:, None])
    one, other = found
    for rows in (slice(0, len(PLACES)), slice(len(PLACES), None)):
        assert np.abs(one[rows] - other[rows]).max() < 1e-9 * np.abs(one[rows]).max()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("law", ["linear", "log"])
def test_where_nothing_weighs_there_is_no_head_and_all_else(law):
    nodes = {"lake": reservoir(1.5e5), "end": {"type": "chamber", "volume": 1.0, "initial_pressure": 1e5}}
    case = scene(nodes, {"gate": valve("lake", "end", 1e-3)}, 0.1, {"rtol": 1e-6}, ["end.head", "end.pressure"], 0.01)
    result = fvsolve.run({**case, "gravity": 0.0, "fluid": {**WATER, "law": law}})
    assert result.ok and np.all(np.isnan(result["end.head"])) and np.ptp(result["end.pressure"]) > 1e3
