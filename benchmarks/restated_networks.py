"""Random networks written twice: other names, order, units and directions must give the same extremes.

python benchmarks/restated_networks.py [--quick] [--networks 300] [--seed 1]

Each network has 2 to 7 pipes with friction between lakes, junctions with demands that jump or ramp, chambers, air
vessels, check valves, relief valves and valves that move. Lengths are round, so that many waves arrive together. Every
network runs twice for each pipe model: as drawn, and with other names, in another order, in other units and with some
links drawn from their other end. The script prints the greatest difference of an extreme, over its range.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from measure import agree, parser

import fvsolve

MODELS = ("finite-volume", "delay-line", "auto")  # pipe models
BOUND = 1e-6  # greatest difference of an extreme, over the range of its probe
DENSITY, GRAVITY = 900.0, 9.80665
FLUID = {
    "name": "user",
    "density": DENSITY,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 0.0,
}
AMBIENT = 5e7  # so high that no cavity opens [Pa]
FRICTIONS = (
    {"model": "none"},
    {"model": "steady", "factor": 0.022},
    {"model": "quasi-steady", "factor": 0.03},
    {"model": "hazen-williams", "coefficient": 110.0},
    {"model": "chezy-manning", "coefficient": 0.013},
)
# unit of a quantity in the second description, and the number of these units in an SI unit
UNITS = {
    "length": ("ft", 1.0 / 0.3048),
    "diameter": ("mm", 1e3),
    "wave_speed": ("km/h", 3.6),
    "area": ("cm2", 1e4),
    "volume": ("l", 1e3),
    "gas_volume": ("l", 1e3),
    "elevation": ("cm", 100.0),
}
TURNED = ("pipe", "valve")  # links that have the same law in both directions
NUMERICS = (
    {},
    {"courant": 0.7},
    {"step": 0.002, "method": "rk4"},
    {"step": 0.002, "method": "trapezoid"},
)
LENGTHS, DIAMETERS, SPEEDS = (
    (30.0, 50.0, 100.0, 150.0, 162.4, 200.0, 222.7),
    (0.15, 0.2, 0.25),
    (1000.0, 1160.0),
)


def network(seed: int, number: int) -> dict[str, Any]:
    """Case of a random tree of pipes from a lake, with a loop in some, and devices at its nodes."""
    random = np.random.default_rng([seed, number])
    inner = int(random.integers(1, 7))
    nodes: dict[str, Any] = {
        "lake": {"type": "reservoir", "head": float(random.integers(40, 90))},
        "low": {"type": "reservoir", "head": 10.0},
    }
    links: dict[str, Any] = {}
    for k in range(inner):
        nodes[f"n{k}"] = node(random) if k else {"type": "junction"}
        links[f"p{k}"] = pipe(random, f"n{int(random.integers(k))}" if k else "lake", f"n{k}")
    if inner > 2 and random.random() < 0.3:
        links["loop"] = pipe(random, "n0", f"n{inner - 1}")
    valve = {
        "type": "valve",
        "from": f"n{int(random.integers(inner))}",
        "to": "low",
        "area": 2.5e-3,
    }
    links["valve"] = valve | {"opening": opening(random)}
    if random.random() < 0.5:
        at = f"n{int(random.integers(inner))}"
        links["relief"] = {
            "type": "relief-valve",
            "from": at,
            "to": "low",
            "area": 4e-3,
            "overpressure": 2e5,
            "set_pressure": AMBIENT + DENSITY * GRAVITY * float(random.integers(70, 110)),
        }
    if random.random() < 0.5:
        nodes["beyond"] = {
            "type": "junction",
            "demand": {"start": 0.3, "duration": 0.1, "value": [4e-3, 1e-3]},
        }
        nodes["end"] = {"type": "junction"}
        before = f"n{int(random.integers(inner))}"
        links["check"] = {"type": "check-valve", "from": before, "to": "beyond", "area": 3e-3}
        links["branch"] = pipe(random, "beyond", "end")
    probes = [f"{name}.head" for name, one in nodes.items() if one["type"] != "reservoir"]
    numerics = {"end": 2.0} | NUMERICS[int(random.integers(len(NUMERICS)))]
    output = {"fields": 0, "every": 0.02, "probes": [*probes, "p0.head@0.5"]}
    return {
        "ambient_pressure": AMBIENT,
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": output,
    }


def node(random: np.random.Generator) -> dict[str, Any]:
    """Junction with or without a demand, chamber, or air vessel."""
    kind = random.choice(
        ["plain", "jump", "ramp", "chamber", "vessel"], p=[0.2, 0.3, 0.2, 0.15, 0.15]
    )
    flow, start = round(float(random.uniform(0.0, 0.02)), 4), 0.1 * int(random.integers(1, 7))
    if kind == "chamber":
        return {"type": "chamber", "volume": round(float(random.uniform(0.3, 3.0)), 2)}
    if kind == "vessel":
        return {
            "type": "accumulator",
            "volume": 10.0,
            "gas_volume": round(float(random.uniform(0.05, 0.3)), 3),
        }
    if kind == "plain":
        return {"type": "junction"}
    duration = 0.0 if kind == "jump" else round(float(random.uniform(0.05, 0.3)), 2)
    return {
        "type": "junction",
        "demand": {"start": start, "duration": duration, "value": [flow, 0.2 * flow]},
    }


def pipe(random: np.random.Generator, start: str, end: str) -> dict[str, Any]:
    """Pipe of a round length with any friction."""
    length, diameter, speed = (
        float(random.choice(values)) for values in (LENGTHS, DIAMETERS, SPEEDS)
    )
    friction = FRICTIONS[int(random.integers(len(FRICTIONS)))]
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": length,
        "diameter": diameter,
        "wave_speed": speed,
        "cells": int(random.integers(4, 9)),
        "friction": friction,
    }


def opening(random: np.random.Generator) -> dict[str, Any]:
    """Opening of a valve that closes and may open again."""
    if random.random() < 0.4:
        return {"time": [0.4, 0.55, 0.7], "value": [1.0, 0.1, 1.0], "kind": "linear"}
    duration, last = float(random.choice([0.0, 0.1, 0.4])), float(random.choice([0.0, 0.4]))
    return {"start": 0.2, "duration": duration, "value": [1.0, last]}


def restated(case: dict[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """Case with other names, in another order, in other units, some links drawn from their other end."""
    said = {name: f"z{len(name)}{name[::-1]}" for name in (*case["nodes"], *case["links"])}
    nodes, links = ([*case[table]] for table in ("nodes", "links"))
    random.shuffle(nodes)
    random.shuffle(links)
    new: dict[str, Any] = {
        **case,
        "nodes": {said[name]: in_units(case["nodes"][name]) for name in nodes},
        "links": {},
    }
    for name in links:
        link = in_units(case["links"][name])
        ends = said[link["from"]], said[link["to"]]
        if link["type"] in TURNED and random.random() < 0.5:
            ends = ends[::-1]
        new["links"][said[name]] = link | dict(zip(("from", "to"), ends, strict=True))
    probes = [
        f"{said[probe.split('.')[0]]}.{probe.split('.', 1)[1]}"
        for probe in case["output"]["probes"]
    ]
    return new | {"output": case["output"] | {"probes": probes}}


def in_units(part: dict[str, Any]) -> dict[str, Any]:
    """Part with its quantities in the units of `UNITS`."""
    return {
        key: f"{value * UNITS[key][1]!r} {UNITS[key][0]}" if key in UNITS else value
        for key, value in part.items()
    }


def extremes(case: dict[str, Any]) -> np.ndarray | str:
    """Least and greatest value of each probe, float64[probes, 2], or the reason why the case is refused."""
    try:
        result = fvsolve.run(case)
    except fvsolve.CaseError as error:
        return str(error.faults[0].message)[:40]
    found = result.summary["extremes"]
    sides = ("minimum", "maximum")
    return np.array(
        [[found[probe][side] for side in sides] for probe in case["output"]["probes"]], dtype=float
    )


def difference(first: np.ndarray | str, second: np.ndarray | str) -> float:
    """Greatest difference of two extremes over the range of their probe; infinite if only one run is refused."""
    if isinstance(first, str) or isinstance(second, str):
        return 0.0 if isinstance(first, str) and isinstance(second, str) else np.inf
    spread = np.maximum(np.ptp(first, axis=1, keepdims=True), 1e-3)
    return float(np.max(np.abs(first - second) / spread))


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "--networks", type=int, default=300, help="number of random networks (default 300)"
    )
    options.add_argument(
        "--seed", type=int, default=1, help="seed of the random networks (default 1)"
    )
    given = options.parse_args()
    many = 4 if given.quick else given.networks
    found = dict.fromkeys(MODELS, 0.0)
    for model in MODELS:
        began, worst, off, refused = time.perf_counter(), 0.0, 0, 0
        for number in range(many):
            case = network(given.seed, number)
            case["numerics"]["pipe_model"] = model
            first = extremes(case)
            apart = difference(
                first, extremes(restated(case, np.random.default_rng([given.seed, number, 7])))
            )
            refused += isinstance(first, str)
            worst, off = max(worst, apart), off + (apart > BOUND)
            if apart > BOUND:
                print(f"{model}: network {number}: {apart:.3g} of the range", flush=True)
        found[model] = worst
        spent = time.perf_counter() - began
        print(
            f"{model}: {many} networks, greatest difference {worst:.3g} of the range, {off} above {BOUND:g}; "
            f"{refused} refused; {spent:.0f} s",
            flush=True,
        )
    for model, worst in found.items():
        agree(f"greatest difference of an extreme over its range, {model}", worst, BOUND)


if __name__ == "__main__":
    main()
