"""End stops between two bodies: keys and faults."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Coupling
from fvsolve.parts.value import VALUE, Quantity, nonnegative, positive


class EndStop(Coupling, kind="end-stop"):
    """Contact of two bodies where x_to - x_from is below `minimum` or above `maximum`; x is the position of a port.

    At the depth d beyond the limit the force is max(0, stiffness d + damping dd/dt). Ports: from, to; the force pushes
    `to` forward at `minimum` and backward (negative) at `maximum`; it never pulls. Stored energy: stiffness d^2 / 2
    [J]. Dissipated power: (force - stiffness d) dd/dt [W].
    """

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("minimum", "maximum"),)

    stiffness: Annotated[float, Quantity("stiffness", positive, "stiffness of the contact [N/m]", changes=VALUE)]
    damping: Annotated[float, Quantity("damping", nonnegative, "damping of the contact [N s/m]", changes=VALUE)] = 0.0
    minimum: Annotated[
        float | None, Quantity("position", about="x_to - x_from below which the stop acts [m]", changes=VALUE)
    ] = None
    maximum: Annotated[
        float | None, Quantity("position", about="x_to - x_from above which the stop acts [m]", changes=VALUE)
    ] = None

    def faults(self, name: str, around: CaseContext) -> Faults:
        if None not in (self.minimum, self.maximum) and self.minimum >= self.maximum:
            yield (
                ("maximum",),
                f"{self.maximum:g} m is not above `minimum`, {self.minimum:g} m; expected a greater value",
            )
