"""Values of a case file for the points of a body and for its inertia."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from fvsolve.parts.value import Matrix, ReadContext, Rows, Value, ValueFault, nonnegative
from fvsolve.units import show

MOMENT_TOLERANCE = 1e-6  # share of the largest moment: tolerance of the triangle inequality for numbers of six digits


class NamedPoints(Value):
    """Value of a case file for a table of points, name -> [x, y, z]."""

    takes = "`{ NAME = [x, y, z] }`"

    def __init__(self, about: str = "points for links, in the axes of the body [m]") -> None:
        self.about = about

    def read(self, given: Any, setting: ReadContext) -> dict[str, tuple[float, ...]]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is not a table; expected {{ NAME = [x, y, z] }}")
        points, faults = {}, []
        for name, place in given.items():
            if not re.fullmatch(r"[\w-]+", name):
                faults.append(((name,), f"{show(name)} is not a valid name; a name has letters, digits, _ and -"))
            try:
                points[name] = Rows("position", length=3).read(place, setting)
            except ValueFault as error:
                faults += [((name, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((name,), str(error)))
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
            raise ValueError(f"moments of {text} kg m2 are not possible: the largest exceeds the sum of the other two")
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
        raise ValueError(f"has a principal moment of {moments[0]:.4g} kg m2; expected principal moments of at least 0")
    return moments
