"""Shape of a vessel and its compressor: keys, height and length."""

from __future__ import annotations

import math
from typing import Annotated, Any

from fvsolve.parts.table_model import Table
from fvsolve.parts.value import Quantity, UsualRange, nonnegative, positive

LEVELS = UsualRange(0.0, 50.0, "pilot vessels to towers")
UPRIGHT = 0.5 * math.pi


class Compressor(Table):
    """Compressor that adds gas: starts when the level rises to `start`, stops when the level falls to `stop`."""

    start: Annotated[float, Quantity("level", nonnegative, "fluid level at which the compressor starts [m]", LEVELS)]
    stop: Annotated[
        float, Quantity("level", nonnegative, "fluid level, below `start`, at which the compressor stops [m]", LEVELS)
    ]
    flow: Annotated[
        float,
        Quantity(
            "flow", positive, "flow of free air, at ambient pressure and the initial temperature of the gas [m3/s]",
            UsualRange(1e-5, 10.0, "workshops to stations"),
        ),
    ]  # fmt: skip


def length_of(vessel: Any) -> float:
    """Length of a cylindrical vessel [m], from its volume and diameter."""
    return vessel.volume / (math.pi * (0.5 * vessel.diameter) ** 2)


def height_of(vessel: Any) -> float:
    """Level above the bottom [m] at which a vessel with a shape is full."""
    if vessel.diameter is not None:
        slope = UPRIGHT if vessel.slope is None else vessel.slope
        across = vessel.diameter * math.cos(slope) if slope < UPRIGHT else 0.0
        return length_of(vessel) * math.sin(slope) + across
    if not hasattr(vessel.area, "level"):
        return vessel.volume / vessel.area
    level, area, left = vessel.area.level, vessel.area.area, vessel.volume
    for z, end, low, high in zip(level, level[1:], area, area[1:], strict=False):
        growth, layer = (high - low) / (end - z), 0.5 * (low + high) * (end - z)
        if left <= layer:
            return float(z + 2.0 * left / (low + math.sqrt(max(low * low + 2.0 * growth * left, 0.0))))
        left -= layer
    return float(level[-1] + left / area[-1])
