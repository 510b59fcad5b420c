"""PlacesByName of a body and its inertia, as a case says them. Knows forms and ranges; knows no joint."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from fvsolve.parts.value import Matrix, Misfit, Rows, Setting, Value, nonnegative
from fvsolve.units import show

SLACK = 1e-6  # of the largest moment, by which numbers typed with six digits may break the triangle inequality


class PlacesByName(Value):
    """A table of places by name."""

    takes = "`{ NAME = [x, y, z] }`"

    def __init__(self, about: str = "places that links push at, in its own axes [m]") -> None:
        self.about = about

    def read(self, given: Any, setting: Setting) -> dict[str, tuple[float, ...]]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table; wanted {{ NAME = [x, y, z] }}")
        found, faults = {}, []
        for name, place in given.items():
            if not re.fullmatch(r"[\w-]+", name):
                faults.append(((name,), f"{show(name)} is no name; a name has letters, digits, _ and -"))
            try:
                found[name] = Rows("position", length=3).read(place, setting)
            except Misfit as error:
                faults += [((name, *below), text) for below, text in error.faults]
            except ValueError as error:
                faults.append(((name,), str(error)))
        if faults:
            raise Misfit(faults)
        return found

    def below(self, key: str) -> Value:
        return Rows("position", length=3)

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": Rows("position", length=3).json()}


class Inertia(Value):
    """Three moments about the axes through the centre of mass, or the whole matrix, symmetric."""

    about = "about the centre of mass in its own axes: moments about x, y, z, or 3 x 3 [kg m2]"
    takes = "[kg m2, kg m2, kg m2], or three such rows"
    changes = "profile"

    def read(self, given: Any, setting: Setting) -> tuple:
        if not isinstance(given, (list, tuple)) or len(given) != 3:
            raise ValueError(f"{show(given)} is no inertia; wanted moments about x, y and z, or three rows of three")
        if any(isinstance(row, (list, tuple)) for row in given):
            found = Matrix("inertia").read(given, setting)
            moments = principal(found)
        else:
            found = Rows("inertia", nonnegative, length=3).read(given, setting)
            moments = np.sort(found)
        if moments[2] > moments[0] + moments[1] + SLACK * moments[2]:
            text = ", ".join(f"{one:.4g}" for one in moments)
            raise ValueError(f"moments of {text} kg m2 belong to no body: one is above the sum of the other two")
        return found

    def below(self, key: str) -> Value:
        return Rows("inertia", length=3)

    def json(self) -> dict[str, Any]:
        return {"anyOf": [Rows("inertia", length=3).json(), Matrix("inertia").json()]}


def principal(rows: tuple) -> np.ndarray:
    """Moments about the principal axes, rising; ValueError of a matrix that is not symmetric, or of negative ones."""
    matrix = np.array(rows)
    if np.abs(matrix - matrix.T).max() > SLACK * np.abs(matrix).max():
        raise ValueError(f"{show(rows)} is not symmetric; wanted the moments, and minus the products of inertia")
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] < -SLACK * moments[2]:
        raise ValueError(f"has a principal moment of {moments[0]:.4g} kg m2; wanted none below 0")
    return moments
