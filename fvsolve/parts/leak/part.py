"""Leaks and emitters: keys and faults."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Link
from fvsolve.parts.outlet.part import outlet_to_ambient
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.value import Number, Text, UsualRange, between, positive


class Leak(Link, kind="leak"):
    """A leak or emitter, q = opening coefficient (p - ambient)^exponent; no flow where the pressure p is below ambient.

    Port: from; the outflow is at the elevation of its node. Below 10 Pa, a millimetre of head, a cubic joins the power
    law to zero flow. Stored energy: none. Dissipated power: (p - ambient) q [W].
    """

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic"}

    from_: Annotated[str, Text("place of the leak"), Field(alias="from")]
    coefficient: Annotated[
        float,
        Number(
            positive, "flow in m3/s at a pressure drop of 1 Pa", UsualRange(1e-15, 0.1, "seeping to a main torn off")
        ),
    ]
    exponent: Annotated[
        float, Number(between(0, 3, open=True), "exponent of the pressure drop, 0.5 for a hole of fixed size")
    ] = 0.5
    opening: Annotated[Schedule, Scheduled("number", between(0, 1), "relative opening, a factor of `coefficient`")] = (
        Field(default_factory=lambda: constant(1.0))
    )

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"from": self.from_}

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        law = {"flow": self.coefficient * 1e5**self.exponent, "exponent": self.exponent, "opening": self.opening}
        return outlet_to_ambient(name, self.from_, **law)

    def faults(self, name: str, around: CaseContext) -> Faults:
        if getattr(around.nodes.get(self.from_), "kind", "") == "reservoir":
            text = "is a reservoir, whose pressure a leak cannot change; expected a junction, a tank or another place"
            yield ("from",), f"{self.from_} {text}"
