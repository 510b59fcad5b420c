"""Smooth bumps with exact cell averages, and the reflection and transmission of a wave at a junction."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import erf

Array = np.ndarray


def gaussian_averages(edges: Array, centre: float, width: float) -> Array:
    """Cell averages of `exp(-((x - centre) / width)^2)`."""
    return width * math.sqrt(math.pi) / 2 * np.diff(erf((edges - centre) / width)) / np.diff(edges)


def scattered(impedances: list[float]) -> tuple[float, list[float]]:
    """Pressure reflected into the first pipe and pressures transmitted to the others, for a unit wave in the first."""
    admittance = [1 / z for z in impedances]
    passed = 2 * admittance[0] / sum(admittance)
    return passed - 1, [passed] * (len(impedances) - 1)
