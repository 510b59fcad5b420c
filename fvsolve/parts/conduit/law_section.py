"""Circular cross section with a slot: area, depth, pressure integral, celerity and Riemann function.

The section has the diameter D. From the depth h_s just below the crown on, where the width of the circle has fallen to
the slot width T_s = g A_f / a^2, its width is T_s. So the celerity c = sqrt(g A / T) rises up to the surcharge celerity
a and stays there (Preissmann's slot). With x = h / D the half angle t of the wetted arc has sin t = 2 sqrt(x (1 - x)),
cos t = 1 - 2 x, and 2 t = 8 A / D^2 + 2 sin t cos t, so that only A(h) and h(A) need tables. They are cubic Hermite
polynomials of smooth quotients: A / A_f = x^1.5 q(x), x = s^2 p(s) with s = (A / A_f)^(1/3), and near the crown by
symmetry. Riemann function: phi = integral of c / A dA = integral of sqrt(g T / A) dh.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.jit import njit
from fvsolve.kernels.cube_root import cube_root_reciprocal

INTERVALS = 512  # of each table
HALF_ROOT = 0.5 ** (1.0 / 3.0)  # s of the half full section


class SlottedSection(NamedTuple):
    """Numbers of a circular section with a slot: seven floats, in SI.

    g : gravity; diameter; slot : width T_s; depth, area, thrust, phi : h_s, A, I and phi at the begin of the slot,
    where I is the integral of the area over the depth
    """

    g: float
    diameter: float
    slot: float
    depth: float
    area: float
    thrust: float
    phi: float


def exact_area(x: np.ndarray) -> np.ndarray:
    """Wetted share A / A_f of a circle at depths x = h / D : float64[n]; by a series at small x."""
    t = np.arccos(1.0 - 2.0 * x)
    series = (4.0 * t**3 / 3.0) * (1.0 - t**2 / 5.0 + 2.0 * t**4 / 105.0 - t**6 / 945.0 + 2.0 * t**8 / 51975.0)
    return np.where(t < 0.3, series, 2.0 * t - np.sin(2.0 * t)) / (2.0 * pi)


def exact_depth(share: np.ndarray) -> np.ndarray:
    """Depth x = h / D of a circle at wetted shares A / A_f up to 0.5 : float64[n]; by Newton's method."""
    x = (6.0 * pi * share) ** (2.0 / 3.0) / 4.0 / 2.0 ** (2.0 / 3.0)
    for _ in range(30):
        width = np.maximum(2.0 * np.sqrt(x * (1.0 - x)), 1e-300)
        x = np.clip(x - (exact_area(x) - share) * (pi / 4.0) / width, 0.0, 0.5)
    return x


def hermite(x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Table float64[INTERVALS, 4] of cubics over the intervals of x, in the local variable from 0 to 1.

    They pass through the values at the ends and at two points between, so x has 3 INTERVALS + 1 points.
    """
    local = np.vander(np.linspace(0.0, 1.0, 4), 4, increasing=True)
    points = np.array([values[:-1:3], values[1::3], values[2::3], values[3::3]])
    return np.ascontiguousarray(np.linalg.solve(local, points).T)


def tables() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Tables of A(h) and h(A) up to the half full section, and of phi / sqrt(g D) below and above it."""
    fine = np.linspace(0.0, 1.0, 3 * INTERVALS + 1)
    x, s = 0.5 * fine, HALF_ROOT * fine
    x[0], s[0] = 1e-8, 1e-4  # where the quotients have their limits
    area, depth = exact_area(x) / x**1.5, exact_depth(s**3) / s**2
    # phi by Gauss-Legendre quadrature: over w with x = w^2, and over v with x = 1 - v^4
    at, weight = np.polynomial.legendre.leggauss(8)

    def integral(points, rate):
        half = 0.5 * np.diff(points)[:, None]
        middle = 0.5 * (points[1:] + points[:-1])[:, None]
        return np.append(0.0, np.cumsum((half * weight * rate(middle + half * at)).sum(axis=1)))

    def rate_below(w):  # sqrt(T / A) 2 w with T / D and A / D^2
        x = w * w
        return np.sqrt(2.0 * np.sqrt(1.0 - x) * w / (0.25 * pi * exact_area(x))) * 2.0 * w

    def rate_above(v):
        x = 1.0 - v**4
        return np.sqrt(2.0 * np.sqrt(x) * v * v / (0.25 * pi * exact_area(x))) * 4.0 * v**3

    low = integral(np.sqrt(0.5) * fine, rate_below)
    high = integral((0.5**0.25) * fine, rate_above)
    return hermite(x, area), hermite(s, depth), hermite(fine, low), hermite(fine, low[-1] + high[-1] - high)


AREA, DEPTH, LOW, HIGH = tables()


@njit(forceinline=True)
def look_up(table, x):
    """Value of a table of cubics at x from 0 to 1."""
    at = x * INTERVALS
    k = min(int(at), INTERVALS - 1)
    r = at - k
    return table[k, 0] + r * (table[k, 1] + r * (table[k, 2] + r * table[k, 3]))


@njit
def area_of(section, h):
    """Area A [m2] at a depth h [m]."""
    if not h > 0.0:
        return 0.0
    if h >= section.depth:
        return section.area + section.slot * (h - section.depth)
    x = h / section.diameter
    low = min(x, 1.0 - x)
    share = low * sqrt(low) * look_up(AREA, 2.0 * low)
    return 0.25 * pi * section.diameter * section.diameter * (share if x <= 0.5 else 1.0 - share)


@njit
def depth_of(section, area):
    """Depth h [m] at an area A [m2]."""
    if area >= section.area:
        return section.depth + (area - section.area) / section.slot
    share = area / (0.25 * pi * section.diameter * section.diameter)
    low = min(share, 1.0 - share)
    if not low > 1e-30:
        return 0.0
    r = cube_root_reciprocal(low)
    s = low * r * r
    x = s * s * look_up(DEPTH, s * (1.0 / HALF_ROOT))
    return section.diameter * (x if share <= 0.5 else 1.0 - x)


@njit
def width_and_thrust(section, h, area):
    """(width T [m], integral I of the area over the depth [m3]) at a depth h [m] with its area [m2]."""
    if h >= section.depth:
        above = h - section.depth
        return section.slot, section.thrust + above * (section.area + 0.5 * section.slot * above)
    d = section.diameter
    x = max(h, 0.0) / d
    s, k = 2.0 * sqrt(x * (1.0 - x)), 1.0 - 2.0 * x
    t = 4.0 * area / (d * d) + s * k
    return d * s, d * d * d * (s * (3.0 - s * s) - 3.0 * t * k) * (1.0 / 24.0)


@njit
def celerity(section, width, area):
    """Speed of waves c = sqrt(g A / T) [m/s]; 0 without water."""
    return sqrt(section.g * area / width) if width > 0.0 else 0.0


@njit
def riemann_function(section, h):
    """Riemann function phi [m/s] at a depth h [m]."""
    if not h > 0.0:
        return 0.0
    if h >= section.depth:
        area = area_of(section, h)
        return section.phi + 2.0 * sqrt(section.g / section.slot) * (sqrt(area) - sqrt(section.area))
    x = h / section.diameter
    if x <= 0.5:
        value = look_up(LOW, sqrt(2.0 * x))
    else:
        value = look_up(HIGH, sqrt(sqrt(2.0 * (1.0 - x))))
    return sqrt(section.g * section.diameter) * value


@njit
def hydraulic_radius_power(section, h, area):
    """Hydraulic radius to the power of -4/3 [m^(-4/3)]; area : at the depth h, at most that of the full circle."""
    d = section.diameter
    if h >= d:
        r = cube_root_reciprocal(0.25 * d)
    else:
        x = h / d
        s, k = 2.0 * sqrt(x * (1.0 - x)), 1.0 - 2.0 * x
        r = cube_root_reciprocal(max(area / (d * (4.0 * area / (d * d) + s * k)), 1e-9 * d))
    return (r * r) * (r * r)


def section_of(gravity: float, diameter: float, surcharge_celerity: float) -> SlottedSection:
    """`SlottedSection` of a conduit; gravity [m/s2], diameter [m], surcharge celerity [m/s]"""
    full = 0.25 * pi * diameter**2
    slot = gravity * full / surcharge_celerity**2
    depth = 0.5 * diameter * (1.0 + sqrt(1.0 - (slot / diameter) ** 2))
    blank = SlottedSection(gravity, diameter, slot, 2.0 * diameter, full, 0.0, 0.0)
    area = area_of(blank, depth)
    thrust = width_and_thrust(blank, depth, area)[1]
    return SlottedSection(gravity, diameter, slot, depth, area, thrust, riemann_function(blank, depth))
