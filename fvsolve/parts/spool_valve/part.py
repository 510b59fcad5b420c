"""Four edges on one spool. Knows their size and the spool's position; evaluates no flow."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.link import Link, Ports
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import SHAPE, between
from fvsolve.parts.valve.part import Sized

EDGES = (("P", "A", 1), ("P", "B", -1), ("A", "T", -1), ("B", "T", 1))  # from, to, side of zero on which it opens


class SpoolValve(Sized, Link, kind="spool-valve"):
    """Overlap zero: P to A and B to T open by `position` above 0, P to B and A to T by -`position` below it.

    Each edge is a valve, q = |position| Cd A sqrt(2 |dp| / rho) sign(dp) (79). Ports: P, T, A, B; position 0 is exactly
    no flow. Stored energy: none. Dissipated power: dp q [W] over the edges.
    """

    joins: ClassVar[dict[str, str]] = dict.fromkeys(("P", "T", "A", "B"), "hydraulic")
    quantities: ClassVar[dict[str, str]] = {f"flow_{port}": "flow" for port in ("P", "T", "A", "B")}

    ports: Annotated[dict[str, str], Ports(("P", "T", "A", "B"))]
    position: Annotated[  # which is cut where it crosses zero
        Schedule, Scheduled("number", between(-1, 1), "of the spool, -1 to 1", changes=SHAPE)
    ]
