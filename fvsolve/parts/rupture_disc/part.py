"""A disc that bursts once and stays open. Knows its size and strength; evaluates no flow."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.disc.part import DROPS
from fvsolve.parts.link import Link
from fvsolve.parts.outlet.part import Outside
from fvsolve.parts.value import Quantity, Text, positive
from fvsolve.parts.valve.part import Sized


class RuptureDisc(Sized, Link, kind="rupture-disc"):
    """Shut until p_from - p_to passes burst_pressure, then for good q = Cd A sqrt(2 |dp| / rho) sign(dp).

    Without `to` it opens to ambient on the level of its place, from where nothing comes back. Ports: from, to. Stored
    energy: none. Dissipated power: dp q [W].
    """

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic", "to": "hydraulic"}
    may_lack: ClassVar[tuple[str, ...]] = ("to",)
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    from_: Annotated[str, Text("the place that it guards"), Field(alias="from")]
    to: Annotated[str | None, Text("the place it opens to; ambient if left out")] = None
    burst_pressure: Annotated[
        float, Quantity("pressure_drop", positive, "of `from` over what lies behind it, above which it bursts", DROPS)
    ]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"from": self.from_} | ({} if self.to is None else {"to": self.to})

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        if self.to is not None:
            return {}, {name: self}
        given = vars(self) | {"to": f"{name}.outside"}
        return {given["to"]: Outside.model_construct(level_of=self.from_)}, {name: ToAmbient.model_construct(**given)}

    def faults(self, name: str, around: Around) -> Faults:
        if self.to is None and getattr(around.nodes.get(self.from_), "kind", "") == "reservoir":
            text = "is a reservoir, whose pressure no disc relieves; wanted a junction, a tank or another place"
            yield ("from",), f"{self.from_} {text}"


class ToAmbient(RuptureDisc):
    """One that opens to ambient, its `to`."""
