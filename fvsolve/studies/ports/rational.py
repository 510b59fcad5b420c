"""Polynomials with exact real coefficients: parsing, location of roots in half planes and on the imaginary axis."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.steppers.numbers.polynomial import Polynomial, chain, sign

BITS = 200  # relative precision of a bracketed root in bits, before values are computed from it


def coefficients(given, name: str) -> Polynomial:
    """Exact polynomial from its coefficients `given`, highest power FIRST; a single number is a constant.

    Whole numbers, fractions, decimals and text ("0.1", "1/3", "2e-7") are taken exactly. A float is taken as its binary
    fraction: 0.1 is 3602879701896397 / 2^55. Raises FvsolveError for an invalid coefficient; name : name of the
    polynomial in the error message
    """
    if isinstance(given, (str, Real, Decimal, complex)) or np.ndim(given) == 0 and isinstance(given, np.ndarray):
        given = [given[()] if isinstance(given, np.ndarray) else given]
    if isinstance(given, (bytes, Mapping)) or not isinstance(given, Iterable):
        raise FvsolveError(f"{name} = {given!r} is not a polynomial. Expected its coefficients, highest power first")
    values = [_exact(x, f"{name}[{k}]") for k, x in enumerate(given)]
    if not values:
        raise FvsolveError(f"{name} has no coefficients. Expected at least one, highest power first")
    return Polynomial(values[::-1])


def _exact(x, name: str) -> Fraction:
    try:
        if isinstance(x, (str, Decimal, Rational)) and not isinstance(x, bool):
            return Fraction(int(x)) if isinstance(x, Integral) else Fraction(x)
        if isinstance(x, Real) and math.isfinite(x) and not isinstance(x, bool):
            return Fraction(float(x))
    except (ValueError, OverflowError, ZeroDivisionError):
        pass
    raise FvsolveError(
        f"{name} = {x!r} is not a coefficient. Expected a finite real number: "
        'a whole number, a fraction, a float, or text like "0.1"'
    )


def even_odd_parts(p: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Polynomials e and o of the even and odd powers of p: p(jw) = e(w^2) + j w o(w^2)."""
    signed = [x if k % 4 < 2 else -x for k, x in enumerate(p.coefficients)]
    return Polynomial(signed[0::2]), Polynomial(signed[1::2])


@dataclass(frozen=True)
class RootLocations:
    """Location of the roots of a real polynomial, counted with multiplicity.

    right, axis, left : numbers of roots s with Re s > 0, Re s = 0, Re s < 0
    zero : number of roots s = 0, which are also counted in `axis`
    pairs : x > 0 and multiplicity of each pair of roots s = +-j sqrt(x), with increasing x
    """

    right: int
    axis: int
    left: int
    zero: int
    pairs: tuple[tuple[Root, int], ...]


def locate_roots(p: Polynomial) -> RootLocations:
    """Locate the roots of p exactly: Cauchy index for the half planes, Sturm chain for the axis.

    The number of left roots minus right roots is the change of arg p(jw) / pi (Hermite 1856, Routh 1877), computed from
    a chain of polynomial remainders. Roots on the axis are the common roots of the even and odd part of p(jw).
    """
    zero = next((k for k, x in enumerate(p.coefficients) if x != 0), 0)
    pairs = tuple(_pairs(p))
    axis = zero + 2 * sum(order for _, order in pairs)
    more_left = _left_minus_right(p)
    right = (p.degree - axis - more_left) // 2
    return RootLocations(right, axis, right + more_left, zero, pairs)


def _pairs(p: Polynomial):
    """Yield x > 0 and multiplicity for every pair of roots +-j sqrt(x) of p."""
    common = axis_factor(p)
    for x in positive_roots(common):
        order, q = 1, common.derivative()
        while q.degree >= 0 and x.sign_of(q) == 0:
            order, q = order + 1, q.derivative()
        yield x, order


def axis_factor(p: Polynomial) -> Polynomial:
    """Polynomial c(x) whose positive roots x are the squares w^2 of the roots s = jw of p on the imaginary axis.

    It is the greatest common divisor of the even and odd part of p(jw).
    """
    even, odd = even_odd_parts(p)
    return even.gcd(odd)


def _left_minus_right(p: Polynomial) -> int:
    """Number of roots of p with Re s < 0 minus number of roots with Re s > 0."""
    signed = [x if k % 4 < 2 else -x for k, x in enumerate(p.coefficients)]
    u = Polynomial(x if k % 2 == 0 else 0 for k, x in enumerate(signed))
    v = Polynomial(x if k % 2 else 0 for k, x in enumerate(signed))
    return -cauchy_index(v, u) if p.degree % 2 == 0 else cauchy_index(u, v)


def cauchy_index(top: Polynomial, below: Polynomial) -> int:
    """Cauchy index of the rational function top / below on the real line.

    It is the number of jumps from -infinity to infinity minus the number of jumps from infinity to -infinity.
    """
    remainders = [below, top] if top.degree >= 0 else [below]
    while len(remainders) > 1 and (remainder := -(remainders[-2] % remainders[-1])).degree >= 0:
        remainders.append(remainder / abs(remainder.coefficients[-1]))
    left, right = (_sign_changes(_sign_at_infinity(q, side) for q in remainders) for side in (-1, 1))
    return left - right


class Root:
    """Real root x > 0 of a polynomial p without multiple roots; it is the only root of p with low < x <= high."""

    def __init__(self, p: Polynomial, low: Fraction, high: Fraction):
        self.p, self.low, self.high = p, low, high
        self.exact = p(high) == 0
        self.rising = sign(p(high)) > 0

    def bisect(self) -> None:
        """Halve the interval from low to high that contains the root."""
        middle = (self.low + self.high) / 2
        if self.exact:
            self.low = middle
            return
        sign_now = sign(self.p(middle))
        if sign_now == 0:
            self.low, self.high, self.exact = self.low, middle, True
        elif (sign_now > 0) == self.rising:
            self.high = middle
        else:
            self.low = middle

    def refine(self, bits: int = BITS) -> Fraction:
        """Upper bound of the root with a relative error of at most 2^-bits, or the root itself if it was found."""
        while not self.exact and (self.high - self.low) * (1 << bits) > self.high:
            self.bisect()
        return self.high

    def sign_of(self, q: Polynomial) -> int:
        """Exact sign of the polynomial q at the root: -1, 0 or 1."""
        if self.exact or q.degree < 1:
            return sign(q(self.high))
        common = chain(self.p.gcd(q))
        if count_roots(common, self.low, self.high):
            return 0
        sequence = chain(q)
        while q(self.low) == 0 or count_roots(sequence, self.low, self.high):
            self.bisect()
            if self.exact:
                return sign(q(self.high))
        return sign(q(self.high))

    @property
    def frequency(self) -> float:
        """Frequency sqrt(x) [rad/s] of the root x as a float, correct to one unit in the last place."""
        return float_root(self.refine())


def float_root(x: Fraction) -> float:
    """Square root of a fraction x >= 0 as a float, correct to the last bit, also if x is out of the range of floats."""
    shift = max(0, 130 - x.numerator.bit_length() + x.denominator.bit_length()) // 2
    return float(Fraction(math.isqrt((x.numerator << (2 * shift)) // x.denominator), 1 << shift))


def positive_roots(p: Polynomial) -> list[Root]:
    """Distinct roots x > 0 of p in increasing order, each in its own interval (Sturm 1829); empty for p = 0."""
    while p.degree > 0 and p.coefficients[0] == 0:
        p = Polynomial(p.coefficients[1:])
    if p.degree < 1:
        return []
    p = p // p.gcd(p.derivative())
    sequence, top = chain(p), abs(p.coefficients[-1])
    bound = Fraction(2) ** math.ceil(max(abs(x) for x in p.coefficients) / top + 1).bit_length()
    intervals, roots = [(Fraction(0), bound, count_roots(sequence, Fraction(0), bound))], []
    while intervals:
        low, high, n_roots = intervals.pop()
        if n_roots == 1:
            roots.append(Root(p, low, high))
        elif n_roots > 1:
            middle = (low + high) / 2
            n_left = count_roots(sequence, low, middle)
            intervals += [(middle, high, n_roots - n_left), (low, middle, n_left)]
    for root in roots:
        while not root.exact and root.low == 0:  # relative widths need a positive lower end
            root.bisect()
    return roots


def count_roots(sequence: list[Polynomial], low: Fraction, high: Fraction) -> int:
    """Number of distinct roots with low < x <= high of the polynomial whose Sturm chain is `sequence`."""
    return _sign_changes(sign(q(low)) for q in sequence) - _sign_changes(sign(q(high)) for q in sequence)


def estimates(p: Polynomial) -> list[complex]:
    """Estimates of all roots of p in floating point, rightmost first; only reported, never used for decisions."""
    if p.degree < 1:
        return []
    top = max(abs(x) for x in p.coefficients)
    roots = np.roots([float(x / top) for x in reversed(p.coefficients)])
    return sorted((complex(s) for s in roots), key=lambda s: (-s.real, abs(s.imag), -s.imag))


def _sign_changes(signs) -> int:
    nonzero = [s for s in signs if s != 0]
    return sum(first != second for first, second in zip(nonzero, nonzero[1:], strict=False))


def _sign_at_infinity(p: Polynomial, side: int) -> int:
    """Sign of p(x) as x tends to infinity (side = 1) or -infinity (side = -1)."""
    top = sign(p.coefficients[-1]) if p.degree >= 0 else 0
    return top if side > 0 or p.degree % 2 == 0 else -top
