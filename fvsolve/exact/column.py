"""Rigid column between given pressures, with or without a valve in series; only quadratic losses.

(L / A) dM/dt = D - K |M| M: mass flow M [kg/s], length L and area A of the column, drive D (difference of
p + rho g z between the ends) and resistance K. Both are constant on each interval between jumps of the opening of the
valve, where M is tanh, coth, tan, a hyperbola or a straight line in time.
"""

from __future__ import annotations

import math

import numpy as np

from fvsolve.exact.schedule_values import constant_from, value
from fvsolve.exact.solution import ExactStart, Solution, count_faults, reservoirs

NODES, LINKS = ("reservoir", "junction"), ("rigid-column", "valve", "orifice")


def find_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one rigid column between constant pressures.

    A valve or orifice in series with the column is allowed.
    """
    name, columns, valves = case.exact.name, *columns_and_valves(case)
    yield from count_faults(case, columns, "rigid-column")
    yield from count_faults(case, valves, "valve") if len(valves) > 1 else ()
    for node, part in case.nodes.items():
        given = part.demand if part.kind == "junction" else part.pressure or part.head
        if not constant_from(given, -math.inf) or (part.kind == "junction" and given.first != 0.0):
            yield ("nodes", node), f'the exact solution "{name}" needs constant pressures and no demand'
    fixed = {node for node, part in case.nodes.items() if part.kind == "reservoir"}
    fixed |= {end for _, part in valves if {part.from_, part.to} & fixed for end in (part.from_, part.to)}
    for link, part in columns:
        for end in {part.from_, part.to} - fixed:
            yield ("links", link), f'the exact solution "{name}" needs a reservoir at {end}, or a valve to a reservoir'
        if {part.from_, part.to}.isdisjoint(node for node, item in case.nodes.items() if item.kind == "reservoir"):
            yield ("links", link), f'the exact solution "{name}" needs a reservoir at one end or both'
        if part.friction.model not in ("none", "steady", "quasi-steady") or part.friction.roughness is not None:
            yield (
                ("links", link, "friction"),
                f'the exact solution "{name}" supports only friction with a Darcy `factor`',
            )
    joined = {end for _, part in columns for end in (part.from_, part.to)}
    for link, part in valves:
        if len(joined & {part.from_, part.to}) != 1:
            yield ("links", link), f'the exact solution "{name}" needs the valve in series with the column'
        if part.opening.kind not in ("constant", "step") or min(part.opening.value) <= 0.0:
            message = f'the exact solution "{name}" needs an opening that is constant or jumps, and is never 0'
            yield ("links", link, "opening"), message
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


def columns_and_valves(case) -> tuple[list, list]:
    """(columns of a case, its valves and orifices): two lists of (name, part)."""
    columns = [item for item in case.links.items() if item[1].kind == "rigid-column"]
    return columns, [item for item in case.links.items() if item[1].kind in ("valve", "orifice")]


def solution(case, start: ExactStart) -> Solution:
    """Flows [m3/s], and the pressure [Pa] between column and valve, as functions of time.

    The case must be one for which `find_faults` yields nothing.
    """
    [(name, column)], valves = columns_and_valves(case)
    rho, t0 = case.properties.density, case.numerics.start
    area = 0.25 * math.pi * column.diameter**2
    potential = {node: law(t0) + rho * case.gravity * case.elevation(node) for node, law in reservoirs(case).items()}
    wall = ((column.friction.factor or 0.0) * column.length / column.diameter + column.minor_loss) / (2 * rho * area**2)
    valve = valves[0][1] if valves else None
    ends = [column.from_, column.to]
    drive = sum(
        sign * potential[reservoir_beyond(case, end, valve)] for sign, end in zip((1.0, -1.0), ends, strict=True)
    )

    def resistance(t):
        if valve is None:
            return 0.0
        return 1.0 / (2.0 * rho * (valve.flow_area() * float(value(valve.opening, t))) ** 2)

    jumps = [] if valve is None else [float(t) for t in valve.opening.time if t > t0]
    pieces, m = [], start.flow[name] * rho
    for begin, end in zip([t0, *jumps], [*jumps, math.inf], strict=True):
        pieces.append((begin, m, wall + resistance(begin), resistance(begin)))
        m = float(flow_after(m, drive, pieces[-1][2], area / column.length, np.array(min(end, 1e300) - begin)))

    def mass_flow(t):
        return _piecewise(pieces, t, lambda s, piece: flow_after(piece[1], drive, piece[2], area / column.length, s))

    def valve_drop(t):  # in the direction of the column
        m = mass_flow(t)
        return _piecewise(pieces, t, lambda s, piece: np.full(s.shape, piece[3])) * m * np.abs(m)

    result = Solution(case, flow={name: lambda t: mass_flow(t) / rho})
    if valve is not None:
        result.flow[valves[0][0]] = lambda t: mass_flow(t) / rho * orientation(column, valve)
        node = valve.from_ if valve.from_ in ends else valve.to
        sign = 1.0 if node == column.to else -1.0
        base = potential[reservoir_beyond(case, node, valve)] - rho * case.gravity * case.elevation(node)
        result.pressure[node] = lambda t: base + sign * valve_drop(t)
    return result


def reservoir_beyond(case, end: str, valve) -> str:
    """Name of the reservoir at the node `end` of the column, or on the far side of the valve at that node."""
    if case.nodes[end].kind == "reservoir":
        return end
    return valve.to if valve.from_ == end else valve.from_


def orientation(column, valve) -> float:
    """Factor 1 if valve and column have the same positive flow direction, else -1."""
    return 1.0 if valve.from_ == column.to or valve.to == column.from_ else -1.0


def _piecewise(pieces, t, law):
    t = np.asarray(t, dtype=float)
    result = np.empty(t.shape)
    index = np.clip(np.searchsorted([piece[0] for piece in pieces], t, side="right") - 1, 0, None)
    for k, piece in enumerate(pieces):
        result[index == k] = law(t[index == k] - piece[0], piece)
    return result


def flow_after(m: float, drive: float, k: float, a: float, t: np.ndarray) -> np.ndarray:
    """Solution M(t) of M' = a (drive - k |M| M) with M(0) = m, at times t."""
    if drive < 0.0 or (drive == 0.0 and m < 0.0):
        return -flow_after(-m, -drive, k, a, t)
    if k == 0.0:
        return m + a * drive * t
    if drive == 0.0:
        return m / (1.0 + a * k * m * t)
    end, rate = math.sqrt(drive / k), a * math.sqrt(drive * k)
    if m < 0.0:  # the flow reverses at a finite time
        turn = math.atan(-m / end) / rate
        back = end * np.tan(rate * (np.minimum(t, turn) - turn))
        return np.where(t < turn, back, end * np.tanh(rate * np.maximum(t - turn, 0.0)))
    if m < end:
        return end * np.tanh(rate * t + math.atanh(m / end))
    return np.full(t.shape, end) if m == end else end / np.tanh(rate * t + math.atanh(end / m))
