"""Shafts of pumps and turbines in the tables of a model: power, efficiency, inertia, drive and torques."""

import math
from collections.abc import Sequence

import numpy as np

from fvsolve.kernels.schedule_pieces import value_with_limit
from fvsolve.parts.pump import law
from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.head_curve import CurvePoints
from fvsolve.parts.pump.lower_curve import base_law, curve_numbers, fit_to_curve, joined_table, rated_point
from fvsolve.parts.pump.part import EFFICIENCY
from fvsolve.parts.schedule import Schedule

SAMPLE_COUNT = 65  # number of points of a power by a Suter table over the angle, and also over the flow


def shaft_points(part, weight: float) -> list[float]:
    """Parameters of the shaft power of a pump at relative speed 1: count of points, flows [m3/s], powers [W].

    For a Suter table they are the rated torque [N m] and the values of WB. For a table that is joined to the head
    curve, its rated torque, its correction of WB at the last flow and its values of WB follow the points.
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
    """(flows [m3/s], shaft powers over the rated power) of a head curve, by the values WB of a Suter table.

    The power is nowhere below that at the rated efficiency.
    numbers : parameters of the head curve; flow, head : rated point [m3/s], [m]; last : last flow of the curve [m3/s]
    """
    flows = flow * np.tan(np.linspace(0.0, math.atan2(last, flow), SAMPLE_COUNT)[:-1])
    flows = np.unique([*flows, *np.linspace(0.0, last, SAMPLE_COUNT), *([flow] if last > flow else [])])
    lifts = np.array([curves.curve_head(numbers, 0, 1.0, float(q))[0] for q in flows]) / head
    at = np.linspace(-math.pi, math.pi, len(table.torque))
    by_table = (1.0 + (flows / flow) ** 2) * np.interp(np.arctan2(flows, flow), at, table.torque)
    return flows, np.maximum(by_table, lifts * flows / flow)


def rated_efficiency(part) -> float:
    """Efficiency of a pump at its rated point; EFFICIENCY if it is not stated, or stated as a curve."""
    return EFFICIENCY if part.efficiency is None or isinstance(part.efficiency, CurvePoints) else part.efficiency


def shaft_power(part, weight: float, flow: float, rated: float) -> tuple[Sequence[float], Sequence[float]]:
    """(flows [m3/s], powers at the shaft [W]) of a pump at relative speed 1, at least two of each.

    flow, rated : flow [m3/s] and shaft power [W] at the rated point; weight : rho g [N/m3]
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
    """(flows [m3/s], shaft powers rho g q H / eta [W]) at the points of the efficiency curve of a pump.

    q : flow, H : head, eta : efficiency; weight : rho g [N/m3]
    At no flow, the power is H times the ratio of power to head at the next point.
    """
    numbers = np.array(curve_numbers(part, weight))
    points = [(q, e) for q, e in zip(part.efficiency.flow, part.efficiency.value, strict=True) if q > 0.0 and e > 0.0]
    flows = [q for q, _ in points]
    powers = [weight * q * curves.curve_head(numbers, 0, 1.0, float(q))[0] / e for q, e in points]
    shut_off = weight * curves.curve_head(numbers, 0, 1.0, 0.0)[0] * flows[0] / points[0][1]
    return [0.0, *flows], [shut_off, *powers]


def inertia(part, weight: float) -> float | None:
    """Inertia of all rotating masses [kg m2], as given; if not given, None, or for a pump that trips an estimate.

    The estimate follows from power and speed; weight : rho g [N/m3]
    """
    if part.inertia is not None or part.trip is None:
        return part.inertia
    return usual_inertia(rated_power(part, weight), part.rated_speed)


def rated_power(part, weight: float) -> float:
    """Shaft power of a pump at its rated point [W], with `rated_efficiency` if `shaft_power` is not stated.

    weight : rho g [N/m3]
    """
    flow, head = rated_point(part, weight)
    if part.shaft_power is not None:
        return float(np.interp(flow, *shaft_power(part, weight, flow, 0.0)))
    return weight * flow * head / rated_efficiency(part)


def usual_inertia(power: float, speed: float) -> float:
    """Usual inertia of impeller, its water and motor [kg m2], from rated shaft power [W] and rated speed [rad/s].

    It is 0.03768 (P / N^3)^0.9556 + 0.0043 (P / N)^1.48, with the power P [kW] and the speed N in 1000 rpm.
    These regressions go back to Thorley (Fluid Transients in Pipeline Systems, 1991). An open program has both
    (`calculate_inertia`). Neutrium prints the former in "Estimation of pump moment of inertia", as 1.5e7 (P/N^3)^0.9556
    with N in rpm, 0.1 % less.
    """
    power, speed = power / 1000.0, speed * 30.0 / math.pi / 1000.0
    return 0.03768 * (power / speed**3) ** 0.9556 + 0.0043 * (power / speed) ** 1.48


ROUNDING_SHARE = 1e-12  # sum of the torques on a shaft regarded as rounding, over their magnitudes


class ShaftLowering:
    """Base of the conversion to table rows of pumps and turbines; small : size of a small deviation of the speed"""

    small = 1.0

    def states_of(self, draft, name, part) -> tuple[str, ...]:
        return ("speed",) if part.trip is not None or torques_on(draft.case, name) else ()

    def scales(self, draft, name, part) -> list[float]:
        return [self.small for _ in self.states_of(draft, name, part)]

    def drive_numbers(self, draft, name, part) -> dict[int, float]:
        """Parameters of the drive, without inertia and rated speed: their index in `law` -> value.

        Also write the speed schedule to the row of the part in the table of devices.
        """
        torques = torques_on(draft.case, name)
        mode = law.TORQUE_DRIVEN if torques else law.HELD_SPEED if part.trip is None else law.TRIPPING
        draft.device_table["schedule"][draft.device_names.index(name)] = draft.schedules.add(part.speed)
        return {law.MODE: mode, law.TRIP: self.trip(draft, name, part), law.TORQUE_COUNT: len(torques)}

    def torque_schedules(self, draft, name) -> list[float]:
        """Flat list of pairs for the given torques on the shaft: index of the schedule, value at the start.

        The values are 0 here and are set in `set_free_shaft`.
        """
        return [x for torque in torques_on(draft.case, name) for x in (draft.schedules.add(torque.torque), 0.0)]

    def trip(self, draft, name, part) -> int:
        """Index of a schedule that is 0 before the trip and 1 from then on; -1 without a trip.

        The speed has a kink at the trip, not a jump.
        """
        if part.trip is None:
            return -1
        kinks, start = dict(draft.schedules.breaks), draft.case.numerics.start
        if part.trip < start:
            trip, begin = (draft.case.amount(moment, "time", 6) for moment in (part.trip, start))
            draft.fault(f"links.{name}.trip", f"{trip} lies before the start at {begin}; expected a later time")
        index = draft.schedules.add(Schedule("step", (part.trip - 1.0 - abs(part.trip), part.trip), (0.0, 1.0)))
        draft.schedules.breaks[part.trip] = kinks.get(part.trip, False)
        return index

    def speed_at(self, start, k: int) -> float:
        """Speed of restriction k at the start, by its schedule: relative for a pump, [rad/s] for a turbine."""
        row = start.draft.device_table[start.valves[k]["device"]]
        return start.schedule_value(row["schedule"])

    def fluid_torque(self, start, row, valve) -> float:
        """Torque of the fluid on the shaft at the start [N m], positive against the rotation."""
        raise NotImplementedError

    def set_free_shaft(self, start, part, row, valve) -> list[str]:
        """Store the speed at which a shaft becomes free; return texts about its acceleration at the start.

        It is the speed at the trip or, for a shaft that given torques drive, at the start. For such a shaft the given
        torques, the torque of the fluid and the unbalanced torque at the start are stored too.
        """
        draft, floats, at = start.draft, start.draft.tables.floats, int(row["data"])
        name = draft.valve_names[row["valve"]]
        if floats[at + law.MODE] == law.TRIPPING:
            trip = float(part.trip)
            tables = draft.tables.schedules, draft.tables.pieces
            floats[at + law.START_SPEED] = value_with_limit(*tables, int(row["schedule"]), trip, trip)
        if floats[at + law.MODE] != law.TORQUE_DRIVEN:
            return []
        braking = self.fluid_torque(start, row, valve)
        first, total = at + law.OWN_NUMBERS, 0.0
        for k in range(int(floats[at + law.TORQUE_COUNT])):
            value = start.schedule_value(floats[first + 2 * k])
            floats[first + 2 * k + 1], total = value, total + value
        rest = total - braking if abs(total - braking) > ROUNDING_SHARE * (abs(total) + abs(braking)) else 0.0
        speed = float(valve["drive"])
        floats[at + law.START_SPEED], floats[at + law.TORQUE], floats[at + law.OFFSET] = speed, braking, rest
        rise = rest / part.inertia
        return [f"{part.kind} {name}: its shaft accelerates by {rise:.4g} rad/s2"] if rest != 0.0 else []


def torques_on(case, name: str) -> list:
    """Torque links of a case on the shaft of a pump or turbine."""
    return [link for link in case.links.values() if link.kind == "torque" and link.to == f"{name}.shaft"]


def numbers_of(by_index: dict[int, float], given: list[float], own: list[float]) -> list[float]:
    """Parameters of a shaft in the order of `law`, as a list of numbers.

    by_index : index in `law` -> parameter of the drive; given : result of `torque_schedules`
    own : parameters of the shaft power
    """
    return [float(by_index.get(k, 0.0)) for k in range(law.OWN_NUMBERS)] + given + own
