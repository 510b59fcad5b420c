"""Shafts that a motor or a generator holds until it lets go, or that torques turn. Knows one; knows no curve."""

from __future__ import annotations

from fvsolve.kernels.schedules import value_until
from fvsolve.parts import Schedule
from fvsolve.parts.pump import law

SNAP = 1e-12  # share of the torques on a shaft below which their sum is rounding


class Turning:
    """What rows of a restriction with a shaft have beside those of a device; `small` is a small change of its speed."""

    small = 1.0

    def states_of(self, draft, name, part) -> tuple[str, ...]:
        return ("speed",) if part.trip is not None or torques_on(draft.case, name) else ()

    def scales(self, draft, name, part) -> list[float]:
        return [self.small for _ in self.states_of(draft, name, part)]

    def turning(self, draft, name, part) -> dict[int, float]:
        """Its numbers that say what turns it, but inertia and rated speed; its schedule of speeds goes to its row."""
        torques = torques_on(draft.case, name)
        mode = law.TURNED if torques else law.HELD_SPEED if part.trip is None else law.TRIPPING
        draft.device_table["schedule"][draft.device_names.index(name)] = draft.schedules.add(part.speed)
        return {law.MODE: mode, law.TRIP: self.trip(draft, name, part), law.GIVEN: len(torques)}

    def given(self, draft, name) -> list[float]:
        """Pairs of schedule and value at the start of the torques given to it."""
        return [x for torque in torques_on(draft.case, name) for x in (draft.schedules.add(torque.torque), 0.0)]

    def trip(self, draft, name, part) -> int:
        """The schedule that is 0 before and 1 after the trip; its speed has a kink there and no jump."""
        if part.trip is None:
            return -1
        kinks, start = dict(draft.schedules.breaks), draft.case.numerics.start
        if part.trip < start:
            trip, begin = (draft.case.amount(one, "time", 6) for one in (part.trip, start))
            draft.fault(f"links.{name}.trip", f"{trip} lies before the start at {begin}")
        made = draft.schedules.add(Schedule("step", (part.trip - 1.0 - abs(part.trip), part.trip), (0.0, 1.0)))
        draft.schedules.breaks[part.trip] = kinks.get(part.trip, False)
        return made

    def speed_at(self, start, k: int) -> float:
        """Speed at the start, as `speed` says it."""
        row = start.draft.device_table[start.valves[k]["device"]]
        return start.given(row["schedule"])

    def asked(self, start, row, valve) -> float:
        """Torque that the fluid asks of the shaft at the start [N m]."""
        raise NotImplementedError

    def let_go(self, start, part, row, valve) -> list[str]:
        """The speed from which a shaft runs free, and what does not hold it; returns what moves, in words."""
        draft, floats, at = start.draft, start.draft.tables.floats, int(row["data"])
        name = draft.valve_names[row["valve"]]
        if floats[at + law.MODE] == law.TRIPPING:
            trip = float(part.trip)
            given = draft.tables.schedules, draft.tables.pieces
            floats[at + law.HELD] = value_until(*given, int(row["schedule"]), trip, trip)
        if floats[at + law.MODE] != law.TURNED:
            return []
        taken = self.asked(start, row, valve)
        first, total = at + law.OWN_NUMBERS, 0.0
        for k in range(int(floats[at + law.GIVEN])):
            value = start.given(floats[first + 2 * k])
            floats[first + 2 * k + 1], total = value, total + value
        left = total - taken if abs(total - taken) > SNAP * (abs(total) + abs(taken)) else 0.0
        speed = float(valve["drive"])
        floats[at + law.HELD], floats[at + law.TORQUE], floats[at + law.OFFSET] = speed, taken, left
        rise = left / part.inertia
        return [f"{part.kind} {name}: its shaft speeds up by {rise:.4g} rad/s2"] if left != 0.0 else []


def torques_on(case, name: str) -> list:
    """Torques given to the shaft of a pump or a turbine."""
    return [link for link in case.links.values() if link.kind == "torque" and link.to == f"{name}.shaft"]


def numbers_of(found: dict[int, float], given: list[float], own: list[float]) -> list[float]:
    """Numbers of a shaft in the order that `law` states."""
    return [float(found.get(k, 0.0)) for k in range(law.OWN_NUMBERS)] + given + own
