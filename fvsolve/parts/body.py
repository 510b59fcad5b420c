"""Rigid bodies in space, and their joints."""

import re
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.parts.attitude_keys import Attitude, is_zero_vector, length_notices
from fvsolve.parts.nodes_and_links import Node
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import Nested, Table, check_table
from fvsolve.parts.value import (
    PROFILE,
    Choice,
    Matrix,
    Quantity,
    ReadContext,
    Rows,
    Text,
    UsualRange,
    Value,
    ValueFault,
    faults_of,
    nonnegative,
    positive,
)
from fvsolve.units import show

# share of the largest moment: tolerance of the triangle inequality for numbers of six digits
MOMENT_TOLERANCE = 1e-6


class NamedPoints(Value):
    """Value of a case file for a table of points, name -> [x, y, z]."""

    takes = "`{ NAME = [x, y, z] }`"

    def __init__(self, about: str = "points for links, in the axes of the body [m]") -> None:
        self.about = about

    def read(self, given: Any, setting: ReadContext) -> dict[str, tuple[float, ...]]:
        check_table(given, "{ NAME = [x, y, z] }")
        points, faults = {}, []
        for name, place in given.items():
            if not re.fullmatch(r"[\w-]+", name):
                faults.append(
                    (
                        (name,),
                        f"{show(name)} is not a valid name; a name has letters, digits, _ and -",
                    )
                )
            try:
                points[name] = Rows("position", length=3).read(place, setting)
            except ValueError as error:
                faults += faults_of(error, name)
        if faults:
            raise ValueFault(faults)
        return points

    def below(self, key: str) -> Value:
        return Rows("position", length=3)

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": Rows("position", length=3).json()}


class Inertia(Value):
    """Value of a case file for the inertia of a body.

    It is three moments about axes through the centre of mass, or the whole symmetric matrix.
    """

    about = "inertia about the centre of mass in the axes of the body: moments about x, y, z, or 3 x 3 [kg m2]"
    takes = "[kg m2, kg m2, kg m2], or three such rows"
    changes = "profile"

    def read(self, given: Any, setting: ReadContext) -> tuple:
        if not isinstance(given, (list, tuple)) or len(given) != 3:
            raise ValueError(
                f"{show(given)} is not an inertia; expected moments about x, y and z, or three rows of three numbers"
            )
        if any(isinstance(row, (list, tuple)) for row in given):
            inertia = Matrix("inertia").read(given, setting)
            moments = principal_moments(inertia)
        else:
            inertia = Rows("inertia", nonnegative, length=3).read(given, setting)
            moments = np.sort(inertia)
        if moments[2] > moments[0] + moments[1] + MOMENT_TOLERANCE * moments[2]:
            text = ", ".join(f"{moment:.4g}" for moment in moments)
            raise ValueError(
                f"moments of {text} kg m2 are not possible: the largest exceeds the sum of the other two"
            )
        return inertia

    def below(self, key: str) -> Value:
        return Rows("inertia", length=3)

    def json(self) -> dict[str, Any]:
        return {"anyOf": [Rows("inertia", length=3).json(), Matrix("inertia").json()]}


def principal_moments(rows: tuple) -> np.ndarray:
    """Principal moments of an inertia matrix [kg m2], ascending : float64[3].

    Raises ValueError if the matrix is not symmetric or a moment is negative.
    """
    matrix = np.array(rows)
    if np.abs(matrix - matrix.T).max() > MOMENT_TOLERANCE * np.abs(matrix).max():
        raise ValueError(
            f"{show(rows)} is not symmetric; expected moments on the diagonal, and minus the products of inertia "
            "elsewhere"
        )
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] < -MOMENT_TOLERANCE * moments[2]:
        raise ValueError(
            f"has a principal moment of {moments[0]:.4g} kg m2; expected principal moments of at least 0"
        )
    return moments


JOINT_KEYS = {  # kind -> keys it allows besides `on`, `at` and `attitude`
    "revolute": ("axis", "angle", "rate", "damping", "stiffness"),
    "prismatic": ("axis", "travel", "rate", "damping", "stiffness"),
    "ball": ("rate", "damping"),
    "free": ("velocity", "rate"),
    "fixed": (),
}
JOINT_SYNONYMS = {
    "hinge": "revolute",
    "pin": "revolute",
    "slider": "prismatic",
    "spherical": "ball",
    "weld": "fixed",
    "floating": "free",
    "driven": "revolute or prismatic with a schedule as its angle or travel",
}
ANGULAR_DIMENSIONS = ("angular_velocity", "rotational_damping", "torque")
LINEAR_DIMENSIONS = ("velocity", "damping", "stiffness")
UNITS_BY_JOINT = {
    "angular_velocity": "rad/s, of a prismatic joint m/s",
    "damping": "N m s, of a prismatic joint N s/m",
    "stiffness": "N m, of a prismatic joint N/m",
}
POSE_QUANTITIES = {
    "x": "position",
    "y": "position",
    "z": "position",
    "roll": "angle",
    "pitch": "angle",
    "yaw": "angle",
    "eta": "number",
    "eps_x": "number",
    "eps_y": "number",
    "eps_z": "number",
}


def vector_quantities(name: str, dimension: str) -> dict[str, str]:
    """Names of the x, y and z components of a vector, each with its dimension; `name` precedes the axis."""
    return {f"{name}{axis}": dimension for axis in "xyz"}


class JointQuantity(Value):
    """Value of a case file: a number whose unit depends on the kind of joint, or three numbers along the body axes."""

    changes = PROFILE

    def __init__(self, dimension: str, about: str) -> None:
        self.dimension, self.about = dimension, about

    def read(self, given: Any, setting: ReadContext) -> float | tuple[float, ...]:
        if isinstance(given, (list, tuple)):
            return Rows(self.dimension, length=3).read(given, setting)
        return Quantity(self.dimension).read(given, setting)

    @property
    def takes(self) -> str:
        return UNITS_BY_JOINT[self.dimension]

    def json(self) -> dict[str, Any]:
        number = Quantity(self.dimension).json()
        return {"anyOf": [number, {"type": "array", "items": number, "minItems": 3}]}


class Joint(Table):
    """Joint between a body and another body or the world: kind, position, initial state.

    The origin of the body lies at its joint. At angle or travel 0 the axes of the body are those of the joint.
    """

    kind: Annotated[
        str,
        Choice(
            "joint", tuple(JOINT_KEYS), "kind of joint (its degrees of freedom)", JOINT_SYNONYMS
        ),
    ] = "free"
    on: Annotated[
        str | None, Text("carrier: BODY, BODY.POINT or FRAME.POINT; the world if left out")
    ] = None
    at: Annotated[
        tuple[float, ...] | None,
        Rows(
            "position",
            length=3,
            about="position of the joint in the axes of its carrier `on` [m]; 0 if left out",
        ),
    ] = None
    attitude: Annotated[
        Attitude, Nested(Attitude, "attitude of the joint axes in the axes of its carrier `on`")
    ] = Attitude()
    axis: Annotated[
        tuple[float, ...] | None, Rows("number", length=3, about="axis of motion in the joint axes")
    ] = None
    angle: Annotated[
        Schedule | None,
        Scheduled(
            "angle",
            about="angle at the start, or a schedule that drives the joint [rad]; 0 if left out",
            moves=True,
        ),
    ] = None
    travel: Annotated[
        Schedule | None,
        Scheduled(
            "position",
            about="travel at the start, or a schedule that drives the joint [m]; 0 if left out",
            moves=True,
        ),
    ] = None
    rate: Annotated[
        Any,
        JointQuantity(
            "angular_velocity",
            "rate of angle or travel at the start; of a ball or free joint the angular velocity [x, y, z] in body axes"
            "; 0 if left out",
        ),
    ] = None
    velocity: Annotated[
        tuple[float, ...] | None,
        Rows(
            "velocity",
            length=3,
            about="velocity of the centre of mass of a free body at the start [m/s]; 0 if left out",
        ),
    ] = None
    damping: Annotated[
        Any,
        JointQuantity("damping", "damping torque or force per rate of the joint; 0 if left out"),
    ] = None
    stiffness: Annotated[
        Any,
        JointQuantity(
            "stiffness", "stiffness of a spring towards angle or travel 0; none if left out"
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults, kind = super().key_faults(given), given.get("kind", "free")
        own = JOINT_KEYS.get(kind) if isinstance(kind, str) else None
        if own is None:
            return faults
        others = {key for keys in JOINT_KEYS.values() for key in keys} - {*own}
        allowed = f"its keys are {', '.join(('on', 'at', 'attitude', *own))}"
        faults += [
            ((key,), f"is not a key of joints of kind {show(kind)}; {allowed}")
            for key in given
            if key in others
        ]
        if "axis" in own and "axis" not in given:
            faults.append(((), f"axis is missing: a {kind} joint needs it, for example [0, 1, 0]"))
        if kind == "free" and "on" in given:
            faults.append(
                (("on",), "is not valid for a free joint, which has no carrier; remove this key")
            )
        if isinstance(given.get("axis"), (list, tuple)) and len(given["axis"]) == 3:
            if all(isinstance(x, (int, float)) for x in given["axis"]) and is_zero_vector(
                given["axis"]
            ):
                faults.append(
                    (("axis",), "is all zeros; expected a direction, for example [0, 1, 0]")
                )
        if "at" in given and isinstance(given.get("on"), str) and "." in given["on"]:
            text = f"{given['on']} gives the position already; remove `at`, or give a body without point in `on`"
            faults.append((("at",), text))
        return faults

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Copy of a table in which the keys `rate`, `damping` and `stiffness` are read in units of the kind of joint.

        Raises ValueFault for an invalid value.
        """
        kind = given.get("kind", "free")
        result = dict(given)
        faults = []
        rate, damping, stiffness = LINEAR_DIMENSIONS if kind == "prismatic" else ANGULAR_DIMENSIONS
        triple = kind in ("ball", "free")
        values = {
            "rate": Rows(rate, length=3) if triple else Quantity(rate),
            "damping": Quantity(damping, nonnegative),
            "stiffness": Quantity(stiffness, nonnegative),
        }
        for key, value in values.items():
            try:
                if key in given:
                    result[key] = value.read(given[key], setting)
            except ValueError as error:
                faults += faults_of(error, key)
        driven = [key for key in ("angle", "travel") if isinstance(given.get(key), dict)]
        for key in ("rate", "damping", "stiffness") if driven else ():
            if key in given:
                faults.append(
                    (
                        (key,),
                        f"has no effect, because {driven[0]} is driven by a schedule; remove this key",
                    )
                )
        if faults:
            raise ValueFault(faults)
        return result

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)

    @property
    def drive_schedule(self) -> Schedule | None:
        """Schedule that drives the joint; None if the joint moves freely."""
        given = self.coordinate
        return given if given is not None and not given.constant else None

    @property
    def coordinate(self) -> Schedule | None:
        """Angle [rad] or travel [m] of the joint, as a schedule; None if not given."""
        return self.travel if self.kind == "prismatic" else self.angle

    @property
    def unit_axis(self) -> np.ndarray:
        """Unit vector along the axis of the joint, zeros for a joint without axis : float64[3]."""
        axis = np.array(self.axis or (0.0, 0.0, 0.0))
        return axis / (np.linalg.norm(axis) or 1.0)

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocity [rad/s] of a ball joint or a free body at the start, in axes of the body : float64[3]."""
        return np.array(self.rate or (0.0, 0.0, 0.0))

    @property
    def centre_velocity(self) -> np.ndarray:
        """Velocity of the centre of mass of a free body at the start [m/s], in axes of the world : float64[3]."""
        return np.array(self.velocity or (0.0, 0.0, 0.0))


class Body(Node, kind="body"):
    """A rigid body: force = mass times acceleration of its centre, torque = J alpha + w x J w; moved by its joint.

    J is the inertia about the centre of mass, w the angular velocity, alpha its rate (docs/course.md, 68). Ports: its
    origin, and its points, `NAME.POINT`; velocity and force. Stored energy [J]: mass v^2 / 2 + w J w / 2 + mass g z +
    k s^2 / 2, with velocity v and height z of the centre, and stiffness k and coordinate s of its joint. Dissipated
    power: damping times rate^2 of its joint [W]. A driven joint supplies its torque times rate.
    """

    domain: ClassVar[str] = "spatial"
    quantities: ClassVar[dict[str, str]] = {
        **POSE_QUANTITIES,
        **vector_quantities("v", "velocity"),
        **vector_quantities("w", "angular_velocity"),
        **vector_quantities("a", "acceleration"),
        "angle": "angle",
        "travel": "position",
        "rate": "angular_velocity",
        **vector_quantities("joint_f", "force"),
        **vector_quantities("joint_t", "torque"),
        "kinetic_energy": "energy",
        **vector_quantities("momentum_", "momentum"),
        **vector_quantities("angular_momentum_", "angular_momentum"),
    }

    mass: Annotated[
        float,
        Quantity(
            "mass",
            positive,
            "mass of the body and all that is fixed to it [kg]",
            UsualRange(1e-6, 1e9, "poppets to ships"),
        ),
    ]
    inertia: Annotated[Any, Inertia()]
    centre_of_mass: Annotated[
        tuple[float, ...],
        Rows("position", length=3, about="centre of mass in the axes of the body [m]"),
    ] = (0.0, 0.0, 0.0)
    points: Annotated[dict[str, tuple[float, ...]], NamedPoints()] = {}
    joint: Annotated[Joint, Nested(Joint, "joint to another body or the world")] = Joint()

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        where = "has no effect: `joint.at`, `angle` or `travel` sets the position of a body; remove this key"
        return faults + [((key,), where) for key in ("elevation", "position") if key in given]

    def inertia_matrix(self) -> np.ndarray:
        """Inertia matrix about the centre of mass in the axes of the body [kg m2] : float64[3, 3]."""
        given = np.array(self.inertia, dtype=float)
        return np.diag(given) if given.ndim == 1 else given


ACCELERATION_TERMS = ("relative", "coriolis", "transversal", "centripetal")


class BodyPoint(Node, kind=""):
    """A point of a body or of the world, to which a link may apply a force; not a part of a case file."""

    kind: ClassVar[str] = "point"
    domain: ClassVar[str] = "spatial"
    quantities: ClassVar[dict[str, str]] = {
        **vector_quantities("", "position"),
        **vector_quantities("v", "velocity"),
        **vector_quantities("a", "acceleration"),
        **{f"a{axis}_{share}": "acceleration" for axis in "xyz" for share in ACCELERATION_TERMS},
    }


class BodyRows(Lowering, kind="body"):
    """Conversion to table rows of rigid bodies in space: none beside those that the case computes of all bodies."""
