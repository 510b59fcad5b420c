"""Ways out of the fluid into ambient. Knows how they open; evaluates no flow."""

from __future__ import annotations

from typing import Any, ClassVar

from fvsolve.parts.link import TwoPort
from fvsolve.parts.node import Node


class Outside(Node):
    """Ambient pressure on the level of another place."""

    kind: ClassVar[str] = "outside"
    fixes_pressure: ClassVar[bool] = True

    level_of: str


class Outlet(TwoPort):
    """From a place to its outside, q = opening / full flow min(most, ((p - least) / (upper - least))^exponent).

    None back. flow : [m3/s] at p = upper and opening = full; least : [Pa], ambient if None; upper : [Pa], 1 bar above
    """

    kind: ClassVar[str] = "outlet"

    flow: float
    exponent: float
    least: float | None = None
    upper: float | None = None
    most: float = float("inf")
    opening: Any = None
    full: float = 1.0


def out_of(name: str, place: str, **law: Any) -> tuple[dict[str, Node], dict[str, Outlet]]:
    """(places, links) of an outlet `name` at a place."""
    outlet = Outlet.model_construct(**{"from": place}, to=f"{name}.outside", **law)
    return {f"{name}.outside": Outside.model_construct(level_of=place)}, {name: outlet}
