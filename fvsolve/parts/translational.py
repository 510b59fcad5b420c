"""Translational mechanics on one axis: masses, frames, springs, dampers, end stops and forces."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from fvsolve.core.assembly.lowering import FORCE, Input, Lowering
from fvsolve.parts import law_elements as codes
from fvsolve.parts.attitude_keys import is_zero_vector, length_notices
from fvsolve.parts.body import NamedPoints
from fvsolve.parts.network_elements import CAPACITY, FLOW, Element
from fvsolve.parts.nodes_and_links import Coupling, Node
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import VALUE, Quantity, Rows, Text, UsualRange, nonnegative, positive


class Mass(Node, kind="mass"):
    """A rigid body on one axis, mass dv/dt = sum of the forces on it; its states are position and velocity v.

    Ports: those of the links that name it, velocity and force. Stored energy: mass v^2 / 2 [J]. Dissipated: none.
    """

    domain: ClassVar[str] = "translational"
    quantities: ClassVar[dict[str, str]] = {"position": "position", "velocity": "velocity"}

    mass: Annotated[
        float,
        Quantity(
            "mass",
            positive,
            "total moving mass [kg]",
            UsualRange(1e-6, 1e9, "poppets to ships"),
            VALUE,
        ),
    ]
    initial_position: Annotated[
        float, Quantity("position", about="position at the start, along the common axis [m]")
    ] = 0.0
    initial_velocity: Annotated[
        float, Quantity("velocity", about="velocity at the start [m/s]")
    ] = 0.0


class MassRows(Lowering, kind="mass"):
    """Conversion to table rows of masses: bodies on an axis, moved by forces."""

    def network_elements(self, case, name, part):
        """Elements of a mass that a part of a network moves: its inertia, and the force of all other parts."""
        if name not in case.network_places:
            return [], []
        place = f"nodes.{name}"
        mass = case.nodes_with_water[name].mass
        return [
            Element(
                CAPACITY,
                place,
                place,
                (name, None),
                mass,
                f"{name}.velocity",
                state_of=("mass", name),
            ),
            Element(FLOW, f"{place}.force", place, (None, name), reads=(codes.FORCE_INPUT, name)),
        ], []


class Frame(Node, kind="frame"):
    """A fixed position on the common axis of masses, or points fixed in the world.

    Its velocity is zero under any force. Ports: those of the links that name it, velocity and force. Stored and
    dissipated energy: none.
    """

    domain: ClassVar[str] = "translational"
    quantities: ClassVar[dict[str, str]] = {"position": "position"}

    initial_position: Annotated[
        float, Quantity("position", about="position on the common axis [m]")
    ] = 0.0
    points: Annotated[
        dict[str, tuple[float, ...]], NamedPoints("fixed points for links, in world axes [m]")
    ] = {}


class FrameRows(Lowering, kind="frame"):
    """Conversion to table rows of frames: fixed bodies on the axis."""


class Spring(Coupling, kind="spring"):
    """Linear spring with the force -stiffness (x_to - x_from - free_length), x the position of a port.

    With `preload` the force is preload - stiffness (length - length at the start), the length x_to - x_from
    (docs/course.md, 81). Ports: from, to; the force pushes `to` forward. Stored energy: force^2 / (2 stiffness) [J]
    (82). Dissipated energy: none.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("free_length", "preload"),)

    stiffness: Annotated[
        float, Quantity("stiffness", positive, "spring rate, force per length [N/m]", changes=VALUE)
    ]
    free_length: Annotated[
        float | None,
        Quantity(
            "length",
            nonnegative,
            "length x_to - x_from without load [m]; 0 without `preload` if left out",
            changes=VALUE,
        ),
    ] = None
    preload: Annotated[
        float | None,
        Quantity("force", about="force at the start, positive in compression [N]", changes=VALUE),
    ] = None

    def model_post_init(self, _: Any) -> None:
        if self.free_length is self.preload is None:
            object.__setattr__(self, "free_length", 0.0)

    def faults(self, name: str, around: CaseContext) -> Faults:
        distance = around.separation(self, "from", "to")
        if distance is not None and distance < 0.0 and (self.free_length or self.preload):
            yield (
                ("to",),
                f"{self.to} is behind {self.from_} at the start; exchange the keys `from` and `to`",
            )


class SpringRows(Lowering, kind="spring"):
    """Conversion to table rows of springs: a force that depends on the distance of two bodies."""

    ledger_name = "stored"
    table, rank = "brace", 0

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        x, row["speed"] = draft.join(row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["schedule"], row["stiffness"] = -1, link.stiffness
        row["force"] = (
            -link.stiffness * (x - link.free_length) if link.preload is None else link.preload
        )
        if link.preload is not None and draft.case.equilibrium_nodes:
            row["force"] -= link.stiffness * (
                x - draft.case.as_stated.separation(link.from_, link.to)
            )


class Damper(Coupling, kind="damper"):
    """A viscous damper with the force = -damping (v_to - v_from), v the velocity of each port.

    Ports: from, to; the force pushes `to` forward. Stored energy: none. Dissipated power: damping
    (v_to - v_from)^2 [W].
    """

    damping: Annotated[
        float, Quantity("damping", positive, "force per relative velocity [N s/m]", changes=VALUE)
    ]


class DamperRows(Lowering, kind="damper"):
    """Conversion to table rows of dampers: a force proportional to the relative velocity of two bodies."""

    ledger_name = "dissipated"
    table, rank = "brace", 1

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        _, row["speed"] = draft.join(row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["schedule"], row["damping"], row["force"] = (
            -1,
            link.damping,
            -link.damping * row["speed"],
        )


class EndStop(Coupling, kind="end-stop"):
    """Contact of two bodies where x_to - x_from is below `minimum` or above `maximum`; x is the position of a port.

    At the depth d beyond the limit the force is max(0, stiffness d + damping dd/dt). Ports: from, to; the force pushes
    `to` forward at `minimum` and backward (negative) at `maximum`; it never pulls. Stored energy: stiffness d^2 / 2
    [J]. Dissipated power: (force - stiffness d) dd/dt [W].
    """

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("minimum", "maximum"),)

    stiffness: Annotated[
        float, Quantity("stiffness", positive, "stiffness of the contact [N/m]", changes=VALUE)
    ]
    damping: Annotated[
        float, Quantity("damping", nonnegative, "damping of the contact [N s/m]", changes=VALUE)
    ] = 0.0
    minimum: Annotated[
        float | None,
        Quantity("position", about="x_to - x_from below which the stop acts [m]", changes=VALUE),
    ] = None
    maximum: Annotated[
        float | None,
        Quantity("position", about="x_to - x_from above which the stop acts [m]", changes=VALUE),
    ] = None

    def faults(self, name: str, around: CaseContext) -> Faults:
        if None not in (self.minimum, self.maximum) and self.minimum >= self.maximum:
            text = f"{self.maximum:g} m is not above `minimum`, {self.minimum:g} m; expected a greater value"
            yield ("maximum",), text


NO_STOP = 1e300  # distance to a stop that does not exist


class EndStopRows(Lowering, kind="end-stop"):
    """Conversion to table rows of end stops: a spring and a damper that act while two bodies are in contact."""

    table = "stop"

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        x, speed = draft.join(row, ("from_mass", "to_mass"), (link.from_, link.to))
        row["stiffness"], row["damping"] = link.stiffness, link.damping
        row["below"] = NO_STOP if link.minimum is None else x - link.minimum
        row["above"] = NO_STOP if link.maximum is None else link.maximum - x
        for distance, sign in ((float(row["below"]), 1.0), (float(row["above"]), -1.0)):
            if distance <= 0.0:
                row["force"] += sign * max(
                    0.0, link.stiffness * -distance + link.damping * float(-sign * speed)
                )


class Force(Coupling, kind="force"):
    """External force(t) that acts on `to` in forward direction, and in opposite direction on `from`, if given.

    Ports: from, to. Stored and dissipated energy: none; it supplies force times (v_to - v_from) [W], v the velocity of
    a port, in space along `direction`.
    """

    may_lack: ClassVar[tuple[str, ...]] = ("from",)

    from_: Annotated[
        str | None,
        Text("mass or point that takes the reaction; none if left out"),
        Field(alias="from"),
    ] = None
    force: Annotated[
        Schedule,
        Scheduled(
            "force",
            about="force on `to`, positive along `direction` (of masses: along their axis) [N]",
        ),
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
            text = "direction is missing: a force on a point needs this key or `from`; for example [0, 0, -1], downward"
            yield (), text
        if not around.spatial(self.to) and self.direction is not None:
            text = f"{self.to} moves along a single axis, which gives the direction of the force; remove this key"
            yield ("direction",), text

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("direction", self.direction)


class ForceRows(Lowering, kind="force"):
    """Conversion to table rows of external forces, which follow a schedule."""

    ledger_name = "supplied"
    table, rank = "brace", 2

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        toward = None if link.direction is None else link.direction / np.linalg.norm(link.direction)
        _, row["speed"] = draft.join(
            row, ("from_mass", "to_mass"), (link.from_, link.to), toward=toward
        )
        row["schedule"] = draft.schedules.add(link.force)

    def inputs(self, model, name, part):
        return {"force": Input(FORCE, model.schedule_of(name))}
