"""Culverts in the tables of a model."""

import math

import numpy as np

from fvsolve.parts.weir.lower import StructureRows

from . import law
from .part import inlets

FRICTION = 19.63  # of HDS-5, 2 g over the square of the unit of Manning's formula [m/s2]


class CulvertRows(StructureRows, kind="culvert"):
    """Conversion to table rows of culverts."""

    law = law
    quantities, bottom_key = ("regime", "control"), "inverts"

    def bottoms(self, part) -> tuple[float, float]:
        return part.inverts

    def size(self, draft, part) -> float:
        return part.barrels * barrel_area(part) * math.sqrt(2.0 * draft.case.gravity)

    def numbers(self, draft, name, part) -> list[float]:
        return culvert_numbers(part, draft.case.gravity)


def barrel_area(part) -> float:
    """Full area of a barrel [m2]."""
    return part.width * part.height if part.diameter is None else 0.25 * math.pi * part.diameter**2


def culvert_numbers(part, gravity: float) -> list[float]:
    """Numbers of a culvert, in the order of `law`; gravity : [m/s2]"""
    inlet, (near, far) = inlets()[part.inlet], part.inverts
    height = part.height if part.diameter is None else part.diameter
    numbers = [
        inlet.form,
        inlet.K,
        inlet.M,
        inlet.c,
        inlet.Y,
        inlet.slope_factor,
        part.width or 0.0,
        height,
        barrel_area(part),
        gravity,
        part.losses,
        FRICTION * part.manning**2 * part.length,
        part.barrels * (1.0 - part.blockage),
        part.length,
        near,
        far,
    ]
    numbers, slope = [float(number) for number in numbers], (near - far) / part.length
    at_joint = (
        law.inlet_weir_flow(np.array(numbers), 0, side, law.WEIR_END * height)
        for side in (slope, -slope)
    )
    return [*numbers, *map(float, at_joint)]
