"""Nodes: base classes of all places with a single potential."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.errors import FvsolveError
from fvsolve.parts.carried_scalar import ScalarValues
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import VALUE, Quantity, Rows, Text, UsualRange
from fvsolve.units import show

USUAL_ELEVATIONS = UsualRange(-12e3, 9e3, "boreholes to mountains")


class Node(Table):
    """Place with a single potential: pressure at its elevation (hydraulic), or velocity (translational or spatial).

    Ports: those of the links that name it. Stored and dissipated energy: none, unless its type states otherwise.
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Node]]] = {}
    quantities: ClassVar[dict[str, str]] = {
        "pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head"
    }  # fmt: skip
    fixes_pressure: ClassVar[bool] = False
    no_scalars: ClassVar[str] = ""  # reason why a case with scalars cannot have this part yet
    own_scalars: ClassVar[str] = ""  # scalars that it states: "start" | "inflow"; none if empty
    driven: ClassVar[tuple[str, float] | None] = (
        None  # key of a prescribed flow, and its sign as flow into links; 0 for a prescribed pressure
    )
    domain: ClassVar[str] = "hydraulic"  # | "translational" | "spatial"

    elevation: Annotated[
        float | None,
        Quantity(
            "length",
            about="elevation above datum, at all nodes or none [m]; "
            "0 (reservoir with `head`: that of the other end of its first link) if left out",
            usual=USUAL_ELEVATIONS,
        ),
    ] = None
    position: Annotated[
        tuple[float, float] | None, Rows("length", length=2, about="position [x, y] in drawings [m]", changes=VALUE)
    ] = None
    scalars: Annotated[
        dict[str, Any], ScalarValues("scalar values of the inflow (reservoir, inflow), or at the start (tank, chamber)")
    ] = {}

    @classmethod
    def variant(cls, given: dict[str, Any]) -> type[Node]:
        """Class of a node with the given keys: this class, or a subclass with more quantities."""
        return cls

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        """Names of the places that replace the node, as in the case file; None if the node itself is a place."""
        return None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        """Names of the bodies that carry the node or move its walls, as in the case file."""
        return ()

    def inner(self, name: str) -> tuple[dict[str, Node], dict[str, Any]]:
        """(places, links) of the solved network for this node, each by name.

        They contain the node itself, and its own places `NAME.PLACE`.
        """
        return {name: self}, {}

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind:
            if kind in Node.kinds:
                raise FvsolveError(f"a node of type {show(kind)} exists already; expected another name")
            cls.kind = kind
            Node.kinds[kind] = cls


class PlaceOnBody(Node):
    """Node that a body may carry."""

    on: Annotated[str | None, Text("body that carries the node; fixed in the world if left out")] = None
    at: Annotated[
        tuple[float, ...] | None,
        Rows(
            "position",
            length=3,
            about="position (of a basin: of its origin) in axes of the body, instead of `elevation` [m]; 0 if left out",
        ),
    ] = None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        return (given["on"],) if isinstance(given.get("on"), str) else ()

    @property
    def position_keys(self) -> dict[str, Any]:
        """Keys of the position of the node, with their values."""
        return {"elevation": self.elevation, "on": self.on, "at": self.at}

    @property
    def place(self) -> tuple[float, ...]:
        """Position [m] of the node in the axes of its body; the origin if not given."""
        return self.at or (0.0, 0.0, 0.0)
