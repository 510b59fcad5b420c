"""A rigid body in space and the joint it hangs by. Knows its inertia and its points; knows no force."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.parts.attitude import Attitude, no_direction, uneven
from fvsolve.parts.body.points import Inertia, PlacesByName
from fvsolve.parts.node import Node
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table import Inside, Table
from fvsolve.parts.value import (
    PROFILE,
    Choice,
    Misfit,
    Quantity,
    Rows,
    Setting,
    Text,
    Usual,
    Value,
    nonnegative,
    positive,
)
from fvsolve.units import show

JOINTS = {  # kind -> keys that go with it, beside `on`, `at` and `attitude`
    "revolute": ("axis", "angle", "rate", "damping", "stiffness"),
    "prismatic": ("axis", "travel", "rate", "damping", "stiffness"),
    "ball": ("rate", "damping"),
    "free": ("velocity", "rate"),
    "fixed": (),
}
OFTEN = {"hinge": "revolute", "pin": "revolute", "slider": "prismatic", "spherical": "ball", "weld": "fixed",
         "floating": "free", "driven": "revolute or prismatic with a schedule as its angle or travel"}  # fmt: skip
TURNING = ("angular_velocity", "rotational_damping", "torque")
SLIDING = ("velocity", "damping", "stiffness")
WIDE = {"angular_velocity": "rad/s, of a prismatic joint m/s", "damping": "N m s, of a prismatic joint N s/m",
        "stiffness": "N m, of a prismatic joint N/m"}  # fmt: skip
ROTATION = {"x": "position", "y": "position", "z": "position", "roll": "angle", "pitch": "angle", "yaw": "angle",
            "eta": "number", "eps_x": "number", "eps_y": "number", "eps_z": "number"}  # fmt: skip


def along(name: str, dimension: str) -> dict[str, str]:
    """A quantity along x, y and z."""
    return {f"{name}{axis}": dimension for axis in "xyz"}


class OfJoint(Value):
    """A number whose unit hangs on the kind of joint, or three of them along the body's axes."""

    changes = PROFILE

    def __init__(self, dimension: str, about: str) -> None:
        self.dimension, self.about = dimension, about

    def read(self, given: Any, setting: Setting) -> float | tuple[float, ...]:
        if isinstance(given, (list, tuple)):
            return Rows(self.dimension, length=3).read(given, setting)
        return Quantity(self.dimension).read(given, setting)

    @property
    def takes(self) -> str:
        return WIDE[self.dimension]

    def json(self) -> dict[str, Any]:
        one = Quantity(self.dimension).json()
        return {"anyOf": [one, {"type": "array", "items": one, "minItems": 3}]}


class Joint(Table):
    """By what a body hangs on another, or on the world: which way it may move, where, and how it starts.

    The body's own origin lies at its joint. At angle or travel 0 its axes are those of the joint.
    """

    kind: Annotated[str, Choice("joint", tuple(JOINTS), "which way it may move", OFTEN)] = "free"
    on: Annotated[str | None, Text("BODY, BODY.POINT or FRAME.POINT; the world if left out")] = None
    at: Annotated[
        tuple[float, ...] | None, Rows("position", length=3, about="its place in the axes of `on` [m]; 0 if left out")
    ] = None
    attitude: Annotated[Attitude, Inside(Attitude, "of its axes in those of `on`")] = Attitude()
    axis: Annotated[tuple[float, ...] | None, Rows("number", length=3, about="in its own axes")] = None
    angle: Annotated[
        Schedule | None, Scheduled("angle", about="at the start [rad]; a schedule drives it; 0 if left out")
    ] = None
    travel: Annotated[
        Schedule | None, Scheduled("position", about="at the start [m]; a schedule drives it; 0 if left out")
    ] = None
    rate: Annotated[
        Any,
        OfJoint("angular_velocity", "at the start, of a ball or a free body [x, y, z] in its own axes; 0 if left out"),
    ] = None
    velocity: Annotated[
        tuple[float, ...] | None,
        Rows("velocity", length=3, about="of a free body's centre of mass at the start [m/s]; 0 if left out"),
    ] = None
    damping: Annotated[Any, OfJoint("damping", "torque or force against its rate; 0 if left out")] = None
    stiffness: Annotated[
        Any, OfJoint("stiffness", "of a spring that pulls its angle or travel back to 0; none if left out")
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults, kind = super().key_faults(given), given.get("kind", "free")
        own = JOINTS.get(kind) if isinstance(kind, str) else None
        if own is None:
            return faults
        others = {key for keys in JOINTS.values() for key in keys} - {*own}
        wanted = f"its keys are {', '.join(('on', 'at', 'attitude', *own))}"
        faults += [((key,), f"goes with no joint of kind {show(kind)}; {wanted}") for key in given if key in others]
        if "axis" in own and "axis" not in given:
            faults.append(((), f"axis is missing: a {kind} joint moves along or about one, for example [0, 1, 0]"))
        if kind == "free" and "on" in given:
            faults.append((("on",), "goes with no free joint, which joins a body to nothing; leave it out"))
        if isinstance(given.get("axis"), (list, tuple)) and len(given["axis"]) == 3:
            if all(isinstance(x, (int, float)) for x in given["axis"]) and no_direction(given["axis"]):
                faults.append((("axis",), "is all zeros; wanted a direction, for example [0, 1, 0]"))
        if "at" in given and isinstance(given.get("on"), str) and "." in given["on"]:
            faults.append((("at",), f"{given['on']} says where it is; leave at out, or name the body alone"))
        return faults

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        """The same; rate, damping and stiffness read in the units of its kind."""
        kind, found, faults = given.get("kind", "free"), dict(given), []
        rate, damping, stiffness = SLIDING if kind == "prismatic" else TURNING
        three = kind in ("ball", "free")
        values = {"rate": Rows(rate, length=3) if three else Quantity(rate), "damping": Quantity(damping, nonnegative),
                  "stiffness": Quantity(stiffness, nonnegative)}  # fmt: skip
        for key, value in values.items():
            try:
                if key in given:
                    found[key] = value.read(given[key], setting)
            except Misfit as error:
                faults += [((key, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((key,), str(error)))
        driven = [key for key in ("angle", "travel") if isinstance(given.get(key), dict)]
        for key in ("rate", "damping", "stiffness") if driven else ():
            if key in given:
                faults.append(((key,), f"its {driven[0]} is driven, so its {key} decides nothing; leave it out"))
        if faults:
            raise Misfit(faults)
        return found

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from uneven("axis", self.axis)

    @property
    def driven(self) -> Schedule | None:
        """What drives it, if anything does."""
        given = self.coordinate
        return given if given is not None and not given.constant else None

    @property
    def coordinate(self) -> Schedule | None:
        """Its angle or travel."""
        return self.travel if self.kind == "prismatic" else self.angle

    @property
    def unit_axis(self) -> np.ndarray:
        """Its axis, of length 1 : float64[3]."""
        axis = np.array(self.axis or (0.0, 0.0, 0.0))
        return axis / (np.linalg.norm(axis) or 1.0)

    @property
    def turning(self) -> np.ndarray:
        """Angular velocity of a ball or a free body at the start, in its own axes : float64[3]."""
        return np.array(self.rate or (0.0, 0.0, 0.0))

    @property
    def speed(self) -> np.ndarray:
        """Velocity of a free body's centre of mass at the start : float64[3]."""
        return np.array(self.velocity or (0.0, 0.0, 0.0))


class Body(Node, kind="body"):
    """A rigid body, F = m a_c and T = J alpha + w x J w about its centre of mass (68), moved by its joint's freedoms.

    Ports: its origin, and its points, `NAME.POINT`; velocity and force. Stored energy: m v_c^2 / 2 + w J w / 2 +
    m g z_c + k s^2 / 2 of its joint [J]. Dissipated power: damping times rate^2 of its joint [W]; a driven joint brings
    its torque times rate.
    """

    domain: ClassVar[str] = "spatial"
    quantities: ClassVar[dict[str, str]] = {
        **ROTATION, **along("v", "velocity"), **along("w", "angular_velocity"), **along("a", "acceleration"),
        "angle": "angle", "travel": "position", "rate": "angular_velocity",
        **along("joint_f", "force"), **along("joint_t", "torque"), "kinetic_energy": "energy",
        **along("momentum_", "momentum"), **along("angular_momentum_", "angular_momentum"),
    }  # fmt: skip

    mass: Annotated[float, Quantity("mass", positive, "of all that moves with it [kg]",
                                    Usual(1e-6, 1e9, "poppets to ships"))]  # fmt: skip
    inertia: Annotated[Any, Inertia()]
    centre_of_mass: Annotated[tuple[float, ...], Rows("position", length=3, about="in its own axes [m]")] = (
        0.0, 0.0, 0.0
    )  # fmt: skip
    points: Annotated[dict[str, tuple[float, ...]], PlacesByName()] = {}
    joint: Annotated[Joint, Inside(Joint, "by which it hangs on another, or on the world")] = Joint()

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        where = "decides nothing: a body is where joint.at, angle or travel put it; leave it out"
        return faults + [((key,), where) for key in ("elevation", "position") if key in given]

    def moment(self) -> np.ndarray:
        """Its inertia about the centre of mass in its own axes [kg m2] : float64[3, 3]."""
        given = np.array(self.inertia, dtype=float)
        return np.diag(given) if given.ndim == 1 else given


SHARES = ("relative", "coriolis", "transversal", "centripetal")


class BodyPoint(Node, kind=""):
    """A point of a body, or of the world: where a link may push. No part of its own."""

    kind: ClassVar[str] = "point"
    domain: ClassVar[str] = "spatial"
    quantities: ClassVar[dict[str, str]] = {
        **along("", "position"), **along("v", "velocity"), **along("a", "acceleration"),
        **{f"a{axis}_{share}": "acceleration" for axis in "xyz" for share in SHARES},
    }  # fmt: skip
