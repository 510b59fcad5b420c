"""Given inflows in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import FLOW, Input, scalar_inputs
from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class InflowRows(Lowering, kind="inflow"):
    """Conversion to table rows of inflows: junctions with a negative demand."""

    ledger_name = "inflow"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = rec.JUNCTION, draft.schedules.add(node.flow, -draft.fluid.density)

    def inputs(self, model, name, part):
        schedule = int(model.tables.nodes[model.node_names.index(name)]["schedule"])
        return {"flow": Input(FLOW, schedule, -model.case.properties.density), **scalar_inputs(model, name)}
