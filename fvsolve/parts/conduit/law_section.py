"""Circular cross section with a slot: area, depth, pressure integral, celerity and Riemann function.

The section has the diameter D. From the depth h_s just below the crown on, where the width of the circle has fallen to
the slot width T_s = g A_f / a^2, its width is T_s. So the celerity c = sqrt(g A / T) rises up to the surcharge celerity
a and stays there (Preissmann's slot). With x = h / D the half angle t of the wetted arc has sin t = 2 sqrt(x (1 - x)),
cos t = 1 - 2 x, and 2 t = 8 A / D^2 + 2 sin t cos t, so that only A(h) and h(A) need approximations. These are
polynomials of smooth quotients: A / A_f = x sin(t) q(x), x = s^2 p(s^2) with s = (A / A_f)^(1/3), and near the crown by
symmetry. Riemann function: phi = integral of c / A dA = integral of sqrt(g T / A) dh. Without branches and tables, the
functions of cells run in loops that vectorise.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.cube_root import cube_root_reciprocal
from fvsolve.jit import njit

TERMS = 24  # of each polynomial, with an error of rounding
HALF_SQUARE = 0.5 ** (2.0 / 3.0)  # s^2 of the half full section
TINY = 1e-300
LEAST_SHARE = 1e-30  # share of the full section below which there is no depth


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
    t = 2.0 * np.arcsin(np.sqrt(x))
    w = (2.0 * t) ** 2
    series = 1.0 - w / 20.0 * (
        1.0 - w / 42.0 * (1.0 - w / 72.0 * (1.0 - w / 110.0 * (1.0 - w / 156.0)))
    )
    return np.where(t < 0.3, 8.0 * t**3 / 6.0 * series, 2.0 * t - np.sin(2.0 * t)) / (2.0 * pi)


def exact_depth(share: np.ndarray) -> np.ndarray:
    """Depth x = h / D of a circle at wetted shares A / A_f up to 0.5 : float64[n]; by Newton's method."""
    x = (6.0 * pi * share) ** (2.0 / 3.0) / 4.0 / 2.0 ** (2.0 / 3.0)
    for _ in range(30):
        width = np.maximum(2.0 * np.sqrt(x * (1.0 - x)), 1e-300)
        x = np.clip(x - (exact_area(x) - share) * (pi / 4.0) / width, 0.0, 0.5)
    return x


def polynomials() -> tuple[np.ndarray, ...]:
    """Coefficients : float64[TERMS] of A(h) and h(A) up to the half full section, and of phi / sqrt(g D) beside it.

    They interpolate at Chebyshev points. phi is x^(1/2) times a polynomial of x below the half full section, and its
    value in the full circle minus y^(5/4) times a polynomial of y^(1/2) above it, with y = 1 - x.
    """
    at, weight = np.polynomial.legendre.leggauss(64)
    at, weight = 0.5 * (at + 1.0), 0.5 * weight

    def fit(function, end):
        found = np.polynomial.Chebyshev.interpolate(function, TERMS - 1, [0.0, end])
        terms = found.convert(kind=np.polynomial.Polynomial, domain=[-1.0, 1.0]).coef
        return np.append(terms, np.zeros(TERMS - terms.size))

    # mean over w from 0 to x^(1/2) of sqrt(T / A) 2 w, with the depth w^2, and with T / D and A / D^2
    def below(x):
        depth = x[:, None] * at**2
        return (
            2.0 * np.sqrt(2.0 * np.sqrt(1.0 - depth) * depth**1.5 / (0.25 * pi * exact_area(depth)))
        ) @ weight

    def above(root):  # mean over y^(1/4) from 0 of sqrt(T / A) 4 y^(3/4), over y
        y = root[:, None] ** 2 * at**4
        return (
            4.0 * np.sqrt(2.0 * np.sqrt(1.0 - y) / (0.25 * pi * exact_area(1.0 - y))) * at**4
        ) @ weight

    area = fit(lambda x: exact_area(x) / (2.0 * x * np.sqrt(x * (1.0 - x))), 0.5)
    depth = fit(lambda square: exact_depth(square**1.5) / square, HALF_SQUARE)
    return area, depth, fit(below, 0.5), fit(above, np.sqrt(0.5))


AREA, DEPTH, LOW, HIGH = polynomials()


@njit(forceinline=True)
def four_terms(p, k, x, square):
    """Terms k to k + 3 of a polynomial over x^k."""
    return (p[k] + p[k + 1] * x) + square * (p[k + 2] + p[k + 3] * x)


@njit(forceinline=True)
def polynomial(p, x):
    """Value of a polynomial with the coefficients p : float64[TERMS] at x."""
    square = x * x
    fourth = square * square
    value = four_terms(p, 16, x, square) + fourth * four_terms(p, 20, x, square)
    value = four_terms(p, 8, x, square) + fourth * (four_terms(p, 12, x, square) + fourth * value)
    return four_terms(p, 0, x, square) + fourth * (four_terms(p, 4, x, square) + fourth * value)


# phi / sqrt(g D)
FULL_PHI = float(sqrt(0.5) * polynomial(LOW, 0.5) + 0.5**1.25 * polynomial(HIGH, sqrt(0.5)))


@njit(forceinline=True)
def section_at_depth(section, h):
    """(area A [m2], width T [m], integral I of the area over the depth [m3]) at a depth h [m]."""
    d, above = section.diameter, h - section.depth
    x = min(max(h, 0.0) * (1.0 / d), 1.0)
    low = min(x, 1.0 - x)
    s, k = 2.0 * sqrt(low * (1.0 - low)), 1.0 - 2.0 * x
    part = low * s * polynomial(AREA, low)
    share = part if x <= 0.5 else 1.0 - part
    t = pi * share + s * k
    if above >= 0.0:
        area = section.area + section.slot * above
        return (
            area,
            section.slot,
            section.thrust + above * (section.area + 0.5 * section.slot * above),
        )
    return (
        0.25 * pi * d * d * share,
        d * s,
        d * d * d * (s * (3.0 - s * s) - 3.0 * t * k) * (1.0 / 24.0),
    )


@njit(forceinline=True)
def area_of(section, h):
    """Area A [m2] at a depth h [m]."""
    return section_at_depth(section, h)[0]


@njit(forceinline=True)
def depth_of(section, area):
    """Depth h [m] at an area A [m2]."""
    share = min(area * (1.0 / (0.25 * pi * section.diameter * section.diameter)), 1.0)
    low = max(min(share, 1.0 - share), LEAST_SHARE)
    r = cube_root_reciprocal(low)
    square = low * r
    x = square * polynomial(DEPTH, square)
    x = x if share <= 0.5 else 1.0 - x
    h = section.diameter * x if share > LEAST_SHARE else 0.0
    return section.depth + (area - section.area) / section.slot if area >= section.area else h


@njit(forceinline=True)
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
        return section.phi + 2.0 * sqrt(section.g / section.slot) * (
            sqrt(area) - sqrt(section.area)
        )
    x = h / section.diameter
    if x <= 0.5:
        value = sqrt(x) * polynomial(LOW, x)
    else:
        root = sqrt(1.0 - x)
        value = FULL_PHI - root * root * sqrt(root) * polynomial(HIGH, root)
    return sqrt(section.g * section.diameter) * value


@njit(forceinline=True)
def hydraulic_radius_power(section, h, area):
    """Hydraulic radius to the power of -4/3 [m^(-4/3)]; area : at the depth h, at most that of the full circle."""
    d = section.diameter
    x = min(max(h, 0.0) * (1.0 / d), 1.0)
    s, k = 2.0 * sqrt(x * (1.0 - x)), 1.0 - 2.0 * x
    r = cube_root_reciprocal(max(area / (d * (4.0 * area / (d * d) + s * k) + TINY), 1e-9 * d))
    return (r * r) * (r * r)


def section_of(gravity: float, diameter: float, surcharge_celerity: float) -> SlottedSection:
    """`SlottedSection` of a conduit; gravity [m/s2], diameter [m], surcharge celerity [m/s]"""
    full = 0.25 * pi * diameter**2
    slot = gravity * full / surcharge_celerity**2
    depth = 0.5 * diameter * (1.0 + sqrt(1.0 - (slot / diameter) ** 2))
    blank = SlottedSection(gravity, diameter, slot, 2.0 * diameter, full, 0.0, 0.0)
    area, _, thrust = section_at_depth(blank, depth)
    return SlottedSection(
        gravity, diameter, slot, depth, area, thrust, riemann_function(blank, depth)
    )
