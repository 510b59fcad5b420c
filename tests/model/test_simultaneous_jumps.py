"""Jumps of waves that arrive together, and with jumps of schedules: states of no duration count nowhere.

The truth is a closed form, or characteristics at Courant number 1 in cells of equal travel time.
"""

import numpy as np
import pytest
from reference.lines_with_jumps import EXACT, line
from reference.scenes import WATER, junction, lake, scene

import fvsolve

AT_REST = {**WATER, "vapor_pressure": 0.0}


def on_exact_grid(case: dict, time: float) -> dict:
    """Case with characteristics at Courant number 1, in cells that a wave crosses in `time` [s]."""
    links = {
        name: link | {"cells": round(link["length"] / link["wave_speed"] / time)}
        if link["type"] == "pipe"
        else link
        for name, link in case["links"].items()
    }
    return {**case, "links": links, "numerics": {"end": case["numerics"]["end"]} | EXACT}


@pytest.mark.parametrize("h", [0.01, 0.0173, 0.25])
def test_a_wave_that_returns_as_a_demand_rises(h):
    """A demand that doubles as the wave of its start returns: the head falls by a v / g and never exceeds 100 m."""
    nodes = {
        "lake": lake(100.0),
        "n": junction({"time": [0.9, 1.0, 1.5], "value": [0.0, 0.01, 0.02], "kind": "step"}),
    }
    case = scene(
        nodes,
        {"p": line("lake", "n", 250.0)},
        4.0,
        {"pipe_model": "delay-line", "step": h},
        ["n.head"],
        0.01,
    )
    found = fvsolve.run(case).extremes["n.head"]
    drop = 1000.0 * 0.01 / (np.pi * 0.3**2 / 4.0) / 9.80665
    assert found.minimum == pytest.approx(100.0 - drop, abs=1e-6)
    assert found.maximum == pytest.approx(100.0, abs=1e-6)


def altitude_valve() -> dict:
    """Case of an altitude valve that shuts and opens again, behind two delay lines and beside a third."""
    friction = {"model": "steady", "factor": 0.02}
    nodes = {
        "a": lake(37.8, elevation=0.0),
        "c": junction(elevation=0.0),
        "z": junction(elevation=0.0),
        "side": {
            "type": "tank",
            "area": 5.0,
            "level": 32.4,
            "elevation": 0.0,
            "connection": {"diameter": 0.19, "loss_in": 1.4, "loss_out": 1.5},
        },
        "end": {"type": "tank", "area": 15.0, "level": 31.82, "elevation": 0.0},
    }
    links = {
        "p2": line("a", "c", 545.0, 0.4, friction=friction) | {"wave_speed": 1090.0},
        "p3": line("c", "z", 70.0, 0.4, friction=friction),
        "p4": line("c", "side", 29.0, 0.28),
        "gate": {
            "type": "altitude-valve",
            "from": "z",
            "to": "end",
            "diameter": 0.28,
            "discharge_coefficient": 0.7,
            "full_level": 31.827,
        },
    }
    return scene(
        nodes, links, 8.0, {"pipe_model": "auto"}, ["z.pressure", "gate.flow"], 0.02, fluid=AT_REST
    )


# own characteristics, 0.5 ms
ALTITUDE_VALVE = {"z.pressure": (4.028e5, 1.7315e6), "gate.flow": (-0.199, 0.164)}


@pytest.mark.parametrize("given", [{"numerics.step": 0.009}, {"numerics.step": 0.001},
                                   {"numerics.step": 0.025, "numerics.method": "euler"}])  # fmt: skip
def test_jumps_that_arrive_with_a_jump_that_ends_a_step(given):
    """They count once: an altitude valve that opens again gets the pressures of characteristics, and no more.

    The tolerance is `numerics.delay_tolerance`: smaller jumps act on the valve at the end of their step.
    """
    found = fvsolve.run(altitude_valve(), set=given)
    assert found.ok
    for probe, (least, greatest) in ALTITUDE_VALVE.items():
        one, span = found.extremes[probe], greatest - least
        assert one.minimum == pytest.approx(least, abs=1e-2 * span)
        assert one.maximum == pytest.approx(greatest, abs=1e-2 * span)


def check_valve() -> dict:
    """Case of jumps that arrive together at junctions and at a check valve, by paths of equal travel time."""
    demand = {"time": [1.6, 2.1, 2.2], "value": [0.019, 0.012, 0.02], "kind": "step"}
    opening = {"time": [1.35, 1.65, 2.25], "value": [0.0, 0.32, 0.81], "kind": "linear"}
    nodes = {
        "lake": lake(77.1),
        "n0": junction(),
        "n1": junction(),
        "n2": junction(),
        "n3": junction(demand),
        "o1": lake(17.7),
        "n0x": junction(),
        "n1x": junction(),
    }
    links = {
        "p0": line("lake", "n0", 663.0, 0.221) | {"wave_speed": 1020.0},
        "p1": line("n1", "n0x", 200.0, 0.17),
        "p2": line("n0", "n2", 117.5, 0.102) | {"wave_speed": 470.0},
        "p3": line("n1x", "n3", 133.8, 0.102) | {"wave_speed": 892.0},
        "v1": {"type": "valve", "from": "n2", "to": "o1", "area": 0.00129, "opening": opening},
        "dn0": {
            "type": "valve",
            "from": "n0",
            "to": "n0x",
            "area": 0.00308,
            "opening": {"start": 0.1, "duration": 1.15, "value": [0.61, 0.2], "exponent": 1},
        },
        "dn1": {
            "type": "check-valve",
            "from": "n1",
            "to": "n1x",
            "area": 0.00161,
            "cracking_pressure": 17000.0,
        },
    }
    made = scene(
        nodes, links, 5.2, {"pipe_model": "delay-line"}, ["n2.head", "n3.head"], 0.05, fluid=AT_REST
    )
    return made | {"ambient_pressure": 5e7}


@pytest.mark.parametrize("h", [0.05, 0.03, 0.0125])
def test_jumps_that_arrive_together_by_several_paths(h):
    found = fvsolve.run(check_valve(), set={"numerics.step": h, "numerics.method": "rk4"})
    truth = fvsolve.run(on_exact_grid(check_valve(), 0.0025))
    for probe in ("n2.head", "n3.head"):
        one, exact = found.extremes[probe], truth.extremes[probe]
        assert one.minimum == pytest.approx(
            exact.minimum, abs=1e-3 * (exact.maximum - exact.minimum)
        )
        assert one.maximum == pytest.approx(
            exact.maximum, abs=1e-3 * (exact.maximum - exact.minimum)
        )


@pytest.mark.parametrize("pipe_model", ["delay-line", "auto"])
@pytest.mark.parametrize("share, delay", [(0.5, 0.0), (2.0 / 7.0, 3.0 / 7.0)])
def test_jumps_that_cross_at_a_probe(pipe_model, share, delay):
    """Opposite jumps from both ends meet at a probe at the same time: its head stays as it is, until they return.

    delay : times the travel time, by which the jump at the near end begins later
    """
    travel, flow = 0.317, 0.01
    times = [0.5 + delay * travel, 0.5]
    nodes = {
        "lake": lake(100.0),
        "far": lake(100.0),
        "a": junction({"start": times[0], "duration": 0.0, "value": [0.0, flow]}),
        "b": junction({"start": times[1], "duration": 0.0, "value": [0.0, -flow]}),
    }
    links = {
        "p": line("lake", "a", 3000.0),
        "q": line("a", "b", 1000.0 * travel),
        "r": line("b", "far", 3000.0),
    }
    end = 0.5 + (1.0 - share) * travel + 0.9 * share * travel
    probe = f"q.head@{share}"
    case = scene(nodes, links, end, {"pipe_model": pipe_model, "step": 0.0123}, [probe], 0.01)
    found = fvsolve.run(case).extremes[probe]
    assert found.minimum == pytest.approx(100.0, abs=1e-6) and found.maximum == pytest.approx(
        100.0, abs=1e-6
    )
