"""Spool valves in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import POSITION, Input
from fvsolve.assembly.lowering import Restriction
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.spool_valve.part import EDGES

FLOWS = {  # flow into the link at a port: weights of its four edges
    f"flow_{port}": [float((port == start) - (port == end)) for start, end, _ in EDGES] for port in "PTAB"
}


class SpoolValveRows(Restriction, kind="spool-valve"):
    """Conversion to table rows of spool valves: four rows for each valve, one for each metering edge.

    The two edges that open on the same side of position zero have one opening schedule.
    """

    rows, rank = len(EDGES), 1

    def fill(self, draft, name, link, rows) -> None:
        parts = {side: draft.schedules.add_part(link.position, side) for side in (1, -1)}
        for (start, end, side), row in zip(EDGES, rows, strict=True):
            row["from_node"], row["to_node"] = (draft.node_index[link.ports[port]] for port in (start, end))
            row["schedule"] = parts[side]
            self.restriction(draft, name, link, row)

    def row_names(self, name) -> list[str]:
        return [f"{name}.{start}-{end}" for start, end, _ in EDGES]

    def probe(self, draft, name, probe, row) -> None:
        row["index"], row["kind"] = draft.valve_names.index(name), rec.SPOOL_FLOW
        row["weights"] = len(draft.floats)
        draft.floats += FLOWS[probe.quantity]

    def inputs(self, model, name, part):
        first = model.valve_names.index(name)
        above, below = (int(model.tables.valves[first + k]["schedule"]) for k in (0, 1))
        return {"position": Input(POSITION, above, other=below)}
