"""Dampers in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.mechanics import PushLowering, join_ports


class DamperRows(PushLowering, kind="damper"):
    """Conversion to table rows of dampers: a force proportional to the relative velocity of two bodies."""

    ledger_name = "dissipated"
    table, rank = "brace", 1

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        _, row["speed"] = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["schedule"], row["damping"], row["force"] = -1, link.damping, -link.damping * row["speed"]
