"""Limited slopes from the two differences beside a cell, and the one ladder from codes to them. Knows no grid.

A limiter is one function: its slope as a fraction (numerator, denominator), zero as 0 / 1. Kernels that want several
slopes at a place divide once for all of them.
"""

from math import nan

from fvsolve.jit import inner, njit
from fvsolve.kernels.records import FLAT, MINMOD, MONOTONIZED_CENTRAL, VAN_LEER

LEAST = 1e-280  # product of two differences below which a slope is none, so that two denominators can be multiplied


@njit
def minmod(a, b):
    """The smaller of two differences of one sign, else zero."""
    s = a if abs(a) < abs(b) else b
    return s if a * b > 0.0 else 0.0, 1.0


@njit
def van_leer(a, b):
    """Harmonic mean 2 a b / (a + b) of two differences of one sign, else zero (van Leer 1974)."""
    ab = a * b
    alike = ab > LEAST
    return 2.0 * ab if alike else 0.0, a + b if alike else 1.0


@njit
def monotonized_central(a, b):
    """The central difference, at most twice the smaller one, else zero (van Leer 1977)."""
    s = a if abs(a) < abs(b) else b
    c = 0.5 * (a + b)
    m = 2.0 * s if 2.0 * abs(s) < abs(c) else c
    return m if a * b > 0.0 else 0.0, 1.0


@njit
def none(a, b):
    """What a code says that is no limiter's."""
    return nan, 1.0


@njit
def slope(limiter, a, b):
    """The slope by a limiter from two differences."""
    numerator, denominator = limiter(a, b)
    return numerator / denominator


@njit
def halves(limiter, a, b, c, d):
    """Half the slopes from two pairs of differences, by one division."""
    (p, s), (q, t) = limiter(a, b), limiter(c, d)
    r = 1.0 / (s * t)
    return 0.5 * p * (t * r), 0.5 * q * (s * r)


@inner
def by_limiter(work, code, *given):
    """What some work gives with the limiter of a code; a loop becomes straight vector code for each."""
    if code == MINMOD:
        return work(minmod, *given)
    if code == VAN_LEER:
        return work(van_leer, *given)
    if code == MONOTONIZED_CENTRAL:
        return work(monotonized_central, *given)
    return work(none, *given)


@njit
def limited(code, a, b):
    """The slope by a limiter's code; none where FLAT."""
    return 0.0 if code == FLAT else by_limiter(slope, code, a, b)
