"""Two vessels joined by an orifice with the turbulent law: the pressure drop is a parabola in time.

The flow is q = Cd A sqrt(2 d / rho): pressure drop d, discharge coefficient Cd, area A of the orifice, density rho. It
reduces the drop, d' = -k q, with the pressure per volume k [Pa/m3] of both vessels. So sqrt(d) is linear in time and
reaches zero at the time 2 sqrt(d0) / s, s = k Cd A sqrt(2 / rho), d0 the drop at the start (Torricelli 1644). A laminar
transition near zero is left out.
"""

from __future__ import annotations

import numpy as np

from fvsolve.exact.schedule_values import constant_from, value
from fvsolve.exact.solution import ExactStart, Solution, count_faults, level_faults, reservoirs

NODES, LINKS = ("reservoir", "tank", "chamber"), ("valve", "orifice")


def find_faults(case):
    """Yield a fault (keys, message) for everything in a case that the solution does not cover from start to end."""
    faults = list(_find_faults(case))
    yield from faults
    if not faults:
        yield from level_faults(solution(case, ExactStart({}, {})))


def _find_faults(case):
    """Yield a fault (keys, message) for each difference of a case from two vessels joined by an orifice or valve."""
    yield from count_faults(case, list(case.links), "orifice or valve")
    name, start = case.exact.name, case.numerics.start
    for node, part in case.nodes.items():
        if part.kind == "tank" and hasattr(part.area, "area"):
            yield ("nodes", node, "area"), f'the exact solution "{name}" needs a constant area'
        if getattr(part, "connection", None) is not None:
            yield (
                ("nodes", node, "connection"),
                f'the exact solution "{name}" does not support `connection`. Remove this key',
            )
        if part.kind == "chamber" and part.initial_pressure is None:
            yield ("nodes", node), f'the exact solution "{name}" needs the key `initial_pressure`'
        if part.kind == "reservoir" and not constant_from(part.pressure or part.head, start):
            yield ("nodes", node), f'the exact solution "{name}" needs a constant pressure or head'
    for link, part in case.links.items():
        if not constant_from(part.opening, start):
            yield ("links", link, "opening"), f'the exact solution "{name}" needs a constant opening'
        if part.characteristic != "linear":
            yield (
                ("links", link, "characteristic"),
                f'the exact solution "{name}" supports only characteristic = "linear"',
            )
        if part.laminar_reynolds is not None:
            yield (
                ("links", link, "laminar_reynolds"),
                f'the exact solution "{name}" supports no laminar flow. Remove this key',
            )


def solution(case, start: ExactStart) -> Solution:
    """Pressures [Pa] and levels [m] of the vessels, and flow [m3/s] of the orifice, as functions of time.

    The case must be one for which `find_faults` yields nothing.
    """
    (link, part), rho, t0 = next(iter(case.links.items())), case.properties.density, case.numerics.start
    ends, weight = (part.from_, part.to), rho * case.gravity
    area = part.flow_area() * float(value(part.opening, t0))
    pressures = [initial_pressure(case, node) for node in ends]
    softness = [pressure_per_volume(case, node) for node in ends]  # pressure per volume of inflow
    drop = sum(s * (p + weight * case.elevation(n)) for s, p, n in zip((1, -1), pressures, ends, strict=True))
    slope = sum(softness) * area * np.sqrt(2.0 / rho)

    def left(t):
        return np.maximum(np.sqrt(abs(drop)) - 0.5 * slope * (np.asarray(t, dtype=float) - t0), 0.0)

    def flow(t):
        return np.sign(drop) * area * np.sqrt(2.0 / rho) * left(t)

    def moved(t):  # volume that has left `from`
        return np.sign(drop) * (abs(drop) - left(t) ** 2) / sum(softness) if sum(softness) else 0.0 * left(t)

    result = Solution(case, flow={link: flow})
    for k, (sign, node) in enumerate(zip((-1.0, 1.0), ends, strict=True)):
        result.pressure[node] = lambda t, k=k, sign=sign: pressures[k] + sign * softness[k] * moved(t)
        if case.nodes[node].kind == "tank":
            tank = case.nodes[node]
            result.level[node] = lambda t, tank=tank, sign=sign: tank.level + sign * moved(t) / tank.area
    return result


def initial_pressure(case, node: str) -> float:
    """Pressure of a node at the start, as stated in the case file [Pa]."""
    part = case.nodes[node]
    if part.kind == "tank":
        return case.ambient_pressure + case.properties.density * case.gravity * part.level
    if part.kind == "chamber":
        return part.initial_pressure
    return float(reservoirs(case)[node](np.float64(case.numerics.start)))


def pressure_per_volume(case, node: str) -> float:
    """Pressure rise of a tank or chamber per volume of inflow [Pa/m3]; 0 for a reservoir."""
    part = case.nodes[node]
    if part.kind == "tank":
        return case.properties.density * case.gravity / part.area
    return case.properties.bulk_modulus / part.volume if part.kind == "chamber" else 0.0
