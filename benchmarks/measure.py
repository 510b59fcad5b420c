"""Options of all scripts, optional peers, and printed runs of solvers at several settings."""

from __future__ import annotations

import argparse
import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter
from types import ModuleType

import numpy as np

# quick.py reads these
QUICK, SKIPPED = "a quick run: its figures are no measurement", "rows skipped"
SLOW = 2.0  # a longer run is not repeated, and no finer run follows [s]


class Quick(argparse.Action):
    """Action of `--quick`, which prints that figures are not measurements."""

    def __call__(self, parser, namespace, values, option=None) -> None:
        namespace.quick = True
        print(QUICK, flush=True)


def parser(about: str) -> argparse.ArgumentParser:
    """Parser of a script with the docstring `about`; it has the option `--quick`."""
    made = argparse.ArgumentParser(description=about.splitlines()[0])
    made.add_argument(
        "--quick",
        action=Quick,
        nargs=0,
        default=False,
        help="small sizes and few repeats: 5 s if compiled",
    )
    return made


def peer_module(name: str, wheel: str) -> ModuleType | None:
    """Module of a peer; None, with a printed line, if its wheel is not installed or fails to import."""
    try:
        return import_module(name)
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == name.partition(".")[0]
        how = (
            "is not installed"
            if missing
            else f"does not import ({str(error).partition(chr(10))[0]})"
        )
        print(f"{wheel} {how}: {SKIPPED}", flush=True)
        return None


def agree(what: str, difference: float, most: float) -> None:
    """Exit with a message unless a difference is `most` or less."""
    if not difference <= most:
        raise SystemExit(f"{what}: {difference:.3g}, expected at most {most:g}")


@dataclass(frozen=True)
class Solver:
    """Solver: `solve(setting)` returns a solution, `count(setting)` returns (steps, calls of f), nan if unknown.

    setting : tolerance, or another number in the column `setting` of the table
    """

    name: str
    solve: Callable[[float], np.ndarray]
    count: Callable[[float], tuple[float, float]] = lambda setting: (np.nan, np.nan)


@dataclass(frozen=True)
class Run:
    """Run of one solver at one setting: error, wall time [s], steps and calls of f."""

    setting: float
    error: float
    wall: float
    steps: float
    calls: float


def best(function: Callable[[], object], budget: float, most: int = 300) -> float:
    """Wall time [s] of the fastest call, of as many as fit into a budget [s]."""
    walls, began = [], perf_counter()
    while not walls or (len(walls) < most and perf_counter() - began < budget):
        start = perf_counter()
        function()
        walls.append(perf_counter() - start)
    return min(walls)


def chart(
    solvers, settings, distance: Callable, budget: float, rounds: int = 3, enough: float = 0.0
) -> dict:
    """Run all solvers at their settings, print the runs, and return them by name of the solver.

    settings : sequence for all solvers, or a dict by name; distance : error of a solution
    A series of a solver ends when its error falls below `enough` or a run takes longer than SLOW. Wall times are the
    best of several rounds over all solvers, so that a disturbance of the machine affects all of them. An exception of
    a solver is printed, and the other solvers continue.
    """
    found = {solver.name: {} for solver in solvers}
    for solver in solvers:
        for setting in settings[solver.name] if isinstance(settings, dict) else settings:
            found[solver.name][setting] = run = first(solver, setting, distance)
            if isinstance(run, Run) and (run.error < enough or run.wall > SLOW):
                break
    for _ in range(rounds):
        for solver in solvers:
            for setting, run in found[solver.name].items():
                if isinstance(run, Run) and run.wall < SLOW:
                    wall = best(lambda: solver.solve(setting), budget / rounds)  # noqa: B023
                    found[solver.name][setting] = replace(run, wall=min(run.wall, wall))
    for name, runs in found.items():
        table(name, runs)
    return {name: [r for r in runs.values() if isinstance(r, Run)] for name, runs in found.items()}


def first(solver: Solver, setting, distance: Callable) -> Run | str:
    """Run of a solver, timed once, or the text of its failure."""
    try:
        error = distance(solver.solve(setting))
        counts = solver.count(setting)
        wall = best(lambda: solver.solve(setting), 0.0)
    except Exception as fault:  # noqa: BLE001  a peer may raise anything
        return f"{type(fault).__name__}: {fault}"
    return Run(setting, error, wall, *counts) if np.isfinite(error) else "did not reach the end"


def table(name: str, runs: dict[float, Run | str]) -> None:
    """Print the runs of one solver."""
    print(
        f"  {name}\n    {'setting':>9} {'error':>9} {'wall ms':>9} {'steps':>7} {'calls of f':>10}"
    )
    for setting, r in runs.items():
        label = f"{setting:9.0e}" if setting < 0.1 else f"{setting:9.2f}"
        told = (
            r
            if isinstance(r, str)
            else f"{r.error:9.1e} {r.wall * 1e3:9.3f} {r.steps:7.0f} {r.calls:10.0f}"
        )
        print(f"    {label} {told}", flush=True)


def against(goal: float, factor: float) -> str:
    """Goal as text, with the result: achieved, or the factor by which it is missed."""
    return f"goal {goal:.3g}: {'met' if factor >= goal else f'missed by {goal / factor:.2f} times'}"


def machine(*packages: str) -> str:
    """Processor and versions of packages, in one line."""
    with open("/proc/cpuinfo") as lines:
        names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    versions = ", ".join(f"{p} {installed(p)}" for p in packages)
    return f"{names[0] if names else platform.processor()}; Python {platform.python_version()}, {versions}"


def installed(package: str) -> str:
    """Version of a package, or a text if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
