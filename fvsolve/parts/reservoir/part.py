"""Reservoirs: nodes of given pressure or head."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve import units
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.node import PlaceOnBody
from fvsolve.parts.schedule import Schedule, Scheduled


class Reservoir(PlaceOnBody, kind="reservoir"):
    """A place of given pressure, p = pressure(t) or p = ambient + rho g (head(t) - elevation) [Pa].

    Ports: any number, with any flow. Stored energy: none. The energy ledger books energy through its ports as work done
    on the network. Dissipated energy: none.
    """

    driven: ClassVar[tuple[str, float]] = "pressure", 0.0
    own_scalars: ClassVar[str] = "inflow"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("pressure", "head"),)
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("pressure", "head"),)
    fixes_pressure: ClassVar[bool] = True

    pressure: Annotated[
        Schedule | None, Scheduled("pressure", about="pressure at the elevation of the reservoir [Pa]")
    ] = None
    head: Annotated[Schedule | None, Scheduled("head", about="head above datum, relative to ambient pressure [m]")] = (
        None
    )

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.pressure is not None:
            yield from around.boiling_faults("nodes", name, "pressure", self.pressure.value.tolist())
        if self.head is None or around.gravity is None or around.fluid is None:
            return
        head, boiling, height = float(self.head.value.min()), around.fluid.vapor_pressure, self.elevation or 0.0
        pressure = around.ambient + around.fluid.density * around.gravity * (head - height)
        if pressure <= boiling:
            place = f"a head of {head:g} m at elevation {height:g} m"
            yield ("head",), f"{place}: {units.vacuum(pressure, pressure, boiling)}"
