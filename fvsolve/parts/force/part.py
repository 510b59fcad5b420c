"""External forces on a mass or a body: keys and faults."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Coupling
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Rows, Text


class Force(Coupling, kind="force"):
    """External force(t) that acts on `to` in forward direction, and in opposite direction on `from`, if given.

    Ports: from, to. Stored and dissipated energy: none; it supplies force times (v_to - v_from) [W], v the velocity of
    a port, in space along `direction`.
    """

    may_lack: ClassVar[tuple[str, ...]] = ("from",)

    from_: Annotated[
        str | None, Text("mass or point that takes the reaction; none if left out"), Field(alias="from")
    ] = None
    force: Annotated[
        Schedule,
        Scheduled("force", about="force on `to`, positive along `direction` (of masses: along their axis) [N]"),
    ]
    direction: Annotated[
        tuple[float, ...] | None,
        Rows(
            "number",
            length=3,
            about="direction of a force on a point, in world axes; the line from `from` to `to` if left out",
        ),
    ] = None

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"to": self.to} if self.from_ is None else super().ports

    def faults(self, name: str, around: CaseContext) -> Faults:
        if is_zero_vector(self.direction):
            yield ("direction",), "is all zeros; expected for example [0, 0, -1]"
        if around.spatial(self.to) and self.from_ is None and self.direction is None:
            yield (
                (),
                "direction is missing: a force on a point needs this key or `from`; for example [0, 0, -1], downward",
            )
        if not around.spatial(self.to) and self.direction is not None:
            yield (
                ("direction",),
                f"{self.to} moves along a single axis, which gives the direction of the force; remove this key",
            )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("direction", self.direction)
