"""Tables of Suter form joined to head curves. Knows one pump and its rated point; evaluates nothing."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.suter_tables import Quadrants, quadrants

STILL = 1e-9  # an angle that is none


def joined_numbers(part, flow: float, head: float, numbers: list[float]) -> list[float]:
    """Numbers of the table that is joined to a head curve of these numbers; none where none is."""
    if (table := joined_table(part, flow, head)) is None:
        return []
    edge = math.atan2(numbers[curves.LAST], flow)
    own = np.array(numbers, dtype=float)
    shut_off, last = (curves.curve_head(own, 0, 1.0, q)[0] / head for q in (0.0, own[curves.LAST]))
    lack, values = fitted(table.head, shut_off, last, edge)
    return [head, flow, len(values), edge, lack, *steadied(values)]


def fitted(values, shut_off: float, last: float, edge: float) -> tuple[float, np.ndarray]:
    """(what a table lacks at the last flow, its values with what they lack at no flow) to meet a curve that has these
    over its rated value there; of the latter less and less until the pump stands."""
    values = np.array(values)
    at = np.linspace(-math.pi, math.pi, len(values))
    lack = last * math.cos(edge) ** 2 - float(np.interp(edge, at, values))
    back = (-0.5 * math.pi <= at) & (at < STILL)
    return lack, values + back * (shut_off - np.interp(0.0, at, values)) * (1.0 + at / (0.5 * math.pi))


def steadied(values: np.ndarray) -> np.ndarray:
    """WH whose head never falls as the flow through a turning pump turns back, which would leave it two to choose from:
    in W = WH between two values, d/d(angle) of W / cos^2 is below 0."""
    values, at = values.copy(), np.linspace(-math.pi, math.pi, len(values))
    width = at[1] - at[0]
    for k in range(len(values) - 2, 0, -1):
        if -0.5 * math.pi < at[k] < -STILL:
            tilt = 2.0 * width * math.tan(max(0.0, -at[k + 1])) - 0.5 * width**2
            values[k] = max(values[k], values[k + 1] * (1.0 - tilt))
    return values


def joined_table(part, flow: float, head: float) -> Quadrants | None:
    """The table of a pump by a curve whose specific speed is known, unless its file says otherwise."""
    if part.curve is None or part.rated_speed is None or part.outside == "parabola":
        return None
    return quadrants(specific_speed(part, flow, head))


def specific_speed(part, flow: float, head: float) -> float:
    """rpm (m3/s)^(1/2) / m^(3/4) at the point where a pump is meant to work: flow [m3/s], head [m]."""
    return part.rated_speed * 30.0 / math.pi * math.sqrt(flow) / head**0.75
