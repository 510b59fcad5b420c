"""Nodes that only shut valves reach take the pressure of equal small leaks, whenever and however these shut."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from truth.scenes import junction, lake, ramp, scene, valve

import fvsolve

SHUT = 1.1


def shutting(ways: list[tuple[str, str]], ends=None, law: str = "linear") -> fvsolve.Result:
    """Lakes A, B, C at 50, 40, 30 m and junctions X, Y, whose valves shut after 1 s, at `ends` if they differ."""
    nodes = {"A": lake(50.0), "B": lake(40.0), "C": lake(30.0), "X": junction(), "Y": junction()}
    used = {name for way in ways for name in way}
    ends = ends or [SHUT] * len(ways)
    links = {
        f"v{k}": valve(*way, 1e-3, ramp(1.0, end - 1.0, 1.0, 0.0))
        for k, (way, end) in enumerate(zip(ways, ends, strict=True))
    }
    probes = [f"{name}.head" for name in sorted(used & {"X", "Y"})] + [f"{name}.flow" for name in links]
    nodes = {name: node for name, node in nodes.items() if name in used}
    case = scene(nodes, links, 2.0, {"rtol": 1e-7, "method": "dormand-prince"}, probes, 0.05)
    case["fluid"]["law"] = law
    result = fvsolve.run(case)
    assert result.ok, result.reason
    assert not result.marks
    return result


def leaks(x: float, *around: float) -> float:
    return sum(math.copysign(math.sqrt(abs(h - x)), h - x) for h in around)


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("ends", [None, [1.1, 1.2, 1.3], [1.0, 1.0, 1.0]], ids=["together", "in turn", "at once"])
def test_a_junction_between_shut_valves_floats_where_equal_leaks_balance(ends, law):
    result = shutting([("A", "X"), ("X", "B"), ("X", "C")], ends, law)
    wanted = brentq(lambda x: leaks(x, 50.0, 40.0, 30.0), 30.0, 50.0)
    late = result.t > 1.35
    assert result["X.head"][late] == pytest.approx(wanted, rel=1e-6 if law == "log" else 1e-10)
    assert all(np.all(result[f"v{k}.flow"][late] == 0.0) for k in range(3))
    assert np.all((result["X.head"] > 29.9) & (result["X.head"] < 50.1))


def test_junctions_in_a_row_of_shut_valves_share_the_drop():
    result = shutting([("A", "X"), ("X", "Y"), ("Y", "C")])
    late = result.t > 1.15
    assert result["X.head"][late] == pytest.approx(50.0 - 20.0 / 3.0, rel=1e-9)
    assert result["Y.head"][late] == pytest.approx(30.0 + 20.0 / 3.0, rel=1e-9)


def test_a_valve_that_all_but_shuts_keeps_its_junction_between_its_neighbours():
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction()}
    opening = ramp(1.0, 0.1, 1.0, 1e-12)
    links = {"v0": valve("A", "X", 1e-3, opening), "v1": valve("X", "B", 1e-3, opening)}
    result = fvsolve.run(scene(nodes, links, 2.0, {"rtol": 1e-7, "method": "dormand-prince"}, ["X.head"], 0.05))
    assert result.ok
    assert result["X.head"] == pytest.approx(45.0, rel=1e-8)


def test_a_demand_behind_shut_valves_stops_the_run_by_name():
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction(1e-3)}
    opening = ramp(1.0, 0.1, 1.0, 0.0)
    links = {"v0": valve("A", "X", 1e-3, opening), "v1": valve("X", "B", 1e-3, opening)}
    result = fvsolve.run(scene(nodes, links, 2.0, {"rtol": 1e-7, "method": "dormand-prince"}, ["X.head"], 0.05))
    assert not result.ok
    assert "no flow can meet what is asked at X" in result.reason
    assert result.t[-1] <= 1.1 + 1e-9
    assert abs(result.ledger["mass"]["relative"]) < 1e-9
