"""Pins in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.lowering import Lowering
from fvsolve.assembly.mechanics import point_row
from fvsolve.kernels import dtypes as rec


class PinRows(Lowering, kind="pin"):
    """Conversion to table rows of pins: loop constraints between two points."""

    table = "pin"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        row["from_point"], row["to_point"] = point_row(draft, link.from_), point_row(draft, link.to)
        directions = link.directions()
        row["rows"], row["pull"] = len(directions), link.stabilisation
        row["directions"][: directions.size] = directions.ravel()

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["side"] = rec.PIN_VALUE, ("gap", "force").index(probe.quantity)
        row["index"] = draft.pin_names.index(name)
