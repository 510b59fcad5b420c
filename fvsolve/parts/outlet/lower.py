"""Outlets to ambient, and valves that open to ambient, in the tables of a model."""

from fvsolve.assembly.device_lowering import Device
from fvsolve.assembly.inputs import opening_input
from fvsolve.assembly.lowering import Lowering, Restriction
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.outlet import law

SPAN = 1e5  # default drop at which an outlet has its nominal flow [Pa]


class OutsideRows(Lowering, kind="outside"):
    """Conversion to table rows of nodes at ambient pressure."""

    ledger_name = "outside"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = rec.FIXED, draft.schedules.add_constant(draft.case.ambient_pressure)

    def pressure_at_start(self, start, i, node, row) -> float:
        return start.schedule_value(row["schedule"])

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return ""


class OutletRows(Restriction, kind="outlet"):
    """Conversion to table rows of outlets: links whose flow is a power of the drop."""

    law = law
    events = ("",) * law.EVENT_COUNT

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening, 1.0 / link.full)
        row["conductance"] = (draft.fluid.density * link.flow) ** 2 / self.span(draft, link)

    def numbers(self, draft, name, link) -> list[float]:
        return [link.exponent, self.least(draft, link), self.span(draft, link), link.most]

    def least(self, draft, link) -> float:
        """Drop [Pa] at which the flow of an outlet begins."""
        return 0.0 if link.least is None else link.least - draft.case.ambient_pressure

    def span(self, draft, link) -> float:
        """Drop at the nominal flow of an outlet minus the drop at which its flow begins [Pa]."""
        return SPAN if link.upper is None else link.upper - draft.case.ambient_pressure - self.least(draft, link)

    def inputs(self, model, name, part):
        return opening_input(model, name)


class RelievingRows(Device, kind=""):
    """Conversion to table rows of valves that are shut at the start and may open to another node or to ambient.

    mode : count of the parameters, and of the event flags, of an outlet that precede those of the valve; 0 for a valve
    between two nodes
    """

    quantities = ("opening",)

    def own_numbers(self, draft, name, part) -> list[float]:
        """Parameters of the law of the valve; for a valve to ambient, `numbers` puts those of an outlet before them."""
        raise NotImplementedError

    def numbers(self, draft, name, part) -> list[float]:
        return [0.5, 0.0, SPAN, law.NO_LIMIT][: self.mode] + self.own_numbers(draft, name, part)

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        new = k not in start.shut
        start.shut |= {k}
        return new

    def follow(self, start, k) -> None:
        """Do nothing: a shut valve has no flow at the start."""
