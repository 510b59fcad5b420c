"""What motion costs: right-hand sides of water between walls that move, and on bodies, beside those that stand still.

`python benchmarks/moving.py [--quick]` prints nanoseconds a cell, best of several, all in one process and in turn, and
their ratios; the goal is 1.2. Everything is compiled before.
"""

import argparse
from time import process_time

import numpy as np
from measure import machine

from fvsolve.case import load
from fvsolve.model import build
from fvsolve.solve import initial_state

GOAL = 1.2
BODY = {"type": "body", "mass": 1e5, "inertia": [1e5, 1e5, 1e5]}
SWING = {"mean": 0, "amplitude": 0.02, "period": 3.0}
WATER = {"name": "user", "density": 1e3, "bulk_modulus": 2e9, "viscosity": 1e-3, "vapor_pressure": 2e3}
WALL = {"patches": {"lid": {"side": "east", "travel": SWING}}}
TRAVELS = {"kind": "prismatic", "axis": [1, 0, 0], "travel": SWING}
TURNS = {"kind": "revolute", "axis": [1, 0, 1], "angle": SWING}
SCENES = {  # keys of the basin, joint of its body
    "stands still": ({}, None),
    "wall along x moves": (WALL, None),
    "wall along y moves": ({"patches": {"lid": {"side": "north", "travel": SWING}}}, None),
    "body travels": ({"on": "body"}, TRAVELS),
    "body turns": ({"on": "body"}, TURNS),
    "body is free": ({"on": "body"}, {"kind": "free"}),
}


def model_of(cells: int, keys: dict, joint: dict | None, scheme: str):
    """The model of a square basin with a hump of water."""
    start = {"level": "1 + 0.1*exp(-(x - 5)^2 - (y - 5)^2)"}
    basin = {"type": "basin", "size": [10, 10], "cells": [cells, cells], "level": 1.0, "start": start, **keys}
    nodes = {"basin": basin} | ({"body": {**BODY, "joint": joint}} if joint else {})
    return build(load({"schema": 1, "fluid": WATER, "nodes": nodes, "numerics": {"end": 1.0, "scheme": scheme}}))


def evaluation(model, y: np.ndarray, handle):
    """times -> CPU time of so many right-hand sides [s]."""
    out, dydt = model.new_out(), np.empty_like(y)

    def spent(times: int) -> float:
        began = process_time()
        for _ in range(times):
            model.functions.rhs(0.3, y, dydt, out, handle)
        return process_time() - began

    spent(1)
    return spent


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer sizes and repeats")
    quick = parser.parse_args().quick
    print(machine("numpy", "numba"))
    for scheme in ("muscl",) if quick else ("upwind", "muscl", "upwind5"):
        for cells in (128,) if quick else (64, 256):
            table(scheme, cells, 7 if quick else 25)


def table(scheme: str, cells: int, rounds: int) -> None:
    """One scheme on one size."""
    timers = {}
    for name, (keys, joint) in SCENES.items():
        model = model_of(cells, keys, joint, scheme)
        with model.slate() as slate:
            timers[name] = evaluation(model, initial_state(model).y, slate.handle), slate, model
    times = max(1, 60000 // cells**2 + 1) * 4
    best = dict.fromkeys(timers, np.inf)
    for _ in range(rounds):  # in turn, so that one noisy moment spoils no single scene
        for name, (spent, *_) in timers.items():
            best[name] = min(best[name], spent(times) / times)
    print(f"\n{scheme}, {cells} x {cells} cells       ns a cell    ratio (goal {GOAL:g})")
    for name, one in best.items():
        print(f"{name:24s}{1e9 * one / cells**2:14.2f}{one / best['stands still']:9.2f}")


if __name__ == "__main__":
    main()
