"""Sign of a polynomial in two variables on a box, proved in integers.

A polynomial lies between its least and its greatest coefficient in Bernstein's basis. Coefficients at the corners of
the box are values of the polynomial there. Bisection of the box moves all coefficients towards values of the polynomial
(Lane and Riesenfeld 1981). Coefficients are rounded down to integer multiples of 2^-400 of the largest coefficient, so
that a proof that they are not negative holds for the polynomial.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb

import numpy as np

BITS = 400
MOST_BOXES = 400  # number of boxes after which the sign is left undecided

Matrix = Sequence[Sequence[int]]  # g[m][i] of x^m y^i


def polynomial_value(g: Matrix, x: Fraction, y: Fraction) -> Fraction:
    """Value of the polynomial sum g[m][i] x^m y^i at (x, y)."""
    total = Fraction(0)
    for row in reversed(g):
        inner = Fraction(0)
        for coefficient in reversed(row):
            inner = inner * y + coefficient
        total = total * x + inner
    return total


def negative_point(g: Matrix, low: Fraction, high: Fraction) -> tuple[Fraction, Fraction] | str | None:
    """Point (x, y) with low <= x <= high, 0 <= y <= 1 where the polynomial g is negative.

    g : coefficients g[m][i] of x^m y^i
    Returns None if g >= 0 in the whole box, and "open" if the search ends undecided.
    """
    boxes, seen = [(_bernstein(g, low, high), low, high, Fraction(0), Fraction(1))], 0
    while boxes:
        b, x0, x1, y0, y1 = boxes.pop()
        if all(left >= 0 for left in b.flat):
            continue
        for corner, x, y in ((b[0, 0], x0, y0), (b[0, -1], x0, y1), (b[-1, 0], x1, y0), (b[-1, -1], x1, y1)):
            if corner < 0 and polynomial_value(g, x, y) < 0:
                return x, y
        seen += 1
        if seen > MOST_BOXES:
            return "open"
        if _curvature(b) >= _curvature(b.T):
            left, right = _bisect(b)
            middle = (x0 + x1) / 2
            boxes += [(left, x0, middle, y0, y1), (right, middle, x1, y0, y1)]
        else:
            left, right = _bisect(b.T)
            middle = (y0 + y1) / 2
            boxes += [(left.T, x0, x1, y0, middle), (right.T, x0, x1, middle, y1)]
    return None


def _bernstein(g: Matrix, low: Fraction, high: Fraction) -> np.ndarray:
    """Bernstein coefficients of the polynomial g on low <= x <= high, 0 <= y <= 1, scaled to integers, rounded down.

    g : coefficients g[m][i] of x^m y^i
    """
    a = np.array([[Fraction(entry) for entry in row] for row in g], dtype=object)
    for k in range(a.shape[0] - 1):  # x = low + s, by repeated Horner schemes
        for m in range(a.shape[0] - 2, k - 1, -1):
            a[m] = a[m] + low * a[m + 1]
    width, power = high - low, Fraction(1)
    for m in range(a.shape[0]):
        a[m], power = a[m] * power, power * width
    a = _to_bernstein(_to_bernstein(a).T).T
    largest = max(abs(entry) for entry in a.flat) or Fraction(1)
    scaled = [
        (entry.numerator << BITS) * largest.denominator // (entry.denominator * largest.numerator) for entry in a.flat
    ]
    return np.array(scaled, dtype=object).reshape(a.shape)


def _to_bernstein(a: np.ndarray) -> np.ndarray:
    """Convert coefficients a of powers to Bernstein's basis along the first axis.

    b_j = sum_i C(j, i) / C(n, i) a_i, with binomial coefficients C and the degree n.
    """
    n = a.shape[0] - 1
    return np.array([sum(Fraction(comb(j, i), comb(n, i)) * a[i] for i in range(j + 1)) for j in range(n + 1)])


def _bisect(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bernstein coefficients on the lower and upper half of a box along the first axis (de Casteljau), rounded down.

    b : Bernstein coefficients on the whole box
    """
    left, right, now = [b[0]], [b[-1]], b
    for _ in range(b.shape[0] - 1):
        now = (now[:-1] + now[1:]) >> 1
        left.append(now[0])
        right.append(now[-1])
    return np.array(left, dtype=object), np.array(right[::-1], dtype=object)


def _curvature(b: np.ndarray) -> int:
    """Greatest absolute second difference of Bernstein coefficients b along the first axis, times the squared degree.

    It is 0 for a degree below 2.
    """
    if b.shape[0] < 3:
        return 0
    return max(abs(difference) for difference in (b[:-2] - 2 * b[1:-1] + b[2:]).flat) * (b.shape[0] - 1) ** 2
