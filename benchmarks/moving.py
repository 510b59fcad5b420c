"""Cost of motion: right-hand sides of basins with moving walls and on bodies, compared with basins at rest.

`python benchmarks/moving.py [--quick]` prints nanoseconds per cell, the best of several, measured in turn in one
process, and their ratios; the goal is 1.2. Water on grids, then liquids, then both on triangles. Everything is compiled
before.
"""

import tempfile
from pathlib import Path
from time import process_time

import numpy as np
from measure import agree, machine, parser
from planes_scenes import of_triangles

from fvsolve.case import load
from fvsolve.core.model import build
from fvsolve.core.solve import initial_state

GOAL = 1.2
BODY = {"type": "body", "mass": 1e5, "inertia": [1e5, 1e5, 1e5]}
SWING = {"mean": 0, "amplitude": 0.02, "period": 3.0}
WATER = {
    "name": "user",
    "density": 1e3,
    "bulk_modulus": 2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2e3,
}
WALL = {"patches": {"lid": {"side": "east", "travel": SWING}}}
TRAVELS = {"kind": "prismatic", "axis": [1, 0, 0], "travel": SWING}
TURNS = {"kind": "revolute", "axis": [1, 0, 1], "angle": SWING}
SCENES = {  # keys of the basin, joint of its body
    "stands still": ({}, None),
    "wall along x moves": (WALL, None),
    "wall along y moves": ({"patches": {"lid": {"side": "north", "travel": SWING}}}, None),
    "body travels": ({"on": "body"}, TRAVELS),
    "body turns": ({"on": "body"}, TURNS),
    "body is free": ({"on": "body"}, {"kind": "free", "rate": [0.01, 0.02, 0.05]}),
}


HUMP = "exp(-(x - 5)^2 - (y - 5)^2)"
LIQUID = {
    "physics": "liquid",
    "pressure": 1e6,
    "thickness": 1.0,
    "start": {"pressure": f"1e6 + 1e5*{HUMP}"},
}
SURFACE = {"level": 1.0, "start": {"level": f"1 + 0.1*{HUMP}"}}


def model_of(
    cells: int,
    keys: dict,
    joint: dict | None,
    scheme: str,
    law: str = "",
    shape: dict | None = None,
):
    """Model of a square basin with a hump of water, or of a liquid if a law is given.

    shape : keys of a mesh in place of a grid
    """
    shape = shape or {"size": [10, 10], "cells": [cells, cells]}
    basin = {"type": "basin"} | shape | (LIQUID if law else SURFACE) | keys
    nodes = {"basin": basin} | ({"body": {**BODY, "joint": joint}} if joint else {})
    numerics = {"end": 1.0, "scheme": scheme}
    return build(
        load(
            {
                "schema": 1,
                "fluid": WATER | ({"law": law} if law else {}),
                "nodes": nodes,
                "numerics": numerics,
            }
        )
    )


def evaluation(model, y: np.ndarray, handle):
    """Function that returns the CPU time of a number of right-hand sides [s]."""
    out, dydt = model.new_out(), np.empty_like(y)

    def spent(times: int) -> float:
        began = process_time()
        for _ in range(times):
            model.functions.rhs(0.3, y, dydt, out, handle)
        return process_time() - began

    spent(1)
    agree("rates that are not finite", np.sum(~np.isfinite(dydt)), 0)
    return spent


def main() -> None:
    """Print the tables."""
    quick = parser(__doc__).parse_args().quick
    print(machine("numpy", "numba"))
    rounds, sizes, side = (2, (16,), 16) if quick else (25, (64, 256), 128)
    few = (
        {name: SCENES[name] for name in ("stands still", "wall along x moves", "body is free")}
        if quick
        else SCENES
    )
    for scheme in ("muscl",) if quick else ("upwind", "muscl", "upwind5"):
        for cells in sizes:
            table(f"{scheme}, {cells} x {cells} cells", few, rounds, cells, scheme)
    for law in () if quick else ("linear", "log"):
        for cells in sizes:
            table(f"liquid, {law}, {cells} x {cells} cells", SCENES, rounds, cells, "muscl", law)
    with tempfile.TemporaryDirectory() as folder:
        for kind, law in (("water", ""), ("liquid, log", "log"))[: 1 if quick else None]:
            shape = of_triangles(Path(folder) / "square.msh", side)
            wall = {"travel": SWING}
            near = {"patches": {"lid": wall | {"zone": 2.0}}}
            scenes = {
                "stands still": ({}, None),
                "wall moves": ({"patches": {"lid": wall}}, None),
                "in a zone": (near, None),
            }
            table(f"{kind}, triangles", scenes, rounds, side, "muscl", law, shape)


def table(title: str, scenes: dict, rounds: int, *what) -> None:
    """Print the times of scenes of one kind and their ratios; what : arguments of `model_of` except keys and joint."""
    timers, (cells, *more) = {}, what
    for name, (keys, joint) in scenes.items():
        model = model_of(cells, keys, joint, *more)
        with model.run_data() as slate:
            timers[name] = evaluation(model, initial_state(model).y, slate.handle), slate, model
    many = next(iter(timers.values()))[2].all_cells
    times, best = max(1, 60000 // many + 1) * 4, dict.fromkeys(timers, np.inf)
    for _ in range(rounds):  # in turn, so that a disturbance affects all scenes
        for name, (spent, *_) in timers.items():
            best[name] = min(best[name], spent(times) / times)
    print(f"\n{title:24s}       ns a cell    ratio (goal {GOAL:g})")
    for name, one in best.items():
        print(f"{name:24s}{1e9 * one / many:14.2f}{one / best['stands still']:9.2f}")


if __name__ == "__main__":
    main()
