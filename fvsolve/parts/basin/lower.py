"""Patches of basins, which are nodes in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class PatchRows(Lowering, kind="patch"):
    """Conversion to table rows of patches of basins: nodes with the pressure of the cells behind the patch."""

    ledger_name = "dry patch"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["row"] = rec.PATCH, draft.stiff()

    def pressure_at_start(self, start, i, node, row) -> float:
        if node.pressure is not None:
            return node.pressure
        return start.law.pressure_under(node.depth) if node.depth else start.case.ambient_pressure

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return f"basin {name}: {amount(flow, 'flow')} flow in"

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity in ("force", "power", "travel"):
            row["kind"], row["index"] = rec.WALL_VALUE, draft.wall_names.index(name)
            row["side"] = ("force", "power", "travel").index(probe.quantity)
        elif probe.quantity != "flow":
            super().probe(draft, name, probe, row)
        else:
            self.probe_flow(draft, name, row)

    def probe_flow(self, draft, name, row) -> None:
        """Fill the row of a probe for the flow through a patch into the basin."""
        row["index"], row["kind"], row["scale"] = draft.node_index[name], rec.PATCH_FLOW, 1.0 / draft.fluid.density
        if not draft.case.nodes[draft.case.places[name].basin].physics_type.joined:
            row["index"], row["kind"] = draft.patch_table["node"].tolist().index(row["index"]), rec.GIVEN_FLOW
