"""Rigid columns between closed valves take the level of equal small leaks, in any order and direction of the parts."""

import math

import numpy as np
import pytest
from reference.scenes import junction, lake, ramp, scene, valve
from scipy.optimize import brentq

import fvsolve

LEVELS = {"A": 50.0, "B": 47.0, "C": 30.0, "D": 500.0}  # of the lakes [m]
HEIGHTS = {"X": 5.0, "Y": -3.0, "Z": 2.0, "V": 1.0, "W": -1.0}  # of the junctions [m]


def run_columns(
    columns: dict[str, tuple[str, str]],
    gates: dict[str, tuple[str, str]],
    ends: dict[str, float],
    law: str = "linear",
    method: str = "dormand-prince",
    turned: str = "",
    reversed_order: bool = False,
) -> fvsolve.Result:
    """Run of rigid columns of 10 m whose valves close from 1 s on.

    columns, gates : (from, to) of each column and valve; ends : times at which valves are closed [s], shut all the time
    for 0; turned : names of columns that are given from their other end; reversed_order : list all parts backwards
    """
    used = {name for way in (*columns.values(), *gates.values()) for name in way}
    nodes = {name: lake(level) for name, level in LEVELS.items() if name in used}
    nodes |= {name: junction(elevation=height) for name, height in HEIGHTS.items() if name in used}
    links = {
        name: {
            "type": "rigid-column",
            "from": way[name in turned],
            "to": way[name not in turned],
            "length": 10.0,
            "diameter": 0.1,
        }
        for name, way in columns.items()
    }
    for name, way in gates.items():
        end = ends[name]
        links[name] = valve(*way, 1e-3, ramp(1.0, end - 1.0, 1.0, 0.0) if end else 0.0)
    if reversed_order:
        nodes, links = dict(reversed(nodes.items())), dict(reversed(links.items()))
    probes = [f"{name}.head" for name in HEIGHTS if name in used]
    probes += [f"{name}.flow" for name in columns]
    case = scene(nodes, links, 3.0, {"rtol": 1e-7, "method": method}, probes, 0.05)
    if law in ("table", "mixture"):
        case["fluid"] = {"name": "Water", "temperature": 293.15}
    case["fluid"] |= {"law": law} | ({"air_fraction": 1e-3} if law == "mixture" else {})
    return fvsolve.run(case)


def balance(head: float, *around: float) -> float:
    """Sum of the leaks at a head from the heads around it."""
    return sum(math.copysign(math.sqrt(abs(other - head)), other - head) for other in around)


@pytest.mark.in_turn
@pytest.mark.parametrize("reversed_order", [False, True])
@pytest.mark.parametrize("turned", ["", "p", "pq"])
@pytest.mark.parametrize("end", [2.0, 2.4], ids=["together", "in turn"])
@pytest.mark.parametrize("law", ["linear", "log", "table", "mixture"])
@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p", "esdirk-4"])
def test_columns_between_shut_valves_take_the_level_of_equal_leaks(
    method, law, end, turned, reversed_order
):
    """Two columns share a junction with a valve that is shut all the time."""
    result = run_columns(
        {"p": ("X", "Y"), "q": ("Y", "Z")},
        {"left": ("A", "X"), "right": ("Z", "C"), "side": ("Y", "B")},
        {"left": 2.0, "right": end, "side": 0.0},
        law,
        method,
        turned,
        reversed_order,
    )
    assert result.ok, result.reason
    assert "isolated" in [note.kind for note in result.warnings]
    late = result.t > end + 0.01
    expected = brentq(balance, 30.0, 50.0, args=(50.0, 47.0, 30.0), xtol=1e-13)
    for name in "XYZ":
        # heads are pressures over a reference density
        relative = 1e-10 if law == "linear" else 2e-4
        assert result[f"{name}.head"][late] == pytest.approx(expected, rel=relative)
    assert np.all(result["p.flow"][late] == 0.0) and np.all(result["q.flow"][late] == 0.0)


@pytest.mark.in_turn
@pytest.mark.parametrize("turned", ["", "p"])
@pytest.mark.parametrize("ends", [(2.0, 2.0), (2.0, 2.4), (2.4, 2.0)], ids=["both", "A", "C"])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_column_between_two_shut_valves_takes_the_mean_level(law, ends, turned):
    """With the second valve open the column had stopped with the error that its flow finds no way."""
    result = run_columns(
        {"p": ("X", "Y")},
        {"left": ("A", "X"), "right": ("Y", "C")},
        dict(zip(("left", "right"), ends, strict=True)),
        law,
        turned=turned,
    )
    assert result.ok, result.reason
    late = result.t > 2.41
    relative = 1e-10 if law == "linear" else 2e-4
    assert result["X.head"][late] == pytest.approx(40.0, rel=relative)
    assert result["Y.head"][late] == pytest.approx(40.0, rel=relative)
    assert np.all(result["p.flow"][late] == 0.0)


def test_a_column_with_an_open_valve_has_the_level_beyond_this_valve():
    result = run_columns(
        {"p": ("X", "Y")},
        {"left": ("A", "X"), "right": ("Y", "C")},
        {"left": 2.0, "right": 2.9},
    )
    between = (result.t > 2.05) & (result.t < 2.85)
    assert result["X.head"][between] == pytest.approx(30.0, rel=1e-9)
    assert result["Y.head"][between] == pytest.approx(30.0, rel=1e-9)


@pytest.mark.parametrize("reversed_order", [False, True])
def test_columns_on_both_sides_of_a_shut_valve_balance_their_leaks_together(reversed_order):
    result = run_columns(
        {"p": ("X", "Y"), "q": ("V", "W")},
        {"left": ("A", "X"), "middle": ("Y", "V"), "side": ("Y", "B"), "right": ("W", "C")},
        {"left": 2.0, "middle": 2.0, "side": 2.0, "right": 2.0},
        reversed_order=reversed_order,
    )
    assert result.ok, result.reason
    late = result.t > 2.01
    # The second group has only two leaks, so its level is the mean of the levels beyond them.
    first = brentq(lambda head: balance(head, 50.0, 47.0, (head + 30.0) / 2.0), 30.0, 50.0)
    for names, expected in (("XY", first), ("VW", (first + 30.0) / 2.0)):
        for name in names:
            assert result[f"{name}.head"][late] == pytest.approx(expected, rel=1e-10)


def test_an_isolated_pressure_is_no_extreme_of_a_run():
    """The level of equal leaks is a convention: here 167 m behind a closed valve to a lake at 500 m."""
    result = run_columns(
        {"p": ("X", "Y")},
        {"left": ("A", "X"), "right": ("Y", "C"), "side": ("Y", "D")},
        {"left": 2.0, "right": 2.4, "side": 0.0},
    )
    expected = brentq(balance, 30.0, 500.0, args=(50.0, 30.0, 500.0), xtol=1e-13)
    assert expected > 100.0 and result["X.head"][-1] == pytest.approx(expected, rel=1e-10)
    assert result.extremes["X.head"].maximum < 55.0
