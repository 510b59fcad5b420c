"""Head curves of pumps as numbers for the kernels."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.head_curve import CurvePoints, zero_head_flow
from fvsolve.parts.pump.lower_join import joined_numbers

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
