"""Reservoirs in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import HEAD, PRESSURE, Input, scalar_inputs
from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class ReservoirRows(Lowering, kind="reservoir"):
    """Conversion to table rows of reservoirs, whose pressure or head follows a schedule."""

    ledger_name = "reservoir"

    def place(self, draft, name, node, row) -> None:
        row["kind"] = rec.FIXED
        if node.head is not None:
            row["schedule"] = draft.hydraulics.add_head(draft.schedules, node.head, row)
        else:
            row["schedule"] = draft.schedules.add(node.pressure)

    def pressure_at_start(self, start, i, node, row) -> float:
        value = start.schedule_value(row["schedule"])
        return start.law.pressure_under(value - row["elevation"]) if row["head_given"] else value

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return ""

    def inputs(self, model, name, part):
        i, weight = model.node_names.index(name), model.case.properties.density * model.case.gravity
        row = model.tables.nodes[i]
        index, ground = int(row["schedule"]), model.case.ambient_pressure - weight * float(row["elevation"])
        inputs = {"pressure": Input(PRESSURE, index, node=i), "head": Input(HEAD, index, weight, ground, node=i)}
        return inputs | scalar_inputs(model, name)
