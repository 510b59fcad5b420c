"""Closing and opening valves against Allievi's recursion and exact ray tracing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference import frictionless, scenes
from reference.frictionless import relative_drop
from reference.scenes import AMBIENT, RHO, SHARP, junction, pipe, ramp, reservoir, scene, valve

import fvsolve

LENGTH, DIAMETER, SPEED, CELLS = 1000.0, 0.4, 1000.0, 20
PERIOD, STEP = 2 * LENGTH / SPEED, LENGTH / SPEED / CELLS
DROP = 1.5e6

SCHEDULES = {
    "slow closure": ramp(0.0, 3 * PERIOD, 1.0, 0.0),
    "fast closure": ramp(0.0, 0.4 * PERIOD, 1.0, 0.0),
    "partial closure": ramp(0.0, 2.5 * PERIOD, 1.0, 0.3),
    "curved closure": ramp(0.0, 2.05 * PERIOD, 1.0, 0.0, 1.5),
    "opening": ramp(0.0, 1.5 * PERIOD, 0.2, 1.0),
    "late closure": ramp(7 * STEP, PERIOD, 1.0, 0.1),
    "there and back": {
        "time": [0.0, PERIOD, 2 * PERIOD, 4 * PERIOD],
        "value": [1.0, 0.4, 0.4, 0.9],
        "kind": "linear",
    },
}


def opening(schedule: dict, t: float) -> float:
    """Value of a schedule at time t [s]: a linear table, or a ramp with an exponent."""
    if "time" in schedule:
        return float(np.interp(t, schedule["time"], schedule["value"]))
    s = min(max((t - schedule["start"]) / schedule["duration"], 0.0), 1.0)
    v0, v1 = schedule["value"]
    return v1 + (v0 - v1) * (1 - s) ** schedule["exponent"]


def flow_area(velocity: float, schedule: dict) -> float:
    """Product Cd A of the fully open valve, which passes `velocity` [m/s] at its initial opening [m2]."""
    return velocity * scenes.area(DIAMETER) / math.sqrt(2 * DROP / RHO) / opening(schedule, -1.0)


def closure(velocity: float, schedule: dict, every: float, turned: bool = False) -> dict:
    ends = ("gate", "lake") if turned else ("lake", "gate")
    across = ("air", "gate") if turned else ("gate", "air")
    nodes = {"lake": reservoir(AMBIENT + DROP), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {
        "main": pipe(*ends, LENGTH, DIAMETER, SPEED, CELLS),
        "valve": valve(*across, flow_area(velocity, schedule), schedule),
    }
    return scene(nodes, links, 6 * PERIOD, SHARP, ["gate.pressure", "valve.flow"], every)


@pytest.mark.parametrize("name", SCHEDULES)
@pytest.mark.parametrize("velocity", [0.1, 1.0, 4.0])
def test_valve_pressure_follows_the_recursion(name, velocity):
    schedule = SCHEDULES[name]
    result = fvsolve.run(closure(velocity, schedule, PERIOD))
    times = np.unique(np.asarray(result.t))
    on = np.flatnonzero(np.abs(times / PERIOD - np.round(times / PERIOD)) < 1e-9)
    assert len(on) == 7
    tau = [opening(schedule, PERIOD * k) / opening(schedule, -1.0) for k in range(7)]
    drops = relative_drop(RHO * SPEED * velocity / (2 * DROP), tau)
    found = np.interp(times[on], result.t, result["gate.pressure"])
    assert found == pytest.approx(AMBIENT + DROP * np.array(drops), abs=1e-10 * DROP)


@pytest.mark.parametrize("name", SCHEDULES)
def test_valve_pressure_and_flow_are_exact_at_every_step(name):
    schedule, velocity = SCHEDULES[name], 1.0
    result = fvsolve.run(closure(velocity, schedule, STEP))
    area = flow_area(velocity, schedule)
    main = frictionless.Pipe("lake", "gate", LENGTH, DIAMETER, SPEED, velocity * scenes.area(DIAMETER), AMBIENT + DROP)
    exact = frictionless.Rays(
        RHO,
        {"main": main},
        {"lake": frictionless.held(AMBIENT + DROP)},
        outlets={"gate": (lambda t: area * opening(schedule, t), AMBIENT)},
    )
    pressure = np.array([exact.pressure("gate", float(t)) for t in result.t])
    opened = np.array([opening(schedule, float(t)) for t in result.t])
    flow = area * opened * np.sqrt(2 * (pressure - AMBIENT) / RHO)
    assert result["gate.pressure"] == pytest.approx(pressure, abs=1e-10 * DROP)
    assert result["valve.flow"] == pytest.approx(flow, abs=1e-10 * velocity)


def test_pipe_and_valve_turned_round_give_the_same_pressure_and_the_opposite_flow():
    schedule = SCHEDULES["curved closure"]
    one, two = (fvsolve.run(closure(2.0, schedule, STEP, turned)) for turned in (False, True))
    assert two["gate.pressure"] == pytest.approx(one["gate.pressure"], abs=1e-10 * DROP)
    assert two["valve.flow"] == pytest.approx(-one["valve.flow"], abs=1e-12)
    assert one["valve.flow"][0] > 0


def test_a_shut_valve_passes_exactly_nothing():
    schedule = SCHEDULES["fast closure"]
    result = fvsolve.run(closure(1.0, schedule, 0.1))
    assert np.all(result["valve.flow"][result.t > 0.4 * PERIOD] == 0.0)


def test_mass_ledger_closes_over_the_closure():
    result = fvsolve.run(closure(4.0, SCHEDULES["slow closure"], 0.5))
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
