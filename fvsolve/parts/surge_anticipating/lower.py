"""Surge-anticipating valves in the tables of a model; the valves are shut at the start."""

from fvsolve.assembly.device_lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.outlet.law import EVENT_COUNT
from fvsolve.parts.outlet.lower import RelievingRows
from fvsolve.parts.surge_anticipating import law, law_outside


class SurgeAnticipatingRows(RelievingRows, kind="surge-anticipating"):
    """Conversion to table rows of surge-anticipating valves between two nodes."""

    law = law
    states = ("opening", "held")
    events = ("is shut", "opens", "is fully open", "begins to shut", "", "", "")
    remedy = "give the surge-anticipating valve a longer closing_time"

    def of(self, part) -> Device:
        return AnticipatingToAmbient() if part.outward else self

    def own_numbers(self, draft, name, part) -> list[float]:
        if part.trip is not None and part.trip < draft.case.numerics.start:
            text = f"{part.trip:g} s lies before the start at {draft.case.numerics.start:g} s"
            draft.fault(f"links.{name}.trip", f"{text}; expected a later time")
        low = -law.NEVER if part.low_set is None else part.low_set
        high, trip = (law.NEVER if value is None else value for value in (part.high_set, part.trip))
        place = float(draft.node_index[part.sensed])
        return [part.opening_time, part.hold, part.closing_time, low, high, trip, place]

    def scales(self, draft, name, part) -> list[float]:
        return [0.1, part.hold + part.opening_time]

    def apply_event(self, run_data, row, t, y, scale) -> None:
        at, o = row["event"] + row["mode"], row["y"]
        if run_data.armed[at + law.SHUT] > 0.0:
            y[o] = 0.0
        elif run_data.armed[at + law.OPENING] > 0.0:
            y[o + 1] = 0.0
        elif run_data.armed[at + law.OPEN] > 0.0:
            y[o] = 1.0

    def begin(self, start, part, row) -> list[str]:
        name, node = start.draft.valve_names[row["valve"]], start.nodes[start.draft.node_index[part.sensed]]
        p, high = float(node["pressure"]), part.high_set is not None and float(node["pressure"]) >= part.high_set
        amount = start.case.amount
        if part.low_set is not None and p < part.low_set:
            text = (f"{name}: the pressure at {part.sensed} is {amount(p, 'pressure', 6)} at the start, below low_set, "
                    f"{amount(part.low_set, 'pressure', 6)}: a low pressure opens the valve only after the pressure "
                    "has exceeded low_set")  # fmt: skip
            start.draft.warnings.append(Notice("start", f"links.{name}", text, "low_set", p, part.low_set))
        if not high:
            return []
        return [
            f"{name}: opens at the start, because the pressure at {part.sensed}, {amount(p, 'pressure', 6)}, is not "
            f"below high_set, {amount(part.high_set, 'pressure', 6)}"
        ]


class AnticipatingToAmbient(SurgeAnticipatingRows, kind=""):
    """Conversion to table rows of surge-anticipating valves that open to ambient."""

    law, mode = law_outside, EVENT_COUNT
    events = ("",) * EVENT_COUNT + SurgeAnticipatingRows.events
