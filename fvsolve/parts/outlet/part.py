"""Leaks and outlets to ambient; rupture discs and surge-anticipating valves, which may open to ambient."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.nodes_and_links import Link, Node, TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.self_acting.part import DROPS, STROKES
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import Number, Quantity, Text, UsualRange, between, nonnegative, positive
from fvsolve.parts.valve import Sized
from fvsolve.units import show


class Outside(Node):
    """Node at ambient pressure, at the elevation of the node `level_of`."""

    kind: ClassVar[str] = "outside"
    fixes_pressure: ClassVar[bool] = True

    level_of: str


class Outlet(TwoPort):
    """Link from a place to ambient, q = opening / full flow min(most, ((p - least) / (upper - least))^exponent).

    q is the volume flow, p the pressure at the place; there is no backflow.
    flow : flow at p = upper and opening = full [m3/s]; opening : schedule
    least : pressure from which flow begins [Pa], ambient pressure if None
    upper : pressure of the nominal flow [Pa], 1 bar above least if None; most : greatest value of the power [-]
    """

    kind: ClassVar[str] = "outlet"

    flow: float
    exponent: float
    least: float | None = None
    upper: float | None = None
    most: float = float("inf")
    opening: Any = None
    full: float = 1.0


def outlet_to_ambient(name: str, place: str, **law: Any) -> tuple[dict[str, Node], dict[str, Outlet]]:
    """(places, links), each by name, of an outlet `name` at a place: a node at ambient pressure, and the outlet.

    law : fields of `Outlet`
    """
    outlet = Outlet.model_construct(**{"from": place}, to=f"{name}.outside", **law)
    return {f"{name}.outside": Outside.model_construct(level_of=place)}, {name: outlet}


class Relieving(Sized, Link):
    """A valve or disc, shut at the start, that opens to another place, or without the key `to` to ambient."""

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic", "to": "hydraulic"}
    may_lack: ClassVar[tuple[str, ...]] = ("to",)
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    from_: Annotated[str, Text("place that the valve or disc protects"), Field(alias="from")]
    to: Annotated[str | None, Text("place of discharge; ambient if left out")] = None

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"from": self.from_} | ({} if self.to is None else {"to": self.to})

    @property
    def outward(self) -> bool:
        """True if the valve or disc opens to ambient."""
        return self.to is None or self.to.endswith(".outside")

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        if self.to is not None:
            return {}, {name: self}
        place = f"{name}.outside"
        return {place: Outside.model_construct(level_of=self.from_)}, {name: self.model_copy(update={"to": place})}

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.to is None and getattr(around.nodes.get(self.from_), "kind", "") == "reservoir":
            text = f"is a reservoir, whose pressure a {self.kind} cannot change. Expected a junction or another place"
            yield ("from",), f"{self.from_} {text}"


class Leak(Link, kind="leak"):
    """A leak or emitter, q = opening coefficient (p - ambient)^exponent; no flow where the pressure p is below ambient.

    Port: from; the outflow is at the elevation of its node. Below 10 Pa, a millimetre of head, a cubic joins the power
    law to zero flow. Stored energy: none. Dissipated power: (p - ambient) q [W].
    """

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic"}

    from_: Annotated[str, Text("place of the leak"), Field(alias="from")]
    coefficient: Annotated[float, Number(
        positive, "flow in m3/s at a pressure drop of 1 Pa", UsualRange(1e-15, 0.1, "seeping to a main torn off"),
    )]  # fmt: skip
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


class RuptureDisc(Relieving, kind="rupture-disc"):
    """Disc that is shut until p_from - p_to exceeds burst_pressure, and then always open.

    The flow is then q = Cd A sqrt(2 |dp| / rho) sign(dp) at the drop dp. Without `to` it opens to ambient at the
    elevation of its place, without backflow. Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

    burst_pressure: Annotated[
        float, Quantity("pressure_drop", positive, "pressure drop above which the disc bursts [Pa]", DROPS)
    ]


class SurgeAnticipating(Relieving, kind="surge-anticipating"):
    """Valve that opens at a pressure below `low_set`, or at `trip`, stays open for the time `hold`, and then shuts.

    A pressure above `high_set` opens it while the pressure lasts. q = x Cd A sqrt(2 |dp| / rho) sign(dp), with flow q
    and drop dp; the opening x moves at the constant rates 1 / opening_time and 1 / closing_time. Without `to` the valve
    opens to ambient at the elevation of its place, without backflow. Ports: from, to. Stored energy: none. Dissipated
    power: dp q [W].
    """

    low_set: Annotated[float | None, Quantity(
        "pressure", about="pressure at `senses` below which the valve opens, gauge or absolute by its unit [Pa]",
    )] = None  # fmt: skip
    high_set: Annotated[float | None, Quantity(
        "pressure", about="pressure at `senses` above which the valve opens, gauge or absolute by its unit [Pa]",
    )] = None  # fmt: skip
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
            message = f"unknown place of the fluid {show(self.senses)}; expected one of {listing(places)}{near}"
            yield ("senses",), message
