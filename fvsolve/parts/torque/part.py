"""A torque from outside on a shaft. Knows its course; knows no shaft."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.link import Link
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Text


class Torque(Link, kind="torque"):
    """torque(t) on the shaft `to`, which then turns as it and the fluid have it.

    Ports: to. Stored and dissipated energy: none; it brings torque times angular velocity [W].
    """

    joins: ClassVar[dict[str, str]] = {"to": "rotational"}
    quantities: ClassVar[dict[str, str]] = {}

    to: Annotated[str, Text("the shaft it turns, PUMP.shaft")]
    torque: Annotated[Schedule, Scheduled("torque", about="in the direction in which a pump is driven [N m]")]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"to": self.to}

    def faults(self, name: str, around: Around) -> Faults:
        pump = around.links.get(self.to.removesuffix(".shaft"))
        if getattr(pump, "kind", "") != "pump":
            return
        if pump.inertia is None:
            yield ("to",), f"{self.to} has no inertia, so no torque can turn it; give the pump inertia"
        if pump.trip is not None:
            text = "is held by its motor until it trips; leave trip out, and let the torque fall to 0 in its place"
            yield ("to",), f"{self.to} {text}"
