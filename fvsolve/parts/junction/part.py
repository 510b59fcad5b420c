"""Junctions and their demands: keys and faults."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.node import PlaceOnBody
from fvsolve.parts.outlet.part import outlet_to_ambient
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.value import Number, Quantity, between


class Junction(PlaceOnBody, kind="junction"):
    """A node without volume: the flows into its links and its demand sum to zero.

    Ports: any number. Stored energy: none. Dissipated energy: none; the demand removes p times demand [W], p its
    pressure.

    With a `required_pressure` the flow is demand ((p - minimum) / (required - minimum))^demand_exponent: 0 up to
    `minimum_pressure`, the full demand from `required_pressure` on (Wagner, Shamir and Marks 1988). It flows out to
    ambient, and (p - ambient) times the flow is dissipated [W].
    """

    driven: ClassVar[tuple[str, float]] = "demand", -1.0

    demand: Annotated[Schedule, Scheduled("flow", about="demand at reference density, positive outward [m3/s]")] = (
        Field(default_factory=lambda: constant(0.0))
    )
    required_pressure: Annotated[
        float | None,
        Quantity("pressure", about="pressure from which the full demand is supplied [Pa]; always supplied if left out"),
    ] = None
    minimum_pressure: Annotated[
        float | None, Quantity("pressure", about="pressure up to which no demand is supplied [Pa]; ambient if left out")
    ] = None
    demand_exponent: Annotated[
        float,
        Number(
            between(0, 3, open=True),
            "exponent of the supplied demand over pressure, between minimum_pressure and required_pressure",
        ),
    ] = 0.5

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        if self.required_pressure is None:
            return {name: self}, {}
        full = float(self.demand.value.max())
        law = {"flow": full, "exponent": self.demand_exponent, "opening": self.demand, "full": full, "most": 1.0}
        law |= {"least": self.minimum_pressure, "upper": self.required_pressure}
        places, links = outlet_to_ambient(f"{name}.demand", name, **law)
        return {name: self.model_copy(update={"demand": constant(0.0), "required_pressure": None}), **places}, links

    def faults(self, name: str, around: CaseContext) -> Faults:
        least = around.ambient if self.minimum_pressure is None else self.minimum_pressure
        if self.required_pressure is None:
            if self.minimum_pressure is not None:
                text = "has no effect without `required_pressure`; give both keys, or remove this key"
                yield ("minimum_pressure",), text
            return
        if self.required_pressure <= least:
            text = (
                f"{self.required_pressure:g} Pa is not above {least:g} Pa, at which no demand is supplied; "
                "expected a higher pressure"
            )
            yield ("required_pressure",), text
        if least < around.ambient:
            yield (
                ("minimum_pressure",),
                (
                    f"{least:g} Pa is below ambient pressure, at which nothing can flow out. "
                    f"Expected at least {around.ambient:g} Pa"
                ),
            )
        if not (self.demand.value.min() >= 0.0 and self.demand.value.max() > 0.0):
            text = "is negative at some time, or always 0; `required_pressure` needs values of at least 0, not all 0"
            yield ("demand",), text
