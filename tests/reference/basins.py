"""Models and states of cases with basins, and the bodies that carry basins."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

import fvsolve
from fvsolve.core.mesh import rectangle
from fvsolve.core.model.model import Model, State
from reference.scenes import AMBIENT, reservoir, scene, valve

PLANE = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2", "courant": 0.9}
HEAVY = {"type": "body", "mass": 10.0, "inertia": [1.0, 1.0, 1.0]}
# axis, and end of the rectangle along it
SIDES = {"west": (0, 0), "east": (0, 1), "south": (1, 0), "north": (1, 1)}


def model_of(case: dict) -> Model:
    return fvsolve.build(fvsolve.load(case))


def ended(case: dict, until: float | None = None) -> tuple[Model, State]:
    """Model of a case, and its state at the time `until`, by default the end of the case."""
    model = model_of(case)
    until = case["numerics"]["end"] if until is None else until
    return model, fvsolve.advance(model, fvsolve.initial_state(model), until)


def straight(speed: float, end: float = 10.0) -> dict:
    """Travel or angle of a constant rate from zero."""
    return {"time": [0.0, end], "value": [0.0, speed * end]}


def slowing(deceleration: float, duration: float = 10.0) -> dict:
    """Travel that comes to rest after `duration` by a constant deceleration."""
    return {
        "start": 0.0,
        "duration": duration,
        "value": [0.0, 0.5 * deceleration * duration**2],
        "exponent": 2,
    }


def turning(angle, axis=(0, 0, 1), **more) -> dict:
    return {**HEAVY, "joint": {"kind": "revolute", "axis": list(axis), "angle": angle, **more}}


def sliding(travel, axis=(1, 0, 0), **more) -> dict:
    return {**HEAVY, "joint": {"kind": "prismatic", "axis": list(axis), "travel": travel, **more}}


def cart(mass=100.0, axis=(1, 0, 0), **more) -> dict:
    """Body that moves freely along an axis."""
    joint = {"kind": "prismatic", "axis": list(axis), **more}
    return {"type": "body", "mass": mass, "inertia": [50.0, 50.0, 50.0], "joint": joint}


def on_sides(points: np.ndarray, ends: np.ndarray, size, sides=SIDES) -> dict[str, np.ndarray]:
    """Lines of each side of the rectangle (0, 0) to `size` : name -> int[k, 2]; ends : lines on its outline."""
    middle = points[ends].mean(axis=1)
    return {
        side: ends[np.abs(middle[:, axis] - far * size[axis]) < 1e-9]
        for side, (axis, far) in SIDES.items()
        if side in sides
    }


def halved(size, cells) -> tuple[np.ndarray, list, dict]:
    """Points and triangles of a rectangle, whose cells are cut along one diagonal, and the lines of its sides."""
    mesh = rectangle(size, cells)
    halves = [half for p, q, r, s in mesh.cells.tolist() for half in ([p, q, r], [p, r, s])]
    return mesh.points, halves, on_sides(mesh.points, mesh.ends[mesh.inner :], size)


def run_in_two_parts(
    case: dict,
    folder: Path,
    after: float,
    between: Callable[[Path], object] = lambda run: None,
    ok: bool = True,
):
    """Run a case with an interruption and a resumption into `run`, and without into `whole`, where nothing is drawn.

    after : time of the interruption [s]; between : function of the folder `run`, called before the resumption
    ok : False for a case whose results have marks
    """
    times = []

    def interrupt(t, seconds, steps):
        times.append(t)
        if t > after:
            raise KeyboardInterrupt

    assert not fvsolve.run(case, out=folder / "run", progress=interrupt, pictures=False).ok
    assert after < times[-1] < case["numerics"]["end"]
    between(folder / "run")
    for name, rest in (("run", {"resume": True}), ("whole", {"pictures": False})):
        found = fvsolve.run(case, out=folder / name, **rest)
        assert found.reason == "finished" and found.ok is ok


def assert_equal_files(folder: Path, names: Iterable[str]) -> None:
    """Files of these names in the folders `run` and `whole` have equal bytes."""
    for name in names:
        assert (folder / "run" / name).read_bytes() == (folder / "whole" / name).read_bytes(), name


def basin(size, cells, level, **more) -> dict:
    return {"type": "basin", "size": list(size), "cells": list(cells), "level": level, **more}


def alone(pool: dict, end: float, **numerics) -> dict:
    """Return a case of a basin that only a closed valve joins to a network."""
    pool = {**pool, "patches": {"east": {"side": "east"}}}
    nodes = {"pool": pool, "out": reservoir(AMBIENT)}
    links = {"shut": valve("pool.east", "out", 0.01, opening=0.0) | {"opening": 0.0}}
    return scene(nodes, links, end, PLANE | numerics, ["pool.east.head"], end)
