"""Viscous dampers between two bodies."""

from __future__ import annotations

from typing import Annotated

from fvsolve.parts.link import Coupling
from fvsolve.parts.value import VALUE, Quantity, positive


class Damper(Coupling, kind="damper"):
    """A viscous damper with the force = -damping (v_to - v_from), v the velocity of each port.

    Ports: from, to; the force pushes `to` forward. Stored energy: none. Dissipated power: damping
    (v_to - v_from)^2 [W].
    """

    damping: Annotated[float, Quantity("damping", positive, "force per relative velocity [N s/m]", changes=VALUE)]
