"""Slope limiters and their selection by code.

A limiter is a function of the two differences beside a cell. Its slope is a fraction (numerator, denominator), zero is
0 / 1. Kernels that need several slopes for a cell divide once for all of them.
"""

from math import nan

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import FLAT, MINMOD, MONOTONIZED_CENTRAL, VAN_LEER

# A slope is zero for products of differences below this, so that the product of two denominators does not underflow.
LEAST = 1e-280


@njit
def minmod(a, b):
    """Minmod limiter as (numerator, denominator): smaller of two differences of equal sign, else zero."""
    s = a if abs(a) < abs(b) else b
    return s if a * b > 0.0 else 0.0, 1.0


@njit
def van_leer(a, b):
    """Van Leer limiter (1974) as (numerator, denominator): harmonic mean 2 a b / (a + b), zero for unequal signs."""
    ab = a * b
    alike = ab > LEAST
    return 2.0 * ab if alike else 0.0, a + b if alike else 1.0


@njit
def monotonized_central(a, b):
    """Monotonized central limiter (van Leer 1977) as (numerator, denominator), for two differences.

    It is the central difference, but at most twice the smaller difference, and zero for differences of unequal sign.
    """
    s = a if abs(a) < abs(b) else b
    c = 0.5 * (a + b)
    m = 2.0 * s if 2.0 * abs(s) < abs(c) else c
    return m if a * b > 0.0 else 0.0, 1.0


@njit
def unknown_limiter(a, b):
    """Not-a-number as (numerator, denominator), for an unknown limiter code."""
    return nan, 1.0


@njit
def slope(limiter, a, b):
    """Slope from two differences by the function `limiter`: quotient of its results (numerator, denominator)."""
    numerator, denominator = limiter(a, b)
    return numerator / denominator


@njit
def half_slopes(limiter, a, b, c, d):
    """(half slope from the differences a and b, half slope from c and d) by the function `limiter`.

    Both are computed with a single division.
    """
    (p, s), (q, t) = limiter(a, b), limiter(c, d)
    r = 1.0 / (s * t)
    return 0.5 * p * (t * r), 0.5 * q * (s * r)


@inline
def by_limiter(work, code, *given):
    """Call `work` with the limiter function of a code; each limiter gives vectorised code of its own.

    given : further arguments of `work`
    """
    if code == MINMOD:
        return work(minmod, *given)
    if code == VAN_LEER:
        return work(van_leer, *given)
    if code == MONOTONIZED_CENTRAL:
        return work(monotonized_central, *given)
    return work(unknown_limiter, *given)


@njit
def limited(code, a, b):
    """Limited slope from the differences a and b by the limiter of a code; zero for FLAT."""
    return 0.0 if code == FLAT else by_limiter(slope, code, a, b)
