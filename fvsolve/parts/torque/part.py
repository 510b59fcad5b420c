"""External torques on shafts and bodies: keys and faults."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Link
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Rows, Text


class Torque(Link, kind="torque"):
    """External torque(t) on the shaft `to`, whose speed follows from it and the fluid; or on a body about `axis`.

    Ports: to; for bodies also from, on which the reaction torque acts. Stored and dissipated energy: none. It supplies
    torque times angular velocity [W]; for bodies, the velocity of `to` relative to `from` about the axis.
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "rotational or spatial"}
    may_lack: ClassVar[tuple[str, ...]] = ("from",)
    quantities: ClassVar[dict[str, str]] = {}

    from_: Annotated[str | None, Text("body that takes the reaction torque; none if left out"), Field(alias="from")] = (
        None
    )
    to: Annotated[str, Text("shaft (PUMP.shaft or TURBINE.shaft) or body on which the torque acts")]
    torque: Annotated[
        Schedule,
        Scheduled(
            "torque", about="torque on `to`, positive as the torque of a motor on its pump, or about `axis` [N m]"
        ),
    ]
    axis: Annotated[
        tuple[float, ...] | None,
        Rows("number", length=3, about="axis of the torque on a body, in the axes of the body"),
    ] = None

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"to": self.to} if self.from_ is None else {"from": self.from_, "to": self.to}

    def faults(self, name: str, around: CaseContext) -> Faults:
        if is_zero_vector(self.axis):
            yield ("axis",), "is all zeros; expected for example [0, 1, 0]"
        turned = around.links.get(self.to.removesuffix(".shaft"))
        if around.spatial(self.to) and self.axis is None:
            yield (), "axis is missing: expected the axis of the torque in the axes of the body, for example [0, 1, 0]"
        if "shaft" not in getattr(turned, "owns", {}) or around.spatial(self.to):
            return
        for key, given in (("from", self.from_), ("axis", self.axis)):
            if given is not None:
                yield (key,), f"is a key for bodies, but {self.to} is a shaft; remove this key"
        if turned.inertia is None:
            yield (
                ("to",),
                f"{self.to} has no inertia, so its speed cannot follow from a torque; give the {turned.kind} `inertia`",
            )
        if turned.trip is not None:
            text = (
                "is held at its speed until the trip; remove the key `trip`, and let the torque fall to 0 at that time"
            )
            yield ("to",), f"{self.to} {text}"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)
