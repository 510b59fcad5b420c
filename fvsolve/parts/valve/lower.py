"""Valves and orifices in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import opening_input
from fvsolve.assembly.lowering import LAMINAR_REYNOLDS, Restriction


class ValveRows(Restriction, kind="valve"):
    """Conversion to table rows of valves: a square-root law, whose conductance follows a schedule of the opening."""

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening)
        super().restriction(draft, name, link, row)
        if link.characteristic == "equal-percentage":
            row["characteristic"] = 1
        elif link.characteristic != "linear":
            row["characteristic"], row["table"] = 2, len(draft.floats)
            row["table_size"] = len(link.characteristic.opening)
            draft.floats += [*link.characteristic.opening, *link.characteristic.flow_area]

    def resize(self, draft, name, before, part, row) -> bool:
        others = part.opening != before.opening or part.characteristic != before.characteristic
        if others or row["hooks"] >= 0 or (part.laminar_reynolds is None) != (before.laminar_reynolds is None):
            return False
        softened = part.laminar_reynolds is None and row["transition"] > 0.0
        draft.restriction(name, part, row)
        if softened:
            row["transition"] = draft.hydraulics.transition_flow(name, part, LAMINAR_REYNOLDS, draft.fault)
        return True

    def inputs(self, model, name, part):
        return opening_input(model, name)
