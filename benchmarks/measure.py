"""Runs of a solver at several settings: error, wall time, counts, printed. Knows no problem and no solver."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from time import perf_counter

import numpy as np


@dataclass(frozen=True)
class Solver:
    """`solve(setting)` gives a solution; `count(setting)` gives (steps, calls of f), nan where it is not told.

    setting : a tolerance or what the table calls it
    """

    name: str
    solve: Callable[[float], np.ndarray]
    count: Callable[[float], tuple[float, float]] = lambda setting: (np.nan, np.nan)


@dataclass(frozen=True)
class Run:
    """One solver at one setting: error, wall time [s], steps and calls of f."""

    setting: float
    error: float
    wall: float
    steps: float
    calls: float


def best(function: Callable[[], object], budget: float, least: int = 3, most: int = 300) -> float:
    """Wall time [s] of the quickest call, of as many as fit into a budget [s]."""
    walls, began = [], perf_counter()
    while len(walls) < least or (len(walls) < most and perf_counter() - began < budget):
        start = perf_counter()
        function()
        walls.append(perf_counter() - start)
    return min(walls)


def measured(solver: Solver, settings, distance: Callable[[np.ndarray], float], budget: float) -> list[Run]:
    """Runs of a solver, printed as they are made; `distance` is the error of a solution. A failure is a line."""
    print(f"  {solver.name}\n    {'setting':>9} {'error':>9} {'wall ms':>9} {'steps':>7} {'calls of f':>10}")
    runs = []
    for setting in settings:
        try:
            error = distance(solver.solve(setting))
        except Exception as fault:  # noqa: BLE001  whatever a peer raises, the others go on
            print(f"    {setting:9.0e} {type(fault).__name__}: {fault}")
            continue
        if np.isfinite(error):
            wall = best(lambda: solver.solve(setting), budget)  # noqa: B023
            runs.append(Run(setting, error, wall, *solver.count(setting)))
            r = runs[-1]
            setting = f"{r.setting:9.0e}" if r.setting < 0.1 else f"{r.setting:9.2f}"
            print(f"    {setting} {r.error:9.1e} {r.wall * 1e3:9.3f} {r.steps:7.0f} {r.calls:10.0f}", flush=True)
        else:
            print(f"    {setting:9.0e} did not reach the end")
    return runs


def against(goal: float, factor: float) -> str:
    """A goal, and whether it is met."""
    return f"goal {goal:.3g}: {'met' if factor >= goal else f'missed by {goal / factor:.2f} times'}"


def machine(*packages: str) -> str:
    """Processor and versions, in a line."""
    with open("/proc/cpuinfo") as lines:
        names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    versions = ", ".join(f"{p} {version(p)}" for p in packages)
    return f"{names[0] if names else platform.processor()}; Python {platform.python_version()}, {versions}"
