"""A place where links meet. Knows its demand; knows no link."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fvsolve.parts.node import Node
from fvsolve.parts.schedule import Schedule, Scheduled, constant


class Junction(Node, kind="junction"):
    """A place without volume: the flows into its links and its demand sum to zero.

    Ports: any number. Stored energy: none. Dissipated energy: none; the demand leaves with p demand [W].
    """

    demand: Annotated[Schedule, Scheduled("flow", about="positive outward [m3/s]")] = Field(
        default_factory=lambda: constant(0.0)
    )
