"""Ways out to ambient in the tables of a scene."""

from __future__ import annotations

from fvsolve.model.lowering import Lowering
from fvsolve.parts.outlet import law


class Outlet(Lowering, kind="outlet"):
    """Its flow a power of the drop."""

    law = law
    events = ("",) * law.EVENTS

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening, 1.0 / link.full)
        row["conductance"] = (draft.fluid.density * link.flow) ** 2 / self.span(draft, link)

    def numbers(self, draft, name, link) -> list[float]:
        return [link.exponent, self.least(draft, link), self.span(draft, link), link.most]

    def least(self, draft, link) -> float:
        """Drop from which on it lets something out [Pa]."""
        return 0.0 if link.least is None else link.least - draft.case.ambient_pressure

    def span(self, draft, link) -> float:
        """From there to the drop at which it lets out its flow [Pa]."""
        return 1e5 if link.upper is None else link.upper - draft.case.ambient_pressure - self.least(draft, link)
