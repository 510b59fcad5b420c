"""Suter tables joined to head curves of pumps."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.suter_tables import Quadrants, quadrants

ROUNDING = 1e-9  # angle regarded as zero [rad]


def joined_numbers(part, flow: float, head: float, numbers: list[float]) -> list[float]:
    """Parameters of the Suter table joined to a head curve, in the order of `law_curve`; empty without such a table.

    flow, head : rated point [m3/s], [m]; numbers : parameters of the head curve
    """
    if (table := joined_table(part, flow, head)) is None:
        return []
    edge = math.atan2(numbers[curves.LAST], flow)
    own = np.array(numbers, dtype=float)
    shut_off, last = (curves.curve_head(own, 0, 1.0, q)[0] / head for q in (0.0, own[curves.LAST]))
    correction, values = fit_to_curve(table.head, shut_off, last, edge)
    return [head, flow, len(values), edge, correction, *monotone_head(values)]


def fit_to_curve(values, shut_off: float, last: float, edge: float) -> tuple[float, np.ndarray]:
    """(correction of a Suter table at the last flow of a curve, values of the table corrected at no flow).

    values : values of WH or WB; edge : angle atan2(v, n) of the last flow [rad]
    shut_off, last : head or power of the curve at no flow and at the last flow, over the rated value
    The correction at no flow fades to zero at standstill.
    """
    values = np.array(values)
    at = np.linspace(-math.pi, math.pi, len(values))
    correction = last * math.cos(edge) ** 2 - float(np.interp(edge, at, values))
    reverse = (-0.5 * math.pi <= at) & (at < ROUNDING)
    return correction, values + reverse * (shut_off - np.interp(0.0, at, values)) * (1.0 + at / (0.5 * math.pi))


def monotone_head(values: np.ndarray) -> np.ndarray:
    """Values of WH, raised so that the head never falls as the flow through a turning pump becomes more negative.

    Otherwise two flows would have the same head. The condition on W = WH between two values is that the derivative of
    W / cos^2(angle) by the angle atan2(v, n) is negative, with relative flow v and relative speed n.
    """
    values, at = values.copy(), np.linspace(-math.pi, math.pi, len(values))
    width = at[1] - at[0]
    for k in range(len(values) - 2, 0, -1):
        if -0.5 * math.pi < at[k] < -ROUNDING:
            tilt = 2.0 * width * math.tan(max(0.0, -at[k + 1])) - 0.5 * width**2
            values[k] = max(values[k], values[k + 1] * (1.0 - tilt))
    return values


def joined_table(part, flow: float, head: float) -> Quadrants | None:
    """Suter table for the specific speed of a pump; None if no table is joined to its head curve.

    flow, head : rated point [m3/s], [m]
    """
    if part.curve is None or part.rated_speed is None or part.curve_extrapolation == "parabola":
        return None
    return quadrants(specific_speed(part, flow, head))


def specific_speed(part, flow: float, head: float) -> float:
    """Specific speed of a pump at its rated point [rpm (m3/s)^(1/2) / m^(3/4)]; flow : [m3/s], head : [m]"""
    return part.rated_speed * 30.0 / math.pi * math.sqrt(flow) / head**0.75
