"""Frames: fixed positions on the axis and points in the world."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.body.body_keys import NamedPoints
from fvsolve.parts.node import Node
from fvsolve.parts.value import Quantity


class Frame(Node, kind="frame"):
    """A fixed position on the common axis of masses, or points fixed in the world.

    Its velocity is zero under any force. Ports: those of the links that name it, velocity and force. Stored and
    dissipated energy: none.
    """

    domain: ClassVar[str] = "translational"
    quantities: ClassVar[dict[str, str]] = {"position": "position"}

    initial_position: Annotated[float, Quantity("position", about="position on the common axis [m]")] = 0.0
    points: Annotated[dict[str, tuple[float, ...]], NamedPoints("fixed points for links, in world axes [m]")] = {}
