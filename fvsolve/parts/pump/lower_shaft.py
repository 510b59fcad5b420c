"""Head curves, shaft power and inertia of pumps as numbers for the kernels, and shafts of pumps and turbines."""

import math
from collections.abc import Sequence

import numpy as np

from fvsolve.core.assembly.lowering import Input
from fvsolve.core.assembly.schedule_tables import value_at
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import CAPACITY, FLOW, Element
from fvsolve.parts.pump import law
from fvsolve.parts.pump.head_curve import CurvePoints, Quadrants, quadrants, zero_head_flow
from fvsolve.parts.pump.part import EFFICIENCY
from fvsolve.parts.schedule import Schedule

ROUNDING = 1e-9  # angle regarded as zero [rad]


def joined_numbers(part, flow: float, head: float, numbers: list[float]) -> list[float]:
    """Parameters of the Suter table joined to a head curve, in the order of `law`; empty without such a table.

    flow, head : rated point [m3/s], [m]; numbers : parameters of the head curve
    """
    if (table := joined_table(part, flow, head)) is None:
        return []
    edge = math.atan2(numbers[law.LAST], flow)
    own = np.array(numbers, dtype=float)
    shut_off, last = (law.curve_head(own, 0, 1.0, q)[0] / head for q in (0.0, own[law.LAST]))
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
    return correction, values + reverse * (shut_off - np.interp(0.0, at, values)) * (
        1.0 + at / (0.5 * math.pi)
    )


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
    """Specific speed of each pump at its rated point [rpm (m3/s)^(1/2) / m^(3/4)].

    flow : of all `count` pumps [m3/s]; head : [m]
    """
    return part.rated_speed * 30.0 / math.pi * math.sqrt(flow / part.count) / head**0.75


# flow over the last flow, below which a curve that is flat at no flow is replaced by a line
LEAST_FLOW = 1e-5
HIGHEST, LOWEST = 1000.0, 0.1  # range of heads of the curve of a constant-power pump [m]


def curve_numbers(part, weight: float) -> list[float]:
    """Parameters of the head curve of a pump, in the order that `law` states; weight : rho g [N/m3]"""
    if part.suter is not None:
        flow, head = rated_point(part, weight)
        return [
            law.SUTER,
            len(part.suter.head),
            0.0,
            0.0,
            0.0,
            0.0,
            flow,
            0.0,
            head,
            flow,
            *part.suter.head,
        ]
    kind, count, first, last, own = base_law(part, weight)
    numbers = [kind, count, first, last, 0.0, 0.0, last, 0.0, *own]
    head, slope = law.base_head(np.array(numbers), 0, float(last))
    tail = -slope / (2.0 * last)
    numbers[law.TAIL_HEAD], numbers[law.TAIL] = head + tail * last**2, tail
    numbers[law.SCALE] = rated_point(part, weight)[0]
    joined = joined_numbers(part, *rated_point(part, weight), numbers)
    numbers[law.JOIN] = len(numbers) if joined else 0.0
    return [float(entry) for entry in (*numbers, *joined)]


def base_law(part, weight: float) -> tuple[int, int, float, float, list[float]]:
    """(kind, count, first flow [m3/s], last flow [m3/s], parameters) of a head curve that is not a Suter table.

    kind : POWER, POINTS or POLYNOMIAL of `law`; count : number of points or coefficients; weight : rho g [N/m3]
    """
    if part.power is not None:
        product = part.power / weight
        return law.POWER, 3, product / HIGHEST, product / LOWEST, [0.0, -product, -1.0]
    curve = part.curve
    if curve.coefficients:
        last = zero_head_flow(curve.coefficients)
        first = (
            LEAST_FLOW * last
            if len(curve.coefficients) < 2 or curve.coefficients[1] == 0.0
            else 0.0
        )
        return law.POLYNOMIAL, len(curve.coefficients), first, last, list(curve.coefficients)
    if (fit := power_law(curve)) is None:
        return law.POINTS, len(curve.flow), 0.0, curve.flow[-1], [*curve.flow, *curve.value]
    a, b, c = fit
    last = (a / b) ** (1.0 / c)
    return law.POWER, 3, 0.0 if c == 1.0 else LEAST_FLOW * last, last, [a, b, c]


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
    kind, count, first, last, own = base_law(part, weight)
    numbers = np.array([kind, count, first, last, 0.0, 0.0, last, 0.0, *own], dtype=float)
    flows = np.linspace(0.0, last, 1001)[1:]
    heads = np.array([law.base_head(numbers, 0, float(q))[0] for q in flows])
    best = int(np.argmax(flows * heads))
    return float(flows[best]), float(heads[best])


# number of points of a power by a Suter table over the angle, and also over the flow
SAMPLE_COUNT = 65


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


def table_power(
    table, numbers, flow: float, head: float, last: float
) -> tuple[np.ndarray, np.ndarray]:
    """(flows [m3/s], shaft powers over the rated power) of a head curve, by the values WB of a Suter table.

    The power is nowhere below that at the rated efficiency.
    numbers : parameters of the head curve; flow, head : rated point [m3/s], [m]; last : last flow of the curve [m3/s]
    """
    flows = flow * np.tan(np.linspace(0.0, math.atan2(last, flow), SAMPLE_COUNT)[:-1])
    flows = np.unique(
        [*flows, *np.linspace(0.0, last, SAMPLE_COUNT), *([flow] if last > flow else [])]
    )
    lifts = np.array([law.curve_head(numbers, 0, 1.0, float(q))[0] for q in flows]) / head
    at = np.linspace(-math.pi, math.pi, len(table.torque))
    by_table = (1.0 + (flows / flow) ** 2) * np.interp(np.arctan2(flows, flow), at, table.torque)
    return flows, np.maximum(by_table, lifts * flows / flow)


def rated_efficiency(part) -> float:
    """Efficiency of a pump at its rated point; EFFICIENCY if it is not stated, or stated as a curve."""
    return (
        EFFICIENCY
        if part.efficiency is None or isinstance(part.efficiency, CurvePoints)
        else part.efficiency
    )


def shaft_power(
    part, weight: float, flow: float, rated: float
) -> tuple[Sequence[float], Sequence[float]]:
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
    points = [
        (q, e)
        for q, e in zip(part.efficiency.flow, part.efficiency.value, strict=True)
        if q > 0.0 and e > 0.0
    ]
    flows = [q for q, _ in points]
    powers = [weight * q * law.curve_head(numbers, 0, 1.0, float(q))[0] / e for q, e in points]
    shut_off = weight * law.curve_head(numbers, 0, 1.0, 0.0)[0] * flows[0] / points[0][1]
    return [0.0, *flows], [shut_off, *powers]


def inertia(part, weight: float) -> float | None:
    """Inertia of all rotating masses [kg m2], as given; if not given, None, or for a pump that trips an estimate.

    The estimate follows from power and speed of each pump; part : all `count` pumps; weight : rho g [N/m3]
    """
    if part.inertia is not None or part.trip is None:
        return part.inertia
    return part.count * usual_inertia(rated_power(part, weight) / part.count, part.rated_speed)


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
    fluid_torque_sign = -1.0  # of the probe `torque`, as a torque that turns the shaft forward

    def states_of(self, draft, name, part) -> tuple[str, ...]:
        free = (
            part.trip is not None
            or torques_on(draft.case, name)
            or f"{name}.shaft" in draft.case.network_places
        )
        return ("speed",) if free else ()

    def network_elements(self, case, name, part) -> tuple[list[Element], list]:
        """Elements of a shaft that other parts of a network join: its inertia, and the torque of the fluid."""
        place, shaft = f"links.{name}", f"{name}.shaft"
        if shaft not in case.network_places:
            return [], []
        rated = part.rated_speed if getattr(part, "rated_speed", None) is not None else 1.0
        return [
            Element(
                CAPACITY,
                f"{place}.shaft",
                place,
                (shaft, None),
                part.inertia or 1.0,
                f"{name}.speed",
                state_of=("device", name),
                unit=rated,
            ),
            Element(
                FLOW,
                f"{place}.fluid",
                place,
                (None, shaft),
                reads=(codes.DEVICE_INPUT, (name, "torque", self.fluid_torque_sign)),
            ),
        ], []

    def speed_input(self, model, name, sort) -> dict[str, Input]:
        """Input "speed"; none for a shaft that torques drive from the start: nothing reads its schedule."""
        row = self.row_of(model, name)
        driven = model.tables.floats[row["data"] + law.MODE] == law.TORQUE_DRIVEN
        return {} if driven else {"speed": Input(sort, int(row["schedule"]))}

    def source_at_start(self, start, part, row, quantity, flow) -> float:
        return -self.fluid_torque_sign * self.fluid_torque(start, row, start.valves[row["valve"]])

    def scales(self, draft, name, part) -> list[float]:
        return [self.small for _ in self.states_of(draft, name, part)]

    def drive_numbers(self, draft, name, part) -> dict[int, float]:
        """Parameters of the drive, without inertia and rated speed: their index in `law` -> value.

        Also write the speed schedule to the row of the part in the table of devices.
        """
        torques = torques_on(draft.case, name)
        free = torques or f"{name}.shaft" in draft.case.network_places
        mode = law.TORQUE_DRIVEN if free else law.HELD_SPEED if part.trip is None else law.TRIPPING
        draft.device_table["schedule"][draft.device_names.index(name)] = draft.schedules.add(
            part.speed
        )
        return {
            law.MODE: mode,
            law.TRIP: self.trip(draft, name, part),
            law.TORQUE_COUNT: len(torques),
        }

    def torque_schedules(self, draft, name) -> list[float]:
        """Flat list of pairs for the given torques on the shaft: index of the schedule, value at the start.

        The values are 0 here and are set in `set_free_shaft`.
        """
        return [
            x
            for torque in torques_on(draft.case, name)
            for x in (draft.schedules.add(torque.torque), 0.0)
        ]

    def trip(self, draft, name, part) -> int:
        """Index of a schedule that is 0 before the trip and 1 from then on; -1 without a trip.

        The speed has a kink at the trip, not a jump.
        """
        if part.trip is None:
            return -1
        kinks, start = dict(draft.schedules.breaks), draft.case.numerics.start
        if part.trip < start:
            trip, begin = (draft.case.moment(moment) for moment in (part.trip, start))
            draft.fault(
                f"links.{name}.trip",
                f"{trip} lies before the start at {begin}; expected a later time",
            )
        index = draft.schedules.add(
            Schedule("step", (part.trip - 1.0 - abs(part.trip), part.trip), (0.0, 1.0))
        )
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
        draft = start.draft
        floats = start.draft.tables.floats
        at = int(row["data"])
        name = draft.valve_names[row["valve"]]
        if floats[at + law.MODE] == law.TRIPPING:
            trip = float(part.trip)
            floats[at + law.START_SPEED] = value_at(draft.tables, int(row["schedule"]), trip, trip)
        if floats[at + law.MODE] != law.TORQUE_DRIVEN:
            return []
        braking = self.fluid_torque(start, row, valve)
        first, total = at + law.OWN_NUMBERS, 0.0
        for k in range(int(floats[at + law.TORQUE_COUNT])):
            value = start.schedule_value(floats[first + 2 * k])
            floats[first + 2 * k + 1], total = value, total + value
        rest = (
            total - braking
            if abs(total - braking) > ROUNDING_SHARE * (abs(total) + abs(braking))
            else 0.0
        )
        speed = float(valve["drive"])
        floats[at + law.START_SPEED], floats[at + law.TORQUE], floats[at + law.OFFSET] = (
            speed,
            braking,
            rest,
        )
        if f"{name}.shaft" in draft.case.network_places:
            return []
        rise = rest / part.inertia
        return (
            [f"{part.kind} {name}: its shaft accelerates by {rise:.4g} rad/s2"]
            if rest != 0.0
            else []
        )


def torques_on(case, name: str) -> list:
    """Torque links of a case on the shaft of a pump or turbine that no other part joins."""
    if f"{name}.shaft" in case.network_places:
        return []  # they are sources of the network
    return [
        link for link in case.links.values() if link.kind == "torque" and link.to == f"{name}.shaft"
    ]


def numbers_of(by_index: dict[int, float], given: list[float], own: list[float]) -> list[float]:
    """Parameters of a shaft in the order of `law`, as a list of numbers.

    by_index : index in `law` -> parameter of the drive; given : result of `torque_schedules`
    own : parameters of the shaft power
    """
    return [float(by_index.get(k, 0.0)) for k in range(law.OWN_NUMBERS)] + given + own
