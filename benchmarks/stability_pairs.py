"""Greatest stable step, predicted and measured, of every linear scheme with every explicit method on four scenes.

    python benchmarks/stability_pairs.py [--quick] [cells] [steps]

The scenes are a closed pipe, a pipe with inflow (ends without reflection), a junction of three pipes with a valve with
flow, and a chain of chambers. The tables give Courant numbers, and the difference of measurement and prediction.
`fvsolve stability --cells N` computes the periodic pipe. Takes some minutes.
"""

from __future__ import annotations

import math

import numpy as np
from measure import agree, parser

from fvsolve.core.schemes import LINEAR
from fvsolve.core.steppers import METHODS
from fvsolve.studies.stability.stability import stability

RHO, AMBIENT = 1000.0, 101325.0
FLUID = {
    "name": "user",
    "density": RHO,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2300.0,
}


def pipe(start: str, end: str, length: float, diameter: float, speed: float, cells: int) -> dict:
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": length,
        "diameter": diameter,
        "wave_speed": speed,
        "cells": cells,
        "friction": {"model": "none"},
    }


def valve(start: str, end: str, flow_area: float, opening: float = 1.0) -> dict:
    return {
        "type": "valve",
        "from": start,
        "to": end,
        "area": flow_area,
        "discharge_coefficient": 1.0,
        "opening": opening,
    }


def scene(nodes: dict, links: dict) -> dict:
    return {
        "schema": 1,
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "numerics": {"end": 1.0, "method": "rk4", "step": 1e-3},
    }


def reservoir(pressure: float) -> dict:
    return {"type": "reservoir", "pressure": pressure}


JUNCTION = {"type": "junction"}


def closed(cells: int) -> dict:
    """Pipe between a closed valve and a dead end."""
    return scene(
        {"A": reservoir(1e6), "a": JUNCTION, "b": JUNCTION},
        {"v": valve("A", "a", 1e-3, 0.0), "p": pipe("a", "b", 100.0, 0.3, 1000.0, cells)},
    )


def inflow(cells: int) -> dict:
    """Pipe with end valves of its own slope, dM/dp = A / a: waves enter and leave without reflection."""
    flow, admittance = 10.0, math.pi / 4 * 0.3**2 / 1000.0
    conductance = 2 * flow * admittance  # M |M| = G dp
    opened, drop = math.sqrt(conductance / (2 * RHO)), flow**2 / conductance
    nodes = {"A": reservoir(1e6 + 2 * drop), "a": JUNCTION, "b": JUNCTION, "B": reservoir(1e6)}
    links = {
        "p": pipe("a", "b", 100.0, 0.3, 1000.0, cells),
        "v": valve("A", "a", opened),
        "w": valve("b", "B", opened),
    }
    return scene(nodes, links)


def network(cells: int) -> dict:
    """Junction of three pipes, with a reservoir, a valve with flow and a dead end."""
    nodes = {
        "A": reservoir(1.2e6),
        "t": JUNCTION,
        "g": JUNCTION,
        "B": reservoir(1e6),
        "d": JUNCTION,
    }
    links = {
        "p": pipe("A", "t", 100.0, 0.3, 1000.0, cells),
        "q": pipe("t", "g", 60.0, 0.2, 1100.0, max(5, cells // 2)),
        "r": pipe("t", "d", 80.0, 0.25, 900.0, max(5, cells // 2)),
        "v": valve("g", "B", 2e-3),
    }
    return scene(nodes, links)


def chain(cells: int) -> dict:
    """Chambers in a row with flow through valves between two pressures."""
    inside = {f"c{k}": {"type": "chamber", "volume": 1e-3 * (1 + k % 3)} for k in range(cells)}
    nodes = {"in": reservoir(2e6), **inside, "out": reservoir(1e6)}
    names = list(nodes)
    return scene(nodes, {f"v{k}": valve(names[k], names[k + 1], 1e-5) for k in range(cells + 1)})


def main() -> None:
    """Print a table and the greatest difference for each scene."""
    options = parser(__doc__)
    options.add_argument(
        "cells", nargs="?", type=int, help="number of cells (default 16, with --quick 8)"
    )
    options.add_argument(
        "steps", nargs="?", type=int, help="number of steps (default 1000, with --quick 200)"
    )
    given = options.parse_args()
    cells, steps = (
        given.cells or (8 if given.quick else 16),
        given.steps or (200 if given.quick else 1000),
    )
    methods = [name for name, one in METHODS.items() if one.name == name and one.explicit]
    schemes, scenes = list(LINEAR), (closed, inflow, network, chain)
    if given.quick:
        methods, schemes, scenes = ["rk4", "ssp-rk3"], ["upwind", "upwind5"], (network, chain)
    worst: list[float] = []
    for make in scenes:
        names = schemes if make is not chain else schemes[:1]
        rows = stability(make(cells), names, methods, steps=steps).rows
        print(
            f"\n{make.__name__}, {cells} cells, {steps} steps: predicted (measured less predicted, %)",
            flush=True,
        )
        print(f"{'':18}" + "".join(f"{name:>20}" for name in names))
        for method in methods:
            line = [row for row in rows if row.method == method]
            unit = [row.rate or 1.0 for row in line]
            cells_of = [
                f"{row.predicted * u:.5g} ({100 * row.difference:+.2f})"
                for row, u in zip(line, unit, strict=True)
            ]
            print(f"{method:18}" + "".join(f"{text:>20}" for text in cells_of), flush=True)
        worst.append(float(np.max(np.abs([row.difference for row in rows]))))
        print(f"greatest difference {100 * worst[-1]:.3f} %", flush=True)
        agree("prediction beside measurement", worst[-1] if given.quick else 0.0, 0.01)


if __name__ == "__main__":
    main()
