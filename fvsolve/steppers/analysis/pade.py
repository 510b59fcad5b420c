"""The Pade table of e^s in exact rationals (course summary 5.9). Knows no method."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from fvsolve.doors import AMOUNT, door
from fvsolve.steppers.numbers.polynomial import Polynomial


@door(k=AMOUNT, m=AMOUNT)
def pade(k: int, m: int) -> tuple[Polynomial, Polynomial]:
    """P^k_m: the quotient of degrees k over m that agrees with e^s in the most powers, k + m + 1 of them.

    N(s) = sum_j (k+m-j)! k! / ((k+m)! j! (k-j)!) s^j, D likewise in m and -s (Hairer and Wanner 1996, IV.3).
    """

    def half(one: int, sign: int) -> Polynomial:
        weight = Fraction(factorial(one), factorial(k + m))
        return Polynomial(
            weight * sign**j * Fraction(factorial(k + m - j), factorial(j) * factorial(one - j)) for j in range(one + 1)
        )

    return half(k, 1), half(m, -1)
