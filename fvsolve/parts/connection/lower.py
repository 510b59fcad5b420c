"""Connections of vessels in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import opening_input
from fvsolve.assembly.lowering import Restriction


class ConnectionRows(Restriction, kind="connection"):
    """Conversion to table rows of the throats of vessels: restrictions with a loss coefficient for each direction."""

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"], row["back"] = draft.schedules.add_constant(1.0), link.outflow_ratio
        super().restriction(draft, name, link, row)

    def inputs(self, model, name, part):
        return opening_input(model, name)
