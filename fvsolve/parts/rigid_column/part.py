"""A conduit whose fluid moves as one body. Knows its size and friction; computes nothing."""

from __future__ import annotations

from typing import Any, ClassVar

from fvsolve.parts.conduit import Conduit


class RigidColumn(Conduit, kind="rigid-column"):
    """An incompressible pipe, (rho length / A) dq/dt = drop of p + rho g z - friction; one state, its flow q.

    Ports: from, to. Stored energy: rho length q^2 / (2 A) [J]. Dissipated power: friction and minor loss,
    pressure drop times flow [W].
    """

    no_scalars: ClassVar[str] = "it has no cells to carry scalars; use a pipe"

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        law = given.get("friction")
        if isinstance(law, dict) and law.get("model") == "unsteady":
            message = 'no "unsteady" friction in a rigid column; wanted "quasi-steady", or a pipe'
            return [*super().key_faults(given), (("friction", "model"), message)]
        return super().key_faults(given)
