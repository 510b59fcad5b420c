"""Faults and notices of pumps in a case."""

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, pump, scene, step

import fvsolve
from fvsolve.errors import CaseError

ONE = {"flow": [0.1], "head": [50.0]}


def faults(more=None, **keys) -> str:
    links = {"pump": pump("sump", "out", **keys), "main": pipe("out", "top", 100.0, 0.3, 1000.0, 5), **(more or {})}
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
    held = {"curve": ONE, "inertia": 2.0, "rated_speed": 150.0, "trip": step(0.5, 0.0, 1.0)["time"][1]}
    assert "is held at its speed until the trip" in faults(motor, **held)
    wet = {"motor": {"type": "torque", "to": "out", "torque": 1.0}}
    assert "a hydraulic place, and this port of a torque needs a rotational or spatial place" in faults(wet, curve=ONE)


def rounded(by: float) -> dict:
    """Return keys of a pump with a Suter table whose ends differ by `by`."""
    x = np.linspace(0.0, 2.0 * np.pi, 9)
    head, torque = 0.5 - np.cos(x), 0.4 - np.cos(x)
    head[-1] += by
    torque[-1] -= by
    return {"suter": {"rated_flow": 0.1, "rated_head": 50.0, "head": head.tolist(), "torque": torque.tolist()}}


@pytest.mark.parametrize("by", [1e-16, -4e-16, 1e-9, -1e-7])
def test_ends_of_a_suter_table_that_differ_by_rounding_are_one(by):
    case = scene({"sump": lake(0.0), "top": lake(20.0)}, {"pump": pump("sump", "top", **rounded(by))}, 1.0, {})
    table = fvsolve.load(case).links["pump"].suter
    assert table.head[0] == table.head[-1] and table.torque[0] == table.torque[-1]


@pytest.mark.parametrize("by", [1e-3, -1e-4])
def test_ends_of_a_suter_table_that_differ_by_more_are_a_fault(by):
    assert "x = 2 pi is x = 0 again" in faults(**rounded(by))


def notes(nodes: dict, start: str, end: str, **keys) -> list:
    links = {"pump": pump(start, end, **keys), "main": pipe("out", "top", 100.0, 0.3, 1000.0, 5, minor_loss=20.0)}
    made = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {})))
    return [(one.key, one.text) for one in made.warnings if one.kind == "range" and one.place == "links.pump"]


WATERS = {"sump": lake(0.0), "out": junction(), "top": lake(20.0)}


def test_a_pump_drawn_backwards_is_asked_about_and_one_that_lifts_is_not():
    assert notes(WATERS, "sump", "out", curve=ONE) == []
    ((key, text),) = notes(WATERS, "out", "sump", curve=ONE)
    assert key == "from" and "the lowest water level" in text and "check its direction" in text
    down = {"sump": lake(60.0), "out": junction(), "top": lake(20.0)}
    ((key, text),) = notes(down, "sump", "out", curve={"flow": [0.02], "head": [10.0]})
    assert key == "from" and "m lower" in text
    assert notes({**down, "top": lake(70.0)}, "sump", "out", curve={"flow": [0.02], "head": [10.0]}) == []  # a booster
    assert notes(WATERS, "out", "sump", curve=ONE, speed=0.0) == []  # at rest


@pytest.mark.parametrize("flow, unit", [(20.0, "l/s"), (2000.0, "m3/h"), (20000.0, "l/min")])
def test_a_rated_flow_too_quick_for_the_pipes_beside_it_is_asked_about(flow, unit):
    said = notes(WATERS, "sump", "out", curve={"flow": [flow], "head": [50.0]})
    assert [key for key, _ in said] == ["curve"] and f'did you mean "{flow:.4g} {unit}"?' in said[0][1]
    assert notes(WATERS, "sump", "out", curve={"flow": [1.0], "head": [50.0]}) == []


@pytest.mark.parametrize("flow, asked", [("0.03 l/s", True), ("0.1 m3/h", True), ("2 l/s", False)])
def test_a_rated_flow_that_hardly_moves_in_the_pipes_beside_it_is_asked_about(flow, asked):
    said = notes(WATERS, "sump", "out", curve={"flow": [flow], "head": [50.0]})
    assert [key for key, _ in said] == ["curve"] * asked and all("mean another unit?" in text for _, text in said)


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
def test_an_inertia_or_a_power_far_from_what_the_rated_point_says_is_noted_once(keys, says):
    said = notes(WATERS, "sump", "out", curve=ONE, rated_speed="1480 rpm", **keys)
    assert [key for key, _ in said] == ([] if says is None else [*keys][:1])
    assert says is None or says in said[0][1]
