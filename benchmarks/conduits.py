"""Cost of a cell and step of a conduit, without and with friction, free, full and filling."""

from __future__ import annotations

from time import perf_counter

from measure import parser

import fvsolve

PROTOTYPE = 500.0  # ns, a solver whose section has no tables (HLL, ssp-rk2, no friction)
STATES = {"free": (0.6, 0.6), "full": (2.0, 2.0), "filling": (2.0, 0.1)}  # levels of both tanks [m]


def conduit(cells: int, levels: tuple[float, float], manning: float) -> dict:
    """Case of a conduit of 0.2 m long cells between two tanks."""
    nodes = {
        name: {"type": "tank", "area": 50.0, "level": level}
        for name, level in zip("ab", levels, strict=True)
    }
    link = {
        "type": "conduit",
        "from": "a",
        "to": "b",
        "diameter": 0.5,
        "length": 0.2 * cells,
        "inverts": [0.2, 0.1],
        "manning": manning,
        "cells": cells,
        "initial_flow": 0.02,
    }
    fluid = {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 2e3,
    }
    return {
        "fluid": fluid,
        "nodes": nodes,
        "links": {"s": link},
        "output": {"every": 10.0, "probes": ["a.level"]},
        "numerics": {"end": 10.0, "scheme": "muscl", "method": "ssp-rk2"},
    }


def main() -> None:
    cells, rounds = (50, 1) if parser(__doc__).parse_args().quick else (1000, 5)
    print(
        f"conduit of {cells} cells, ssp-rk2, ns a cell and step (prototype without tables: {PROTOTYPE:g})"
    )
    for name, levels in STATES.items():
        for manning in (0.0, 0.013):
            model, best = fvsolve.build(fvsolve.load(conduit(cells, levels, manning))), float("inf")
            for _ in range(rounds + 1):  # the first run compiles
                begin = perf_counter()
                run = fvsolve.run(model)
                best = min(best, perf_counter() - begin)
            cost = 1e9 * best / (cells * run.summary["steps"])
            print(f"  {name:8s} manning {manning:<6g} {cost:6.0f}   {run.summary['steps']} steps")


if __name__ == "__main__":
    main()
