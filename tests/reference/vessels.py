"""Closed forms for tanks and chambers behind an orifice, under the linear density law.

A drop `d` that drives `q = Cd A sqrt(2 d / rho)` and decreases by `k q` has a root that is linear in time.
`sqrt(d) = sqrt(d0) - s t / 2`, and the drop is zero from the time `2 sqrt(d0) / s` on.
"""

import math

import numpy as np
from scipy.optimize import brentq

Array = np.ndarray
GRAVITY = 9.80665


def falling_root(start: float, slope: float, t: Array) -> Array:
    """Solution of `d' = -slope sqrt(d)` from `start`, zero after its end."""
    root = math.sqrt(start) - slope * np.asarray(t, float) / 2
    return np.where(root > 0, root, 0.0) ** 2


def prism(area: float, flow_area: float, level: float, t: Array) -> Array:
    """Level of a tank of constant area that drains through an orifice at its bottom [m]."""
    return falling_root(level, flow_area * math.sqrt(2 * GRAVITY) / area, t)


def levelling(areas: tuple[float, float], flow_area: float, drop: float, t: Array) -> Array:
    """Difference of level of two tanks of constant area joined by an orifice [m]."""
    return falling_root(drop, flow_area * math.sqrt(2 * GRAVITY) * (1 / areas[0] + 1 / areas[1]), t)


def tapered(foot: float, growth: float, flow_area: float, level: float, t: Array) -> Array:
    """Level of a tank of area `foot + growth h` that drains at its bottom, by its implicit closed form [m]."""

    def volume_time(root: float) -> float:
        return 2 * foot * root + 2 / 3 * growth * root**3

    total, speed = volume_time(math.sqrt(level)), flow_area * math.sqrt(2 * GRAVITY)
    found = []
    for left in total - speed * np.asarray(t, float):
        found.append(
            brentq(
                lambda r, v=left: volume_time(r) - v, 0, math.sqrt(level) * (1 + 1e-12), xtol=1e-15
            )
            ** 2
            if left > 0
            else 0.0
        )
    return np.array(found)


def filling(
    volume: float, modulus: float, flow_area: float, density: float, drop: float, t: Array
) -> Array:
    """Missing pressure in a chamber that fills from a fixed pressure through an orifice [Pa]."""
    return falling_root(drop, modulus / volume * flow_area * math.sqrt(2 / density), t)


def chambers_levelling(
    volumes, modulus: float, flow_area: float, density: float, drop: float, t: Array
) -> Array:
    """Difference of pressure of two chambers joined by an orifice [Pa]."""
    compliance = modulus * (1 / volumes[0] + 1 / volumes[1])
    return falling_root(drop, compliance * flow_area * math.sqrt(2 / density), t)
