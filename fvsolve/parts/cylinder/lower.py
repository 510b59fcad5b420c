"""Cylinders in the tables of a model; their chambers are separate nodes."""

from __future__ import annotations

from fvsolve.assembly.mechanics import PushLowering, join_ports
from fvsolve.kernels import dtypes as rec


class CylinderRows(PushLowering, kind="cylinder"):
    """Conversion to table rows of cylinders: a piston between two chambers, and between two masses or two points."""

    table = "piston"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        distance, row["speed"] = join_ports(draft, row, ("case", "rod"), (link.ports["case"], link.ports["rod"]))
        row["position"] = distance - link.closed_length
        row["a"], row["b"] = draft.node_index[f"{name}.A"], draft.node_index[f"{name}.B"]
        row["area_a"], row["area_b"] = link.areas()
        row["stroke"], row["leakage"], row["damping"] = link.stroke, link.leakage, link.viscous_friction

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity == "force":
            return super().probe(draft, name, probe, row)
        row["index"] = draft.piston_names.index(name)
        row["kind"] = rec.PISTON_POSITION if probe.quantity == "position" else rec.PISTON_VELOCITY
