"""Outlets, rupture discs and surge-anticipating valves in the tables of a model."""

from fvsolve.core.assembly.lowering import Device, Lowering, Restriction, opening_input
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import Notice
from fvsolve.parts.outlet import (
    law_outlet,
    law_rupture_disc,
    law_rupture_disc_outside,
    law_surge_anticipating,
    law_surge_anticipating_outside,
)
from fvsolve.parts.outlet.law_outlet import EVENT_COUNT

SPAN = 1e5  # default drop at which an outlet has its nominal flow [Pa]


class OutsideRows(Lowering, kind="outside"):
    """Conversion to table rows of nodes at ambient pressure."""

    ledger_name = "outside"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = (
            rec.FIXED,
            draft.schedules.add_constant(draft.case.ambient_pressure),
        )

    def pressure_at_start(self, start, i, node, row) -> float:
        return start.schedule_value(row["schedule"])

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return ""


class OutletRows(Restriction, kind="outlet"):
    """Conversion to table rows of outlets: links whose flow is a power of the drop."""

    law = law_outlet
    events = ("",) * law_outlet.EVENT_COUNT

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening, 1.0 / link.full)
        row["conductance"] = (draft.fluid.density * link.flow) ** 2 / self.span(draft, link)
        row["one_way"] = rec.OUTWARD_DEMAND if link.demand else rec.OUTWARD
        row["begins"] = self.least(draft, link)

    def numbers(self, draft, name, link) -> list[float]:
        return [link.exponent, self.least(draft, link), self.span(draft, link), link.most]

    def least(self, draft, link) -> float:
        """Drop [Pa] at which the flow of an outlet begins."""
        return 0.0 if link.least is None else link.least - draft.case.ambient_pressure

    def span(self, draft, link) -> float:
        """Drop at the nominal flow of an outlet minus the drop at which its flow begins [Pa]."""
        if link.upper is None:
            return link.span or SPAN
        return link.upper - draft.case.ambient_pressure - self.least(draft, link)

    def inputs(self, model, name, part):
        return opening_input(model, name)

    def probe(self, draft, name, probe, row) -> None:
        """Fill the PROBE row of its flow, or of a pressure at the place from which it flows."""
        super().probe(draft, name, probe, row)
        if probe.quantity != "flow":
            row["kind"], row["index"] = (
                rec.PRESSURE,
                draft.node_index[draft.inside(draft.case.conduits[name].from_)],
            )


class RelievingRows(Device, kind=""):
    """Conversion to table rows of valves that are shut at the start and may open to another node or to ambient.

    mode : count of the parameters, and of the event flags, of an outlet that precede those of the valve; 0 for a valve
    between two nodes
    """

    quantities = ("opening",)

    def own_numbers(self, draft, name, part) -> list[float]:
        """Parameters of the law of the valve; for a valve to ambient, `numbers` puts those of an outlet before them."""
        raise NotImplementedError

    def restriction(self, draft, name, link, row) -> None:
        super().restriction(draft, name, link, row)
        row["one_way"] = rec.OUTWARD if self.mode > 0 else rec.BOTH_WAYS

    def numbers(self, draft, name, part) -> list[float]:
        return [0.5, 0.0, SPAN, law_outlet.NO_LIMIT][: self.mode] + self.own_numbers(
            draft, name, part
        )

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        new = k not in start.shut
        start.shut |= {k}
        return new

    def follow(self, start, k) -> None:
        """Do nothing: a shut valve has no flow at the start."""


class RuptureDiscRows(RelievingRows, kind="rupture-disc"):
    """Conversion to table rows of rupture discs between two nodes."""

    law, events_only = law_rupture_disc, True
    events = ("bursts",)

    def of(self, part) -> Device:
        if not part.outward:
            return self
        events = ("",) * EVENT_COUNT + self.events
        return self.varied(law=law_rupture_disc_outside, mode=EVENT_COUNT, events=events)

    def own_numbers(self, draft, name, part) -> list[float]:
        return [part.burst_pressure]

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        drop, name = start.valve_drive(k)[0], start.draft.valve_names[k]
        if drop >= part.burst_pressure:
            across = start.case.amount(drop, "pressure", 6, span=True)
            text = f"a drop of {across} at the start would burst the disc; raise `burst_pressure` or remove the disc"
            start.draft.fault(f"links.{name}.burst_pressure", text)
        return []


class SurgeAnticipatingRows(RelievingRows, kind="surge-anticipating"):
    """Conversion to table rows of surge-anticipating valves between two nodes."""

    law = law_surge_anticipating
    states = ("opening", "held")
    events = ("is shut", "opens", "is fully open", "begins to shut", "", "", "")
    remedy = "give the surge-anticipating valve a longer closing_time"

    def of(self, part) -> Device:
        if not part.outward:
            return self
        events = ("",) * EVENT_COUNT + self.events
        return self.varied(law=law_surge_anticipating_outside, mode=EVENT_COUNT, events=events)

    def own_numbers(self, draft, name, part) -> list[float]:
        if part.trip is not None and part.trip < draft.case.numerics.start:
            text = f"{part.trip:g} s lies before the start at {draft.case.numerics.start:g} s"
            draft.fault(f"links.{name}.trip", f"{text}; expected a later time")
        low = -law_surge_anticipating.NEVER if part.low_set is None else part.low_set
        high, trip = (
            law_surge_anticipating.NEVER if value is None else value
            for value in (part.high_set, part.trip)
        )
        place = float(draft.node_index[part.sensed])
        return [part.opening_time, part.hold, part.closing_time, low, high, trip, place]

    def scales(self, draft, name, part) -> list[float]:
        return [0.1, part.hold + part.opening_time]

    def apply_event(self, run_data, row, t, y, scale) -> None:
        at, o = row["event"] + row["mode"], row["y"]
        if run_data.armed[at + law_surge_anticipating.SHUT] > 0.0:
            y[o] = 0.0
        elif run_data.armed[at + law_surge_anticipating.OPENING] > 0.0:
            y[o + 1] = 0.0
        elif run_data.armed[at + law_surge_anticipating.OPEN] > 0.0:
            y[o] = 1.0

    def begin(self, start, part, row) -> list[str]:
        name = start.draft.valve_names[row["valve"]]
        node = start.nodes[start.draft.node_index[part.sensed]]
        p = float(node["pressure"])
        high = part.high_set is not None and float(node["pressure"]) >= part.high_set
        amount = start.case.amount
        if part.low_set is not None and p < part.low_set:
            text = (
                f"{name}: the pressure at {part.sensed} is {amount(p, 'pressure', 6)} at the start, below low_set, "
                f"{amount(part.low_set, 'pressure', 6)}: a low pressure opens the valve only after the pressure "
                "has exceeded low_set"
            )
            start.draft.warnings.append(
                Notice("start", f"links.{name}", text, "low_set", p, part.low_set)
            )
        if not high:
            return []
        return [
            f"{name}: opens at the start, because the pressure at {part.sensed}, {amount(p, 'pressure', 6)}, is not "
            f"below high_set, {amount(part.high_set, 'pressure', 6)}"
        ]
