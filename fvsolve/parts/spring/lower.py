"""Springs in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.mechanics import PushLowering, join_ports


class SpringRows(PushLowering, kind="spring"):
    """Conversion to table rows of springs: a force that depends on the distance of two bodies."""

    ledger_name = "stored"
    table, rank = "brace", 0

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        x, row["speed"] = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["schedule"], row["stiffness"] = -1, link.stiffness
        row["force"] = -link.stiffness * (x - link.free_length) if link.preload is None else link.preload
        if link.preload is not None and draft.case.equilibrium_nodes:
            row["force"] -= link.stiffness * (x - draft.case.as_stated.separation(link.from_, link.to))
