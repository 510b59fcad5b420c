"""A body that stands still. Knows where; knows no force."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.body.points import PlacesByName
from fvsolve.parts.node import Node
from fvsolve.parts.value import Quantity


class Frame(Node, kind="frame"):
    """A fixed place on the axis, velocity zero whatever force it takes.

    Ports: those of the links that name it, velocity and force. Stored and dissipated energy: none.
    """

    domain: ClassVar[str] = "translational"
    quantities: ClassVar[dict[str, str]] = {"position": "position"}

    initial_position: Annotated[float, Quantity("position", about="where it stands on the common axis [m]")] = 0.0
    points: Annotated[dict[str, tuple[float, ...]], PlacesByName("places in the world that links push at [m]")] = {}
