"""Observed orders of convergence, exact averages of smooth bumps, and scattering of a wave at a junction."""

import math

import numpy as np
from scipy.special import erf


def observed_order(errors, sizes) -> float:
    """Slope of log error over log size between the last two entries."""
    e, h = np.log(np.asarray(errors, float)), np.log(np.asarray(sizes, float))
    return float((e[-1] - e[-2]) / (h[-1] - h[-2]))


def mean_error(found, exact) -> float:
    """Mean absolute error relative to the greatest exact value (L1 norm)."""
    found, exact = np.asarray(found), np.asarray(exact)
    return float(np.mean(np.abs(found - exact)) / np.max(np.abs(exact)))


Array = np.ndarray


def gaussian_averages(edges: Array, centre: float, width: float) -> Array:
    """Cell averages of `exp(-((x - centre) / width)^2)`."""
    return width * math.sqrt(math.pi) / 2 * np.diff(erf((edges - centre) / width)) / np.diff(edges)


def scattered(impedances: list[float]) -> tuple[float, list[float]]:
    """Pressure reflected into the first pipe and pressures transmitted to the others, for a unit wave in the first."""
    admittance = [1 / z for z in impedances]
    passed = 2 * admittance[0] / sum(admittance)
    return passed - 1, [passed] * (len(impedances) - 1)
