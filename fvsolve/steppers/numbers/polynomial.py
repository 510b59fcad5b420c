"""Polynomials with exact coefficients, lowest power first. Knows fractions and algebraic numbers; knows no method."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction


class Polynomial:
    """sum_k coefficients[k] x^k; no highest coefficient is zero, so that the zero polynomial has none."""

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Iterable):
        found = [Fraction(x) if isinstance(x, int) else x for x in coefficients]
        while found and found[-1] == 0:
            found.pop()
        self.coefficients = tuple(found)

    @property
    def degree(self) -> int:
        """-1 of the zero polynomial."""
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
        found = [Fraction(0)] * (self.degree + other.degree + 1) if self.coefficients and other.coefficients else []
        for i, x in enumerate(self.coefficients):
            for j, y in enumerate(other.coefficients):
                found[i + j] = found[i + j] + x * y
        return Polynomial(found)

    def __radd__(self, other) -> Polynomial:
        return self + other

    def __rsub__(self, other) -> Polynomial:
        return -self + other

    def __rmul__(self, other) -> Polynomial:
        return self * other

    def __truediv__(self, number) -> Polynomial:
        """By a number alone."""
        number = _as(number)
        if number.degree != 0:
            raise ZeroDivisionError("a polynomial can be divided by a number other than 0 alone")
        return Polynomial(x / number.coefficients[0] for x in self.coefficients)

    def __pow__(self, power: int) -> Polynomial:
        found = Polynomial([1])
        for _ in range(power):
            found = found * self
        return found

    def __divmod__(self, other: Polynomial) -> tuple[Polynomial, Polynomial]:
        rest, below = list(self.coefficients), other.coefficients
        whole = [Fraction(0)] * max(len(rest) - len(below) + 1, 0)
        for k in reversed(range(len(whole))):
            whole[k] = rest[k + len(below) - 1] / below[-1]
            for j, y in enumerate(below):
                rest[k + j] = rest[k + j] - whole[k] * y
        return Polynomial(whole), Polynomial(rest[: len(below) - 1])

    def __floordiv__(self, other: Polynomial) -> Polynomial:
        return divmod(self, other)[0]

    def __mod__(self, other: Polynomial) -> Polynomial:
        return divmod(self, other)[1]

    def monic(self) -> Polynomial:
        """With highest coefficient 1."""
        return Polynomial(x / self.coefficients[-1] for x in self.coefficients)

    def derivative(self) -> Polynomial:
        return Polynomial(k * x for k, x in enumerate(self.coefficients[1:], start=1))

    def gcd(self, other: Polynomial) -> Polynomial:
        """Greatest common divisor, monic."""
        one, two = self, other
        while two.coefficients:
            one, two = two, one % two
            two = two.monic() if two.coefficients else two
        return one.monic() if one.coefficients else one


def sign(value) -> int:
    """-1, 0 or 1 of an exact number, decided."""
    return (value > 0) - (value < 0) if isinstance(value, (int, Fraction)) else value.sign()


def _as(value) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial([value])
