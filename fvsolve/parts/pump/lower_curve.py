"""Head curves and powers of pumps as the numbers that kernels read. Knows the curves; knows no scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.head_curve import CurvePoints, first_root
from fvsolve.parts.pump.part import EFFICIENCY
from fvsolve.parts.pump.suter_tables import Quadrants, quadrants

STILL = 1e-9  # an angle that is none
LEAST_FLOW = 1e-5  # share of the last flow below which a curve that is flat there is a straight line
HIGHEST, LOWEST = 1000.0, 0.1  # heads between which a pump of constant power keeps it [m]


def curve_numbers(part, weight: float) -> list[float]:
    """Numbers of a pump's head curve, in the order that `law_curve` states; weight = rho g [N/m3]."""
    if part.suter is not None:
        one = part.suter
        return [
            curves.SUTER,
            len(one.head),
            0.0,
            0.0,
            0.0,
            0.0,
            one.rated_flow,
            0.0,
            one.rated_head,
            one.rated_flow,
            *one.head,
        ]
    law, count, first, last, own = base_law(part, weight)
    numbers = [law, count, first, last, 0.0, 0.0, last, 0.0, *own]
    head, slope = curves.base_head(np.array(numbers), 0, float(last))
    tail = -slope / (2.0 * last)
    numbers[curves.TAIL_HEAD], numbers[curves.TAIL] = head + tail * last**2, tail
    numbers[curves.SCALE] = rated_point(part, weight)[0]
    joined = joined_numbers(part, weight, numbers)
    numbers[curves.JOIN] = len(numbers) if joined else 0.0
    return [float(one) for one in (*numbers, *joined)]


def joined_numbers(part, weight: float, numbers: list[float]) -> list[float]:
    """Numbers of the table that is joined to a head curve of these numbers; none where none is."""
    if (table := joined_table(part, weight)) is None:
        return []
    flow, head = rated_point(part, weight)
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


def joined_table(part, weight: float) -> Quadrants | None:
    """The table of a pump by a curve whose specific speed is known, unless its file says otherwise."""
    if part.curve is None or part.rated_speed is None or part.outside == "parabola":
        return None
    return quadrants(specific_speed(part, weight))


def specific_speed(part, weight: float) -> float:
    """rpm (m3/s)^(1/2) / m^(3/4) at the point where a pump is meant to work."""
    flow, head = rated_point(part, weight)
    return part.rated_speed * 30.0 / math.pi * math.sqrt(flow) / head**0.75


def base_law(part, weight: float) -> tuple[int, int, float, float, list[float]]:
    """(law, how many, first and last flow, own numbers) of a curve that is no Suter table."""
    if part.power is not None:
        product = part.power / weight
        return curves.POWER, 3, product / HIGHEST, product / LOWEST, [0.0, -product, -1.0]
    curve = part.curve
    if curve.coefficients:
        last = first_root(curve.coefficients)
        first = LEAST_FLOW * last if len(curve.coefficients) < 2 or curve.coefficients[1] == 0.0 else 0.0
        return curves.POLYNOMIAL, len(curve.coefficients), first, last, list(curve.coefficients)
    if (fit := power_law(curve)) is None:
        return curves.POINTS, len(curve.flow), 0.0, curve.flow[-1], [*curve.flow, *curve.value]
    a, b, c = fit
    last = (a / b) ** (1.0 / c)
    return curves.POWER, 3, 0.0 if c == 1.0 else LEAST_FLOW * last, last, [a, b, c]


def power_law(curve: CurvePoints) -> tuple[float, float, float] | None:
    """a, b, c of H = a - b q^c through one point (4/3 of its head at no flow, 0 at twice its flow) or three from q = 0.

    None of other curves, which are straight lines between their points. As EPANET has it (Rossman 2020).
    """
    if len(curve.flow) == 1:
        return 4.0 / 3.0 * curve.value[0], curve.value[0] / 3.0 / curve.flow[0] ** 2, 2.0
    if len(curve.flow) != 3 or curve.flow[0] != 0.0:
        return None
    fall, full = curve.value[0] - curve.value[1], curve.value[0] - curve.value[2]
    c = math.log(full / fall) / math.log(curve.flow[2] / curve.flow[1])
    return curve.value[0], fall / curve.flow[1] ** c, c


def rated_point(part, weight: float) -> tuple[float, float]:
    """(flow [m3/s], head [m]) where a pump is meant to work: its point, the middle of three, or the greatest q H."""
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


def shaft_points(part, weight: float) -> list[float]:
    """[how many, flows, powers at the shaft [W]] at relative speed 1; of a Suter table [rated torque, WB].

    Where a table is joined to the curve there follow its rated torque, what WB lacks and WB; by one number for the
    efficiency there are no points.
    """
    flow, head = rated_point(part, weight)
    rated = weight * flow * head / rated_efficiency(part)
    torque = rated / (part.rated_speed or 1.0)
    if part.suter is not None:
        return [torque, *part.suter.torque]
    if (table := joined_table(part, weight)) is None:
        flows, powers = shaft_power(part, weight, flow, rated)
        return [len(flows), *flows, *powers]
    if part.shaft_power is None and not isinstance(part.efficiency, CurvePoints):
        return [0, torque, 0.0, *table.torque]
    flows, powers = shaft_power(part, weight, flow, rated)
    last = base_law(part, weight)[3]
    shut_off, end = np.interp([0.0, last], flows, powers) / rated
    lack, values = fitted(table.torque, shut_off, end, math.atan2(last, flow))
    return [len(flows), *flows, *powers, torque, lack, *values]


def rated_efficiency(part) -> float:
    """The number that a pump has at its rated point."""
    return EFFICIENCY if part.efficiency is None or isinstance(part.efficiency, CurvePoints) else part.efficiency


def shaft_power(part, weight: float, flow: float, rated: float) -> tuple[Sequence[float], Sequence[float]]:
    """Flows and powers at the shaft [W] at relative speed 1, two or more of each."""
    if part.power is not None and part.shaft_power is None:
        return (0.0, flow), (part.power / rated_efficiency(part),) * 2
    if part.shaft_power is not None:
        flows, powers = part.shaft_power.flow, part.shaft_power.value
    elif isinstance(part.efficiency, CurvePoints):
        flows, powers = by_efficiency(part, weight)
    else:
        flows, powers = (0.0, flow, 4.0 * flow), (2.0 / 3.0 * rated, rated, 2.0 * rated)
    if len(flows) == 1:
        flows, powers = (flows[0], 2.0 * flows[0] + 1.0), (powers[0], powers[0])
    return flows, powers


def by_efficiency(part, weight: float) -> tuple[list[float], list[float]]:
    """Powers at the points of an efficiency over flow, rho g q H / eta; at no flow that of the first one above it."""
    numbers = np.array(curve_numbers(part, weight))
    points = [(q, e) for q, e in zip(part.efficiency.flow, part.efficiency.value, strict=True) if q > 0.0 and e > 0.0]
    flows = [q for q, _ in points]
    powers = [weight * q * curves.curve_head(numbers, 0, 1.0, float(q))[0] / e for q, e in points]
    shut_off = weight * curves.curve_head(numbers, 0, 1.0, 0.0)[0] * flows[0] / points[0][1]
    return [0.0, *flows], [shut_off, *powers]


def inertia(part, weight: float) -> float | None:
    """Of all that turns with the shaft [kg m2]; where a pump that trips has none, impeller with its water, and motor.

    0.03768 (P / N^3)^0.9556 + 0.0043 (P / N)^1.48, P the power at the shaft at the rated point [kW], N its speed in
    1000 rpm. Regressions that go back to Thorley (Fluid Transients in Pipeline Systems, 1991), read as an open program
    has both (`calculate_inertia`) and as Neutrium prints the former ("Estimation of pump moment of inertia":
    1.5e7 (P / N^3)^0.9556 with N in rpm, 0.1 % less).
    """
    if part.inertia is not None or part.trip is None:
        return part.inertia
    flow, head = rated_point(part, weight)
    power = weight * flow * head / rated_efficiency(part) / 1000.0
    if part.shaft_power is not None:
        power = float(np.interp(flow, *shaft_power(part, weight, flow, 0.0))) / 1000.0
    speed = part.rated_speed * 30.0 / math.pi / 1000.0
    return 0.03768 * (power / speed**3) ** 0.9556 + 0.0043 * (power / speed) ** 1.48
