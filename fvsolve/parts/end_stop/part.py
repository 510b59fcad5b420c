"""End stops between two bodies: keys and faults."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.link import Coupling
from fvsolve.parts.value import VALUE, Quantity, nonnegative, positive


class EndStop(Coupling, kind="end-stop"):
    """Contact outside least <= x_to - x_from <= greatest, at depth d with force max(0, stiffness d + damping dd/dt).

    Ports: from, to; the force pushes `to` forward, so it is negative at `greatest`; it never pulls. Stored energy:
    stiffness d^2 / 2 [J]. Dissipated power: (force - stiffness d) dd/dt [W].
    """

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("least", "greatest"),)

    stiffness: Annotated[float, Quantity("stiffness", positive, "stiffness of the contact [N/m]", changes=VALUE)]
    damping: Annotated[float, Quantity("damping", nonnegative, "damping of the contact [N s/m]", changes=VALUE)] = 0.0
    least: Annotated[
        float | None, Quantity("position", about="x_to - x_from below which the stop acts [m]", changes=VALUE)
    ] = None
    greatest: Annotated[
        float | None, Quantity("position", about="x_to - x_from above which the stop acts [m]", changes=VALUE)
    ] = None

    def faults(self, name: str, around: Around) -> Faults:
        if None not in (self.least, self.greatest) and self.least >= self.greatest:
            yield ("greatest",), f"{self.greatest:g} m is not above least, {self.least:g} m"
