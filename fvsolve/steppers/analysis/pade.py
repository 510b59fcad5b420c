"""Pade table of e^s in exact rationals (course summary 5.9)."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from fvsolve.steppers.numbers.polynomial import Polynomial
from fvsolve.validation import COUNT_FROM_ZERO, validated


@validated(k=COUNT_FROM_ZERO, m=COUNT_FROM_ZERO)
def pade(k: int, m: int) -> tuple[Polynomial, Polynomial]:
    """Return numerator and denominator of P^k_m, the Pade approximation of e^s with degrees k over m.

    It agrees with e^s in k + m + 1 powers.
    N(s) = sum_j (k+m-j)! k! / ((k+m)! j! (k-j)!) s^j; D likewise with m and -s (Hairer and Wanner 1996, IV.3).
    """

    def part(degree: int, sign: int) -> Polynomial:
        weight = Fraction(factorial(degree), factorial(k + m))
        return Polynomial(
            weight * sign**j * Fraction(factorial(k + m - j), factorial(j) * factorial(degree - j))
            for j in range(degree + 1)
        )

    return part(k, 1), part(m, -1)
