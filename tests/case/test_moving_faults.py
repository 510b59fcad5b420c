"""Faults of bodies, of parts on bodies and of moving walls, found before a run."""

import pytest
from reference.refusals import refused
from reference.scenes import scene

import fvsolve

BODY = {"type": "body", "mass": 100.0, "inertia": [10.0, 10.0, 10.0]}
POOL = {"type": "basin", "size": [2.0, 1.0], "cells": [8, 4], "level": 0.5}


def faults(nodes: dict, links: dict | None = None) -> str:
    return str(refused(scene(nodes, links or {}, 4.0, {"scheme": "upwind"})))


def fine(nodes: dict, links: dict | None = None):
    return fvsolve.build(fvsolve.load(scene(nodes, links or {}, 4.0, {"scheme": "upwind"})))


def fixed(attitude: dict) -> dict:
    return {**BODY, "joint": {"kind": "fixed", "attitude": attitude}}


@pytest.mark.parametrize("attitude", [{"roll": "180 deg"}, {"pitch": "120 deg"}])
@pytest.mark.parametrize("on_body", [True, False])
def test_water_upside_down_on_a_fixed_joint_is_a_fault_of_the_case(attitude, on_body):
    hull, tank = fixed(attitude if on_body else {}), {**POOL, "on": "hull"}
    said = faults({"hull": hull, "tank": tank if on_body else {**tank, "attitude": attitude}})
    assert "nodes.tank.on" in said and "run out" in said and "hull" in said


def test_frozen_water_may_lie_upside_down_and_open_water_aslant():
    fine({"hull": fixed({"roll": "180 deg"}), "tank": {**POOL, "on": "hull", "sloshing": "frozen"}})
    fine({"hull": fixed({"roll": "80 deg"}), "tank": {**POOL, "on": "hull"}})


def wall(side: str, to: float, **more) -> dict:
    return {"side": side, "travel": {"time": [0.0, 2.0], "value": [0.0, to]}, **more}


def test_two_walls_that_cross_are_a_fault_and_two_that_pass_on_together_are_not():
    pool = {**POOL, "patches": {"left": wall("west", 1.1), "right": wall("east", -1.1)}}
    said = faults({"pool": pool})
    assert "nodes.pool.patches.right.travel" in said and "left" in said and "t = 1.8" in said
    fine({"pool": {**POOL, "patches": {"left": wall("west", 1.1), "right": wall("east", 1.1)}}})
    fine({"pool": {**POOL, "patches": {"left": wall("west", 0.9), "right": wall("east", -0.9)}}})
    zones = {"left": wall("west", 0.9, zone=1.0), "right": wall("east", -0.9, zone=1.0)}
    fine({"pool": {**POOL, "patches": zones}})


@pytest.mark.parametrize(("key", "value"), [("elevation", "3 m"), ("position", [1.0, 2.0])])
def test_a_height_or_a_place_in_the_plan_of_a_body_is_a_fault(key, value):
    joint = {"kind": "revolute", "axis": [0, 1, 0]}
    said = faults({"arm": {**BODY, "joint": joint, key: value}})
    assert f"nodes.arm.{key}" in said and "joint.at" in said


def test_a_bushing_that_holds_nothing_is_a_fault():
    nodes = {"wall": {"type": "frame", "points": {"a": [0, 0, 0]}}, "box": BODY}
    soft = {"type": "bushing", "from": "wall.a", "to": "box"}
    assert "links.rubber.stiffness" in faults(nodes, {"rubber": soft})
    fine(nodes, {"rubber": {**soft, "rotational_damping": 1.0}})


def test_a_level_below_the_whole_bed_is_noted():
    low = fine({"pool": {**POOL, "bed": "1 + 0.1 * x"}})
    (told,) = [one for one in low.warnings if one.key == "level"]
    assert (told.place, told.value) == ("nodes.pool", 0.5) and told.limit == pytest.approx(
        1.0, abs=0.02
    )
    for wet in (
        POOL,
        {**POOL, "bed": "0.45 + 0.1 * x"},
        {**POOL, "bed": "1", "start": {"level": "1.1"}},
    ):
        assert not [one for one in fine({"pool": wet}).warnings if one.key == "level"]
