"""Collocation: integrals of Lagrange polynomials on the nodes of a method, in exact arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from fvsolve.steppers.numbers.polynomial import Polynomial


def lagrange(c: Sequence) -> list[Polynomial]:
    """Lagrange polynomials l_i on the nodes c, with l_i(c_j) = 1 if i = j, otherwise 0; the nodes must differ."""
    polynomials = []
    for i, x in enumerate(c):
        product = Polynomial([1])
        for y in (*c[:i], *c[i + 1 :]):
            product = product * Polynomial([-y, 1]) / (x - y)
        polynomials.append(product)
    return polynomials


def integrals(c: Sequence) -> list[Polynomial]:
    """Integrals from 0 to theta of the Lagrange polynomials l_i on the nodes c, as polynomials in theta."""
    return [
        Polynomial([0, *(x / (k + 1) for k, x in enumerate(polynomial.coefficients))]) for polynomial in lagrange(c)
    ]


def collocation(a: Sequence, b: Sequence, c: Sequence, rounding: Fraction = Fraction(0)) -> tuple[tuple, ...]:
    """Coefficients dense_ij of the dense output y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1).

    The result is empty if a, b, c is not a collocation method, which has a_ij = int_0^c_i l_j and b_j = int_0^1 l_j
    with the Lagrange polynomials l_j (Hairer, Norsett and Wanner 1993, II.7).
    rounding : relative error of a coefficient
    """
    if len(set(c)) < len(c) or (len(c) > 1 and not any(x != 0 for i, row in enumerate(a) for x in row[i:])):
        return ()

    def equal(x, y) -> bool:
        return abs(x - y) <= 100 * rounding * len(c) if rounding else x == y

    integrated = integrals(c)
    for x, row in zip((*c, Fraction(1)), (*a, b), strict=True):
        if not all(equal(value, integral(x)) for value, integral in zip(row, integrated, strict=True)):
            return ()
    return tuple(
        tuple(integral.coefficients[1:]) + (Fraction(0),) * (len(c) - integral.degree) for integral in integrated
    )


def extrapolated(c: Sequence, start) -> tuple:
    """Weights of the stages in the embedded solution of Radau IIA methods (Hairer and Wanner 1996, IV.8).

    Together with the weight `start` at time 0, they integrate exactly from 0 to 1 all polynomials of a degree below the
    number of stages. c : times of the stages
    """
    return tuple(
        integral(Fraction(1)) - start * basis(Fraction(0))
        for integral, basis in zip(integrals(c), lagrange(c), strict=True)
    )
