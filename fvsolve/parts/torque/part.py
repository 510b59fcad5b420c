"""A torque from outside on a shaft. Knows its course; knows no shaft."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.link import Link
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Text


class Torque(Link, kind="torque"):
    """torque(t) on the shaft `to`, which then turns as it and the fluid have it.

    Ports: to. Stored and dissipated energy: none; it brings torque times angular velocity [W].
    """

    joins: ClassVar[dict[str, str]] = {"to": "rotational"}
    quantities: ClassVar[dict[str, str]] = {}

    to: Annotated[str, Text("the shaft it turns, for example pump.shaft")]
    torque: Annotated[Schedule, Scheduled("torque", about="in the direction in which a pump is driven [N m]")]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"to": self.to}
