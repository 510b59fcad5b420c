"""A conduit whose fluid moves as one body. Knows its size and friction; computes nothing."""

from __future__ import annotations

from typing import Annotated

from fvsolve.parts.friction import NONE, Friction
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import Number, Quantity, nonnegative, positive


class RigidColumn(TwoPort, kind="rigid-column"):
    """An incompressible pipe, (rho length / A) dq/dt = drop of p + rho g z - friction; one state, its flow q.

    Ports: from, to. Stored energy: rho length q^2 / (2 A) [J]. Dissipated power: friction and minor loss,
    pressure drop times flow [W].
    """

    length: Annotated[float, Quantity("length", positive, "along its axis [m]")]
    diameter: Annotated[float, Quantity("length", positive, "inner diameter [m]")]
    friction: Friction = NONE
    minor_loss: Annotated[float, Number(nonnegative, "loss coefficient on its velocity")] = 0.0
    initial_flow: Annotated[float | None, Quantity("flow", about="at the start [m3/s]")] = None
