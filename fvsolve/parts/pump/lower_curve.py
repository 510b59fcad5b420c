"""Head curves of pumps, and Suter tables joined to them, as numbers for the kernels."""

import math

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.head_curve import CurvePoints, zero_head_flow
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


LEAST_FLOW = 1e-5  # flow over the last flow, below which a curve that is flat at no flow is replaced by a line
HIGHEST, LOWEST = 1000.0, 0.1  # range of heads of the curve of a constant-power pump [m]


def curve_numbers(part, weight: float) -> list[float]:
    """Parameters of the head curve of a pump, in the order that `law_curve` states; weight : rho g [N/m3]"""
    if part.suter is not None:
        entry = part.suter
        return [
            curves.SUTER,
            len(entry.head),
            0.0,
            0.0,
            0.0,
            0.0,
            entry.rated_flow,
            0.0,
            entry.rated_head,
            entry.rated_flow,
            *entry.head,
        ]
    law, count, first, last, own = base_law(part, weight)
    numbers = [law, count, first, last, 0.0, 0.0, last, 0.0, *own]
    head, slope = curves.base_head(np.array(numbers), 0, float(last))
    tail = -slope / (2.0 * last)
    numbers[curves.TAIL_HEAD], numbers[curves.TAIL] = head + tail * last**2, tail
    numbers[curves.SCALE] = rated_point(part, weight)[0]
    joined = joined_numbers(part, *rated_point(part, weight), numbers)
    numbers[curves.JOIN] = len(numbers) if joined else 0.0
    return [float(entry) for entry in (*numbers, *joined)]


def base_law(part, weight: float) -> tuple[int, int, float, float, list[float]]:
    """(law, count, first flow [m3/s], last flow [m3/s], parameters) of a head curve that is not a Suter table.

    law : POWER, POINTS or POLYNOMIAL of `law_curve`; count : number of points or coefficients; weight : rho g [N/m3]
    """
    if part.power is not None:
        product = part.power / weight
        return curves.POWER, 3, product / HIGHEST, product / LOWEST, [0.0, -product, -1.0]
    curve = part.curve
    if curve.coefficients:
        last = zero_head_flow(curve.coefficients)
        first = LEAST_FLOW * last if len(curve.coefficients) < 2 or curve.coefficients[1] == 0.0 else 0.0
        return curves.POLYNOMIAL, len(curve.coefficients), first, last, list(curve.coefficients)
    if (fit := power_law(curve)) is None:
        return curves.POINTS, len(curve.flow), 0.0, curve.flow[-1], [*curve.flow, *curve.value]
    a, b, c = fit
    last = (a / b) ** (1.0 / c)
    return curves.POWER, 3, 0.0 if c == 1.0 else LEAST_FLOW * last, last, [a, b, c]


def power_law(curve: CurvePoints) -> tuple[float, float, float] | None:
    """(a, b, c) of the head curve H = a - b q^c, with head H [m] and flow q [m3/s], as in EPANET (Rossman 2020).

    It passes through one point (with 4/3 of its head at no flow, and zero head at twice its flow), or through three
    points, of which the first has no flow.
    None for other points, between which the curve is linear.
    """
    if len(curve.flow) == 1:
        return 4.0 / 3.0 * curve.value[0], curve.value[0] / 3.0 / curve.flow[0] ** 2, 2.0
    if len(curve.flow) != 3 or curve.flow[0] != 0.0:
        return None
    fall, full = curve.value[0] - curve.value[1], curve.value[0] - curve.value[2]
    c = math.log(full / fall) / math.log(curve.flow[2] / curve.flow[1])
    return curve.value[0], fall / curve.flow[1] ** c, c


def rated_point(part, weight: float) -> tuple[float, float]:
    """(flow [m3/s], head [m]) at the rated point of a pump; weight : rho g [N/m3]

    It is the single point of the curve, the middle of three points from no flow on, or the point with the greatest flow
    times head. A Suter table states its rated point; that of a pump with constant power is at a head of 10 m.
    """
    if part.suter is not None:
        return part.suter.rated_flow, part.suter.rated_head
    if part.power is not None:
        flow = part.power / weight / math.sqrt(HIGHEST * LOWEST)
        return flow, math.sqrt(HIGHEST * LOWEST)
    curve = part.curve
    if not curve.coefficients and power_law(curve) is not None:
        k = min(1, len(curve.flow) - 1)
        return curve.flow[k], curve.value[k]
    law, count, first, last, own = base_law(part, weight)
    numbers = np.array([law, count, first, last, 0.0, 0.0, last, 0.0, *own], dtype=float)
    flows = np.linspace(0.0, last, 1001)[1:]
    heads = np.array([curves.base_head(numbers, 0, float(q))[0] for q in flows])
    best = int(np.argmax(flows * heads))
    return float(flows[best]), float(heads[best])
