"""Masses that move along one axis: keys."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.node import Node
from fvsolve.parts.value import VALUE, Quantity, UsualRange, positive


class Mass(Node, kind="mass"):
    """A rigid body on one axis, mass dv/dt = sum of the forces on it; its states are position and velocity v.

    Ports: those of the links that name it, velocity and force. Stored energy: mass v^2 / 2 [J]. Dissipated: none.
    """

    domain: ClassVar[str] = "translational"
    quantities: ClassVar[dict[str, str]] = {"position": "position", "velocity": "velocity"}

    mass: Annotated[
        float,
        Quantity("mass", positive, "total moving mass [kg]", UsualRange(1e-6, 1e9, "poppets to ships"), VALUE),
    ]
    initial_position: Annotated[
        float, Quantity("position", about="position at the start, along the common axis [m]")
    ] = 0.0
    initial_velocity: Annotated[float, Quantity("velocity", about="velocity at the start [m/s]")] = 0.0
