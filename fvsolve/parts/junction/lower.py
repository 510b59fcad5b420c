"""Junctions in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import FLOW, Input
from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class JunctionRows(Lowering, kind="junction"):
    """Conversion to table rows of junctions, at which the flows add up to the demand."""

    ledger_name = "demand"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = rec.JUNCTION, draft.schedules.add(node.demand, draft.fluid.density)

    def inputs(self, model, name, part):
        schedule = int(model.tables.nodes[model.node_names.index(name)]["schedule"])
        return {"demand": Input(FLOW, schedule, model.case.properties.density)}
