"""Shafts that a motor, a generator or given torques drive, in the tables of a model."""

from __future__ import annotations

from fvsolve.kernels.schedule_pieces import value_with_limit
from fvsolve.parts import Schedule
from fvsolve.parts.pump import law

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
