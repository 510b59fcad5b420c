"""Pumps against closed forms: operating points, affinity laws, series, parallel, constant states, density laws."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.scenes import GRAVITY, RHO, junction, lake, pipe, pump, scene

import fvsolve

FACTOR, LENGTH, BORE = 0.02, 1000.0, 0.3
RESISTANCE = FACTOR * LENGTH / BORE / (2.0 * GRAVITY * (math.pi / 4 * BORE**2) ** 2)  # head per flow squared
STEADY = {"model": "steady", "factor": FACTOR}
ONE = {"flow": [0.1], "head": [50.0]}
THREE = {"flow": [0.0, 0.1, 0.15], "head": [60.0, 50.0, 35.0]}
FOUR = {"flow": [0.0, 0.05, 0.1, 0.15], "head": [60.0, 58.0, 50.0, 35.0]}


def main(start: str, end: str, cells: int = 10, **more) -> dict:
    return pipe(start, end, LENGTH, BORE, 1000.0, cells, friction=STEADY, **more)


def rising(lift: float = 30.0, end: float = 5.0, numerics=None, probes=("pump.flow", "pump.head"), **pump_keys) -> dict:
    """Return a case of a pump from a sump at head 0 m through a main to a lake at head `lift` [m]."""
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(lift)}
    links = {"pump": pump("sump", "out", **pump_keys), "main": main("out", "top")}
    return scene(nodes, links, end, numerics or {}, probes)


def system(f, lift: float = 30.0, high: float = 1.0) -> float:
    """Flow at which f(q) = lift + R q |q|, by bisection."""
    low = -high
    for _ in range(200):
        q = 0.5 * (low + high)
        low, high = (q, high) if f(q) > lift + RESISTANCE * q * abs(q) else (low, q)
    return low


def power_law(q, a, b, c):
    return a - b * q**c


C3 = math.log(25.0 / 10.0) / math.log(1.5)
CURVES = [
    (ONE, lambda q, n=1.0: n * n * 200.0 / 3.0 - 50.0 / 3.0 / 0.01 * q * q),
    (THREE, lambda q, n=1.0: n * n * 60.0 - 10.0 * n ** (2.0 - C3) * (q / 0.1) ** C3 if q > 0 else n * n * 60.0),
    (FOUR, lambda q, n=1.0: n * n * float(np.interp(q / n, FOUR["flow"], FOUR["head"]))),
    ({"coefficients": [60.0, -20.0, 0.0, -5000.0]}, lambda q, n=1.0: 60 * n * n - 20.0 * q * n - 5000.0 * q**3 / n),
]


@pytest.mark.parametrize("lift", [20.0, 59.9, 60.0, 70.0])
def test_a_straight_curve_of_three_points_has_a_slope_at_no_flow(lift):
    """The parabola from zero head at 0.6 m3/s has b' = 100 / 1.2; reverse flow adds b' q^2 to the straight line."""
    found = fvsolve.build(fvsolve.load(rising(lift, curve={"flow": [0.0, 0.1, 0.2], "head": [60.0, 50.0, 40.0]})))
    q = system(lambda q: 60.0 - 100.0 * q + (100.0 / 1.2 * q * q if q < 0.0 else 0.0), lift)
    assert found.tables.valves[0]["flow"] / RHO == approx(q, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("curve, f", CURVES, ids=["one", "three", "four", "polynomial"])
@pytest.mark.parametrize("speed", [1.0, 0.9])
def test_operating_point_is_where_curve_and_system_meet(curve, f, speed):
    found = fvsolve.build(fvsolve.load(rising(20.0, curve=curve, speed=speed)))
    q = system(lambda q: f(q, speed), 20.0)
    row = found.tables.valves[0]
    assert row["flow"] / RHO == approx(q, rel=1e-9)
    assert -row["drop"] / (RHO * GRAVITY) == approx(f(q, speed), rel=1e-9)


def test_constant_power():
    found = fvsolve.build(fvsolve.load(rising(power=40e3)))
    q = system(lambda q: 40e3 / (RHO * GRAVITY * q) if q > 0 else 1e3)
    assert found.tables.valves[0]["flow"] / RHO == approx(q, rel=1e-9)


@pytest.mark.parametrize("many, way", [(2, "series"), (3, "series"), (2, "parallel"), (3, "parallel")])
def test_pumps_in_series_add_heads_and_in_parallel_flows(many, way):
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(20.0)}
    if way == "series":
        names = ["sump", *(f"n{k}" for k in range(1, many)), "out"]
        nodes |= {name: junction() for name in names[1:-1]}
        links = {f"p{k}": pump(names[k], names[k + 1], curve=ONE) for k in range(many)}
        f = lambda q: many * CURVES[0][1](q)  # noqa: E731
    else:
        links = {f"p{k}": pump("sump", "out", curve=ONE) for k in range(many)}
        f = lambda q: CURVES[0][1](q / many)  # noqa: E731
    case = scene(nodes, {**links, "main": main("out", "top")}, 3.0, {}, ["main.flow", "p0.flow"])
    result = fvsolve.run(case)
    assert result["main.flow"][0] == approx(system(f, 20.0), rel=1e-9)
    assert np.ptp(result["main.flow"]) == 0.0
    assert result["p0.flow"][0] == approx(system(f, 20.0) / (many if way == "parallel" else 1), rel=1e-9)


def test_pump_between_two_lakes_alone():
    for law in ("linear", "log"):
        links, numerics = {"p": pump("a", "b", curve=ONE)}, {"step": 0.1, "method": "rk4"}
        case = scene({"a": lake(0.0), "b": lake(30.0)}, links, 1.0, numerics, ["p.flow"])
        case["fluid"] = {**case["fluid"], "law": law}
        result = fvsolve.run(case)
        q = math.sqrt((200.0 / 3.0 - 30.0) / (50.0 / 3.0 / 0.01))
        assert result["p.flow"] == approx(q, rel=1e-12 if law == "linear" else 1e-4)


@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("curve", [ONE, FOUR], ids=["one", "four"])
def test_nothing_moves_by_a_bit_while_nothing_changes(law, curve):
    case = rising(curve=curve, end=3.0, probes=["pump.flow", "out.pressure", "main.flow@0.5", "pump.speed"])
    case["fluid"] = {"name": "Water", "law": law}
    result = fvsolve.run(case)
    assert result.ok and not result.summary["marks"]
    for name in case["output"]["probes"]:
        assert np.ptp(result[name]) == 0.0
    jet = 0.0 if law == "linear" else 1.0 / (2.0 * GRAVITY * (math.pi / 4 * BORE**2) ** 2)  # v^2 / 2 g is lost
    f = CURVES[0 if curve is ONE else 2][1]
    assert result["pump.flow"][0] == approx(system(lambda q: f(q) - jet * q * q), rel=1e-9 if law == "linear" else 2e-4)


def test_slow_change_of_speed_follows_operating_points():
    """Between two lakes the flow at every speed follows from the curve and the lift."""
    nodes = {"sump": lake(0.0), "top": lake(20.0)}
    speed = {"time": [0.0, 1.0], "value": [1.0, 0.8]}
    case = scene(nodes, {"pump": pump("sump", "top", curve=ONE, speed=speed)}, 1.0, {"step": 0.05, "method": "rk4"},
                 ["pump.flow", "pump.speed"], 0.1)  # fmt: skip
    result = fvsolve.run(case)
    n = result["pump.speed"]
    assert n == approx(1.0 - 0.2 * result.t, abs=1e-15)
    assert result["pump.flow"] == approx(np.sqrt((200.0 / 3.0 * n * n - 20.0) / (50.0 / 3.0 / 0.01)), rel=1e-11)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_elevations_are_lifted_too(law):
    """The flow depends on heads alone, not on the elevation of the pump."""
    flows = []
    for height in (-5.0, 4.0):
        nodes = {
            "sump": lake(-3.0, elevation=height), "out": junction(elevation=height), "top": lake(25.0, elevation=20.0),
        }  # fmt: skip
        links = {"pump": pump("sump", "out", curve=ONE), "main": main("out", "top")}
        case = scene(nodes, links, 2.0, {}, ["pump.flow", "out.head", "pump.head"])
        case["fluid"] = {**case["fluid"], "law": law}
        result = fvsolve.run(case)
        assert np.ptp(result["pump.flow"]) == 0.0
        assert result["out.head"][0] + 3.0 == approx(result["pump.head"][0], abs=1e-6)
        flows.append(result["pump.flow"][0])
    assert flows[0] == approx(flows[1], rel=1e-9 if law == "linear" else 1e-4)
    if law == "linear":
        assert flows[0] == approx(system(CURVES[0][1], 28.0), rel=1e-9)


def test_a_pump_starts_from_rest_behind_its_check_valve():
    """The check valve opens when n^2 66.7 m exceeds the lift; the flow ends at the operating point."""
    speed = {"time": [1.0, 2.0], "value": [0.0, 1.0]}
    case = rising(30.0, 60.0, {"initial": "rest"}, curve=ONE, speed=speed, check_valve=True)
    result = fvsolve.run(case)
    events = result.summary["events"]
    assert events[0]["what"] == "check valve opens"
    assert events[0]["time"] == approx(1.0 + math.sqrt(30.0 / (200.0 / 3.0)), abs=1e-4)
    assert not result["pump.flow"][result.t < events[0]["time"]].any() and len(events) == 1
    assert result["pump.flow"][-1] == approx(system(CURVES[0][1]), rel=1e-2)


def test_its_speed_is_an_input():
    model = fvsolve.build(fvsolve.load(rising(curve=ONE)))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 0.5, {"pump.speed": 1.0})
    assert not np.any(state.y)
    state = fvsolve.advance(model, state, 1.0, {"pump.speed": 0.9})
    assert np.any(state.y)
