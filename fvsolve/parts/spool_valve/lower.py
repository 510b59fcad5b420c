"""Spool valves in the tables of a model."""

from __future__ import annotations

from fvsolve.model.inputs import POSITION, Input
from fvsolve.model.lowering import Restriction
from fvsolve.parts.spool_valve.part import EDGES


class SpoolValve(Restriction, kind="spool-valve"):
    """Four valves; those of one side of zero share a schedule of their opening."""

    rows, rank = len(EDGES), 1

    def fill(self, draft, name, link, rows) -> None:
        parts = {side: draft.schedules.add_part(link.position, side) for side in (1, -1)}
        for (start, end, side), row in zip(EDGES, rows, strict=True):
            row["from_node"], row["to_node"] = (draft.node_index[link.ports[port]] for port in (start, end))
            row["schedule"] = parts[side]
            self.restriction(draft, name, link, row)

    def inputs(self, model, name, part):
        first = model.valve_names.index(name)
        above, below = (int(model.tables.valves[first + k]["schedule"]) for k in (0, 1))
        return {"position": Input(POSITION, above, other=below)}
