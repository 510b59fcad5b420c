"""Events between two states of one step: event functions that reach zero and return before the step ends."""

import math

import pytest
from reference.scenes import WATER

import fvsolve

ADAPTIVE = [
    ("tr-bdf2", 1e-6),
    ("dormand-prince", 1e-8),
    ("bogacki-shampine", 1e-5),
    ("verner-7", 1e-6),
    ("esdirk-4", 1e-4),
    ("radau-iia-5", 1e-6),
    ("rodas-4", 1e-6),
    ("auto", 1e-4),
]
METHODS = [
    *({"method": name, "rtol": rtol} for name, rtol in ADAPTIVE),
    {"method": "rk4", "step": 40.0},
    {"method": "gauss-4", "step": 60.0},
]


def filled(numerics, links=None, flow="0.064*(1 - t/50)", end=90.0, **tank):
    """Case of a tank of 1 m2 whose level is 4 m + 0.064 (t - t^2 / 100) m, with its peak of 5.6 m at 50 s."""
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": {
            "src": {"type": "inflow", "flow": flow},
            "pot": {"type": "tank", "area": 1.0, "level": 4.0, **tank},
            "out": {"type": "reservoir", "head": 0.0},
        },
        "links": {
            "fill": {"type": "valve", "from": "src", "to": "pot", "area": 0.1},
            "drain": {"type": "valve", "from": "pot", "to": "out", "area": 1e-3, "opening": 0.0},
        }
        | (links or {}),
        "numerics": {"end": end, **numerics},
        "output": {"every": end, "probes": ["pot.level"]},
    }


def with_relay(numerics, on):
    """Case of the tank with a relay that opens its drain at the level `on`."""
    case = filled(numerics)
    case["links"]["drain"]["opening"] = {"control": "r"}
    return case | {
        "controls": {
            "r": {"type": "relay", "input": "pot.level", "on": on, "off": 3.0, "initial": 0}
        }
    }


@pytest.mark.parametrize("margin", [1e-3, 0.3])
@pytest.mark.parametrize("numerics", METHODS, ids=lambda one: one["method"])
def test_a_relay_acts_at_a_peak_within_a_step(numerics, margin):
    """The level is above `on` by `margin` of its range at most, around 50 s; a step may extend over all this time."""
    result = fvsolve.run(with_relay(numerics, 5.6 - 1.6 * margin))
    (event, *_) = result.summary["events"]
    assert event["what"] == "turns on"
    assert event["time"] == pytest.approx(50.0 * (1.0 - math.sqrt(margin)), rel=1e-5)


def test_the_search_costs_nothing_where_nothing_is_near():
    """A relay with a distant threshold adds at most the rates at the end of the first step."""
    numerics = {"method": "bogacki-shampine", "rtol": 1e-6}
    plain, watched = fvsolve.run(filled(numerics)), fvsolve.run(with_relay(numerics, 50.0))
    assert watched.summary["events"] == [] and watched.summary["steps"] == plain.summary["steps"]
    assert watched.summary["rhs"] <= plain.summary["rhs"] + 1


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-5p"])
def test_a_disc_bursts_at_the_first_of_two_peaks(method):
    """The level is 4 m + 0.5 m sin(2 pi t / 100 s); the disc bursts 1 mm below both peaks."""
    w = 2.0 * math.pi / 100.0
    disc = {
        "type": "rupture-disc",
        "from": "pot",
        "area": 1e-4,
        "burst_pressure": 998.2 * 9.80665 * 4.499,
    }
    case = filled(
        {"method": method, "rtol": 1e-5}, {"disc": disc}, f"{0.5 * w!r}*cos({w!r}*t)", 180.0
    )
    case["fluid"] = WATER | {"density": 998.2}
    (event,) = fvsolve.run(case).summary["events"]
    assert event["time"] == pytest.approx(math.asin(0.499 / 0.5) / w, rel=1e-3)


@pytest.mark.parametrize("numerics", METHODS[::3], ids=lambda one: one["method"])
def test_a_tank_spills_at_a_peak_within_a_step(numerics):
    case = filled(numerics, height=5.5)
    result = fvsolve.run(case)
    assert result.extremes["pot.level"].maximum == pytest.approx(5.5, abs=1e-9)
    # above 50 s the inflow is negative, so the level falls from the rim
    assert result["pot.level"][-1] == pytest.approx(5.5 - 0.064 * 40.0**2 / 100.0, abs=1e-4)


STIFFNESS, MASS, STOP, SPEED, WEIGHT = 1e6, 2.0, 0.48, 3.1315570887372, 9.80665


def thrown(numerics):
    """Case of a mass thrown to 0.5 m, against a stop without damping at 0.48 m."""
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": {
            "ground": {"type": "frame"},
            "m": {"type": "mass", "mass": MASS, "initial_velocity": SPEED},
        },
        "links": {
            "weight": {"type": "force", "to": "m", "force": -MASS * WEIGHT},
            "stop": {
                "type": "end-stop",
                "from": "ground",
                "to": "m",
                "stiffness": STIFFNESS,
                "maximum": STOP,
            },
        },
        "numerics": {"end": 0.6, **numerics},
        "output": {"every": 0.6, "probes": ["m.position", "m.velocity", "stop.force"]},
    }


def after_the_stop(t):
    """(position [m], velocity [m/s]) of the mass at t [s] after the contact, in closed form."""
    w = math.sqrt(STIFFNESS / MASS)
    v = math.sqrt(SPEED**2 - 2.0 * WEIGHT * STOP)
    begin, resting = (SPEED - v) / WEIGHT, -WEIGHT / w**2
    # x - resting = a cos(w s) + b sin(w s) with x = 0 at both ends of the contact
    duration = (2.0 * math.pi - 2.0 * math.atan2(v / w, resting)) / w
    flight = t - begin - duration
    return STOP - v * flight - 0.5 * WEIGHT * flight**2, -v - WEIGHT * flight


@pytest.mark.parametrize("numerics, near", [
    ({"method": "dormand-prince", "rtol": 1e-8}, 1e-4), ({"method": "auto", "rtol": 1e-8}, 1e-4),
    ({"method": "radau-iia-5", "rtol": 1e-8}, 1e-4), ({"method": "rodas-5p", "rtol": 1e-8}, 1e-4),
    ({"method": "rk4", "step": 0.1}, 1e-3), ({"method": "gauss-4", "step": 0.6}, 1e-3),
], ids=lambda one: one["method"] if isinstance(one, dict) else "")  # fmt: skip
def test_a_stop_near_the_apex_throws_the_mass_back(numerics, near):
    """The contact lasts 4.4 ms within a step; a given step of 707 rad/s times 0.1 s is divided while it lasts."""
    result, (x, v) = fvsolve.run(thrown(numerics)), after_the_stop(0.6)
    assert (x, v) == pytest.approx((-0.300387, -3.962100), abs=1e-6)
    assert result["m.position"][-1] == pytest.approx(x, abs=near)
    assert result["m.velocity"][-1] == pytest.approx(v, abs=4.0 * near)


def test_a_load_at_rest_on_a_stop_does_not_divide_given_steps():
    case = thrown({"method": "implicit-euler", "step": 0.1})
    case["nodes"]["m"] = {"type": "mass", "mass": MASS}
    case["links"]["stop"] |= {"minimum": 0.0, "maximum": 1.0}
    result = fvsolve.run(case)
    assert result.summary["steps"] <= 8 and result["m.position"][-1] == pytest.approx(
        -MASS * WEIGHT / STIFFNESS, rel=0.1
    )
