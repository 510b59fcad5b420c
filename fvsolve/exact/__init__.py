"""Exact solutions, which a case file names under `[exact]`."""

from collections.abc import Iterator
from importlib import import_module

from fvsolve.exact.solution import Exact, ExactStart, Solution, law_faults, type_faults

__all__ = ["NAMES", "Solution", "ExactStart", "find_faults", "solution"]

NAMES = {  # name in the case file -> (module of this package, description)
    "rays": ("rays", "waves in frictionless pipes between reservoirs, junctions and valves, by ray tracing"),
    "laminar-line": ("laminar_line", "a laminar pipe from a reservoir to a demand, with its velocity profile"),
    "creeping-line": (
        "laminar_line",
        "a pipe with wall creep from a reservoir to a demand, frictionless or laminar",
    ),
    "levelling": (
        "lumped",
        "a tank or chamber joined by an orifice to a reservoir, or to another tank or chamber: a parabola in time",
    ),
    "column": ("lumped", "one rigid column between given pressures: tanh in time"),
    "oscillation": ("lumped", "two open tanks, or a tank and a reservoir, joined by a frictionless rigid column"),
    "spring-mass": ("lumped", "one mass on linear springs and dampers under constant force"),
}


def find_faults(case) -> Iterator[tuple[tuple, str]]:
    """Yield a fault (keys, message) for everything in a case that its exact solution does not cover.

    keys : key path as a tuple. Parts of types that the solution does not support are reported first; the keys of parts
    are checked only if there are no such parts.
    """
    exact = _exact(case.exact.name)
    if case.controls:
        yield ("controls",), "exact solutions have no controls; remove [controls], or [exact]"
    yield from law_faults(case)
    yield from list(type_faults(case, exact.nodes, exact.links)) or exact.find_faults(case)


def solution(case, start: ExactStart) -> Solution:
    """Exact solution that a case names under `[exact]`, from the flows and pressures at the start."""
    return _exact(case.exact.name).solution(case, start)


def _exact(name: str) -> Exact:
    return getattr(import_module(f"{__name__}.{NAMES[name][0]}"), name.replace("-", "_").upper())
