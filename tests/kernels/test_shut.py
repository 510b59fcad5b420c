"""Nodes without storage take the pressure of equal small leaks behind closed valves; parts apart are independent."""

import math

import numpy as np
import pytest
from reference.scenes import WATER, junction, lake, pipe, pump, ramp, scene, valve
from scipy.optimize import brentq

import fvsolve

SHUT = 1.1


def shutting(ways: list[tuple[str, str]], ends=None, law: str = "linear") -> fvsolve.Result:
    """Run of lakes A, B, C at 50, 40, 30 m and junctions X, Y, whose valves close after 1 s, at `ends` if given [s]."""
    nodes = {"A": lake(50.0), "B": lake(40.0), "C": lake(30.0), "X": junction(), "Y": junction()}
    used = {name for way in ways for name in way}
    ends = ends or [SHUT] * len(ways)
    links = {
        f"v{k}": valve(*way, 1e-3, ramp(1.0, end - 1.0, 1.0, 0.0))
        for k, (way, end) in enumerate(zip(ways, ends, strict=True))
    }
    probes = [f"{name}.head" for name in sorted(used & {"X", "Y"})] + [
        f"{name}.flow" for name in links
    ]
    nodes = {name: node for name, node in nodes.items() if name in used}
    case = scene(nodes, links, 2.0, {"rtol": 1e-7, "method": "dormand-prince"}, probes, 0.05)
    case["fluid"]["law"] = law
    result = fvsolve.run(case)
    assert result.ok, result.reason
    assert not result.marks
    return result


def leaks(x: float, *around: float) -> float:
    return sum(math.copysign(math.sqrt(abs(h - x)), h - x) for h in around)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize(
    "ends", [None, [1.1, 1.2, 1.3], [1.0, 1.0, 1.0]], ids=["together", "in turn", "at once"]
)
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


def test_a_valve_that_almost_shuts_leaves_its_junction_between_its_neighbours():
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction()}
    opening = ramp(1.0, 0.1, 1.0, 1e-12)
    links = {"v0": valve("A", "X", 1e-3, opening), "v1": valve("X", "B", 1e-3, opening)}
    result = fvsolve.run(
        scene(nodes, links, 2.0, {"rtol": 1e-7, "method": "dormand-prince"}, ["X.head"], 0.05)
    )
    assert result.ok
    assert result["X.head"] == pytest.approx(45.0, rel=1e-8)


def with_given_flow_at_x(demand: float, law: str = "linear") -> fvsolve.Result:
    """Run of a junction X with a given demand [m3/s] between two valves that shut at 1.1 s."""
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction(demand)}
    opening = ramp(1.0, 0.1, 1.0, 0.0)
    links = {"v0": valve("A", "X", 1e-3, opening), "v1": valve("X", "B", 1e-3, opening)}
    fluid = {**WATER, "law": law}
    numerics = {"rtol": 1e-7, "method": "dormand-prince"}
    return fvsolve.run(scene(nodes, links, 2.0, numerics, ["X.head"], 0.05, fluid=fluid))


@pytest.mark.parametrize(
    ("demand", "law", "words"),
    [
        (-1e-3, "linear", "the inflow at X finds no way out"),
        (1e-3, "log", "the demand at X cannot be supplied"),
    ],
)
def test_a_given_flow_behind_shut_valves_stops_the_run_by_name(demand, law, words):
    result = with_given_flow_at_x(demand, law)
    assert not result.ok
    assert words in result.reason
    assert result.t[-1] <= 1.1 + 1e-9
    assert abs(result.ledger["mass"]["relative"]) < 1e-9


def test_a_demand_behind_shut_valves_is_not_supplied_and_the_run_goes_on():
    """From 1.1 s on 1 l/s lacks, 0.9 l until the end at 2 s; the junction drains to ambient pressure, a head of 0 m."""
    result = with_given_flow_at_x(1e-3)
    assert result.ok and result.t[-1] == 2.0
    (note,) = [note for note in result.warnings if note.kind == "unsupplied"]
    assert note.value == pytest.approx(0.9e-3, rel=1e-4) and "shut: v0, v1" in note.text
    assert result["X.head"][result.t > 1.11] == pytest.approx(0.0, abs=1e-9)
    assert abs(result.ledger["mass"]["relative"]) < 1e-9


def column_and_valve(opening: dict, **numerics) -> fvsolve.Result:
    """Run of a rigid column of 10 m from a lake at 50 m to a valve with a schedule, before a lake at 40 m."""
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction()}
    column = {"type": "rigid-column", "from": "A", "to": "X", "length": 10.0, "diameter": 0.1}
    links = {"main": column, "tap": valve("X", "B", 0.61e-3, opening)}
    settings = numerics or {"rtol": 1e-6, "method": "dormand-prince"}
    return fvsolve.run(scene(nodes, links, 3.0, settings, ["X.head", "main.flow"], 0.05))


@pytest.mark.parametrize(
    "numerics", [{}, {"step": 1e-3, "method": "rk4"}], ids=["default", "fixed step"]
)
def test_a_valve_shuts_on_a_rigid_column_at_the_head_that_stops_it(numerics):
    """Near the end q = F s with s^2 = dP - (L / A) F' s in kg/s and Pa: 52.478 m in X, then 50 m as in the lake."""
    result = column_and_valve(ramp(0.5, 0.5, 1.0, 0.0), **numerics)
    assert result.ok, result.reason
    assert not result.marks
    drop, full = 1000.0 * 9.80665 * 10.0, math.sqrt(2.0 * 1000.0) * 0.61e-3
    slowed = 10.0 / (math.pi / 4 * 0.1**2) * full / 0.5
    s = 0.5 * (slowed + math.sqrt(slowed**2 + 4.0 * drop))
    assert result.extremes["X.head"].maximum == pytest.approx(40.0 + s**2 / 9806.65, rel=1e-5)
    late = result.t > 1.001
    assert np.all(result["main.flow"][late] == 0.0)
    assert result["X.head"][late] == pytest.approx(50.0, rel=1e-12)


@pytest.mark.in_turn
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p", "radau-iia-5"])
def test_a_valve_does_so_next_to_an_ideal_check_valve_that_is_shut(method, law, turned):
    """An ideal check valve acts only after an event: the valve controls the column, and no event occurs."""
    nodes = {"A": lake(50.0), "B": lake(40.0), "X": junction()}
    column = {"type": "rigid-column", "from": "A", "to": "X", "length": 10.0, "diameter": 0.1}
    links = {"main": column, "tap": valve("X", "B", 0.61e-3, ramp(0.5, 0.5, 1.0, 0.0))}
    links["check"] = {
        "type": "check-valve",
        "area": 0.61e-3,
        "discharge_coefficient": 1.0,
        "from": "B",
        "to": "X",
    }
    case = scene(nodes, links, 1.5, {"rtol": 1e-6, "method": method}, ["X.head", "main.flow"], 0.05)
    case["fluid"]["law"] = law
    if turned:
        case["links"] = dict(reversed(links.items()))
    result = fvsolve.run(case)
    drop, full = 1000.0 * 9.80665 * 10.0, math.sqrt(2.0 * 1000.0) * 0.61e-3
    slowed = 10.0 / (math.pi / 4 * 0.1**2) * full / 0.5
    s = 0.5 * (slowed + math.sqrt(slowed**2 + 4.0 * drop))
    assert result.ok and not result.marks and result.summary["events"] == []
    assert result.extremes["X.head"].maximum == pytest.approx(
        40.0 + s**2 / 9806.65, rel=1e-5 if law == "linear" else 1e-3
    )
    assert np.all(result["main.flow"][result.t > 1.001] == 0.0)


@pytest.mark.in_turn
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize(
    "ends", [(1.0, 0.0), (0.0, 1.0), (1.0, 1e-6)], ids=["shuts", "opens", "all but shuts"]
)
def test_no_ramp_of_a_valve_on_a_rigid_column_stalls_the_run(ends, exponent):
    result = column_and_valve(ramp(0.5, 0.5, *ends, exponent))
    assert result.ok, result.reason
    assert not result.marks
    assert result.summary["steps"] < 500
    assert 40.0 < result.extremes["X.head"].minimum and result.extremes["X.head"].maximum < 56.0


def test_a_rigid_column_starts_from_rest_when_its_valve_opens_again():
    """q' = (g A / L)(10 m - q^2 / (2 g (Cd A)^2)) gives a tanh from the time of the opening, here a jump."""
    opening = {"time": [0.4, 0.5, 1.0], "value": [1.0, 0.0, 1.0], "kind": "step"}
    result = column_and_valve(opening)
    assert result.ok, result.reason
    rate, most = (
        9.80665 * math.pi / 4 * 0.1**2 / 10.0 * 10.0,
        0.61e-3 * math.sqrt(2 * 9.80665 * 10.0),
    )
    late = result.t > 1.0
    wanted = most * np.tanh(rate / most * (result.t[late] - 1.0))
    assert result["main.flow"][late] == pytest.approx(wanted, abs=1e-6 * most)


def test_rows_between_steps_do_not_overshoot_a_front():
    nodes = {"lake": lake(60.0), "gate": junction(), "sea": lake(30.0)}
    links = {
        "main": {
            "type": "pipe",
            "from": "lake",
            "to": "gate",
            "length": 100.0,
            "diameter": 0.3,
            "wave_speed": 1000.0,
            "cells": 10,
            "friction": {"model": "none"},
        },
        "tap": valve(
            "gate", "sea", 0.01, {"time": [0.0, 0.1], "value": [1.0, 0.0], "kind": "step"}
        ),
    }
    numerics = {"scheme": "upwind", "method": "euler", "courant": 1.0}
    result = fvsolve.run(
        scene(nodes, links, 1.0, numerics, ["gate.pressure", "main.pressure@0.55"], 0.001)
    )
    for name in ("gate.pressure", "main.pressure@0.55"):
        least, _, greatest, _ = result.extremes[name]
        assert np.max(result[name]) <= greatest + 1e-6
        assert np.min(result[name]) >= least - 1e-6


FLUIDS = {
    "linear": dict(WATER),
    "log": {**WATER, "law": "log"},
    "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-4},
}
STEADY = {"model": "steady", "factor": 0.02}


def town(name: str, size: float) -> tuple[dict, dict]:
    """Nodes and links from a common lake: two places joined by a valve, and a third behind a pipe.

    All flows are zero at the start, because a steady state is solved for the whole scene.
    """
    a, b, c, d, e = "lake", *(f"{name}-{one}" for one in "bcde")
    nodes = {a: lake(40.0), b: junction(), c: junction(), d: junction(), e: lake(40.0)}
    links = {
        f"{name}-1": pipe(a, b, 100.0, size, 1000.0, 3, friction=STEADY),
        f"{name}-2": valve(b, c, 0.1 * size**2),
        f"{name}-3": pipe(c, d, 70.0, size, 900.0, 2, friction=STEADY),
        f"{name}-4": valve(d, e, 0.05 * size**2),
        f"{name}-5": valve(b, d, 0.02 * size**2),
    }
    return nodes, links


@pytest.mark.parametrize("law", FLUIDS)
def test_rates_of_separate_towns_are_independent_to_the_bit(law):
    """States of the second town deviate up to three times as much, so Newton's method needs more iterations there."""

    def built(*towns):
        nodes = {name: node for one in towns for name, node in one[0].items()}
        links = {name: link for one in towns for name, link in one[1].items()}
        return fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {}, [], 0.1, fluid=FLUIDS[law])))

    one, two = town("x", 0.3), town("y", 0.05)
    alone, both = built(one), built(one, two)
    at = [both.state_names.index(name) for name in alone.state_names]
    rng = np.random.default_rng(5)
    for _ in range(50):
        y = both.scale * rng.uniform(-1.0, 1.0, both.y_size) * rng.choice([0.0, 1.0, 3.0])
        y[at] = alone.scale * rng.uniform(-1.0, 1.0, alone.y_size)
        assert np.array_equal(both.rhs(0.0, y)[at], alone.rhs(0.0, y[at]))


@pytest.mark.parametrize("law", FLUIDS)
def test_more_pumps_than_places_all_pump(law):
    """H(q) = 4/3 H_r s^2 - 1/3 H_r (q / q_r)^2 between two lakes, at full and at 0.6 of the speed."""
    places = {"low": lake(10.0), "high": lake(15.0)}
    rated = [0.01, 0.02, 0.03, 0.04]
    slowing = {"time": [0.0, 0.5], "value": [1.0, 0.6]}
    links = {
        f"p{k}": pump("low", "high", curve={"flow": [flow], "head": [30.0]}, speed=slowing)
        for k, flow in enumerate(rated)
    }
    links["main"] = pipe("low", "high", 100.0, 0.2, 1000.0, 4, friction=STEADY)
    case = scene(places, links, 1.0, {}, [f"{name}.flow" for name in links], 0.5, fluid=FLUIDS[law])
    result = fvsolve.run(case)
    for k, flow in enumerate(rated):
        for row, speed in ((0, 1.0), (-1, 0.6)):
            wanted = flow * np.sqrt((40.0 * speed**2 - 5.0) / 10.0)
            assert result[f"p{k}.flow"][row] == pytest.approx(
                wanted, rel=1e-9 if law == "linear" else 1e-3
            )
