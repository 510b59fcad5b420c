"""Radius of absolute monotonicity of a method, which is its SSP radius (Kraaijevanger 1991)."""

from __future__ import annotations

import functools
import math
from fractions import Fraction

from fvsolve.steppers.tableau import Method

BITS = 52  # precision of the radius
LONGEST = Fraction(1 << 64)  # a larger radius counts as infinite


def ssp_radius(method: Method) -> float:
    """SSP radius r of a method: if Euler steps up to h do not increase a norm, steps of the method up to r h do not.

    It is the greatest r with (I + r K)^-1 e >= 0 and r K (I + r K)^-1 >= 0, for K = [[A, 0], [b^T, 0]] and the vector e
    of ones. It is 0 if no r > 0 is possible, inf if every r is possible.
    """
    k = _used(method)
    if any(x < 0 for row in k for x in row) or not _has_no_fill_in(k):
        return 0.0
    if _monotone(k, LONGEST):
        return math.inf
    low, high = Fraction(0), Fraction(1)
    while _monotone(k, high):
        low, high = high, 2 * high
    for _ in range(BITS):
        middle = (low + high) / 2
        if _monotone(k, middle):
            low = middle
        else:
            high = middle
    simple = low.limit_denominator(1000)
    return float(simple if abs(simple - low) < Fraction(1, 1 << 40) and _monotone(k, simple) else low)


@functools.cache
def in_euler_steps(method: Method) -> bool:
    """True if a method is explicit, has SSP radius 1 and no error estimate, and c_2 = 1 if it has more than one stage.

    Then every stage is a convex combination of Euler steps of the full length.
    """
    if not method.explicit or method.adaptive or method.kind == "linear":
        return False
    return (method.stages == 1 or method.c[1] == 1.0) and ssp_radius(method) == 1.0


def _used(method: Method) -> list[list]:
    """Matrix K = [[A, 0], [b^T, 0]] of a method, restricted to the stages that the new state depends on."""
    a, b = method.exact.a, method.exact.b
    used, new = set(), {j for j, x in enumerate(b) if x != 0}
    while new - used:
        used |= new
        new = {j for i in used for j, x in enumerate(a[i]) if x != 0}
    stages = sorted(used)
    return [[row[j] for j in stages] + [Fraction(0)] for row in (*(a[i] for i in stages), b)]


def _has_no_fill_in(k: list[list]) -> bool:
    """True if K^2 has no nonzero entry where K has a zero; otherwise the SSP radius is 0. k : matrix K of `_used`"""
    n = len(k)
    return all(
        k[i][j] != 0 or not any(k[i][m] != 0 and k[m][j] != 0 for m in range(n)) for i in range(n) for j in range(n)
    )


def _monotone(k: list[list], r: Fraction) -> bool:
    """True if both conditions of `ssp_radius` hold at r: no entry of (I + r K)^-1 [e, r K] is negative.

    It is False if I + r K is singular. The computation is exact. k : matrix K
    """
    n = len(k)
    rows = [[(i == j) + r * k[i][j] for j in range(n)] + [Fraction(1)] + [r * x for x in k[i]] for i in range(n)]
    for i in range(n):
        pivot = next((m for m in range(i, n) if rows[m][i] != 0), None)
        if pivot is None:
            return False
        rows[i], rows[pivot] = rows[pivot], rows[i]
        top = rows[i] = [x / rows[i][i] if x != 0 else x for x in rows[i]]
        for m in range(n):
            if m != i and rows[m][i] != 0:
                factor = rows[m][i]
                rows[m] = [x - factor * y if y != 0 else x for x, y in zip(rows[m], top, strict=True)]
    return all(x >= 0 for row in rows for x in row[n:])
