"""Closed volumes of fluid: keys and faults."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.node import PlaceOnBody
from fvsolve.parts.value import VALUE, Quantity, UsualRange, positive


class Chamber(PlaceOnBody, kind="chamber"):
    """A rigid vessel full of fluid, (V / beta) dp/dt = net flow into it; V `volume`, p pressure, beta bulk modulus.

    Ports: any number (docs/course.md, 80). Stored energy, p above ambient: V p^2 / (2 beta) [J] under the density law
    `linear`, V (beta (exp(p / beta) - 1) - p) under the law `log`. Dissipated energy: none.
    """

    own_scalars: ClassVar[str] = "start"
    fixes_pressure: ClassVar[bool] = True

    volume: Annotated[
        float,
        Quantity("volume", positive, "volume of fluid [m3]", UsualRange(1e-10, 1e5, "cylinders to caverns"), VALUE),
    ]
    initial_pressure: Annotated[
        float | None, Quantity("pressure", about="pressure at the start [Pa]; that of the steady state if left out")
    ] = None

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.initial_pressure is not None:
            yield from around.boiling_faults("nodes", name, "initial_pressure", [self.initial_pressure])
