"""A place with one potential. Knows what every node has; knows no link."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.errors import FvsolveError
from fvsolve.parts.scalar import Carried
from fvsolve.parts.table import Table
from fvsolve.parts.value import VALUE, Quantity, Rows, Text, Usual
from fvsolve.units import show

HEIGHTS = Usual(-12e3, 9e3, "boreholes to mountains")


class Node(Table):
    """A place with one potential: a pressure, taken at its elevation, or a velocity where the domain is translational.

    Ports: those of the links that name it. Stored and dissipated energy: none, unless the kind says so.
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Node]]] = {}
    quantities: ClassVar[dict[str, str]] = {
        "pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head"
    }  # fmt: skip
    fixes_pressure: ClassVar[bool] = False
    no_scalars: ClassVar[str] = ""  # why a case with scalars cannot have it yet
    own_scalars: ClassVar[str] = ""  # which values of scalars it states: "start" | "inflow"; none if empty
    driven: ClassVar[tuple[str, float] | None] = None  # a port's key, and its sign as flow into links; 0 of a pressure
    domain: ClassVar[str] = "hydraulic"  # | "translational"

    elevation: Annotated[
        float | None,
        Quantity(
            "length",
            about="height above datum [m], of a reservoir by head that of the far end; 0 for all if left out",
            usual=HEIGHTS,
        ),
    ] = None
    position: Annotated[
        tuple[float, float] | None, Rows("length", length=2, about="[x, y] for drawing [m]", changes=VALUE)
    ] = None
    scalars: Annotated[dict[str, Any], Carried("of scalars that flow in from it, or that it holds at the start")] = {}

    @classmethod
    def variant(cls, given: dict[str, Any]) -> type[Node]:
        """Its kind as its keys make it: itself, or one of which more can be read."""
        return cls

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        """Names of places in its stead, as the file says them; None where it is a place itself."""
        return None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        """Names of bodies that it goes with, as the file says them."""
        return ()

    def inner(self, name: str) -> tuple[dict[str, Node], dict[str, Any]]:
        """(places, links) of the fluid that it stands for, by name: itself, and what it owns as `NAME.PLACE`."""
        return {name: self}, {}

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind:
            if kind in Node.kinds:
                raise FvsolveError(f"a node of type {show(kind)} is there already; wanted another name")
            cls.kind = kind
            Node.kinds[kind] = cls


class Rider(Node):
    """A place that may ride on a body."""

    on: Annotated[str | None, Text("a body that it rides on; it stands still if left out")] = None
    at: Annotated[
        tuple[float, ...] | None,
        Rows(
            "position",
            length=3,
            about="its origin in axes of that body, in place of elevation [m]; 0 if left out",
        ),
    ] = None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        return (given["on"],) if isinstance(given.get("on"), str) else ()

    @property
    def stands(self) -> dict[str, Any]:
        """Its keys that say where it is."""
        return {"elevation": self.elevation, "on": self.on, "at": self.at}

    @property
    def place(self) -> tuple[float, ...]:
        """Where it is in axes of its body [m]."""
        return self.at or (0.0, 0.0, 0.0)
