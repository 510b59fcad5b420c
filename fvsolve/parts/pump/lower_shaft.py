"""Shaft power, efficiency and inertia of pumps as numbers for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.head_curve import CurvePoints
from fvsolve.parts.pump.lower_curve import base_law, curve_numbers, rated_point
from fvsolve.parts.pump.lower_join import fit_to_curve, joined_table
from fvsolve.parts.pump.part import EFFICIENCY

SAMPLE_COUNT = 65  # number of points of a power by a Suter table over the angle, and also over the flow


def shaft_points(part, weight: float) -> list[float]:
    """Numbers of the shaft power at relative speed 1: count of points, flows [m3/s], powers [W].

    For a Suter table: rated torque, values of WB. Where a table is joined to the curve, its rated torque, the
    correction of WB at the last flow and the values of WB follow the points.
    """
    flow, head = rated_point(part, weight)
    rated = weight * flow * head / rated_efficiency(part)
    torque = rated / (part.rated_speed or 1.0)
    if part.suter is not None:
        return [torque, *part.suter.torque]
    if (table := joined_table(part, flow, head)) is None:
        flows, powers = shaft_power(part, weight, flow, rated)
        return [len(flows), *flows, *powers]
    last = base_law(part, weight)[3]
    if part.shaft_power is None and not isinstance(part.efficiency, CurvePoints):
        flows, powers = table_power(table, np.array(curve_numbers(part, weight)), flow, head, last)
        powers = rated * powers
    else:
        flows, powers = shaft_power(part, weight, flow, rated)
    shut_off, end = np.interp([0.0, last], flows, powers) / rated
    lack, values = fit_to_curve(table.torque, shut_off, end, math.atan2(last, flow))
    return [len(flows), *flows, *powers, torque, lack, *values]


def table_power(table, numbers, flow: float, head: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Flows [m3/s] and shaft powers over the rated power of a head curve, by the values WB of a Suter table.

    The power is nowhere below that at the rated efficiency. numbers : those of the curve; flow, head : rated point
    last : last flow of the curve [m3/s]
    """
    flows = flow * np.tan(np.linspace(0.0, math.atan2(last, flow), SAMPLE_COUNT)[:-1])
    flows = np.unique([*flows, *np.linspace(0.0, last, SAMPLE_COUNT), *([flow] if last > flow else [])])
    lifts = np.array([curves.curve_head(numbers, 0, 1.0, float(q))[0] for q in flows]) / head
    at = np.linspace(-math.pi, math.pi, len(table.torque))
    by_table = (1.0 + (flows / flow) ** 2) * np.interp(np.arctan2(flows, flow), at, table.torque)
    return flows, np.maximum(by_table, lifts * flows / flow)


def rated_efficiency(part) -> float:
    """Efficiency of a pump at its rated point."""
    return EFFICIENCY if part.efficiency is None or isinstance(part.efficiency, CurvePoints) else part.efficiency


def shaft_power(part, weight: float, flow: float, rated: float) -> tuple[Sequence[float], Sequence[float]]:
    """Flows [m3/s] and powers at the shaft [W] at relative speed 1, at least two of each.

    flow, rated : flow [m3/s] and shaft power [W] at the rated point
    """
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
    """Flows [m3/s] and shaft powers rho g q H / eta [W] at the points of an efficiency curve.

    q : flow, H : head, eta : efficiency; at no flow, the power is H times the ratio of power to head at the next point
    """
    numbers = np.array(curve_numbers(part, weight))
    points = [(q, e) for q, e in zip(part.efficiency.flow, part.efficiency.value, strict=True) if q > 0.0 and e > 0.0]
    flows = [q for q, _ in points]
    powers = [weight * q * curves.curve_head(numbers, 0, 1.0, float(q))[0] / e for q, e in points]
    shut_off = weight * curves.curve_head(numbers, 0, 1.0, 0.0)[0] * flows[0] / points[0][1]
    return [0.0, *flows], [shut_off, *powers]


def inertia(part, weight: float) -> float | None:
    """Inertia of all rotating masses [kg m2]: as given, or estimated from power and speed for a pump that trips."""
    if part.inertia is not None or part.trip is None:
        return part.inertia
    return usual_inertia(rated_power(part, weight), part.rated_speed)


def rated_power(part, weight: float) -> float:
    """Shaft power at the rated point [W]."""
    flow, head = rated_point(part, weight)
    if part.shaft_power is not None:
        return float(np.interp(flow, *shaft_power(part, weight, flow, 0.0)))
    return weight * flow * head / rated_efficiency(part)


def usual_inertia(power: float, speed: float) -> float:
    """Usual inertia of impeller, its water and motor [kg m2], from shaft power [W] and speed [rad/s].

    0.03768 (P / N^3)^0.9556 + 0.0043 (P / N)^1.48, P the power at the shaft at the rated point [kW], N its speed in
    1000 rpm. Regressions that go back to Thorley (Fluid Transients in Pipeline Systems, 1991), read as an open program
    has both (`calculate_inertia`) and as Neutrium prints the former ("Estimation of pump moment of inertia":
    1.5e7 (P / N^3)^0.9556 with N in rpm, 0.1 % less).
    """
    power, speed = power / 1000.0, speed * 30.0 / math.pi / 1000.0
    return 0.03768 * (power / speed**3) ** 0.9556 + 0.0043 * (power / speed) ** 1.48
