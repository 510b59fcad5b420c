"""Spool valves with four metering edges."""

from typing import Annotated, ClassVar

from fvsolve.assembly.inputs import POSITION, Input
from fvsolve.assembly.lowering import Restriction
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.link import Link, Ports
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import SHAPE, between
from fvsolve.parts.valve import Sized

EDGES = (
    ("P", "A", 1),
    ("P", "B", -1),
    ("A", "T", -1),
    ("B", "T", 1),
)  # from, to, sign of the position at which it opens


class SpoolValve(Sized, Link, kind="spool-valve"):
    """Zero-lapped spool valve: edges P-A and B-T open by `position` above 0, edges P-B and A-T by -`position` below 0.

    Each edge is a valve, q = |position| Cd A sqrt(2 |dp| / rho) sign(dp), with flow q and drop dp (docs/course.md, 79).
    Ports: P, T, A, B; at position 0 there is no flow. Stored energy: none. Dissipated power: dp q [W], summed over the
    edges.
    """

    joins: ClassVar[dict[str, str]] = dict.fromkeys(("P", "T", "A", "B"), "hydraulic")
    quantities: ClassVar[dict[str, str]] = {f"flow_{port}": "flow" for port in ("P", "T", "A", "B")}

    ports: Annotated[dict[str, str], Ports(("P", "T", "A", "B"))]
    position: Annotated[  # the schedule is divided where it crosses zero
        Schedule, Scheduled("number", between(-1, 1), "position of the spool, -1 to 1", changes=SHAPE)
    ]


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
