"""A valve that opens ahead of a surge and shuts slowly. Knows its settings and times; evaluates no flow."""

from __future__ import annotations

from typing import Annotated, Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.around import Around, Faults
from fvsolve.parts.outlet.part import Relieving
from fvsolve.parts.regulating.part import STROKES
from fvsolve.parts.value import Quantity, Text, nonnegative, positive
from fvsolve.units import show


class SurgeAnticipating(Relieving, kind="surge-anticipating"):
    """q = x Cd A sqrt(2 |dp| / rho) sign(dp); a pressure below low_set, or `trip`, opens it for `hold`, then it shuts.

    A pressure above high_set opens it for as long as it lasts. x moves at even speed, 1 / opening_time and
    1 / closing_time. Without `to` it opens to ambient on the level of its place, from where nothing comes back. Ports:
    from, to. Stored energy: none. Dissipated power: dp q [W].
    """

    low_set: Annotated[
        float | None,
        Quantity("pressure", about="at `senses`, below which it opens, gauge or absolute by its unit"),
    ] = None
    high_set: Annotated[float | None, Quantity("pressure", about="at `senses`, above which it opens, likewise")] = None
    trip: Annotated[float | None, Quantity("time", about="at which it opens in any case")] = None
    senses: Annotated[str | None, Text("the place whose pressure opens it; `from` if left out")] = None
    opening_time: Annotated[float, Quantity("time", positive, "from shut to fully open", STROKES)]
    hold: Annotated[
        float, Quantity("time", nonnegative, "that it stays fully open after low_set or trip have opened it")
    ] = 0.0
    closing_time: Annotated[float, Quantity("time", positive, "from fully open to shut", STROKES)]

    @property
    def sensed(self) -> str:
        """The place whose pressure opens it."""
        return self.from_ if self.senses is None else self.senses

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if not {"low_set", "high_set", "trip"} & set(given):
            faults.append(((), "nothing opens it; wanted low_set, high_set or trip"))
        return faults

    def faults(self, name: str, around: Around) -> Faults:
        yield from super().faults(name, around)
        if self.low_set is not None and self.high_set is not None and not self.low_set < self.high_set:
            yield ("high_set",), f"{self.high_set:.6g} Pa is not above low_set, {self.low_set:.6g} Pa; set it higher"
        places = [place for place, node in around.nodes.items() if getattr(node, "domain", "") == "hydraulic"]
        if self.senses is not None and self.senses not in places:
            near = did_you_mean(self.senses, places)
            yield ("senses",), f"no place of the fluid named {show(self.senses)}; places are {listing(places)}{near}"
