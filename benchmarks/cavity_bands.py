"""Error bands of first peaks after column separation, compared with runs at eight times the resolution.

python benchmarks/cavity_bands.py [--quick] [CASE]...

Runs columns that separate at a closing end, with and without friction and slope, and shipped cases. For each probe with
a peak after the start it prints the band of the first peak, and its change to eight times the cells. Expected: no
change outside its band, and no band above three times the change. Changes below 1e-3 of the range do not count.
"""

from __future__ import annotations

import math
import time

import numpy as np
from measure import agree, parser

from fvsolve.case import load
from fvsolve.core.run import run
from fvsolve.studies.outcome import NO_FIELDS
from fvsolve.studies.peak_error import SIGNS, peak_errors
from fvsolve.studies.resolution import refined_keys

WATER = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2300.0,
    "cavitation": True,
}
TIMES, WIDEST, SMALL = 8.0, 3.0, 1e-3
# fraction of the run before and after the time of the first peak, in which the finer peak is sought
WINDOW = 0.1


def column(
    head: float, speed: float, slope: float, friction: float, closure: float, cells: int
) -> dict:
    """Case of a column of 100 m that leaves a closing end."""
    flow = 0.25 * math.pi * 0.1**2 * speed
    nodes = {
        "lake": {"type": "reservoir", "head": head, "elevation": 0.0},
        "end": {
            "type": "junction",
            "elevation": slope,
            "demand": {"start": 0.1, "duration": closure, "value": [flow, 0.0]},
        },
    }
    model = {"model": "steady", "factor": friction} if friction else {"model": "none"}
    links = {
        "main": {
            "type": "pipe",
            "from": "lake",
            "to": "end",
            "length": 100.0,
            "diameter": 0.1,
            "wave_speed": 1000.0,
            "cells": cells,
            "friction": model,
        }
    }
    output = {
        "every": 0.002,
        "fields": 0,
        "probes": ["end.pressure", "main.pressure@0.5", "main.flow@1"],
    }
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": nodes,
        "links": links,
        "numerics": {"end": 1.2},
        "output": output,
    }


COLUMNS = [column(30.0, 0.8, 0.0, 0.02, 0.02, 24), column(20.0, 0.6, 0.0, 0.0, 0.0, 32),
           column(40.0, 1.2, 3.0, 0.03, 0.05, 40), column(25.0, 0.5, -4.0, 0.02, 0.01, 28),
           column(60.0, 1.5, 0.0, 0.015, 0.03, 50)]  # fmt: skip
SHIPPED = ("adelaide", "summit-cavity")


def first_peaks(source: object) -> list[tuple[str, float, float, float]]:
    """Name, band, true change and range of each first peak of a case."""
    case = load(source)
    found = peak_errors(run(case, set=NO_FIELDS, pictures=False), case)
    every = {"output.every": case.output.every / TIMES}
    fine = run(case, set=refined_keys(case, TIMES) | NO_FIELDS | every, pictures=False)
    rows, window = [], WINDOW * (fine.seconds[-1] - fine.seconds[0])
    for probe, peak in found["peaks"].items():
        for side, sign in SIGNS.items():
            first = peak[side].get("first")
            if first is None or first["time"] == fine.seconds[0]:
                continue
            near = np.abs(fine.seconds - first["time"]) < window
            change = abs(float(np.max(sign * fine[probe][near])) - sign * first["value"])
            rows.append((f"{side} {probe}", first["error"], change, float(np.ptp(fine[probe]))))
    return rows


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "cases",
        nargs="*",
        metavar="CASE",
        help="cases (default five columns and two shipped cases)",
    )
    given, began, outside, wide, many = options.parse_args(), time.process_time(), 0, 0, 0
    sources = given.cases or [
        *COLUMNS[: 1 if given.quick else None],
        *(() if given.quick else SHIPPED),
    ]
    for k, source in enumerate(sources):
        for name, band, change, span in first_peaks(source):
            many += 1
            outside += change > band + SMALL * span
            wide += band > WIDEST * max(change, SMALL * span)
            label = source if isinstance(source, str) else f"column {k}"
            print(
                f"{label}: {name}: band {band:.3g}, change {change:.3g}, range {span:.3g}",
                flush=True,
            )
    print(
        f"{many} first peaks, {outside} outside their band, {wide} with a band above {WIDEST:g} times the change"
    )
    print(f"{time.process_time() - began:.0f} s of processor time")
    if given.quick:
        agree("first peaks outside their band", outside, 0)


if __name__ == "__main__":
    main()
