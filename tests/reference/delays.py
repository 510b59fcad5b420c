"""Cases with delay lines, and solutions by characteristics at Courant number 1."""

import numpy as np

from reference.scenes import RHO, scene

SPEED, BORE, LENGTH, FLOW = 1200.0, 0.3, 900.0, 0.03
AREA = np.pi / 4 * BORE**2
JUMP = RHO * SPEED * FLOW / AREA  # Joukowsky jump [Pa]
TRAVEL = LENGTH / SPEED  # 0.75 [s]
STEPS = {"step": 0.04}


def pipe(one: str, other: str, length: float = LENGTH, **keys) -> dict:
    """Pipe, by default frictionless."""
    return {
        "type": "pipe",
        "from": one,
        "to": other,
        "length": length,
        "diameter": BORE,
        "wave_speed": SPEED,
        "friction": {"model": "none"},
        "cells": 8,
        **keys,
    }


STOP = {"time": [0.0, 0.5], "value": [FLOW, 0.0], "kind": "step"}


def main(
    end: float = 8.0,
    numerics: dict | None = None,
    demand=STOP,
    every: float = 0.05,
    probes=(),
    **keys,
) -> dict:
    """Case of a lake, a pipe and a demand that stops."""
    nodes = {
        "lake": {"type": "reservoir", "pressure": 6e6},
        "gate": {"type": "junction", "demand": demand},
    }
    probes = ["gate.pressure", "main.flow@0", "main.pressure@0.5", "main.pressure@0.3", *probes]
    numerics = {
        "method": "euler",
        "pipe_model": "delay-line",
        **(STEPS if numerics is None else numerics),
    }
    return scene(nodes, {"main": pipe("lake", "gate", **keys)}, end, numerics, probes, every)


def fork(numerics: dict, end: float = 6.0, every: float = 0.05, **keys) -> dict:
    """Case of three pipes with travel times of 0.5, 0.3 and 0.2 s, a lake, a dead end and a demand that stops."""
    nodes = {
        "lake": {"type": "reservoir", "pressure": 6e6},
        "fork": {"type": "junction"},
        "dead": {"type": "junction"},
        "gate": {"type": "junction", "demand": STOP},
    }
    links = {
        "up": pipe("lake", "fork", 600.0, cells=5, **keys),
        "down": pipe("fork", "gate", 360.0, cells=3, **keys),
        "side": pipe(
            "fork",
            "dead",
            240.0,
            cells=2,
            diameter=0.2,
            **{k: v for k, v in keys.items() if k != "diameter"},
        ),
    }
    probes = ["gate.pressure", "fork.pressure", "dead.pressure", "up.flow@0", "down.pressure@0.5"]
    return scene(nodes, links, end, numerics, probes, every)


def turned(case: dict) -> dict:
    """Copy of a case with `from` and `to` of every pipe exchanged."""
    ends = {"from": "to", "to": "from"}
    links = {
        name: {ends.get(key, key): value for key, value in link.items()}
        if link["type"] == "pipe"
        else link
        for name, link in case["links"].items()
    }
    return {**case, "links": links}


def square(t, first: float, period: float) -> np.ndarray:
    """Square wave that alternates between 1 and -1 from `first` on, with half a period each; 0 before `first`."""
    return np.where(
        t < first, 0.0, np.where(np.floor((t - first) / (0.5 * period) + 1e-9) % 2 == 0, 1.0, -1.0)
    )


def between_jumps(t, first: float, spacing: float) -> np.ndarray:
    """True at times that differ from all times of jumps, first + k spacing."""
    share = (t - first) / spacing
    return np.abs(share - np.round(share)) > 1e-6
