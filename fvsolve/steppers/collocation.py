"""Collocation: integrals of Lagrange polynomials on the nodes of a method. Knows exact numbers; knows no time loop."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from fvsolve.steppers.numbers.polynomial import Polynomial


def lagrange(c: Sequence) -> list[Polynomial]:
    """l_i with l_i(c_j) = 1 where i = j, else 0; the nodes differ."""
    found = []
    for i, x in enumerate(c):
        one = Polynomial([1])
        for y in (*c[:i], *c[i + 1 :]):
            one = one * Polynomial([-y, 1]) / (x - y)
        found.append(one)
    return found


def integrals(c: Sequence) -> list[Polynomial]:
    """int_0^theta l_i."""
    return [Polynomial([0, *(x / (k + 1) for k, x in enumerate(one.coefficients))]) for one in lagrange(c)]


def collocation(a: Sequence, b: Sequence, c: Sequence, rounding: Fraction = Fraction(0)) -> tuple[tuple, ...]:
    """dense_ij of y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1); empty if it is no collocation method.

    It is one where a_ij = int_0^c_i l_j and b_j = int_0^1 l_j (Hairer, Norsett and Wanner 1993, II.7).
    """
    if len(set(c)) < len(c) or (len(c) > 1 and not any(x != 0 for i, row in enumerate(a) for x in row[i:])):
        return ()

    def equal(x, y) -> bool:
        return abs(x - y) <= 100 * rounding * len(c) if rounding else x == y

    found = integrals(c)
    for x, row in zip((*c, Fraction(1)), (*a, b), strict=True):
        if not all(equal(value, one(x)) for value, one in zip(row, found, strict=True)):
            return ()
    return tuple(tuple(one.coefficients[1:]) + (Fraction(0),) * (len(c) - one.degree) for one in found)


def extrapolated(c: Sequence, start) -> tuple:
    """Weights that, with `start` at 0, integrate polynomials of degree less than the stages over 0 to 1.

    The embedded solution of Radau IIA (Hairer and Wanner 1996, IV.8).
    """
    return tuple(
        whole(Fraction(1)) - start * one(Fraction(0)) for whole, one in zip(integrals(c), lagrange(c), strict=True)
    )
