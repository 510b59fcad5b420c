"""End stops in the tables of a model."""

from __future__ import annotations

from fvsolve.assembly.mechanics import PushLowering, join_ports

NO_STOP = 1e300  # distance to a stop that does not exist


class EndStopRows(PushLowering, kind="end-stop"):
    """Conversion to table rows of end stops: a spring and a damper that act while two bodies are in contact."""

    table = "stop"

    def fill(self, draft, name, link, rows) -> None:
        from fvsolve.kernels.mass_dynamics import contact_force  # not loaded by models without bodies

        (row,) = rows
        x, speed = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["stiffness"], row["damping"] = link.stiffness, link.damping
        row["below"] = NO_STOP if link.minimum is None else x - link.minimum
        row["above"] = NO_STOP if link.maximum is None else link.maximum - x
        for distance, sign in ((float(row["below"]), 1.0), (float(row["above"]), -1.0)):
            if distance <= 0.0:
                row["force"] += sign * contact_force(
                    float(link.stiffness), float(link.damping), -distance, float(-sign * speed)
                )
