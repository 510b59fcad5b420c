"""Suter tables joined to head curves of pumps."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.suter_tables import Quadrants, quadrants

ROUNDING = 1e-9  # angle regarded as zero [rad]


def joined_numbers(part, flow: float, head: float, numbers: list[float]) -> list[float]:
    """Numbers of the Suter table joined to a head curve, in the order of `law_curve`; empty without a table.

    flow, head : rated point [m3/s], [m]; numbers : those of the head curve
    """
    if (table := joined_table(part, flow, head)) is None:
        return []
    edge = math.atan2(numbers[curves.LAST], flow)
    own = np.array(numbers, dtype=float)
    shut_off, last = (curves.curve_head(own, 0, 1.0, q)[0] / head for q in (0.0, own[curves.LAST]))
    correction, values = fit_to_curve(table.head, shut_off, last, edge)
    return [head, flow, len(values), edge, correction, *monotone_head(values)]


def fit_to_curve(values, shut_off: float, last: float, edge: float) -> tuple[float, np.ndarray]:
    """Fit a Suter table to a curve: correction at the last flow, and values of the table corrected for no flow.

    shut_off, last : values of the curve at no flow and at the last flow, over the rated value; edge : angle atan2(v, n)
    of the last flow. The correction for no flow fades to zero at standstill.
    """
    values = np.array(values)
    at = np.linspace(-math.pi, math.pi, len(values))
    correction = last * math.cos(edge) ** 2 - float(np.interp(edge, at, values))
    reverse = (-0.5 * math.pi <= at) & (at < ROUNDING)
    return correction, values + reverse * (shut_off - np.interp(0.0, at, values)) * (1.0 + at / (0.5 * math.pi))


def monotone_head(values: np.ndarray) -> np.ndarray:
    """Values of WH, raised so that the head never falls as the flow through a turning pump reverses.

    Otherwise two flows have one head. Condition on W = WH between two values: d/d(angle) of W / cos^2 is below 0.
    """
    values, at = values.copy(), np.linspace(-math.pi, math.pi, len(values))
    width = at[1] - at[0]
    for k in range(len(values) - 2, 0, -1):
        if -0.5 * math.pi < at[k] < -ROUNDING:
            tilt = 2.0 * width * math.tan(max(0.0, -at[k + 1])) - 0.5 * width**2
            values[k] = max(values[k], values[k + 1] * (1.0 - tilt))
    return values


def joined_table(part, flow: float, head: float) -> Quadrants | None:
    """Suter table for the specific speed of a pump with `curve` and `rated_speed`; None if it has no joined table."""
    if part.curve is None or part.rated_speed is None or part.curve_extrapolation == "parabola":
        return None
    return quadrants(specific_speed(part, flow, head))


def specific_speed(part, flow: float, head: float) -> float:
    """Specific speed at the rated point, in rpm (m3/s)^(1/2) / m^(3/4); flow [m3/s], head [m]"""
    return part.rated_speed * 30.0 / math.pi * math.sqrt(flow) / head**0.75
