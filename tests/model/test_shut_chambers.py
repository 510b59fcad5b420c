"""Closed chambers without a stated pressure carry their load: pressures by balances of forces, without motion."""

from __future__ import annotations

import numpy as np
import pytest
from pytest import approx
from reference.scenes import AMBIENT, GRAVITY, RHO, reservoir, scene, valve

import fvsolve
from fvsolve.errors import CaseError

A, B = 12e-4, 8e-4
MASS = {"type": "mass", "mass": 1000.0, "initial_position": 0.1}
POOL = {"type": "basin", "size": [2.0, 1.0], "cells": [10, 5], "level": 1.0,
        "patches": {"east": {"side": "east", "body": "load"}}}  # fmt: skip
WATER_FORCE = 0.5 * RHO * GRAVITY  # thrust of water 1 m deep on a wall 1 m wide [N]


def jack(rod: str = "load", case: str = "ground", **more) -> dict:
    ports = {"rod": rod, "case": case}
    dead = {"dead_volume_A": 2e-5, "dead_volume_B": 2e-5}
    return {"type": "cylinder", "ports": ports, "stroke": 0.2, "area_A": A, "area_B": B, **dead, **more}


def standing(load: float, initial: str = "steady", law: str = "linear", nodes=(), **more) -> dict:
    places = {"ground": {"type": "frame"}, "load": MASS, **dict(nodes)}
    links = {"lift": jack(**more), "weight": {"type": "force", "to": "load", "force": load}}
    case = scene(places, links, 0.02, {"method": "dormand-prince", "rtol": 1e-9, "initial": initial, "scheme": "muscl"})
    case["fluid"]["law"] = law
    return case


def held(case: dict) -> tuple[dict[str, float], float]:
    """Initial pressures of both chambers [Pa], and displacement of the mass [m]."""
    case["output"] |= {"probes": ["lift.A.pressure", "lift.B.pressure", "load.position"]}
    run = fvsolve.run(case)
    return {side: run[f"lift.{side}.pressure"][0] for side in "AB"}, float(np.ptp(run["load.position"]))


@pytest.mark.parametrize("initial", ["steady", "equilibrium"])
@pytest.mark.parametrize(
    ("load", "more", "pressures"),
    [
        (-9810.0, {}, (AMBIENT + 9810.0 / A, AMBIENT)),
        (-9810.0, {"law": "log"}, (AMBIENT + 9810.0 / A, AMBIENT)),
        (9810.0, {}, (AMBIENT, AMBIENT + 9810.0 / B)),
        (-9810.0, {"initial_pressure_B": 2e6}, (AMBIENT + (9810.0 + B * (2e6 - AMBIENT)) / A, 2e6)),
        (2000.0, {"initial_pressure_A": 2e6}, (2e6, AMBIENT + (2000.0 + A * (2e6 - AMBIENT)) / B)),
        (-500.0, {"nodes": {"pool": POOL}}, (AMBIENT, AMBIENT + (WATER_FORCE - 500.0) / B)),
        (-8000.0, {"nodes": {"pool": POOL}}, (AMBIENT + (8000.0 - WATER_FORCE) / A, AMBIENT)),
    ],
)
def test_a_mass_and_a_wall_of_water_stand_on_shut_chambers(load, more, pressures, initial):
    found, moved = held(standing(load, initial, **more))
    assert (found["A"], found["B"]) == approx(pressures, rel=1e-9)
    assert moved == 0.0


@pytest.mark.parametrize("initial", ["steady", "equilibrium"])
def test_masses_on_top_of_one_another_stand_on_a_cylinder_each(initial):
    case = standing(-3000.0, initial)
    case["nodes"]["top"] = {**MASS, "initial_position": 0.2}
    case["links"] |= {"upper": jack("top", "load"), "more": {"type": "force", "to": "top", "force": -5000.0}}
    case["output"] |= {"probes": ["lift.A.pressure", "upper.A.pressure", "top.position", "load.position"]}
    run = fvsolve.run(case)
    assert run["lift.A.pressure"][0] == approx(AMBIENT + 8000.0 / A, rel=1e-9)
    assert run["upper.A.pressure"][0] == approx(AMBIENT + 5000.0 / A, rel=1e-9)
    assert np.ptp(run["top.position"]) == np.ptp(run["load.position"]) == 0.0


def test_a_mass_beside_a_body_stands_on_its_own_cylinder():
    case = standing(-9810.0)
    case["nodes"]["post"] = {"type": "frame", "points": {"foot": [0, 0, 0]}}
    case["nodes"]["box"] = {"type": "body", "mass": 50.0, "inertia": [1.0, 1.0, 1.0],
                            "joint": {"kind": "prismatic", "axis": [0, 0, 1], "travel": 0.1}}  # fmt: skip
    case["links"] |= {"post_lift": jack("box", "post.foot"), "gate": valve("lift.A", "post_lift.A", 1e-5, 0.0)}
    case["output"] |= {"probes": ["lift.A.pressure", "post_lift.A.pressure", "load.position", "box.travel"]}
    run = fvsolve.run(case)
    assert run["lift.A.pressure"][0] == approx(AMBIENT + 9810.0 / A, rel=1e-9)
    assert run["post_lift.A.pressure"][0] == approx(AMBIENT + 50.0 * GRAVITY / A, rel=1e-9)
    assert np.ptp(run["load.position"]) == np.ptp(run["box.travel"]) == 0.0


@pytest.mark.parametrize("load", [-9810.0, 9810.0, 0.0])
def test_behind_a_servo_valve_at_rest_one_chamber_is_at_half_the_supply_and_the_other_holds(load):
    high, low = AMBIENT + 140e5, AMBIENT
    case = standing(load, "equilibrium", nodes={"high": reservoir(high), "low": reservoir(low)})
    case["links"]["spool"] = {"type": "spool-valve", "ports": {"P": "high", "T": "low", "A": "lift.A", "B": "lift.B"},
                              "area": 1e-5, "position": 0.0}  # fmt: skip
    found, moved = held(case)
    half = 0.5 * (high + low)
    assert found["B" if load < 0.0 else "A"] == approx(half, rel=1e-9)
    assert A * (found["A"] - AMBIENT) - B * (found["B"] - AMBIENT) == approx(-load, abs=1e-6)
    assert moved == 0.0


def test_a_shut_chamber_that_would_have_to_pull_holds_no_mass():
    with pytest.raises(CaseError, match="nodes.load.* N remain"):
        fvsolve.build(fvsolve.load(standing(-20000.0, "equilibrium", initial_pressure_A=2e6)))
