"""Bushings in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.lowering import Lowering
from fvsolve.assembly.mechanics import point_row, pose_of
from fvsolve.kernels import dtypes as rec


class BushingRows(Lowering, kind="bushing"):
    """Conversion to table rows of bushings: three forces and three torques between two bodies."""

    table = "bushing"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        row["from_point"], row["to_point"] = point_row(draft, link.from_), point_row(draft, link.to)
        row["stiffness"], row["damping"] = link.stiffness, link.damping
        row["turn_stiffness"], row["turn_damping"] = link.rotational_stiffness, link.rotational_damping
        poses = [pose_of(draft, end) for end in (link.from_, link.to)]
        row["attitude"] = (poses[0].attitude.T @ poses[1].attitude).ravel()

    def probe(self, draft, name, probe, row) -> None:
        row["kind"], row["side"] = rec.BUSHING_VALUE, ("gap", "force", "torque").index(probe.quantity)
        row["index"] = draft.bushing_names.index(name)
