"""A place that feeds a given flow. Knows its flow; knows no link."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.node import Rider
from fvsolve.parts.schedule import Schedule, Scheduled


class Inflow(Rider, kind="inflow"):
    """A place without volume that feeds `flow(t)` into its links.

    Ports: any number. Stored energy: none. Dissipated energy: none; it brings p times flow [W].
    """

    driven: ClassVar[tuple[str, float]] = "flow", 1.0
    own_scalars: ClassVar[str] = "inflow"

    flow: Annotated[Schedule, Scheduled("flow", about="positive into the network, of the reference density [m3/s]")]
