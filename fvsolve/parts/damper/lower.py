"""Dampers in the tables of a model."""

from __future__ import annotations

from fvsolve.model.bodies import Push, join


class DamperRows(Push, kind="damper"):
    """A force by the speed between two bodies."""

    books = "dissipated"
    table, rank = "brace", 1

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        _, row["speed"] = join(draft, row, ("from_body", "to_body"), (link.from_, link.to))
        row["schedule"], row["damping"], row["force"] = -1, link.damping, -link.damping * row["speed"]
