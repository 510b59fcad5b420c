"""Pumps against closed forms: operating points, affinity laws, series, parallel, constant states, density laws.

Pumps in networks that change: flows and heads lie on their curves, and check valves do not chatter. Faults and notices.
"""

import math

import numpy as np
import pytest
from pytest import approx
from reference.scenes import GRAVITY, RHO, junction, lake, pipe, pump, scene, step, valve

import fvsolve
from fvsolve.errors import CaseError

FACTOR, LENGTH, BORE = 0.02, 1000.0, 0.3
# head per flow squared
RESISTANCE = FACTOR * LENGTH / BORE / (2.0 * GRAVITY * (math.pi / 4 * BORE**2) ** 2)
STEADY = {"model": "steady", "factor": FACTOR}
ONE = {"flow": [0.1], "head": [50.0]}
THREE = {"flow": [0.0, 0.1, 0.15], "head": [60.0, 50.0, 35.0]}
FOUR = {"flow": [0.0, 0.05, 0.1, 0.15], "head": [60.0, 58.0, 50.0, 35.0]}


def main(start: str, end: str, cells: int = 10, **more) -> dict:
    return pipe(start, end, LENGTH, BORE, 1000.0, cells, friction=STEADY, **more)


def rising(
    lift: float = 30.0,
    end: float = 5.0,
    numerics=None,
    probes=("pump.flow", "pump.head"),
    **pump_keys,
) -> dict:
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
    (
        THREE,
        lambda q, n=1.0: (
            n * n * 60.0 - 10.0 * n ** (2.0 - C3) * (q / 0.1) ** C3 if q > 0 else n * n * 60.0
        ),
    ),
    (FOUR, lambda q, n=1.0: n * n * float(np.interp(q / n, FOUR["flow"], FOUR["head"]))),
    (
        {"coefficients": [60.0, -20.0, 0.0, -5000.0]},
        lambda q, n=1.0: 60 * n * n - 20.0 * q * n - 5000.0 * q**3 / n,
    ),
]


@pytest.mark.parametrize("lift", [20.0, 59.9, 60.0, 70.0])
def test_a_straight_curve_of_three_points_has_a_slope_at_no_flow(lift):
    """The parabola from zero head at 0.6 m3/s has b' = 100 / 1.2; reverse flow adds b' q^2 to the straight line."""
    found = fvsolve.build(
        fvsolve.load(rising(lift, curve={"flow": [0.0, 0.1, 0.2], "head": [60.0, 50.0, 40.0]}))
    )
    q = system(lambda q: 60.0 - 100.0 * q + (100.0 / 1.2 * q * q if q < 0.0 else 0.0), lift)
    assert found.tables.valves[0]["flow"] / RHO == approx(q, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("curve, f", CURVES, ids=["one", "three", "four", "polynomial"])
@pytest.mark.parametrize("speed", [1.0, 0.9])
def test_operating_point_is_where_curve_and_system_intersect(curve, f, speed):
    found = fvsolve.build(fvsolve.load(rising(20.0, curve=curve, speed=speed)))
    q = system(lambda q: f(q, speed), 20.0)
    row = found.tables.valves[0]
    assert row["flow"] / RHO == approx(q, rel=1e-9)
    assert -row["drop"] / (RHO * GRAVITY) == approx(f(q, speed), rel=1e-9)


def test_constant_power():
    found = fvsolve.build(fvsolve.load(rising(power=40e3)))
    q = system(lambda q: 40e3 / (RHO * GRAVITY * q) if q > 0 else 1e3)
    assert found.tables.valves[0]["flow"] / RHO == approx(q, rel=1e-9)


@pytest.mark.parametrize(
    "many, way", [(2, "series"), (3, "series"), (2, "parallel"), (3, "parallel")]
)
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
    assert result["p0.flow"][0] == approx(
        system(f, 20.0) / (many if way == "parallel" else 1), rel=1e-9
    )


def test_pump_between_two_lakes_alone():
    for law in ("linear", "log"):
        links, numerics = {"p": pump("a", "b", curve=ONE)}, {"step": 0.1, "method": "rk4"}
        case = scene({"a": lake(0.0), "b": lake(30.0)}, links, 1.0, numerics, ["p.flow"])
        case["fluid"] = {**case["fluid"], "law": law}
        result = fvsolve.run(case)
        q = math.sqrt((200.0 / 3.0 - 30.0) / (50.0 / 3.0 / 0.01))
        assert result["p.flow"] == approx(q, rel=1e-12 if law == "linear" else 1e-4)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("curve", [ONE, FOUR], ids=["one", "four"])
def test_nothing_moves_by_a_bit_while_nothing_changes(law, curve):
    case = rising(
        curve=curve, end=3.0, probes=["pump.flow", "out.pressure", "main.flow@0.5", "pump.speed"]
    )
    case["fluid"] = {"name": "Water", "law": law}
    result = fvsolve.run(case)
    assert result.ok and not result.summary["marks"]
    for name in case["output"]["probes"]:
        assert np.ptp(result[name]) == 0.0
    # v^2 / 2 g is lost
    jet = 0.0 if law == "linear" else 1.0 / (2.0 * GRAVITY * (math.pi / 4 * BORE**2) ** 2)
    f = CURVES[0 if curve is ONE else 2][1]
    assert result["pump.flow"][0] == approx(
        system(lambda q: f(q) - jet * q * q), rel=1e-9 if law == "linear" else 2e-4
    )


def test_slow_change_of_speed_follows_operating_points():
    """Between two lakes the flow at every speed follows from the curve and the lift."""
    nodes = {"sump": lake(0.0), "top": lake(20.0)}
    speed = {"time": [0.0, 1.0], "value": [1.0, 0.8]}
    case = scene(
        nodes,
        {"pump": pump("sump", "top", curve=ONE, speed=speed)},
        1.0,
        {"step": 0.05, "method": "rk4"},
        ["pump.flow", "pump.speed"],
        0.1,
    )
    result = fvsolve.run(case)
    n = result["pump.speed"]
    assert n == approx(1.0 - 0.2 * result.t, abs=1e-15)
    assert result["pump.flow"] == approx(
        np.sqrt((200.0 / 3.0 * n * n - 20.0) / (50.0 / 3.0 / 0.01)), rel=1e-11
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_elevations_are_lifted_too(law):
    """The flow depends on heads alone, not on the elevation of the pump."""
    flows = []
    for height in (-5.0, 4.0):
        nodes = {
            "sump": lake(-3.0, elevation=height),
            "out": junction(elevation=height),
            "top": lake(25.0, elevation=20.0),
        }
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


STEADY_NETWORK = {"model": "steady", "factor": 0.02}
NETWORK_CURVES = [
    {"curve": {"flow": [0.1], "head": [50.0]}},
    {"curve": {"flow": [0.0, 0.1, 0.15], "head": [60.0, 50.0, 35.0]}},
    # flat, steep, flat
    {"curve": {"flow": [0.0, 0.05, 0.06, 0.15], "head": [60.0, 59.9, 30.0, 29.9]}},
    {"curve": {"flow": [0.0, 0.1, 0.11], "head": [50.0, 49.999, 20.0]}},  # a power of 50
    {"curve": {"flow": [0.0, 0.1, 0.4], "head": [60.0, 30.0, 15.0]}},  # a power below 1
    {"curve": {"coefficients": [60.0, 0.0, 0.0, -8000.0]}},
    {"power": 40e3},
    {"suter": {"rated_flow": 0.1, "rated_head": 50.0, "table": "radial-35"}},
]


def random_scene(seed: int) -> dict:
    """Return a case of random pumps with random speeds between lakes, with a pipe and a valve that closes and opens."""
    rng = np.random.default_rng(seed)
    many = int(rng.integers(1, 4))
    nodes = {
        "sump": lake(0.0),
        "top": lake(float(rng.uniform(-10.0, 70.0))),
        "end": junction(),
        "out": junction(),
    }
    places = ["sump", *(f"n{k}" for k in range(many - 1)), "out"] if rng.random() < 0.5 else None
    nodes |= {name: junction() for name in (places or [])[1:-1]}
    links = {"main": pipe("out", "end", 300.0, 0.3, 1000.0, 8, friction=STEADY_NETWORK)}
    times = [0.0, 0.2, 0.8, 1.0, 1.6]
    links["tap"] = valve("end", "top", 0.02, {"time": times, "value": [1.0, 1.0, 0.0, 0.0, 1.0]})
    for k in range(many):
        start, stop = (places[k], places[k + 1]) if places else ("sump", "out")
        values = rng.choice([0.0, 0.3, 1.0, 1.2], 5).tolist()
        law = NETWORK_CURVES[int(rng.integers(len(NETWORK_CURVES)))]
        links[f"p{k}"] = pump(
            start,
            stop,
            **law,
            speed={"time": times, "value": values},
            check_valve=bool(rng.random() < 0.5),
        )
    probes = [f"p{k}.{what}" for k in range(many) for what in ("flow", "head")] + [
        f"{name}.head" for name in nodes
    ]
    return scene(nodes, links, 2.5, {}, probes, 0.02)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("seed", range(12))
def test_flows_and_heads_lie_on_the_curves(seed, law):
    case = random_scene(seed)
    case["fluid"] = {**case["fluid"], "law": law}
    result = fvsolve.run(case)
    assert result.ok, result.reason
    for name, link in case["links"].items():
        if link["type"] != "pump":
            continue
        flow, head = result[f"{name}.flow"], result[f"{name}.head"]
        across = result[f"{link['to']}.head"] - result[f"{link['from']}.head"]
        if link["check_valve"]:
            assert flow.min() > -1e-9
            assert np.all(across[flow == 0.0] >= head[flow == 0.0] - 1e-3)
        flows = flow != 0.0 if link["check_valve"] else np.ones(flow.size, dtype=bool)
        assert across[flows] == approx(head[flows], abs=2e-6)
    assert len(result.summary["events"]) <= 24


def test_two_pumps_in_parallel_with_a_too_weak_pump_stop_as_a_steady_state():
    """The check valve of the weak pump is shut at the start and opens after the strong pump stops."""
    strong, weak = {"flow": [0.1], "head": [50.0]}, {"flow": [0.05], "head": [20.0]}
    speed = {"time": [1.0, 2.0], "value": [1.0, 0.0]}
    links = {
        "strong": pump("sump", "out", curve=strong, check_valve=True, speed=speed),
        "weak": pump("sump", "out", curve=weak, check_valve=True),
        "main": pipe("out", "top", 1000.0, 0.2, 1000.0, 10, friction=STEADY_NETWORK),
    }
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(20.0)}
    probes = ["strong.flow", "weak.flow"]
    result = fvsolve.run(scene(nodes, links, 60.0, {}, probes, 0.1))
    assert (
        not result["weak.flow"][result.t < 1.0].any()
        and np.ptp(result["strong.flow"][result.t < 1.0]) == 0.0
    )
    assert result["strong.flow"][-1] == 0.0 and result["weak.flow"][-1] > 0.02
    assert len(result.summary["events"]) <= 6


def faults(more=None, **keys) -> str:
    links = {
        "pump": pump("sump", "out", **keys),
        "main": pipe("out", "top", 100.0, 0.3, 1000.0, 5),
        **(more or {}),
    }
    case = scene({"sump": lake(0.0), "out": junction(), "top": lake(20.0)}, links, 1.0, {})
    with pytest.raises(CaseError) as caught:
        fvsolve.build(fvsolve.load(case))
    return str(caught.value)


FOUND = [
    ({}, "expected one of curve, power, suter"),
    ({"curve": ONE, "power": 1e4}, "curve and power are given; keep one"),
    ({"curve": {"flow": [0.0, 0.1], "head": [50.0, 55.0]}}, "curve.head[1]: 55.0 comes after 50.0; the head must fall"),
    ({"curve": {"flow": [0.0, 0.1], "head": [50.0, 50.0]}}, "the head must fall as the flow rises"),
    ({"curve": {"flow": [0.0, 0.1, 0.1], "head": [50.0, 40.0, 30.0]}}, "flows out of order: 0.1 comes after 0.1"),
    ({"curve": {"flow": [0.0], "head": [50.0]}}, "a single point must have a flow and a head above 0"),
    ({"curve": {"flow": [], "head": []}}, "has no values; expected a list of values"),
    ({"curve": {"flow": [0.0, 0.1], "head": [50.0]}}, "has length 1, but `flow` has length 2"),
    ({"curve": {"coefficients": [50.0]}}, "fall to 0 at some flow"),
    ({"curve": {"coefficients": [50.0, 100.0, -5000.0]}}, "the head rises at a flow of 0 m3/s"),
    ({"curve": ONE, "trip": 1.0}, "trip: needs rated_speed"),
    ({"curve": ONE, "inertia": 2.0}, 'inertia: needs rated_speed, for example "1480 rpm"'),
    ({"curve": ONE, "inertia": -2.0, "rated_speed": 150.0}, "inertia: -2.0 is out of range; expected a value above 0"),
    ({"curve": ONE, "inertia": "2 kg", "rated_speed": 150.0}, "is a mass; expected a moment of inertia"),
    ({"curve": ONE, "inertia": 2.0, "rated_speed": 150.0, "trip": -1.0}, "-1 s lies before the start at 0 s"),
    ({"curve": ONE, "speed": -1.0}, "speed: -1.0 is out of range"),
    ({"curve": ONE, "efficiency": 1.2}, "efficiency: 1.2 is out of range"),
    ({"curve": ONE, "efficiency": {"flow": [0.0], "efficiency": [0.0]}}, "no value above 0 at a flow above 0"),
    ({"curve": ONE, "efficiency": 0.8, "shaft_power": {"flow": [0.1], "power": [1e4]}}, "keep one"),
    ({"curve": ONE, "check_valve": 1}, "check_valve: 1 is neither true nor false"),
    ({"suter": {"rated_flow": 0.1, "rated_head": 50.0}}, "expected `table`, or `head` and `torque`"),
    ({"suter": {"rated_flow": 0.1, "rated_head": 50.0, "table": "radial"}}, 'did you mean "radial-35"?'),
    ({"suter": {"rated_flow": 0.1, "rated_head": 50.0, "head": [1.0] * 5, "torque": [1.0] * 5}}, "expected at least 9"),
    ({"suter": {"rated_flow": 0.1, "rated_head": 50.0, "head": [1.0] * 9, "torque": [1.0] * 8 + [2.0]}},
     "x = 2 pi is x = 0 again"),
    ({"suter": {"rated_flow": 0.1, "rated_head": 50.0, "table": "radial-35"},
      "shaft_power": {"flow": [0.1], "power": [1.0]}}, "`suter` already gives the torque"),
]  # fmt: skip


@pytest.mark.parametrize("keys, message", FOUND, ids=[message[:30] for _, message in FOUND])
def test_a_fault_of_a_pump(keys, message):
    assert message in faults(**keys)


def test_all_faults_come_at_once():
    said = faults(curve={"flow": [0.1, 0.1], "head": [40.0, 50.0]}, trip=1.0, speed=-1.0)
    for part in ("flows out of order", "the head must fall", "needs rated_speed", "out of range"):
        assert part in said


def test_faults_of_torques():
    motor = {"motor": {"type": "torque", "to": "pump.shaft", "torque": 1.0}}
    assert "pump.shaft has no inertia" in faults(motor, curve=ONE)
    held = {
        "curve": ONE,
        "inertia": 2.0,
        "rated_speed": 150.0,
        "trip": step(0.5, 0.0, 1.0)["time"][1],
    }
    assert "is held at its speed until the trip" in faults(motor, **held)
    wet = {"motor": {"type": "torque", "to": "out", "torque": 1.0}}
    assert (
        "a hydraulic place, and this port of a torque needs a rotational or spatial place"
        in faults(wet, curve=ONE)
    )


def rounded(by: float) -> dict:
    """Return keys of a pump with a Suter table whose ends differ by `by`."""
    x = np.linspace(0.0, 2.0 * np.pi, 9)
    head, torque = 0.5 - np.cos(x), 0.4 - np.cos(x)
    head[-1] += by
    torque[-1] -= by
    return {
        "suter": {
            "rated_flow": 0.1,
            "rated_head": 50.0,
            "head": head.tolist(),
            "torque": torque.tolist(),
        }
    }


@pytest.mark.parametrize("by", [1e-16, -4e-16, 1e-9, -1e-7])
def test_ends_of_a_suter_table_that_differ_by_rounding_are_equal(by):
    case = scene(
        {"sump": lake(0.0), "top": lake(20.0)},
        {"pump": pump("sump", "top", **rounded(by))},
        1.0,
        {},
    )
    table = fvsolve.load(case).links["pump"].suter
    assert table.head[0] == table.head[-1] and table.torque[0] == table.torque[-1]


@pytest.mark.parametrize("by", [1e-3, -1e-4])
def test_ends_of_a_suter_table_that_differ_by_more_are_a_fault(by):
    assert "x = 2 pi is x = 0 again" in faults(**rounded(by))


def notes(nodes: dict, start: str, end: str, **keys) -> list:
    links = {
        "pump": pump(start, end, **keys),
        "main": pipe("out", "top", 100.0, 0.3, 1000.0, 5, minor_loss=20.0),
    }
    made = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {})))
    return [
        (one.key, one.text)
        for one in made.warnings
        if one.kind == "range" and one.place == "links.pump"
    ]


WATERS = {"sump": lake(0.0), "out": junction(), "top": lake(20.0)}


def test_a_pump_drawn_backwards_is_questioned_and_a_pump_that_lifts_is_not():
    assert notes(WATERS, "sump", "out", curve=ONE) == []
    ((key, text),) = notes(WATERS, "out", "sump", curve=ONE)
    assert key == "from" and "the lowest water level" in text and "check its direction" in text
    down = {"sump": lake(60.0), "out": junction(), "top": lake(20.0)}
    ((key, text),) = notes(down, "sump", "out", curve={"flow": [0.02], "head": [10.0]})
    assert key == "from" and "m lower" in text
    # a booster
    assert (
        notes({**down, "top": lake(70.0)}, "sump", "out", curve={"flow": [0.02], "head": [10.0]})
        == []
    )
    assert notes(WATERS, "out", "sump", curve=ONE, speed=0.0) == []  # at rest


@pytest.mark.parametrize("flow, unit", [(20.0, "l/s"), (2000.0, "m3/h"), (20000.0, "l/min")])
def test_a_rated_flow_too_quick_for_the_adjacent_pipes_is_questioned(flow, unit):
    said = notes(WATERS, "sump", "out", curve={"flow": [flow], "head": [50.0]})
    assert [key for key, _ in said] == ["curve"] and f'did you mean "{flow:.4g} {unit}"?' in said[
        0
    ][1]
    assert notes(WATERS, "sump", "out", curve={"flow": [1.0], "head": [50.0]}) == []


@pytest.mark.parametrize("flow, asked", [("0.03 l/s", True), ("0.1 m3/h", True), ("2 l/s", False)])
def test_a_rated_flow_too_slow_for_the_adjacent_pipes_is_questioned(flow, asked):
    said = notes(WATERS, "sump", "out", curve={"flow": [flow], "head": [50.0]})
    assert [key for key, _ in said] == ["curve"] * asked and all(
        "mean another unit?" in text for _, text in said
    )


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"inertia": 1.5e4}, '"15000 kg cm2"'),  # power and speed give 1.5 kg m2 to a factor of 2
        ({"inertia": 0.0015}, "1.84 kg m2 is usual for 6.538e+04 W at 1480 rpm"),
        ({"inertia": 1.5}, None),
        ({"inertia": 15.0}, None),  # a flywheel
        ({"shaft_power": {"flow": [0.1], "power": [65]}}, '"65 kW"'),
        ({"shaft_power": {"flow": [0.1], "power": ["65 MW"]}}, "shaft_power is 6.5e+07 W"),
        ({"shaft_power": {"flow": [0.1], "power": ["65 kW"]}}, None),
    ],
)
def test_an_inertia_or_a_power_far_from_the_rated_point_is_noted_once(keys, says):
    said = notes(WATERS, "sump", "out", curve=ONE, rated_speed="1480 rpm", **keys)
    assert [key for key, _ in said] == ([] if says is None else [*keys][:1])
    assert says is None or says in said[0][1]
