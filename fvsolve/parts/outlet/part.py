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
    upper : pressure of the nominal flow [Pa], `span` above least if None, by default 1 bar; most : greatest value of
    the power [-]; demand : True for the demand of a junction
    """

    kind: ClassVar[str] = "outlet"

    flow: float
    exponent: float
    least: float | None = None
    upper: float | None = None
    span: float | None = None
    most: float = float("inf")
    opening: Any = None
    full: float = 1.0
    demand: bool = False


def outlet_to_ambient(
    name: str, place: str, **law: Any
) -> tuple[dict[str, Node], dict[str, Outlet]]:
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
        return {place: Outside.model_construct(level_of=self.from_)}, {
            name: self.model_copy(update={"to": place})
        }

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.to is None and getattr(around.nodes.get(self.from_), "kind", "") == "reservoir":
            text = f"is a reservoir, whose pressure a {self.kind} cannot change; expected a junction or another place"
            yield ("from",), f"{self.from_} {text}"


class FromPlace(Link):
    """Link from a place to ambient, at the elevation of the place."""

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic"}

    from_: Annotated[str, Text("place from which it flows"), Field(alias="from")]
    opening: Annotated[
        Schedule, Scheduled("number", between(0, 1), "relative opening, a factor of the flow")
    ] = Field(default_factory=lambda: constant(1.0))

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"from": self.from_}

    def faults(self, name: str, around: CaseContext) -> Faults:
        if getattr(around.nodes.get(self.from_), "kind", "") == "reservoir":
            text = f"is a reservoir, whose pressure a {self.kind} cannot change; expected a junction, a tank or"
            yield ("from",), f"{self.from_} {text} another place"


class Leak(FromPlace, kind="leak"):
    """A leak or emitter, q = opening coefficient (p - ambient)^exponent; no flow where the pressure p is below ambient.

    Port: from; the outflow is at the elevation of its node. Below 10 Pa, a millimetre of head, a cubic joins the power
    law to zero flow. Stored energy: none. Dissipated power: (p - ambient) q [W].
    """

    coefficient: Annotated[
        float,
        Number(
            positive,
            "flow in m3/s at a pressure drop of 1 Pa",
            UsualRange(1e-15, 0.1, "seeping to a main torn off"),
        ),
    ]
    exponent: Annotated[
        float,
        Number(
            between(0, 3, open=True), "exponent of the pressure drop, 0.5 for a hole of fixed size"
        ),
    ] = 0.5

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        law = {
            "flow": self.coefficient * 1e5**self.exponent,
            "exponent": self.exponent,
            "opening": self.opening,
        }
        return outlet_to_ambient(name, self.from_, **law)


# pressure above its residual pressure at which a hydrant has its flow, 1 cm of head [Pa]
HYDRANT_SPAN = 100.0


class Hydrant(FromPlace, kind="hydrant"):
    """A hydrant that draws opening times `flow`, or less, so that its place keeps at least `residual_pressure`.

    Where the network cannot supply `flow` at this pressure, the flow is the available fire flow, and the pressure is
    at most 100 Pa above it. No flow if the pressure is below it. Port: from. Stored energy: none. Dissipated power:
    (p - ambient) q [W], with pressure p and flow q.
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "gauge_pressure": "gauge_pressure"}

    flow: Annotated[
        float, Quantity("flow", positive, "flow that it draws, or its greatest flow [m3/s]")
    ]
    residual_pressure: Annotated[
        float | None,
        Quantity(
            "pressure", about="least pressure that it leaves at its place [Pa]; ambient if left out"
        ),
    ] = None

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        law = {
            "flow": self.flow,
            "exponent": 0.5,
            "opening": self.opening,
            "most": 1.0,
            "span": HYDRANT_SPAN,
        }
        return outlet_to_ambient(name, self.from_, **law, least=self.residual_pressure)

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        if self.residual_pressure is not None and self.residual_pressure < around.ambient:
            text = f"{self.residual_pressure:g} Pa is below ambient pressure, at which nothing can flow out"
            yield ("residual_pressure",), f"{text}; expected at least {around.ambient:g} Pa"


class RuptureDisc(Relieving, kind="rupture-disc"):
    """Disc that is shut until p_from - p_to exceeds burst_pressure, and then always open.

    The flow is then q = Cd A sqrt(2 |dp| / rho) sign(dp) at the drop dp. Without `to` it opens to ambient at the
    elevation of its place, without backflow. Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

    burst_pressure: Annotated[
        float,
        Quantity(
            "pressure_drop", positive, "pressure drop above which the disc bursts [Pa]", DROPS
        ),
    ]


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
            "pressure",
            about="pressure at `senses` below which the valve opens, gauge or absolute by its unit [Pa]",
        ),
    ] = None
    high_set: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="pressure at `senses` above which the valve opens, gauge or absolute by its unit [Pa]",
        ),
    ] = None
    trip: Annotated[
        float | None,
        Quantity("time", about="time at which the valve opens regardless of pressure [s]"),
    ] = None
    senses: Annotated[
        str | None, Text("place whose pressure opens the valve; `from` if left out")
    ] = None
    opening_time: Annotated[
        float, Quantity("time", positive, "time from shut to fully open [s]", STROKES)
    ]
    hold: Annotated[
        float,
        Quantity(
            "time",
            nonnegative,
            "time for which the valve stays fully open after `low_set` or `trip` [s]",
        ),
    ] = 0.0
    closing_time: Annotated[
        float, Quantity("time", positive, "time from fully open to shut [s]", STROKES)
    ]

    @property
    def sensed(self) -> str:
        """Place whose pressure opens the valve."""
        return self.from_ if self.senses is None else self.senses

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if not {"low_set", "high_set", "trip"} & set(given):
            faults.append(
                ((), "nothing opens the valve; expected the key `low_set`, `high_set` or `trip`")
            )
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        if (
            self.low_set is not None
            and self.high_set is not None
            and not self.low_set < self.high_set
        ):
            text = f"{self.high_set:.6g} Pa is not above low_set, {self.low_set:.6g} Pa"
            yield ("high_set",), f"{text}; expected a higher pressure"
        places = [
            place
            for place, node in around.nodes.items()
            if getattr(node, "domain", "") == "hydraulic"
        ]
        if self.senses is not None and self.senses not in places:
            near = did_you_mean(self.senses, places)
            message = f"unknown place of the fluid {show(self.senses)}; expected one of {listing(places)}{near}"
            yield ("senses",), message
