"""Faults of the points of a hill chart, opening by opening."""

from __future__ import annotations

import math
from itertools import pairwise

LEAST = 1e-3  # least valid unit speed, unit flow and opening
ANGLE_TOLERANCE = 1e-6  # angle between points regarded as zero [rad]
SPEED, FLOW, EFFICIENCY, TORQUE = "unit_speed", "unit_flow", "efficiency", "unit_torque"


def faults_of_shut(curve) -> list[tuple[str, str]]:
    """Faults (key, text) of the curve of opening 0, at which the vanes are shut; the key is "" for the whole curve."""
    if not len(curve.speed) == len(curve.flow) == len(curve.value) == 1 or curve.quantity != TORQUE:
        return [("", f"vanes at opening 0 are shut; expected no curve, or a single point with a {TORQUE}")]
    faults = [(FLOW, f"{curve.flow[0]:g} is a flow through shut vanes; expected 0")] * (curve.flow[0] != 0.0)
    if not curve.speed[0] >= LEAST:
        faults.append((SPEED, f"{curve.speed[0]:g} is out of range; expected a value of at least {LEAST:g}"))
    if curve.value[0] > 0.0:
        faults.append((TORQUE, f"{curve.value[0]:g} drives the runner behind shut vanes; expected 0 or less"))
    return faults


def faults_of_curve(curve) -> list[tuple[str, str]]:
    """Faults (key, text) of the curve of an opening above 0; the key is "" for the whole curve."""
    if not len(curve.speed) == len(curve.flow) == len(curve.value):
        counts = f"{len(curve.speed)} of {SPEED}, {len(curve.flow)} of {FLOW}, {len(curve.value)} of {curve.quantity}"
        return [("", f"{counts}; expected equal numbers")]
    if len(curve.speed) < 2:
        return [("", "has one point; expected at least two")]
    points, faults = list(zip(curve.speed, curve.flow, strict=True)), []
    if curve.opening < LEAST:
        faults.append(("opening", f"{curve.opening:g} is almost shut; expected at least {LEAST:g}, or 0"))
    if curve.quantity == EFFICIENCY and not all(n > 0.0 and q > 0.0 for n, q in points):
        k = next(k for k, (n, q) in enumerate(points) if not (n > 0.0 and q > 0.0))
        faults.append(
            (
                EFFICIENCY,
                f"gives no torque at point {k + 1}, {point_text(points[k])}; expected {TORQUE} instead for the whole "
                "curve",
            )
        )
    if not any(q >= LEAST for _, q in points):
        faults.append(
            (FLOW, f"has no value of {LEAST:g} or more; expected at least one, a flow that drives the turbine")
        )
    if (dead := next((p for p in points if p[0] == 0.0 and p[1] <= 0.0), None)) is not None:
        faults.append(
            (
                "",
                f"{point_text(dead)} is not a valid point: through a runner at rest a positive head drives a positive "
                "flow; expected a flow above 0 at unit speed 0",
            )
        )
    return faults or angle_faults(points)


def angle_faults(points: list[tuple[float, float]]) -> list[tuple[str, str]]:
    """Fault (key, text), in a list, if the angle of the points about the origin does not always rise or always fall.

    There is also a fault if they cross reverse flow at rest, or if the end with the least angle has no forward speed.
    points : (unit speed, unit flow) of each point
    """
    way = 0.0
    for k, ((n, q), (m, r)) in enumerate(pairwise(points)):
        across = n * r - q * m
        if abs(across) <= ANGLE_TOLERANCE * math.hypot(n, q) * math.hypot(m, r):
            return [
                (
                    "",
                    f"points {k + 1} and {k + 2}, {point_text((n, q))} and {point_text((m, r))}, are in line with the "
                    f"origin; expected different angles, atan2({FLOW}, {SPEED})",
                )
            ]
        if across * way < 0.0:
            rule = (
                f"its angle, atan2({FLOW}, {SPEED}), must rise or fall throughout: list the points in their order "
                "along the curve"
            )
            return [("", f"turns back at point {k + 1}, {point_text((n, q))}; a curve may fold in {SPEED}, but {rule}")]
        way = across
        if (n > 0.0) != (m > 0.0) and (q * abs(m) + r * abs(n)) <= 0.0:
            return [
                (
                    "",
                    f"passes from {point_text((n, q))} to {point_text((m, r))} across reverse flow through a runner at "
                    f"rest, through which a positive head drives a positive flow; expected {FLOW} above 0 at {SPEED} 0",
                )
            ]
    if not (points[0] if way > 0.0 else points[-1])[0] >= LEAST:
        end = f"the end of the curve with the least angle, atan2({FLOW}, {SPEED})"
        return [(SPEED, f"is below {LEAST:g} at {end}; expected a forward speed, at which a turbine drives")]
    return []


def point_text(point: tuple[float, float]) -> str:
    """Text of a point (unit speed, unit flow), such as "(60, 0.5)"."""
    return f"({point[0]:g}, {point[1]:g})"
