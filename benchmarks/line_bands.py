"""Error bands of random networks of delay lines, compared with runs of eight times the resolution.

python benchmarks/line_bands.py [--quick] [--seed 1] [--random 22]

The bands are those of `fvsolve run --estimate-error`. Networks have pipes of 3 to 900 m, with or without friction,
between a lake and a valve that closes at once or by a ramp, in part or in full. Some have a check valve or a branch.
Steps are given by Courant number, by length or by tolerance.
"""

from __future__ import annotations

import math
import time

import numpy as np
from measure import agree, parser

from fvsolve.core.run import model_of, run
from fvsolve.studies.peak_error import SIDES, peak_errors
from fvsolve.studies.resolution import refined_keys

WATER = {
    "name": "user",
    "density": 1000,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2000,
}
FRICTIONS = (
    {"model": "none"},
    {"model": "steady", "factor": 0.02},
    {"model": "quasi-steady", "roughness": 2e-4},
)


def network(random: np.random.Generator) -> dict:
    """Case of a random chain of two to four pipes, some with a branch or a check valve."""
    many = int(random.integers(2, 5))
    nodes = {"lake": {"type": "reservoir", "head": float(random.uniform(40, 150))}}
    links, before, friction = {}, "lake", FRICTIONS[int(random.integers(3))]
    for i in range(many):
        nodes[f"n{i}"] = {"type": "junction"}
        links[f"p{i}"] = pipe(random, before, f"n{i}", friction)
        before = f"n{i}"
    if random.random() < 0.5:
        nodes["dead"] = {"type": "junction"}
        links["side"] = pipe(random, "n0", "dead", friction)
    if random.random() < 0.3:
        nodes["c"] = {"type": "junction"}
        links["check"] = {
            "type": "check-valve",
            "from": before,
            "to": "c",
            "diameter": 0.3,
            "loss_coefficient": 1.0,
        }
        links["beyond"] = pipe(random, "c", "end", friction)
        nodes["end"] = {"type": "junction"}
        before = "end"
    duration = float(random.choice([0.0, 0.0, 0.05, 0.3]))
    nodes["out"] = {"type": "reservoir", "pressure": "0 barg"}
    opening = {"start": 0.3, "duration": duration, "value": [1.0, float(random.choice([0.0, 0.3]))]}
    links["v"] = {
        "type": "valve",
        "from": before,
        "to": "out",
        "area": float(random.uniform(5e-4, 4e-3)),
        "opening": opening,
    }
    control = [
        {"courant": 0.9},
        {"step": float(10.0 ** random.uniform(-2.5, -1.3))},
        {"rtol": 1e-5},
    ]
    numerics = {"end": 4.0, "pipe_model": "delay-line", **control[int(random.integers(3))]}
    numerics["method"] = (
        "bogacki-shampine" if "rtol" in numerics else str(random.choice(["euler", "rk4"]))
    )
    probes = [f"{name}.head" for name, node in nodes.items() if node["type"] == "junction"] + [
        "p0.flow",
        "v.flow",
    ]
    output = {"every": 0.02, "fields": 0, "probes": [*probes, "p0.pressure@0.37"]}
    return {"fluid": WATER, "nodes": nodes, "links": links, "numerics": numerics, "output": output}


def pipe(random: np.random.Generator, one: str, other: str, friction: dict) -> dict:
    """Random pipe of 3 to 900 m between two nodes."""
    return {
        "type": "pipe",
        "from": one,
        "to": other,
        "length": float(10.0 ** random.uniform(0.5, 2.95)),
        "diameter": float(random.choice([0.15, 0.2, 0.3])),
        "wave_speed": float(random.uniform(900, 1300)),
        "friction": friction,
        "cells": int(random.integers(4, 30)),
    }


def bands(given: dict) -> list[tuple[str, float, float]]:
    """Name, band, and difference from eight times the resolution, of each peak; an unknown band is infinite."""
    case = model_of(given).case
    said = peak_errors(run(given, pictures=False), case)
    every = {"output.every": case.output.every / 8.0}
    fine = run(given, set=refined_keys(case, 8.0) | every, pictures=False).summary["extremes"]
    return [
        (
            f"{side} {probe}",
            math.inf if one[side]["error"] is None else one[side]["error"],
            abs(fine[probe][side] - one[side]["value"]),
        )
        for probe, one in said["peaks"].items()
        for side in SIDES
    ]


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "--seed", type=int, default=1, help="seed of the random networks (default 1)"
    )
    options.add_argument(
        "--random",
        type=int,
        metavar="N",
        help="number of random networks (default 22, with --quick 1)",
    )
    given, began, rows = options.parse_args(), time.perf_counter(), []
    many = given.random or (1 if given.quick else 22)
    for k in range(many):
        scene = network(np.random.default_rng([given.seed, k]))
        found = bands(scene)
        rows += found
        for what, band, off in found:
            if off > band:
                print(
                    f"scene {k} ({scene['numerics']['method']}): {what}: off by {off:.3g}, band {band:.3g}"
                )
    outside, known = (
        sum(off > band for _, band, off in rows),
        [row for row in rows if math.isfinite(row[1])],
    )
    wide = [band / off for _, band, off in known if off > 0.0]
    print(
        f"{len(rows)} peaks of {many} networks: {outside} outside their band, {len(rows) - len(known)} "
        f"not known; band over difference, median {np.median(wide):.3g}; {time.perf_counter() - began:.0f} s"
    )
    agree("peaks outside their band", outside, 0)


if __name__ == "__main__":
    main()
