"""Nodes with a given inflow: keys."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.node import PlaceOnBody
from fvsolve.parts.schedule import Schedule, Scheduled


class Inflow(PlaceOnBody, kind="inflow"):
    """A node without volume that supplies a given flow(t) to its links.

    Ports: any number. Stored energy: none. Dissipated energy: none; it supplies p times flow [W], p its pressure.
    """

    driven: ClassVar[tuple[str, float]] = "flow", 1.0
    own_scalars: ClassVar[str] = "inflow"

    flow: Annotated[Schedule, Scheduled("flow", about="flow at reference density, positive into the network [m3/s]")]
