"""Exact solutions that a case may name under `[exact]`. Knows closed forms; knows no grid and no model."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from fvsolve.exact.solution import ExactStart, Solution, kinds_only, law_holds

__all__ = ["NAMES", "Solution", "Start", "misfits", "solution"]

NAMES = {  # name in the case file -> (module of this room, what it solves)
    "rays": ("rays", "waves in frictionless pipes between reservoirs, junctions and valves, by ray tracing"),
    "laminar-line": ("laminar_line", "a laminar pipe from a reservoir to a demand, its velocity profile and all"),
    "creeping-line": (
        "creeping_line",
        "a pipe whose wall creeps, from a reservoir to a demand, frictionless or laminar",
    ),
    "levelling": ("levelling", "a tank or chamber on an orifice to a reservoir, or two on one: a parabola in time"),
    "column": ("column", "one rigid column between given pressures: tanh in time"),
    "oscillation": ("oscillation", "two open tanks, or a tank and a reservoir, joined by a frictionless rigid column"),
    "spring-mass": ("spring_mass", "one mass on linear springs and dampers under constant force"),
}


def misfits(case) -> Iterator[tuple[tuple, str]]:
    """(keys, message) of everything in a case that its named exact solution does not hold for.

    What a solution says of parts it knows is asked only where there are no others.
    """
    room = _module(case.exact.name)
    yield from law_holds(case)
    yield from list(kinds_only(case, room.NODES, room.LINKS)) or room.misfits(case)


def solution(case, start: ExactStart) -> Solution:
    """The exact solution that a case names, from the flows and pressures it starts with."""
    return _module(case.exact.name).solution(case, start)


def _module(name: str):
    return import_module(f"{__name__}.{NAMES[name][0]}")
