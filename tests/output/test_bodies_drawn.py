"""Positions of bodies, and of basins on bodies, in field frames."""

from __future__ import annotations

import math

import meshio
import numpy as np
import pytest
from reference.scenes import scene

from fvsolve import run
from fvsolve.errors import RunError
from fvsolve.output.fields import read_series


def test_a_turning_boom_and_its_tank_are_written_where_they_are(tmp_path):
    rate = 0.4
    boom = {
        "type": "body", "mass": 10.0, "inertia": [1.0, 1.0, 1.0], "centre_of_mass": [1.0, 0, 0],
        "points": {"tip": [2.0, 0, 0]},
        "joint": {"kind": "revolute", "axis": [0, 0, 1], "at": [5.0, 0, 1.0],
                  "angle": {"time": [0, 9], "value": [0, 9 * rate]}},
    }  # fmt: skip
    tank = {"type": "basin", "on": "boom", "at": [2.0, 0, 0.5], "size": [1.0, 1.0], "cells": [2, 2], "level": 0.2}
    world = {"type": "frame", "points": {"post": [5.0, 3.0, 1.0]}}
    stay = {"type": "spring", "from": "world.post", "to": "boom.tip", "stiffness": 1.0}
    case = scene({"boom": boom, "b": tank, "world": world}, {"stay": stay}, 2.0, {"scheme": "upwind"})
    case["output"]["fields"] = 4
    run(case, out=tmp_path / "r")
    frames = read_series(tmp_path / "r" / "fields.pvd")
    bodies = [(t, meshio.read(path)) for t, path in frames if path.name.startswith("bodies")]
    tanks = [(t, meshio.read(path)) for t, path in frames if path.name.startswith("b-")]
    assert len(bodies) == len(tanks) == 5
    for (t, one), (_, other) in zip(bodies, tanks, strict=True):
        east = np.array([math.cos(rate * t), math.sin(rate * t), 0.0])
        north = np.array([-east[1], east[0], 0.0])
        tip = np.array([5.0, 0, 1.0]) + 2.0 * east
        assert np.abs(one.points - tip).sum(axis=1).min() < 1e-9
        assert np.abs(one.points - [5.0, 3.0, 1.0]).sum(axis=1).min() < 1e-9
        assert set(one.cell_data["body"][0]) == {0, -1}
        corner = tip + east + north + [0, 0, 0.5]
        assert np.abs(other.points - corner).sum(axis=1).min() < 1e-9
        assert other.cell_data["normal"][0] == pytest.approx(np.tile([0, 0, 1.0], (4, 1)))


@pytest.mark.parametrize(
    ("physics", "attitude", "along"),
    [
        ({"level": 0.2}, {"yaw": "90 deg"}, [0.0, 1.0, 0.0]),
        ({"physics": "liquid", "thickness": 0.1, "pressure": "2 bar"}, {"yaw": "90 deg"}, [0.0, 1.0, 0.0]),
        (
            {"physics": "liquid", "thickness": 0.1, "pressure": "2 bar"},
            {"pitch": "-30 deg"},
            [math.sqrt(0.75), 0.0, 0.5],
        ),
    ],
)
def test_velocities_in_frames_are_along_axes_of_the_world_and_on_lines_along_those_of_the_basin(
    physics, attitude, along, tmp_path
):
    hull = {"type": "body", "mass": 10.0, "inertia": [1.0, 1.0, 1.0], "joint": {"kind": "fixed", "attitude": attitude}}
    tank = {"type": "basin", "on": "hull", "size": [1.0, 1.0], "cells": [4, 4], "start": {"u": 0.3}, **physics}
    case = scene({"hull": hull, "tank": tank}, {}, 1e-6, {"scheme": "upwind"})
    case["output"] |= {"fields": 1, "lines": {"cut": {"basin": "tank", "from": [0.2, 0.5], "to": [0.8, 0.5]}}}
    run(case, out=tmp_path / "r")
    frame = meshio.read(tmp_path / "r" / "fields" / "tank-000000.vtu")
    assert frame.cell_data["velocity"][0] == pytest.approx(np.tile(0.3 * np.array(along), (16, 1)), abs=1e-12)
    line = np.genfromtxt(tmp_path / "r" / "lines" / "cut-000000.csv", delimiter=",", names=True)
    assert line["u_ms"] == pytest.approx(np.full(line.size, 0.3)) and np.abs(line["v_ms"]).max() < 1e-12


@pytest.mark.parametrize(
    ("fields", "out", "reason"),
    [(0, True, "fields is 0"), (2, False, "nothing was written"), (2, None, "the case has no ")],
)
def test_a_run_without_frames_says_the_one_reason(fields, out, reason, tmp_path):
    stone = {"type": "body", "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
    weight = {"type": "mass", "mass": 1.0}
    coil = {"type": "spring", "from": "wall", "to": "weight", "stiffness": 1.0}
    lone = out is None
    nodes = {"weight": weight, "wall": {"type": "frame"}} if lone else {"stone": stone}
    case = scene(nodes, {"coil": coil} if lone else {}, 0.1, {"method": "rk4", "step": 0.01, "scheme": "upwind"})
    case["output"]["fields"] = fields
    found = run(case, out=None if out is False else tmp_path / "r")
    with pytest.raises(RunError, match=reason) as told:
        found.view(field="speed")
    assert sum(one in str(told.value) for one in ("fields is 0", "nothing was written", "the case has no ")) == 1
