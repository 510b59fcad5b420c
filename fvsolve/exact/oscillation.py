"""Open tanks of constant area joined by a frictionless rigid column: a harmonic oscillation.

M' = (A / L) D, D' = -g (1 / A_from + 1 / A_to) M: mass flow M of the column of area A and length L, difference D of
p + rho g z between its ends, areas A_from and A_to of the tanks (infinite for a reservoir).
"""

from __future__ import annotations

import math

import numpy as np

from fvsolve.exact.levelling import initial_pressure
from fvsolve.exact.schedule_values import constant_from
from fvsolve.exact.solution import ExactStart, Solution, count_faults, level_faults

NODES, LINKS = ("reservoir", "tank"), ("rigid-column",)


def find_faults(case):
    """Yield a fault (keys, message) for everything in a case that the solution does not cover from start to end."""
    faults = list(_find_faults(case))
    yield from faults
    if not faults:
        yield from level_faults(
            solution(case, ExactStart({}, {name: link.initial_flow or 0.0 for name, link in case.links.items()}))
        )


def _find_faults(case):
    """Yield a fault (keys, message) for each difference of a case from open tanks and a frictionless column."""
    yield from count_faults(case, list(case.links), "rigid-column")
    name = case.exact.name
    for node, part in case.nodes.items():
        if part.kind == "tank" and hasattr(part.area, "area"):
            yield ("nodes", node, "area"), f'the exact solution "{name}" needs a constant area'
        if getattr(part, "connection", None) is not None:
            yield (
                ("nodes", node, "connection"),
                f'the exact solution "{name}" does not support `connection`. Remove this key',
            )
        if part.kind == "reservoir" and not constant_from(part.pressure or part.head, -math.inf):
            yield ("nodes", node), f'the exact solution "{name}" needs a constant pressure or head'
    if not any(node.kind == "tank" for node in case.nodes.values()):
        yield ("nodes",), f'the exact solution "{name}" needs a tank'
    for link, part in case.links.items():
        if part.friction.model != "none" or part.minor_loss != 0.0:
            text = f'the exact solution "{name}" holds only without friction and losses'
            yield ("links", link, "friction"), f'{text}; expected model = "none", and no `minor_loss` of the column'


def solution(case, start: ExactStart) -> Solution:
    """Levels [m] and pressures [Pa] of both end nodes, and flow [m3/s] of the column, as functions of time.

    The case must be one for which `find_faults` yields nothing.
    """
    name, column = next(iter(case.links.items()))
    rho, g, t0 = case.properties.density, case.gravity, case.numerics.start
    slope = 0.25 * math.pi * column.diameter**2 / column.length
    ends = (column.from_, column.to)
    soft = [1.0 / case.nodes[n].area if case.nodes[n].kind == "tank" else 0.0 for n in ends]
    omega = math.sqrt(slope * g * sum(soft))
    first = [initial_pressure(case, node) for node in ends]
    drop = first[0] - first[1] + rho * g * (case.elevation(ends[0]) - case.elevation(ends[1]))
    m0 = start.flow[name] * rho

    def mass_flow(t):
        s = omega * (np.asarray(t, dtype=float) - t0)
        return m0 * np.cos(s) + slope * drop / omega * np.sin(s)

    def moved(t):  # mass that has left `from`
        s = omega * (np.asarray(t, dtype=float) - t0)
        return (m0 * np.sin(s) + slope * drop / omega * (1.0 - np.cos(s))) / omega

    result = Solution(case, flow={name: lambda t: mass_flow(t) / rho})
    for k, (sign, node) in enumerate(zip((-1.0, 1.0), ends, strict=True)):
        result.pressure[node] = lambda t, k=k, sign=sign: first[k] + sign * g * soft[k] * moved(t)
        if case.nodes[node].kind == "tank":
            result.level[node] = lambda t, k=k, sign=sign, node=node: (
                case.nodes[node].level + sign * soft[k] * moved(t) / rho
            )
    return result
