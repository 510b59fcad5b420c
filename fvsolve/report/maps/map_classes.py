"""Classes of the values of a map, with their limits, colours and texts."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fvsolve.report.tables import value_text

# Colours of the lowest to the highest class.
BLUES = ("#cfe8f7", "#9ecae9", "#6aaed6", "#3d8dc4", "#1f6aae", "#0d4a8b", "#072f5f")
HEAT = ("#fff0b8", "#fdd271", "#fba94a", "#f27a31", "#d8481f", "#a81d1a", "#6b0f1a")
# visible as lines on light and on dark pages
SPECTRUM = ("#3a78c3", "#2fa39b", "#7fb84d", "#d9b62c", "#ee8730", "#e0452f", "#c2187a")
HAZARD = ("#a6d96a", "#fee08b", "#fdae61", "#e0522f", "#7b1fa2")
TIMES = ("#3b1f6b", "#3f4f9a", "#2f7f9f", "#2aa787", "#7ac55a", "#d3d63f", "#fdeb6b")
STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)  # round numbers in a decade, for limits in any unit
MOST_EQUAL = 7  # greatest number of equal classes
NEAR = 1e-6  # of the width of a class, by which values may lie below the first class


class Classes(NamedTuple):
    """Classes of the values of a quantity.

    limits : lower ends of the classes, ascending; the last class has no upper end; values below the first have none
    colours : `#rrggbb` of each class; unit : of the limits
    """

    limits: tuple[float, ...]
    colours: tuple[str, ...]
    unit: str

    def of(self, values: np.ndarray) -> np.ndarray:
        """Number of the class of each value, -1 for values below the first limit and for NaN : int64, any shape."""
        known = np.nan_to_num(values, nan=-math.inf)
        return np.searchsorted(self.limits, known, "right") - 1

    @property
    def texts(self) -> list[str]:
        """Text of each class without the unit, such as `0.1 to 0.3` or `above 2`."""
        ends = [value_text(limit) for limit in self.limits]
        pairs = [f"{low} to {high}" for low, high in zip(ends[:-1], ends[1:], strict=True)]
        return [*pairs, f"above {ends[-1]}"]

    @property
    def rgb(self) -> np.ndarray:
        """Colours : uint8[classes, 3]."""
        return np.array([rgb_of(colour) for colour in self.colours], np.uint8).reshape(-1, 3)


def rgb_of(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of `#rrggbb`, from 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def colours_between(anchors: Sequence[str], count: int) -> tuple[str, ...]:
    """Colours at `count` equal steps from the first to the last of the colours `anchors`."""
    known = np.array([rgb_of(colour) for colour in anchors], float)
    at = (
        np.linspace(0.0, len(anchors) - 1.0, count) if count > 1 else np.array([len(anchors) - 1.0])
    )
    mixed = [np.interp(at, np.arange(len(anchors)), known[:, k]) for k in range(3)]
    return tuple("#{:02x}{:02x}{:02x}".format(*map(round, rgb)) for rgb in zip(*mixed, strict=True))


def round_limit(value: float) -> float:
    """Number of `STEPS` times a power of ten that is nearest to a value above 0, in the ratio."""
    power = 10.0 ** math.floor(math.log10(value))
    step = min(STEPS, key=lambda item: abs(math.log(item * power / value)))
    return float(f"{step * power:.3g}")


def stated_classes(
    limits: Sequence[float], factor: float, unit: str, anchors: Sequence[str], rounded: bool
) -> Classes:
    """Classes with given lower limits [SI].

    factor : of the unit, so that a value in it is factor times the value in SI
    rounded : True to replace each limit by a round number in the unit, if the unit is not decimal
    """
    scaled = [float(f"{factor * limit:.12g}") for limit in limits]
    is_decimal = abs(math.log10(factor) - round(math.log10(factor))) < 1e-9
    if rounded and not is_decimal:
        scaled = [round_limit(limit) if limit > 0.0 else limit for limit in scaled]
    return Classes(tuple(scaled), colours_between(anchors, len(scaled)), unit)


def equal_classes(low: float, high: float, unit: str, anchors: Sequence[str]) -> Classes:
    """Classes of equal width between round limits, for values from `low` to `high`."""
    if not (math.isfinite(low) and math.isfinite(high)):
        low, high = 0.0, 1.0
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        half = 0.5 * abs(high) or 0.5
        low, high = low - half, high + half
    raw = (high - low) / (MOST_EQUAL - 1)
    power = 10.0 ** math.floor(math.log10(raw))
    width = next(
        step * power for step in (1.0, 2.0, 2.5, 5.0, 10.0) if step * power >= raw * (1 - 1e-9)
    )
    # an end that lies beyond a limit by rounding needs no class of its own
    first = math.floor(low / width + NEAR)
    last = max(math.ceil(high / width - NEAR), first + 1)
    limits = tuple(float(f"{width * k:.12g}") for k in range(first, last))
    return Classes(limits, colours_between(anchors, len(limits)), unit)
