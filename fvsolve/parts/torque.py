"""Torques on shafts and bodies."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from fvsolve.assembly.inputs import TORQUE, Input
from fvsolve.assembly.lowering import Lowering, lowering_of
from fvsolve.assembly.mechanics import PushLowering, join_ports
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.context import CaseContext, Faults
from fvsolve.parts.link import Link
from fvsolve.parts.pump.law import OWN_NUMBERS
from fvsolve.parts.pump.lower_shaft import torques_on
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.translational import brace_of
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


class TorqueRows(Lowering, kind="torque"):
    """Conversion of torques on shafts; they have no rows, because the pump or turbine contains their parameters."""

    def of(self, part):
        return self if part.axis is None else BODY_TORQUES

    def inputs(self, model, name, part):
        turned = part.to.removesuffix(".shaft")
        row = lowering_of(type(model.case.links[turned])).row_of(model, turned)
        place = [torque is part for torque in torques_on(model.case, turned)].index(True)
        return {"torque": Input(TORQUE, int(model.tables.floats[row["data"] + OWN_NUMBERS + 2 * place]))}


class BodyTorqueRows(PushLowering):
    """Conversion to table rows of torques about an axis of a body, which follow a schedule."""

    ledger_name = "supplied"
    table, rank = "brace", 3

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        axis = rec.ABOUT, link.axis / np.linalg.norm(link.axis)
        _, row["speed"] = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to), *axis)
        row["schedule"] = draft.schedules.add(link.torque)

    def inputs(self, model, name, part):
        return {"torque": Input(TORQUE, brace_of(model, name)["schedule"].item())}


BODY_TORQUES = BodyTorqueRows()
