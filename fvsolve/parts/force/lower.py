"""Forces from outside in the tables of a model."""

from __future__ import annotations

from fvsolve.model.inputs import FORCE, Input
from fvsolve.model.lowering import rows_in
from fvsolve.model.masses import Push, join


class ForceRows(Push, kind="force"):
    """A force by a schedule."""

    books = "supplied"
    table, rank = "brace", 2

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        _, row["speed"] = join(draft, row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["schedule"] = draft.schedules.add(link.force)

    def inputs(self, model, name, part):
        place = [one for one, _, _ in rows_in(model.case, "brace")].index(name)
        return {"force": Input(FORCE, int(model.tables.braces[place]["schedule"]))}
