"""Pade table of e^s in exact fractions (docs/course.md, 5.9)."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from fvsolve.steppers.numbers.polynomial import Polynomial
from fvsolve.validation import COUNT_FROM_ZERO, validated


@validated(k=COUNT_FROM_ZERO, m=COUNT_FROM_ZERO)
def pade(k: int, m: int) -> tuple[Polynomial, Polynomial]:
    """Numerator N(s) and denominator D(s) of the Pade approximation of e^s, with the degrees k and m.

    Its power series agrees with that of e^s in the first k + m + 1 terms.
    N(s) = sum_j (k+m-j)! k! / ((k+m)! j! (k-j)!) s^j; D is the same sum with m in place of k and -s in place of s
    (Hairer and Wanner 1996, IV.3).
    """

    def part(degree: int, sign: int) -> Polynomial:
        weight = Fraction(factorial(degree), factorial(k + m))
        return Polynomial(
            weight * sign**j * Fraction(factorial(k + m - j), factorial(j) * factorial(degree - j))
            for j in range(degree + 1)
        )

    return part(k, 1), part(m, -1)
