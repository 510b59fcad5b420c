"""Slope limiters, and values at faces from cell averages, biased to the side from which a wave comes.

A limiter is a function of the two differences beside a cell. Its slope is a fraction (numerator, denominator), zero is
0 / 1. Kernels that need several slopes for a cell divide once for all of them.

Every loop over faces reads a window P of cell averages and writes face values F: face j lies between P[j+2] and P[j+3].
A forward wave uses P[j] .. P[j+4], a backward wave P[j+5] .. P[j+1].
"""

from math import nan

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.own_limiters import FIRST_ADDRESS, call_own
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import inline, njit

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
    # Up to twice the smaller difference, face values create no new extreme.
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


@inline
def inner_slopes(limiter, c, d):
    """Write limited slopes of c (differences over a cell) to d, for all cells except those at the ends.

    limiter : limiter function of two differences; c : float64[cells]  values
    """
    here = c[1:]
    next = c[2:]
    inside = d[1:]
    for i in range(c.size - 2):
        inside[i] = slope(limiter, here[i] - c[i], next[i] - here[i])


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

    A work that is called with limiters of users needs an entry in `own_limiters.LOOPS`.

    given : further arguments of `work`
    """
    if code == rec.MINMOD:
        return work(minmod, *given)
    if code == rec.VAN_LEER:
        return work(van_leer, *given)
    if code == rec.MONOTONIZED_CENTRAL:
        return work(monotonized_central, *given)
    if code >= FIRST_ADDRESS:
        return call_own(work, code, given)
    return work(unknown_limiter, *given)


@njit
def limited(code, a, b):
    """Limited slope from the differences a and b by the limiter of a code; zero for FLAT."""
    return 0.0 if code == rec.FLAT else by_limiter(slope, code, a, b)


@njit
def value_weno5(a, b, c, d, e, small):
    """Fifth-order WENO-Z value at the face after cell c (Borges et al. 2008), from the averages of five cells a .. e.

    small : square of a negligible value, which prevents a division by zero
    """
    # Face values of three parabolas, each through three of the five cells.
    p0 = (2.0 * a - 7.0 * b + 11.0 * c) / 6.0
    p1 = (-b + 5.0 * c + 2.0 * d) / 6.0
    p2 = (2.0 * c + 5.0 * d - e) / 6.0
    # Smoothness indicators of Jiang and Shu (1996): a parabola across a front has a great one.
    s0 = 13.0 / 12.0 * (a - 2.0 * b + c) ** 2 + 0.25 * (a - 4.0 * b + 3.0 * c) ** 2
    s1 = 13.0 / 12.0 * (b - 2.0 * c + d) ** 2 + 0.25 * (b - d) ** 2
    s2 = 13.0 / 12.0 * (c - 2.0 * d + e) ** 2 + 0.25 * (3.0 * c - 4.0 * d + e) ** 2
    # In smooth data tau is of higher order than the indicators, so the weights stay near the ideal ones.
    tau = abs(s0 - s2)
    r0 = tau / (s0 + small)
    r1 = tau / (s1 + small)
    r2 = tau / (s2 + small)
    # The weights 0.1, 0.6, 0.3 of the three parabolas give fifth order.
    w0 = 0.1 * (1.0 + r0 * r0)
    w1 = 0.6 * (1.0 + r1 * r1)
    w2 = 0.3 * (1.0 + r2 * r2)
    return (w0 * p0 + w1 * p1 + w2 * p2) / (w0 + w1 + w2)


@njit
def value_muscl(limiter, b, c, d):
    """Second-order value at the face after cell c with a limited slope, from the averages of cells b, c, d."""
    return c + 0.5 * limited(limiter, c - b, d - c)


@njit
def faces_linear(w0, w1, w2, w3, w4, w5, p, f):
    """Write face values of a linear scheme: f[j] = sum of w_k p[j+k]."""
    for j in range(f.size):
        f[j] = (
            (w0 * p[j] + w1 * p[j + 1])
            + (w2 * p[j + 2] + w3 * p[j + 3])
            + (w4 * p[j + 4] + w5 * p[j + 5])
        )


@inline
def muscl_forward(limiter, p, f):
    """Write limited second-order face values of a forward wave to f; face j lies between p[j+2] and p[j+3]."""
    for j in range(f.size):
        f[j] = p[j + 2] + 0.5 * slope(limiter, p[j + 2] - p[j + 1], p[j + 3] - p[j + 2])


@inline
def muscl_backward(limiter, p, f):
    """Write limited second-order face values of a backward wave to f; face j lies between p[j+2] and p[j+3]."""
    for j in range(f.size):
        f[j] = p[j + 3] - 0.5 * slope(limiter, p[j + 4] - p[j + 3], p[j + 3] - p[j + 2])


@njit
def faces_weno5(small, backward, p, f):
    """Write fifth-order WENO-Z face values to f; face j lies between p[j+2] and p[j+3].

    backward : 1 for a backward wave; small : square of a negligible value, which prevents a division by zero
    """
    if backward == 1:
        # The mirror image: cells are read in the opposite order.
        for j in range(f.size):
            f[j] = value_weno5(p[j + 5], p[j + 4], p[j + 3], p[j + 2], p[j + 1], small)
    else:
        for j in range(f.size):
            f[j] = value_weno5(p[j], p[j + 1], p[j + 2], p[j + 3], p[j + 4], small)


@njit
def faces(settings, scheme, small, backward, p, f):
    """Write face values to f by a scheme family; face j lies between the cell averages p[j+2] and p[j+3].

    backward : 1 for a backward wave; small : square of a negligible value
    """
    if scheme == rec.UPWIND:
        for j in range(f.size):
            f[j] = p[j + 3] if backward == 1 else p[j + 2]
    elif scheme == rec.LINEAR:
        s = settings
        if backward == 1:
            faces_linear(s["w5"], s["w4"], s["w3"], s["w2"], s["w1"], s["w0"], p, f)
        else:
            faces_linear(s["w0"], s["w1"], s["w2"], s["w3"], s["w4"], s["w5"], p, f)
    elif scheme == rec.SHORT:
        # Third order: the value at the face of the parabola through three cell averages.
        b = -1.0 / 6.0
        c = 5.0 / 6.0
        d = 1.0 / 3.0
        if backward == 1:
            faces_linear(0.0, 0.0, d, c, b, 0.0, p, f)
        else:
            faces_linear(0.0, b, c, d, 0.0, 0.0, p, f)
    elif scheme == rec.MUSCL:
        if backward == 1:
            by_limiter(muscl_backward, settings["limiter"], p, f)
        else:
            by_limiter(muscl_forward, settings["limiter"], p, f)
    else:
        faces_weno5(small, backward, p, f)


@njit
def rhs_periodic(t, y, dydt, out, handle):
    """Rates du_j/dt = F[j] - F[j+1] of the values of cells in a ring.

    The face values F are those of a forward wave, which passes one cell per unit of time.
    y, dydt : float64[n]  values u and their rates; nothing is written for an empty `dydt`, except to `out`
    scratch : float64[2 n + 7]  window of values with three cells of the ring on both sides, then face values
    `noise` of the pipe : square of a negligible value, as `small` of `faces`
    """
    tables = open_tables(handle)
    settings = tables.settings[0]
    scratch = tables.scratch
    n = y.size
    out[rec.RATE], out[rec.STATUS], out[rec.WHERE] = 1.0, rec.OK, -1.0
    if dydt.size == 0:
        return
    p, f = scratch[: n + 6], scratch[n + 6 :]
    for j in range(n):
        p[j + 3] = y[j]
    # The ring goes on with the cells of its opposite end.
    for g in range(3):
        p[g], p[n + 3 + g] = y[n - 3 + g], y[g]
    faces(settings, settings["scheme"], tables.pipes[0]["noise"], 0, p, f)
    for j in range(n):
        dydt[j] = f[j] - f[j + 1]
