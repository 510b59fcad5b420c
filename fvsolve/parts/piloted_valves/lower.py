"""Piloted valves in the tables of a model, and their states at the steady start."""

from fvsolve.core.assembly.lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.self_acting import law_relief_valve
from fvsolve.parts.self_acting.law_disc import FREE_BACK, SENSED
from fvsolve.parts.self_acting.lower import (
    LIFTING,
    OPEN,
    SMALL_FLOW,
    SMALL_LIFT,
    SMALL_PRESSURE,
    STOP_EVENTS,
    Relief,
    ReliefDisc,
)

from . import law_pilot_check, law_shuttle

BACK_EVENTS = ("flow reverses", "flow is forward again")


class PilotedDisc(ReliefDisc, kind=""):
    """Conversion to table rows of valves with disc dynamics that a sum of two sensed pressures lifts."""

    controlling_event = -1

    def numbers(self, draft, name, part):
        self.check_columns(draft, name)
        return super().numbers(draft, name, part)

    def sensed_at(self, start, k):
        row = start.draft.device_table[start.valves[k]["device"]]
        return [(int(row[column]), float(row[f"{column}_weight"])) for column in ("node", "second")]

    def flow_at(self, start, k, drop, lift):
        """Results of `LiftedValve.flow_at`; below the seat the flow stays linear in the lift, for Newton's method."""
        full, steep, rise = super().flow_at(start, k, drop, 1.0)
        return lift * full, max(lift, 0.0) * steep, rise

    def check_columns(self, draft, name: str) -> None:
        """Add a notice if a rigid column ends at the valve, whose exchange of flow and lift no step resolves."""
        valve = draft.valve_table[draft.valve_names.index(name)]
        ends = {int(valve[end]) for end in ("from_node", "to_node")}
        for column, row in zip(draft.column_names, draft.column_table, strict=True):
            if ends & {int(row[end]) for end in ("from_node", "to_node")}:
                text = (
                    f"{name}: joins the rigid column {column}: its lift and flow are not reliable near its seat; "
                    "make the column a pipe, or put a chamber between them"
                )
                draft.warnings.append(Notice("range", f"links.{name}", text))


class CounterbalanceDisc(PilotedDisc, kind=""):
    """Conversion to table rows of counterbalance valves with disc dynamics; reverse flow passes the full size."""

    mode = FREE_BACK
    events = (*STOP_EVENTS, *BACK_EVENTS)

    def sensed(self, part):
        return (part.from_, 1.0), (part.pilot, part.pilot_ratio)

    def opening_pressure(self, start, part):
        return part.set_pressure + part.pilot_ratio * start.case.ambient_pressure

    def is_reversed(self, start, k, flow):
        before, behind = start.across(k)
        return (
            before - behind < -SMALL_PRESSURE
            if k in start.shut
            else super().is_reversed(start, k, flow)
        )

    def next_mode(self, x, back, now):
        if back:
            return OPEN
        return LIFTING if now == OPEN and x < 1.0 - SMALL_LIFT else super().next_mode(x, False, now)

    def store_lift(self, start, row, x, target):
        super().store_lift(start, row, min(max(target, 0.0), 1.0) if x == 1.0 else x, target)


class CounterbalanceRows(CounterbalanceDisc, kind="counterbalance"):
    """Conversion to table rows of counterbalance valves whose lift follows the pressures at once."""

    law = law_relief_valve
    mode = law_relief_valve.FREE_BACK
    regular = True
    events = Relief.events
    numbers = Relief.numbers
    store_lift = Relief.store_lift

    def of(self, part) -> Device:
        return CounterbalanceDisc().moved_as(part) if part.has_dynamics else self


class CompensatorDisc(PilotedDisc, kind=""):
    """Conversion to table rows of pressure compensators with disc dynamics."""

    mode = SENSED

    def sensed(self, part):
        before, behind = part.senses
        return (before, -1.0), (behind, 1.0)

    def opening_pressure(self, start, part):
        return -part.set_drop - part.overpressure

    def edge(self, start, k):
        # a spool below its seat would pass a reversed flow forward
        start.valve_modes.setdefault(k, OPEN)
        return super().edge(start, k)

    def flow_at(self, start, k, drop, lift):
        """Results of `LiftedValve.flow_at`; a reversed flow changes with the lift too."""
        full, steep, _ = super().flow_at(start, k, drop, 1.0)
        return lift * full, max(lift, 0.0) * steep, full

    def begin(self, start, part, row):
        super().begin(start, part, row)
        return []

    def store_lift(self, start, row, x, target):
        super().store_lift(start, row, min(max(target, 0.0), 1.0) if start.rest else x, target)

    def add_start_notices(self, start, name, x):
        """Add no notice: the valve is open at rest."""


class CompensatorRows(CompensatorDisc, kind="pressure-compensator"):
    """Conversion to table rows of pressure compensators whose opening follows the pressures at once."""

    law = law_relief_valve
    mode = 0
    regular = True
    events = Relief.events
    numbers = Relief.numbers
    store_lift = Relief.store_lift

    def of(self, part) -> Device:
        return CompensatorDisc().moved_as(part) if part.has_dynamics else self


class PilotCheckRows(Device, kind="pilot-check"):
    """Conversion to table rows of pilot-operated check valves, which are either open or shut.

    In the steady state no open valve has a reverse flow that its pilot does not permit, and nothing opens a shut valve.
    """

    law, events_only = law_pilot_check, True
    quantities = ("opening",)
    events = ("shuts", "opens")
    remedy = (
        "raise the pilot pressure, or lower the pressure that its reverse flow builds up at `from`"
    )

    def sensed(self, part):
        return ((part.pilot, 1.0),)

    def numbers(self, draft, name, part) -> list[float]:
        return [part.cracking_pressure, part.pilot_ratio, 0.0, 0.0]

    def excesses(self, start, part, row) -> tuple[float, float]:
        """(drop minus cracking pressure, excess of the pilot) [Pa], see `law_pilot_check.excesses`."""
        valve = start.valves[row["valve"]]
        before, behind, pilot = (
            start.pressure(int(i)) for i in (valve["from_node"], valve["to_node"], row["node"])
        )
        excess = part.pilot_ratio * (pilot - before) + before - behind - part.cracking_pressure
        return before - behind - part.cracking_pressure, excess

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        forward, pilot = self.excesses(start, part, row)
        if k in start.shut:
            opens = max(forward, pilot) > SMALL_PRESSURE
            start.shut -= {k} if opens else set()
            return opens
        shuts = pilot <= 0.0 and start.valve_flows()[k] < -SMALL_FLOW * start.flow_scale
        start.shut |= {k} if shuts else set()
        return shuts

    def begin(self, start, part, row) -> list[str]:
        forward, pilot = self.excesses(start, part, row)
        floats, at = start.draft.tables.floats, int(row["data"])
        floats[at + law_pilot_check.DROP] = forward + part.cracking_pressure
        floats[at + law_pilot_check.PILOT_EXCESS] = pilot
        return []


class ShuttleRows(Device, kind="shuttle"):
    """Conversion to table rows of shuttle valves: two rows for each valve, from A to out and from B to out."""

    rows = 2
    law = law_shuttle
    events_only = True
    quantities = ("flow_A", "flow_B", "flow_out", "position")
    events = ("switches to B", "switches to A")
    remedy = "its own flow lowers the higher pressure below the lower; reduce it, or give A and B stiffer supplies"

    def fill(self, draft, name, link, rows) -> None:
        for port, row in zip("AB", rows, strict=True):
            row["from_node"], row["to_node"] = (
                draft.node_index[link.ports[port]],
                draft.node_index[link.ports["out"]],
            )
            row["schedule"] = -1
            self.restriction(draft, name, link, row)

    def row_names(self, name) -> list[str]:
        return [f"{name}.A-out", f"{name}.B-out"]

    def numbers(self, draft, name, part) -> list[float]:
        first = draft.valve_names.index(name)
        draft.valve_table["device"][first + 1] = draft.valve_table["device"][first]
        return [0.0]

    def difference(self, start, row) -> float:
        """Pressure at A minus that at B [Pa]."""
        first = int(row["valve"])
        a, b = (start.pressure(int(start.valves[k]["from_node"])) for k in (first, first + 1))
        return a - b

    def revise_state(self, start, part, row) -> bool:
        first = int(row["valve"])
        shut = first if self.difference(start, row) < -law_shuttle.PRESSURE_MARGIN else first + 1
        before, start.shut = start.shut, (start.shut - {first, first + 1}) | {shut}
        return start.shut != before

    def begin(self, start, part, row) -> list[str]:
        start.draft.tables.floats[int(row["data"])] = self.difference(start, row)
        return []
