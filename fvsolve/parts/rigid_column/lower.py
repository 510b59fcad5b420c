"""Rigid columns in the tables of a model."""

from __future__ import annotations

import math

from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class RigidColumnRows(Lowering, kind="rigid-column"):
    """Conversion to table rows of rigid columns, each with its flow as state."""

    table = "column"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.ends(link, row)
        row["area"], row["length"] = math.pi / 4.0 * link.diameter**2, link.length
        draft.hydraulics.friction(name, link, row, draft.fault)
        row["y"] = draft.states([f"{name}.flow"], 0.1 * draft.fluid.density * row["area"])

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["index"] = rec.COLUMN_FLOW, draft.column_names.index(name)
