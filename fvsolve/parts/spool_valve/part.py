"""Four-way spool valves: keys."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.link import Link, Ports
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import SHAPE, between
from fvsolve.parts.valve.part import Sized

EDGES = (
    ("P", "A", 1),
    ("P", "B", -1),
    ("A", "T", -1),
    ("B", "T", 1),
)  # from, to, sign of the position at which it opens


class SpoolValve(Sized, Link, kind="spool-valve"):
    """Zero-lapped spool valve: edges P-A and B-T open by `position` above 0, edges P-B and A-T by -`position` below 0.

    Each edge is a valve, q = |position| Cd A sqrt(2 |dp| / rho) sign(dp), with flow q and drop dp (docs/course.md, 79).
    Ports: P, T, A, B; at position 0 there is no flow. Stored energy: none. Dissipated power: dp q [W], summed over the
    edges.
    """

    joins: ClassVar[dict[str, str]] = dict.fromkeys(("P", "T", "A", "B"), "hydraulic")
    quantities: ClassVar[dict[str, str]] = {f"flow_{port}": "flow" for port in ("P", "T", "A", "B")}

    ports: Annotated[dict[str, str], Ports(("P", "T", "A", "B"))]
    position: Annotated[  # the schedule is divided where it crosses zero
        Schedule, Scheduled("number", between(-1, 1), "position of the spool, -1 to 1", changes=SHAPE)
    ]
