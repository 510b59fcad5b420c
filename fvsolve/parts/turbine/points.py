"""What is wrong with the points of a hill chart. Knows the curve of one opening at a time; reads no file."""

from __future__ import annotations

import math
from itertools import pairwise

LEAST = 1e-3  # unit speed, unit flow and opening that count
NEAR = 1e-6  # an angle between points that is none
SPEED, FLOW, EFFICIENCY, TORQUE = "unit_speed", "unit_flow", "efficiency", "unit_torque"


def faults_of_still(one) -> list[tuple[str, str]]:
    """Faults of what is said of shut vanes."""
    if not len(one.speed) == len(one.flow) == len(one.value) == 1 or one.word != TORQUE:
        return [("", f"vanes at opening 0 let nothing pass; wanted no curve, or one point with a {TORQUE}")]
    faults = [(FLOW, f"{one.flow[0]:g} flows through shut vanes; wanted 0")] * (one.flow[0] != 0.0)
    if not one.speed[0] >= LEAST:
        faults.append((SPEED, f"{one.speed[0]:g} is out of range; wanted a value of at least {LEAST:g}"))
    if one.value[0] > 0.0:
        faults.append((TORQUE, f"{one.value[0]:g} drives the runner behind shut vanes; wanted 0 or one below it"))
    return faults


def faults_of_curve(one) -> list[tuple[str, str]]:
    """Faults of the points of an opening above 0."""
    if not len(one.speed) == len(one.flow) == len(one.value):
        counts = f"{len(one.speed)} of {SPEED}, {len(one.flow)} of {FLOW}, {len(one.value)} of {one.word}"
        return [("", f"{counts}; wanted as many of each")]
    if len(one.speed) < 2:
        return [("", "has one point; wanted two at least")]
    points, faults = list(zip(one.speed, one.flow, strict=True)), []
    if one.opening < LEAST:
        faults.append(("opening", f"{one.opening:g} is all but shut; wanted one of at least {LEAST:g}, or 0"))
    if one.word == EFFICIENCY and not all(n > 0.0 and q > 0.0 for n, q in points):
        k = next(k for k, (n, q) in enumerate(points) if not (n > 0.0 and q > 0.0))
        faults.append((EFFICIENCY, f"says no torque at point {k + 1}, {at(points[k])}; wanted {TORQUE} of such points"))
    if not any(q >= LEAST for _, q in points):
        faults.append((FLOW, f"is nowhere {LEAST:g} or more; flow that drives the turbine is positive"))
    if (dead := next((p for p in points if p[0] == 0.0 and p[1] <= 0.0), None)) is not None:
        faults.append(("", f"{at(dead)} is no point of a curve: flow is not driven back through a standing runner"))
    return faults or turns(points)


def turns(points: list[tuple[float, float]]) -> list[tuple[str, str]]:
    """The fault of points that do not go one way round the origin, or across flow backwards at rest."""
    way = 0.0
    for k, ((n, q), (m, r)) in enumerate(pairwise(points)):
        across = n * r - q * m
        if abs(across) <= NEAR * math.hypot(n, q) * math.hypot(m, r):
            return [("", f"points {k + 1} and {k + 2}, {at((n, q))} and {at((m, r))}, are at one angle, atan2({FLOW}, "
                         f"{SPEED}), where a curve has one point; or a curve has no head there")]  # fmt: skip
        if across * way < 0.0:
            said = f"its angle, atan2({FLOW}, {SPEED}), must rise or fall throughout: give the points in their order"
            return [("", f"turns back at point {k + 1}, {at((n, q))}; a curve may fold in {SPEED}, but {said}")]
        way = across
        if (n > 0.0) != (m > 0.0) and (q * abs(m) + r * abs(n)) <= 0.0:
            return [("", f"passes from {at((n, q))} to {at((m, r))} across a standing runner that flow is driven back "
                         "through; no head that drives it is there")]  # fmt: skip
    if not (points[0] if way > 0.0 else points[-1])[0] >= LEAST:
        return [(SPEED, f"is nowhere {LEAST:g} or more where its angle is least; a turbine turns forward as it drives")]
    return []


def at(point: tuple[float, float]) -> str:
    """A point in words."""
    return f"({point[0]:g}, {point[1]:g})"
