"""Links between bodies: pins, bushings and torques."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from fvsolve.core.assembly.lowering import TORQUE, Input, Lowering, lowering_of
from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.network_elements import FLOW, Element, network_of
from fvsolve.parts.nodes_and_links import Link, TwoPort
from fvsolve.parts.pump.law import OWN_NUMBERS
from fvsolve.parts.pump.lower_shaft import torques_on
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import VALUE, Quantity, Rows, Text, nonnegative, positive


class Pin(TwoPort, kind="pin"):
    """Joint that keeps point `to` at point `from`; with `axis`, only in the two directions normal to it (plane loop).

    gap is the distance vector between the points. Ports: from, to. Stored and dissipated energy: none, except the
    energy by which `stabilisation` closes a gap. The forces are Lagrange multipliers of
    d2(gap)/dt2 = -2 stabilisation d(gap)/dt - stabilisation^2 gap (Baumgarte, 1972).
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "spatial"}
    quantities: ClassVar[dict[str, str]] = {"gap": "length", "force": "force"}

    axis: Annotated[
        tuple[float, ...] | None,
        Rows(
            "number",
            length=3,
            about="free direction, in the axes of `from`; none (all three directions constrained) if left out",
        ),
    ] = None
    stabilisation: Annotated[
        float,
        Quantity(
            "rate",
            positive,
            "rate at which a gap closes (Baumgarte stabilisation) [1/s]",
            changes=VALUE,
        ),
    ] = 10.0

    def faults(self, name: str, around: CaseContext) -> Faults:
        if is_zero_vector(self.axis):
            yield ("axis",), "is all zeros; expected for example [0, 1, 0]"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)

    def directions(self) -> np.ndarray:
        """Constrained directions in the axes of `from`, as unit vectors : float64[directions, 3]."""
        if self.axis is None:
            return np.eye(3)
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(axis, first)])


class PinRows(Lowering, kind="pin"):
    """Conversion to table rows of pins: loop constraints between two points."""

    table = "pin"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.join(row, ("from_point", "to_point"), (link.from_, link.to))
        directions = link.directions()
        row["rows"], row["pull"] = len(directions), link.stabilisation
        row["directions"][: directions.size] = directions.ravel()


class Bushing(TwoPort, kind="bushing"):
    """Spring and damper in all directions between two points; it also turns the second body to its initial attitude.

    gap : vector from point `from` to point `to`; w : relative angular velocity; (eta, eps) : Euler parameters of the
    deviation from the initial relative attitude (docs/course.md, 56). In the axes of `from`, the force -stiffness gap -
    damping d(gap)/dt and the torque -2 rotational_stiffness eta eps - rotational_damping w (57) act on both bodies at
    point `to`. Ports: from, to; velocity and force. Stored energy: stiffness gap^2 / 2 + 2 rotational_stiffness eps^2
    [J]. Dissipated power: damping (d(gap)/dt)^2 + rotational_damping w^2 [W].
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "spatial"}
    quantities: ClassVar[dict[str, str]] = {"gap": "length", "force": "force", "torque": "torque"}

    def faults(self, name: str, around: CaseContext) -> Faults:
        if not any(
            (self.stiffness, self.damping, self.rotational_stiffness, self.rotational_damping)
        ):
            text = "is 0, like `damping`, `rotational_stiffness` and `rotational_damping`"
            yield ("stiffness",), f"{text}; expected at least one of these four keys above 0"

    stiffness: Annotated[
        float,
        Quantity(
            "stiffness",
            nonnegative,
            "force per displacement between the points [N/m]",
            changes=VALUE,
        ),
    ] = 0.0
    damping: Annotated[
        float,
        Quantity(
            "damping",
            nonnegative,
            "force per relative velocity of the points [N s/m]",
            changes=VALUE,
        ),
    ] = 0.0
    rotational_stiffness: Annotated[
        float,
        Quantity("torque", nonnegative, "torque per angle, for small angles [N m]", changes=VALUE),
    ] = 0.0
    rotational_damping: Annotated[
        float,
        Quantity(
            "rotational_damping", nonnegative, "torque per angular velocity [N m s]", changes=VALUE
        ),
    ] = 0.0


class BushingRows(Lowering, kind="bushing"):
    """Conversion to table rows of bushings: three forces and three torques between two bodies."""

    table = "bushing"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        draft.join(row, ("from_point", "to_point"), (link.from_, link.to))
        row["stiffness"], row["damping"] = link.stiffness, link.damping
        row["turn_stiffness"], row["turn_damping"] = (
            link.rotational_stiffness,
            link.rotational_damping,
        )
        case = draft.case
        poses = [case.as_stated.pose_of(case.body_point(end)[0]) for end in (link.from_, link.to)]
        row["attitude"] = (poses[0].attitude.T @ poses[1].attitude).ravel()


class Torque(Link, kind="torque"):
    """External torque(t) on the shaft `to`, whose speed follows from it and the fluid; or on a body about `axis`.

    Ports: to; for bodies also from, on which the reaction torque acts. Stored and dissipated energy: none. It supplies
    torque times angular velocity [W]; for bodies, the velocity of `to` relative to `from` about the axis.
    """

    joins: ClassVar[dict[str, str]] = {"from": "spatial", "to": "rotational or spatial"}
    may_lack: ClassVar[tuple[str, ...]] = ("from",)
    quantities: ClassVar[dict[str, str]] = {}

    from_: Annotated[
        str | None,
        Text("body that takes the reaction torque; none if left out"),
        Field(alias="from"),
    ] = None
    to: Annotated[
        str, Text("shaft (also PUMP.shaft or TURBINE.shaft) or body on which the torque acts")
    ]
    torque: Annotated[
        Schedule,
        Scheduled(
            "torque",
            about="torque on `to`, positive as the torque of a motor on its pump, or about `axis` [N m]",
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
            yield (
                (),
                "axis is missing; expected the axis of the torque in the axes of the body, for example [0, 1, 0]",
            )
        if around.spatial(self.to):
            return
        for key, given in (("from", self.from_), ("axis", self.axis)):
            if given is not None:
                yield (key,), f"is a key for bodies, but {self.to} is a shaft; remove this key"
        if "shaft" not in getattr(turned, "owns", {}):
            return
        if turned.inertia is None:
            text = f"{self.to} has no inertia, so its speed cannot follow from a torque"
            yield ("to",), f"{text}; give the {turned.kind} `inertia`"
        if turned.trip is not None:
            text = (
                "is held at its speed until the trip; remove the key `trip`, and "
                "let the torque fall to 0 at that time"
            )
            yield ("to",), f"{self.to} {text}"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)


class TorqueRows(Lowering, kind="torque"):
    """Conversion of torques on shafts; they have no rows, because the pump or turbine contains their parameters."""

    def of(self, part):
        return self if part.axis is None else BODY_TORQUES

    def network_elements(self, case, name, part):
        """Element of a torque on a shaft of a network."""
        if part.to not in case.network_places:
            return [], []
        place = f"links.{name}"
        return [
            Element(
                FLOW,
                place,
                place,
                (None, part.to),
                schedule=part.torque,
                key="torque",
                ledger="supplied",
            )
        ], []

    def inputs(self, model, name, part):
        if part.to in model.case.network_places:
            return {"torque": Input(TORQUE, network_of(model).schedules[f"links.{name}", "torque"])}
        turned = part.to.removesuffix(".shaft")
        row = lowering_of(type(model.case.links[turned])).row_of(model, turned)
        place = [torque is part for torque in torques_on(model.case, turned)].index(True)
        return {
            "torque": Input(TORQUE, int(model.tables.floats[row["data"] + OWN_NUMBERS + 2 * place]))
        }


class BodyTorqueRows(Lowering):
    """Conversion to table rows of torques about an axis of a body, which follow a schedule."""

    ledger_name = "supplied"
    table, rank = "brace", 3

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        axis = link.axis / np.linalg.norm(link.axis)
        _, row["speed"] = draft.join(
            row, ("from_mass", "to_mass"), (link.from_, link.to), about=axis
        )
        row["schedule"] = draft.schedules.add(link.torque)

    def inputs(self, model, name, part):
        return {"torque": Input(TORQUE, model.schedule_of(name))}


BODY_TORQUES = BodyTorqueRows()
