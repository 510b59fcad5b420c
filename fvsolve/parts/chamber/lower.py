"""Closed volumes in the tables of a model: chambers, and the chambers of cylinders."""

from __future__ import annotations

from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


def joins_masses(case, cylinder) -> bool:
    """True if both ends of a cylinder are masses or frames on one axis, not points of bodies."""
    ends = [cylinder.ports[port] for port in ("case", "rod")]
    return all(getattr(case.nodes.get(end), "domain", "") == "translational" for end in ends)


class ChamberRows(Lowering, kind="chamber"):
    """Conversion to table rows of chambers: nodes whose pressure follows from the mass of the fluid in them."""

    def place(self, draft, name, node, row) -> None:
        moving, air = name in draft.owned, draft.fluid.air
        row["kind"], row["volume"] = rec.MOVING if moving else rec.CHAMBER, node.volume
        row["stiffness"] = draft.fluid.bulk_modulus / (draft.fluid.density * node.volume)
        swept = moving and joins_masses(draft.case, draft.case.links[name.rpartition(".")[0]])
        row["y"] = draft.states([f"{name}.{'excess' if swept else 'mass'}"], 1e5 / row["stiffness"])
        if moving or (air is not None and air.fraction > 0.0):  # air makes the stiffness depend on pressure
            row["row"] = draft.stiff()

    def pressure_at_start(self, start, i, node, row) -> float | None:
        if node.initial_pressure is not None:
            return node.initial_pressure
        return start.case.ambient_pressure if row["kind"] == rec.MOVING and not start.is_joined(i) else None

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return f"chamber {name}: pressure changes by {amount(row['stiffness'] * inflow, 'pressure', span=True)}/s"
