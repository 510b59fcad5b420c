"""Surge-anticipating valves: keys and faults."""

from typing import Annotated, Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.outlet.part import Relieving
from fvsolve.parts.regulating.part import STROKES
from fvsolve.parts.value import Quantity, Text, nonnegative, positive
from fvsolve.units import show


class SurgeAnticipating(Relieving, kind="surge-anticipating"):
    """Valve that opens at a pressure below `low_set`, or at `trip`, stays open for the time `hold`, and then shuts.

    A pressure above `high_set` opens it while the pressure lasts. q = x Cd A sqrt(2 |dp| / rho) sign(dp), with flow q
    and drop dp; the opening x moves at the constant rates 1 / opening_time and 1 / closing_time. Without `to` the valve
    opens to ambient at the elevation of its place, without backflow. Ports: from, to. Stored energy: none. Dissipated
    power: dp q [W].
    """

    low_set: Annotated[
        float | None,
        Quantity(
            "pressure", about="pressure at `senses` below which the valve opens, gauge or absolute by its unit [Pa]"
        ),
    ] = None
    high_set: Annotated[
        float | None,
        Quantity(
            "pressure", about="pressure at `senses` above which the valve opens, gauge or absolute by its unit [Pa]"
        ),
    ] = None
    trip: Annotated[
        float | None, Quantity("time", about="time at which the valve opens regardless of pressure [s]")
    ] = None
    senses: Annotated[str | None, Text("place whose pressure opens the valve; `from` if left out")] = None
    opening_time: Annotated[float, Quantity("time", positive, "time from shut to fully open [s]", STROKES)]
    hold: Annotated[
        float, Quantity("time", nonnegative, "time for which the valve stays fully open after `low_set` or `trip` [s]")
    ] = 0.0
    closing_time: Annotated[float, Quantity("time", positive, "time from fully open to shut [s]", STROKES)]

    @property
    def sensed(self) -> str:
        """Place whose pressure opens the valve."""
        return self.from_ if self.senses is None else self.senses

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if not {"low_set", "high_set", "trip"} & set(given):
            faults.append(((), "nothing opens the valve; expected the key `low_set`, `high_set` or `trip`"))
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        if self.low_set is not None and self.high_set is not None and not self.low_set < self.high_set:
            text = f"{self.high_set:.6g} Pa is not above low_set, {self.low_set:.6g} Pa"
            yield ("high_set",), f"{text}; expected a higher pressure"
        places = [place for place, node in around.nodes.items() if getattr(node, "domain", "") == "hydraulic"]
        if self.senses is not None and self.senses not in places:
            near = did_you_mean(self.senses, places)
            yield (
                ("senses",),
                f"unknown place of the fluid {show(self.senses)}; expected one of {listing(places)}{near}",
            )
