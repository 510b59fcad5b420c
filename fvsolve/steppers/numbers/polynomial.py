"""Polynomials with exact coefficients (fractions or algebraic numbers), lowest power first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction


class Polynomial:
    """Polynomial sum_k coefficients[k] x^k with exact coefficients.

    The last coefficient is not zero, so the zero polynomial has no coefficients.
    """

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Iterable):
        exact = [Fraction(x) if isinstance(x, int) else x for x in coefficients]
        while exact and exact[-1] == 0:
            exact.pop()
        self.coefficients = tuple(exact)

    @property
    def degree(self) -> int:
        """Degree; -1 for the zero polynomial."""
        return len(self.coefficients) - 1

    def __call__(self, x):
        total = 0 * x
        for value in reversed(self.coefficients):
            total = total * x + value
        return total

    def __eq__(self, other) -> bool:
        return self.coefficients == _as(other).coefficients

    def __hash__(self) -> int:
        return hash(self.coefficients)

    def __repr__(self) -> str:
        return f"Polynomial({[str(x) for x in self.coefficients]})"

    def __neg__(self) -> Polynomial:
        return Polynomial(-x for x in self.coefficients)

    def __add__(self, other) -> Polynomial:
        long, short = sorted((self.coefficients, _as(other).coefficients), key=len, reverse=True)
        return Polynomial([x + y for x, y in zip(long, short, strict=False)] + list(long[len(short) :]))

    def __sub__(self, other) -> Polynomial:
        return self + -_as(other)

    def __mul__(self, other) -> Polynomial:
        other = _as(other)
        product = [Fraction(0)] * (self.degree + other.degree + 1) if self.coefficients and other.coefficients else []
        for i, x in enumerate(self.coefficients):
            for j, y in enumerate(other.coefficients):
                product[i + j] = product[i + j] + x * y
        return Polynomial(product)

    def __radd__(self, other) -> Polynomial:
        return self + other

    def __rsub__(self, other) -> Polynomial:
        return -self + other

    def __rmul__(self, other) -> Polynomial:
        return self * other

    def __truediv__(self, number) -> Polynomial:
        """Polynomial divided by a number."""
        number = _as(number)
        if number.degree != 0:
            raise ZeroDivisionError("a polynomial can only be divided by a number other than 0")
        return Polynomial(x / number.coefficients[0] for x in self.coefficients)

    def __pow__(self, power: int) -> Polynomial:
        result = Polynomial([1])
        for _ in range(power):
            result = result * self
        return result

    def __divmod__(self, other: Polynomial) -> tuple[Polynomial, Polynomial]:
        remainder, below = list(self.coefficients), other.coefficients
        quotient = [Fraction(0)] * max(len(remainder) - len(below) + 1, 0)
        for k in reversed(range(len(quotient))):
            quotient[k] = remainder[k + len(below) - 1] / below[-1]
            for j, y in enumerate(below):
                remainder[k + j] = remainder[k + j] - quotient[k] * y
        return Polynomial(quotient), Polynomial(remainder[: len(below) - 1])

    def __floordiv__(self, other: Polynomial) -> Polynomial:
        return divmod(self, other)[0]

    def __mod__(self, other: Polynomial) -> Polynomial:
        return divmod(self, other)[1]

    def monic(self) -> Polynomial:
        """Polynomial scaled so that its highest coefficient is 1."""
        return Polynomial(x / self.coefficients[-1] for x in self.coefficients)

    def derivative(self) -> Polynomial:
        return Polynomial(k * x for k, x in enumerate(self.coefficients[1:], start=1))

    def gcd(self, other: Polynomial) -> Polynomial:
        """Monic greatest common divisor of this and another polynomial."""
        a, b = self, other
        while b.coefficients:
            a, b = b, a % b
            b = b.monic() if b.coefficients else b
        return a.monic() if a.coefficients else a


def sign(value) -> int:
    """Sign of an exact number: -1, 0 or 1."""
    return (value > 0) - (value < 0) if isinstance(value, (int, Fraction)) else value.sign()


def _as(value) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial([value])


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
