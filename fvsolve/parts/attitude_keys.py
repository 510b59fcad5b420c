"""Attitude of a body: the keys of its representations, checked against each other."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve import attitude
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import Matrix, Quantity, ReadContext, Rows, UsualRange, ValueFault

USUAL_ANGLES = UsualRange(-6.3, 6.3, "one turn in either direction")
ROUNDING = 1e-6  # rounding of numbers typed with six digits; larger deviations give a notice
# R'R - I of a matrix typed with three digits, and [rad] between forms; larger deviations are faults
TOLERANCE = 1e-3
SHORTEST = 1e-100  # smallest length of an axis
ANGLES = ("roll", "pitch", "yaw")


def Angle(about: str) -> Quantity:
    """Declaration of a key for an angle of an attitude."""
    return Quantity("angle", about=about, usual=USUAL_ANGLES)


class Attitude(Table):
    """Rotation matrix from the rotated axes of a body or joint to its reference axes, in one of five forms.

    The forms are roll, pitch and yaw (docs/course.md, 40); zyz Euler angles (41); axis and angle (43); Euler parameters
    (45); a matrix. If several forms are given, they must agree; the first in this order is used.
    """

    roll: Annotated[
        float | None, Angle("angle about x, the last rotation [rad]; 0 if left out")
    ] = None
    pitch: Annotated[
        float | None, Angle("angle about y, the second rotation [rad]; 0 if left out")
    ] = None
    yaw: Annotated[
        float | None, Angle("angle about z, the first rotation [rad]; 0 if left out")
    ] = None
    zyz: Annotated[
        tuple[float, ...] | None,
        Rows(
            "angle",
            length=3,
            about="classical Euler angles [psi, theta, phi] about z, y and z [rad]",
            usual=USUAL_ANGLES,
        ),
    ] = None
    axis: Annotated[
        tuple[float, ...] | None,
        Rows("number", length=3, about="axis of a single rotation by `angle`"),
    ] = None
    angle: Annotated[float | None, Angle("angle of a single rotation about `axis` [rad]")] = None
    euler_parameters: Annotated[
        tuple[float, ...] | None,
        Rows("number", length=4, about="Euler parameters [eta, e1, e2, e3]"),
    ] = None
    matrix: Annotated[
        tuple | None,
        Matrix(
            "number",
            about="rotation matrix R; its columns are the rotated axes in the reference axes",
        ),
    ] = None

    synonyms: ClassVar[dict[str, str]] = {
        "rpy": "roll, pitch, yaw",
        "heel": "roll",
        "trim": "pitch",
        "heading": "yaw",
        "rotation": "matrix",
        "quaternion": "euler_parameters = [eta, e1, e2, e3]",
        "euler_angles": "zyz, or roll, pitch, yaw",
    }
    forms: ClassVar[dict[tuple[str, ...], Callable[..., np.ndarray]]] = {
        ANGLES: attitude.of_roll_pitch_yaw,
        ("zyz",): lambda zyz: attitude.of_zyz(*zyz),
        ("axis", "angle"): attitude.of_axis,
        ("euler_parameters",): attitude.of_euler_parameters,
        ("matrix",): lambda matrix: attitude.nearest(np.array(matrix)),
    }

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix : float64[3, 3], columns are the rotated axes in the reference axes; identity by default."""
        return next(iter(self._rotations().values()), np.eye(3))

    @property
    def parameters(self) -> np.ndarray:
        """Euler parameters (eta, e1, e2, e3) of the rotation, eta not negative : float64[4]."""
        return attitude.euler_parameters(self.rotation)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        pairs = (("axis", "angle"), ("angle", "axis"))
        alone = [(key, other) for key, other in pairs if key in given and other not in given]
        return super().key_faults(given) + [
            ((key,), f"needs the key `{other}` too") for key, other in alone
        ]

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Return the table unchanged. Raises ValueFault if a form is not a rotation, or differs from the first form."""
        values = valid_values(cls, given, setting)
        faults = {}
        for key, example in (
            ("axis", "[0, 0, 1]"),
            ("euler_parameters", "[1, 0, 0, 0], the identity"),
        ):
            if is_zero_vector(values.get(key)):
                faults[key] = f"has zero length; expected a length of 1, for example {example}"
        faults |= dict(_rotation_faults(values))
        complete = [
            keys
            for keys in cls.forms
            if all(item in values and item not in faults for item in keys if item in given)
        ]
        sound = cls.model_construct(
            **{key: values[key] for keys in complete for key in keys if key in values}
        )
        faults |= {
            key: f"{text}; expected the same rotation"
            for key, text, apart in sound._deviations()
            if apart > TOLERANCE
        }
        if faults:
            raise ValueFault([((key,), text) for key, text in faults.items()])
        return given

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from length_notices("axis", self.axis)
        yield from length_notices("euler_parameters", self.euler_parameters)
        off = attitude.defect(np.array(self.matrix))[0] if self.matrix else 0.0
        if off > ROUNDING:
            message = (
                "is not exactly a rotation: R'R differs from the identity by "
                f"{off:.2g}; the nearest rotation is used"
            )
            yield ("matrix",), off, ROUNDING, message
        for key, text, apart in self._deviations():
            if apart > ROUNDING:
                yield (key,), apart, ROUNDING, f"{text}; the latter is used"

    def _rotations(self) -> dict[str, np.ndarray]:
        """Rotation matrix of each given form : first key of the form -> float64[3, 3]."""
        result = {}
        for keys, form in self.forms.items():
            values = [getattr(self, key) for key in keys]
            if keys == ANGLES and values != [None] * 3:
                values = [angle or 0.0 for angle in values]
            if None not in values:
                result["roll" if keys == ANGLES else keys[0]] = form(*values)
        return result

    def _deviations(self) -> Iterator[tuple[str, str, float]]:
        """Compare each given form except the first with the first form; yield (key, text, angle [rad]).

        key : first key of the form; text : description of the deviation
        angle : angle of the rotation between both attitudes
        """
        (first, rotation), *others = self._rotations().items() or [("", None)]
        for key, other in others:
            angle = attitude.axis_angle(attitude.deviation(other, rotation))[1]
            name = "roll, pitch, yaw" if first == "roll" else first
            text = (
                f"is {math.degrees(angle):.3g} deg from the attitude that {name} "
                f"give{'' if first == 'roll' else 's'}"
            )
            yield (key, text, angle)


def valid_values(table: type[Table], given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
    """Read the keys that have valid values : key -> value.

    Other keys are left out; the table itself reports their faults.
    """
    result = {}
    for key, value in table.values().items():
        with suppress(KeyError, ValueError):
            result[key] = value.read(given[key], setting)
    return result


def length_notices(
    key: str, given: tuple[float, ...] | None
) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
    """Yield a notice if a direction or Euler parameters have a length other than 1; they are divided by their length.

    key : key of the vector; given : its components
    """
    length = math.hypot(*given) if given else 1.0
    if abs(length - 1.0) > ROUNDING:
        yield (
            (key,),
            length,
            1.0,
            f"the vector has length {length:.6g}, not 1, and is divided by this length",
        )


def is_zero_vector(given: tuple[float, ...] | None) -> bool:
    """True if a vector is given and its length is zero, or too small to be squared."""
    return given is not None and math.hypot(*given) < SHORTEST


def _rotation_faults(values: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "matrix" not in values:
        return
    off, determinant = attitude.defect(np.array(values["matrix"]))
    if off > TOLERANCE:
        text = f"is not a rotation: R'R differs from the identity by {off:.3g}; expected orthogonal columns of length 1"
        yield "matrix", text
    elif determinant < 0.0:
        text = "is a reflection: its determinant is -1; expected a rotation, with determinant +1 and right-handed axes"
        yield "matrix", text
