"""External forces in the tables of a model."""

from __future__ import annotations

import numpy as np

from fvsolve.assembly.inputs import FORCE, Input
from fvsolve.assembly.lowering import rows_in
from fvsolve.assembly.mechanics import PushLowering, join_ports
from fvsolve.kernels import dtypes as rec


class ForceRows(PushLowering, kind="force"):
    """Conversion to table rows of external forces, which follow a schedule."""

    ledger_name = "supplied"
    table, rank = "brace", 2

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        direction = () if link.direction is None else (rec.TOWARD, link.direction / np.linalg.norm(link.direction))
        _, row["speed"] = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to), *direction)
        row["schedule"] = draft.schedules.add(link.force)

    def inputs(self, model, name, part):
        return {"force": Input(FORCE, brace_of(model, name)["schedule"].item())}


def brace_of(model, name: str):
    """Row of the link `name` in the table of braces (springs, dampers, forces)."""
    return model.tables.braces[[link for link, _, _ in rows_in(model.case, "brace")].index(name)]
