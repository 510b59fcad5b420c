"""Polynomials with exact coefficients (fractions or algebraic numbers), lowest power first.

Sturm chains count their roots; Lagrange polynomials on the nodes of a method give its collocation coefficients.
"""

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
        return Polynomial(
            [x + y for x, y in zip(long, short, strict=False)] + list(long[len(short) :])
        )

    def __sub__(self, other) -> Polynomial:
        return self + -_as(other)

    def __mul__(self, other) -> Polynomial:
        other = _as(other)
        product = (
            [Fraction(0)] * (self.degree + other.degree + 1)
            if self.coefficients and other.coefficients
            else []
        )
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
            # Without this, the fractions of successive remainders grow fast.
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
        Polynomial([0, *(x / (k + 1) for k, x in enumerate(polynomial.coefficients))])
        for polynomial in lagrange(c)
    ]


def collocation(
    a: Sequence, b: Sequence, c: Sequence, rounding: Fraction = Fraction(0)
) -> tuple[tuple, ...]:
    """Coefficients dense_ij of the dense output y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1).

    The result is empty if a, b, c is not a collocation method, which has a_ij = int_0^c_i l_j and b_j = int_0^1 l_j
    with the Lagrange polynomials l_j (Hairer, Norsett and Wanner 1993, II.7).
    rounding : relative error of a coefficient
    """
    # Equal nodes have no Lagrange polynomials, and an explicit method is no collocation.
    if len(set(c)) < len(c) or (
        len(c) > 1 and not any(x != 0 for i, row in enumerate(a) for x in row[i:])
    ):
        return ()

    def equal(x, y) -> bool:
        return abs(x - y) <= 100 * rounding * len(c) if rounding else x == y

    integrated = integrals(c)
    # Integrals up to c_i must give the rows of A, integrals up to 1 the weights.
    for x, row in zip((*c, Fraction(1)), (*a, b), strict=True):
        if not all(
            equal(value, integral(x)) for value, integral in zip(row, integrated, strict=True)
        ):
            return ()
    return tuple(
        tuple(integral.coefficients[1:]) + (Fraction(0),) * (len(c) - integral.degree)
        for integral in integrated
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


DIGITS = Fraction(1, 1 << 64)  # relative width of the bracket of a root


def chain(p: Polynomial) -> list[Polynomial]:
    """Sturm's chain of p: p, p', then the negative remainders of successive divisions, scaled by positive numbers."""
    polynomials = [p, p.derivative()]
    while polynomials[-1].degree > 0:
        remainder = -(polynomials[-2] % polynomials[-1])
        if remainder.degree < 0:
            break
        # A positive factor keeps the signs of the chain and its fractions short.
        top = remainder.coefficients[-1]
        polynomials.append(remainder / (top if sign(top) > 0 else -top))
    return polynomials


def count_roots(p: Polynomial, low=None, high=None) -> int:
    """Number of distinct real roots of p in low < x <= high; None stands for infinity. `p` must not be zero."""
    if p.degree < 1:
        return 0
    polynomials = chain(p)
    return _changes(polynomials, low, -1) - _changes(polynomials, high, 1)


def odd_part(p: Polynomial) -> Polynomial:
    """Polynomial with a single root wherever p changes sign: product of the factors of odd multiplicity (Yun 1976)."""
    product, k = Polynomial([1]), 1
    common = p.gcd(p.derivative())
    w, y = p // common, p.derivative() // common
    while w.degree > 0:
        z = y - w.derivative()
        factor = w.gcd(z) if z.degree >= 0 else w.monic()
        if k % 2:
            product = product * factor
        w, y = w // factor, z // factor
        k += 1
    return product


def first_sign_change(p: Polynomial) -> float | None:
    """Least x > 0 at which p changes sign, accurate to about the last bit; None without sign change there."""
    p = odd_part(p) if p.degree > 0 else p
    # A root at zero is not one at x > 0.
    while p.degree > 0 and p.coefficients[0] == 0:
        p = Polynomial(p.coefficients[1:])
    if p.degree < 1:
        return None
    polynomials = chain(p)
    low = Fraction(0)
    high = Fraction(1)
    # Sturm: the number of roots up to x is the loss of sign changes from 0 to x.
    at_low, far = _changes(polynomials, low, 1), _changes(polynomials, None, 1)
    if at_low == far:
        return None
    # First an interval that contains a root, then one with a single root, then bisection.
    while _changes(polynomials, high, 1) == at_low:
        low, high = high, 2 * high
    while at_low - _changes(polynomials, high, 1) > 1:
        middle = (low + high) / 2
        if _changes(polynomials, middle, 1) == at_low:
            low = middle
        else:
            high = middle
    rising = sign(p(high))
    if rising == 0:
        return float(high)
    while high - low > high * DIGITS:
        middle = (low + high) / 2
        now = sign(p(middle))
        if now == 0:
            return float(middle)
        if now == rising:
            high = middle
        else:
            low = middle
    return float(high)


def nowhere_negative(p: Polynomial) -> bool:
    """True if p(x) >= 0 for all x >= 0."""
    return p.degree < 0 or (sign(p.coefficients[-1]) > 0 and first_sign_change(p) is None)


def roots_right(p: Polynomial) -> bool:
    """True if all roots of p lie in the open right half plane, by Routh's array of p(-x)."""
    up = [x if k % 2 == 0 else -x for k, x in enumerate(p.coefficients)][::-1]
    upper, lower = up[0::2], up[1::2]
    # Routh: the first column of the array must not change its sign.
    first = sign(upper[0])
    while lower:
        if sign(lower[0]) != first:
            return False
        ratio = upper[0] / lower[0]
        rest = [x - ratio * y for x, y in zip(upper[1:], [*lower[1:], Fraction(0)], strict=False)]
        upper, lower = lower, rest
    return True


def _changes(polynomials: list[Polynomial], x, side: int) -> int:
    """Number of sign changes along a Sturm chain at x, or at side * infinity if x is None."""
    signs = [sign(q(x)) if x is not None else _far(q, side) for q in polynomials]
    signs = [s for s in signs if s != 0]
    return sum(a != b for a, b in zip(signs, signs[1:], strict=False))


def _far(p: Polynomial, side: int) -> int:
    if p.degree < 0:
        return 0
    top = sign(p.coefficients[-1])
    return top if side > 0 or p.degree % 2 == 0 else -top
