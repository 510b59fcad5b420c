"""How a case says an attitude: in one form or several, held against each other. Knows forms; turns nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve import attitude
from fvsolve.parts.table import Table
from fvsolve.parts.value import Matrix, Misfit, Quantity, Rows, Setting, Usual

TURNS = Usual(-6.3, 6.3, "a turn either way")
TYPED = 1e-6  # what numbers typed with six digits are off by, of 1; beyond it is noted
LOOSE = 1e-3  # R'R - I of a matrix typed with three digits, and [rad] between forms; beyond it is a fault
SHORTEST = 1e-100  # of an axis
ANGLES = ("roll", "pitch", "yaw")


def Angle(about: str) -> Quantity:
    """An angle of an attitude."""
    return Quantity("angle", about=about, usual=TURNS)


class Attitude(Table):
    """How axes b stand in axes a: R^a_b by angles (40), (41), axis and angle (43), Euler parameters (45) or a matrix.

    Of several forms all must say the same; the first of them, in this order, is taken.
    """

    roll: Annotated[
        float | None, Quantity("angle", about="about x, the last turn [rad]; 0 if left out", usual=TURNS)
    ] = None
    pitch: Annotated[
        float | None, Quantity("angle", about="about y, the turn between [rad]; 0 if left out", usual=TURNS)
    ] = None
    yaw: Annotated[
        float | None, Quantity("angle", about="about z, the first turn [rad]; 0 if left out", usual=TURNS)
    ] = None
    zyz: Annotated[
        tuple[float, ...] | None,
        Rows("angle", length=3, about="[psi, theta, phi], classical Euler angles [rad]", usual=TURNS),
    ] = None
    axis: Annotated[tuple[float, ...] | None, Rows("number", length=3, about="that it is turned about by angle")] = None
    angle: Annotated[float | None, Angle("about axis [rad]")] = None
    euler_parameters: Annotated[tuple[float, ...] | None, Rows("number", length=4, about="[eta, e1, e2, e3]")] = None
    matrix: Annotated[tuple | None, Matrix("number", about="its columns are the axes of b as a sees them")] = None

    meant: ClassVar[dict[str, str]] = {
        "rpy": "roll, pitch, yaw", "heel": "roll", "trim": "pitch", "heading": "yaw", "rotation": "matrix",
        "quaternion": "euler_parameters = [eta, e1, e2, e3]", "euler_angles": "zyz, or roll, pitch, yaw",
    }  # fmt: skip
    forms: ClassVar[dict[tuple[str, ...], Callable[..., np.ndarray]]] = {
        ANGLES: attitude.of_roll_pitch_yaw,
        ("zyz",): lambda zyz: attitude.of_zyz(*zyz),
        ("axis", "angle"): attitude.of_axis,
        ("euler_parameters",): attitude.of_euler_parameters,
        ("matrix",): lambda matrix: attitude.nearest(np.array(matrix)),
    }

    @property
    def rotation(self) -> np.ndarray:
        """R^a_b : float64[3, 3]; of no form at all the identity."""
        return next(iter(self._rotations().values()), np.eye(3))

    @property
    def parameters(self) -> np.ndarray:
        """(eta, eps), eta not negative : float64[4]."""
        return attitude.euler_parameters(self.rotation)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        pairs = (("axis", "angle"), ("angle", "axis"))
        alone = [(one, other) for one, other in pairs if one in given and other not in given]
        return super().key_faults(given) + [((one,), f"wants an {other} beside it") for one, other in alone]

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        """The same table; Misfit where a form is no rotation, or another than the first."""
        said = readable(cls, given, setting)
        faults = dict([*_no_length(said), *_no_rotation(said)])
        whole = [keys for keys in cls.forms if all(one in said and one not in faults for one in keys if one in given)]
        sound = cls.model_construct(**{key: said[key] for keys in whole for key in keys if key in said})
        faults |= {key: f"{text}; wanted the same rotation" for key, text, apart in sound._apart() if apart > LOOSE}
        if faults:
            raise Misfit([((key,), text) for key, text in faults.items()])
        return given

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from uneven("axis", self.axis)
        yield from uneven("euler_parameters", self.euler_parameters)
        off = attitude.defect(np.array(self.matrix))[0] if self.matrix else 0.0
        if off > TYPED:
            yield ("matrix",), off, TYPED, f"R'R is the identity but for {off:.2g}; the nearest rotation is taken"
        for key, text, apart in self._apart():
            if apart > TYPED:
                yield (key,), apart, TYPED, f"{text}; the latter is taken"

    def _rotations(self) -> dict[str, np.ndarray]:
        """The rotation that each form says that is given, by its first key."""
        found = {}
        for keys, form in self.forms.items():
            values = [getattr(self, key) for key in keys]
            if keys == ANGLES and values != [None] * 3:
                values = [one or 0.0 for one in values]
            if None not in values:
                found["roll" if keys == ANGLES else keys[0]] = form(*values)
        return found

    def _apart(self) -> Iterator[tuple[str, str, float]]:
        """(key, text, angle [rad]) of every form beside the first."""
        (first, rotation), *others = self._rotations().items() or [("", None)]
        for key, other in others:
            angle = attitude.axis_angle(attitude.deviation(other, rotation))[1]
            name = "roll, pitch, yaw" if first == "roll" else first
            yield (
                key,
                f"is {math.degrees(angle):.3g} deg away from what {name} say{'' if first == 'roll' else 's'}",
                angle,
            )


def readable(table: type[Table], given: dict[str, Any], setting: Setting) -> dict[str, Any]:
    """The values of those keys that can be read: of others the table itself says what is wrong."""
    found = {}
    for key, value in table.values().items():
        try:
            if key in given:
                found[key] = value.read(given[key], setting)
        except ValueError:
            continue
    return found


def uneven(key: str, given: tuple[float, ...] | None) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
    """What is odd of a direction, or of Euler parameters, whose length is not 1: it is divided by it."""
    length = math.hypot(*given) if given else 1.0
    if abs(length - 1.0) > TYPED:
        yield (key,), length, 1.0, f"its length is {length:.6g}, not 1; it is divided by it"


def no_direction(given: tuple[float, ...] | None) -> bool:
    """Whether a vector is given that points nowhere, or has no square."""
    return given is not None and math.hypot(*given) < SHORTEST


def _no_length(said: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, wanted in (("axis", "[0, 0, 1]"), ("euler_parameters", "[1, 0, 0, 0], which turns nothing")):
        if no_direction(said.get(key)):
            yield key, f"is all zeros; wanted a length of 1, for example {wanted}"


def _no_rotation(said: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "matrix" not in said:
        return
    off, determinant = attitude.defect(np.array(said["matrix"]))
    if off > LOOSE:
        yield (
            "matrix",
            f"is no rotation: R'R is the identity but for {off:.3g}; wanted columns of length 1 at right angles",
        )
    elif determinant < 0.0:
        yield "matrix", "is no rotation but a mirror: its determinant is -1; wanted +1, right-handed axes"
