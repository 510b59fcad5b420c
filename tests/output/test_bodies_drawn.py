"""Frames of bodies and of basins that ride on them lie where these are."""

from __future__ import annotations

import math

import meshio
import numpy as np
import pytest

from fvsolve import run
from fvsolve.output.fields import read_series
from tests.truth.scenes import scene


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
