"""Random mains of two or three pipes with a valve at their end, and limits near their peaks."""

from __future__ import annotations

from typing import Any

import numpy as np

from fvsolve.core.schemes import SCHEMES

FLUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": "2.2 GPa",
    "viscosity": "1 mPa s",
    "vapor_pressure": "2.3 kPa",
    "law": "linear",
}
MIDDLES = ("junction", "junction", "accumulator", "tank", "dead end", "check valve", "branch")
PROBES = ("end.pressure", "j.pressure", "a.flow", "b.pressure@0.37")
VACUUM = 2300.0  # pressure below which no limit is set [Pa]
START = 0.2  # start of the movement of the valve [s]
COURANT = {"linear-upwind": 0.6}  # schemes with a Courant limit below the default
SCHEME_NAMES = tuple(SCHEMES)


def random_main(seed: int) -> dict[str, Any]:
    """Case of a lake, pipe `a`, a random node `j`, pipe `b` and a valve at the end that moves within 2 ms to 2 s."""
    rng = np.random.default_rng(seed)
    nodes = {
        "lake": {"type": "reservoir", "head": rng.uniform(60.0, 160.0)},
        "end": {"type": "junction"},
        "out": {"type": "reservoir", "pressure": 101325.0},
    }
    links = {"a": pipe(rng, "lake", "j"), "b": pipe(rng, "j", "end"), "v": closing_valve(rng)}
    add_middle(str(rng.choice(MIDDLES)), rng, nodes, links)
    period = sum(
        one["length"] / one["wave_speed"] for name, one in links.items() if name in ("a", "b")
    )
    end = START + rng.uniform(2.0, 6.0) * period
    scheme = SCHEME_NAMES[seed % len(SCHEME_NAMES)]
    numerics = {"scheme": scheme, "end": end, "courant": COURANT.get(scheme, 0.9)}
    return {
        "schema": 1,
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": 0.02, "fields": 0, "probes": list(PROBES)},
    }


def pipe(rng: np.random.Generator, start: str, end: str) -> dict[str, Any]:
    """Random pipe of 16 to 100 cells and 100 to 1000 m."""
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": rng.uniform(100.0, 1000.0),
        "diameter": float(rng.choice([0.1, 0.15, 0.2, 0.3, 0.4])),
        "wave_speed": rng.uniform(900.0, 1300.0),
        "friction": {"model": "quasi-steady", "factor": rng.uniform(0.01, 0.03)},
        "cells": int(rng.integers(16, 101)),
    }


def closing_valve(rng: np.random.Generator) -> dict[str, Any]:
    """Random valve from `end` that closes in part or in full, opens, or closes and opens again."""
    duration = float(10.0 ** rng.uniform(-2.7, 0.3))
    ways = ([1.0, 0.0], [1.0, rng.uniform(0.0, 0.6)], [rng.uniform(0.2, 0.6), 1.0])
    opening: dict[str, Any] = {
        "start": START,
        "duration": duration,
        "value": ways[rng.choice(3, p=[0.4, 0.4, 0.2])],
    }
    if rng.random() < 0.2:
        opening = {
            "time": [START, START + duration, START + 3.0 * duration],
            "value": [1.0, 0.1, 0.8],
            "kind": "linear",
        }
    return {
        "type": "valve",
        "from": "end",
        "to": "out",
        "area": 0.004 * rng.uniform(0.3, 1.5),
        "opening": opening,
    }


def add_middle(kind: str, rng: np.random.Generator, nodes: dict, links: dict) -> None:
    """Add the parts between the pipes, with the node `j`."""
    nodes["j"] = {"type": "junction"}
    if kind == "accumulator":
        volume = rng.uniform(0.05, 0.5)
        connection = {"diameter": 0.1, "loss_in": 2.0, "loss_out": 2.0}
        nodes["j"] = {
            "type": kind,
            "volume": volume,
            "gas_volume": 0.1 * volume,
            "connection": connection,
        }
    elif kind == "tank":
        nodes["j"] = {
            "type": kind,
            "area": rng.uniform(0.05, 0.5),
            "level": nodes["lake"]["head"] - 2.0,
        }
    elif kind in ("dead end", "branch"):
        nodes["far"] = {"type": "junction"} if kind == "dead end" else dict(nodes["lake"])
        links["c"] = pipe(rng, "j", "far")
    elif kind == "check valve":
        nodes["before"] = {"type": "junction"}
        links["a"]["to"] = "before"
        links["check"] = {
            "type": "check-valve",
            "from": "before",
            "to": "j",
            "diameter": 0.2,
            "loss_coefficient": 2.0,
        }


def limits_near(peaks: dict[str, tuple[float, float]], seed: int) -> dict[str, Any]:
    """Upper and lower limit on the pressure of each part, at 0.9 to 1.1 of its peaks [Pa]."""
    rng, made = np.random.default_rng([seed, 1]), {}
    for part, (least, greatest) in peaks.items():
        for bound, value in (("minimum", least), ("maximum", greatest)):
            limit = value * rng.uniform(0.9, 1.1)
            if limit > VACUUM:
                made[f"{part}-{bound}"] = {"on": part, "quantity": "pressure", bound: limit}
    return made
