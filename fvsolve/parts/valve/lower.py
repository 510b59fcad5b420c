"""Valves and orifices in the tables of a model."""

from __future__ import annotations

from fvsolve.model.inputs import opening
from fvsolve.model.lowering import Restriction


class ValveRows(Restriction, kind="valve"):
    """A root whose conductance follows a schedule."""

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening)
        super().restriction(draft, name, link, row)
        if link.characteristic == "equal-percentage":
            row["characteristic"] = 1
        elif link.characteristic != "linear":
            row["characteristic"], row["table"] = 2, len(draft.floats)
            row["table_size"] = len(link.characteristic.opening)
            draft.floats += [*link.characteristic.opening, *link.characteristic.flow_area]

    def inputs(self, model, name, part):
        return opening(model, name)
