"""Rational functions of s with exact real coefficients: reading, reducing, where their roots lie. Knows no verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.steppers.numbers.polynomial import Polynomial, sign
from fvsolve.steppers.numbers.sturm import chain

BITS = 200  # to which a root is bracketed, relative to itself, before anything is computed from it


def coefficients(given, name: str) -> Polynomial:
    """The polynomial of coefficients, highest power FIRST, exact; FvsolveError says which one is none.

    Whole numbers, fractions, decimals and text ("0.1", "1/3", "2e-7") are what they say. A float is the binary
    fraction that it is: 0.1 is 3602879701896397 / 2^55. A bare number is a constant.
    """
    if isinstance(given, (str, Real, Decimal, complex)) or np.ndim(given) == 0 and isinstance(given, np.ndarray):
        given = [given[()] if isinstance(given, np.ndarray) else given]
    if isinstance(given, (bytes, Mapping)) or not isinstance(given, Iterable):
        raise FvsolveError(f"{name} = {given!r} is no polynomial; wanted its coefficients, highest power first")
    found = [_exact(x, f"{name}[{k}]") for k, x in enumerate(given)]
    if not found:
        raise FvsolveError(f"{name} has no coefficients; wanted at least one, highest power first")
    return Polynomial(found[::-1])


def _exact(x, name: str) -> Fraction:
    try:
        if isinstance(x, (str, Decimal, Rational)) and not isinstance(x, bool):
            return Fraction(int(x)) if isinstance(x, Integral) else Fraction(x)
        if isinstance(x, Real) and math.isfinite(x) and not isinstance(x, bool):
            return Fraction(float(x))
    except (ValueError, OverflowError, ZeroDivisionError):
        pass
    raise FvsolveError(
        f'{name} = {x!r} is no coefficient; wanted a finite real number: whole, a fraction, a float, or text like "0.1"'
    )


def sides(p: Polynomial) -> tuple[Polynomial, Polynomial]:
    """(e, o) with p(jw) = e(w^2) + j w o(w^2)."""
    signed = [x if k % 4 < 2 else -x for k, x in enumerate(p.coefficients)]
    return Polynomial(signed[0::2]), Polynomial(signed[1::2])


@dataclass(frozen=True)
class Places:
    """Where the roots of a real polynomial lie, counted with their multiplicity.

    right, axis, left : how many have Re s > 0, = 0, < 0; zero : how many are s = 0 (counted in `axis` too)
    pairs : ((x, order), ...) of the roots s = +-j sqrt(x), x > 0, rising
    """

    right: int
    axis: int
    left: int
    zero: int
    pairs: tuple[tuple[Root, int], ...]


def places(p: Polynomial) -> Places:
    """Where the roots of p lie, decided: the index of Cauchy for the half planes, Sturm's chain for the axis.

    left - right = change of arg p(jw) / pi (Hermite 1856, Routh 1877), by a chain of remainders in which no row is
    degenerate. Roots on the axis are the roots that both sides of p(jw) share.
    """
    zero = next((k for k, x in enumerate(p.coefficients) if x != 0), 0)
    pairs = tuple(_pairs(p))
    axis = zero + 2 * sum(order for _, order in pairs)
    more_left = _turns(p)
    right = (p.degree - axis - more_left) // 2
    return Places(right, axis, right + more_left, zero, pairs)


def _pairs(p: Polynomial):
    """(x, order) of every pair of roots +-j sqrt(x), x > 0."""
    common = shared(p)
    for x in positive_roots(common):
        order, q = 1, common.derivative()
        while q.degree >= 0 and x.sign_of(q) == 0:
            order, q = order + 1, q.derivative()
        yield x, order


def shared(p: Polynomial) -> Polynomial:
    """c(x), the greatest common divisor of both sides of p(jw), x = w^2."""
    even, odd = sides(p)
    return even.gcd(odd)


def _turns(p: Polynomial) -> int:
    """Roots with Re s < 0 less those with Re s > 0."""
    signed = [x if k % 4 < 2 else -x for k, x in enumerate(p.coefficients)]
    u = Polynomial(x if k % 2 == 0 else 0 for k, x in enumerate(signed))
    v = Polynomial(x if k % 2 else 0 for k, x in enumerate(signed))
    return -index(v, u) if p.degree % 2 == 0 else index(u, v)


def index(top: Polynomial, below: Polynomial) -> int:
    """Cauchy's index of top / below on the real line: jumps from -infinity to infinity less those back."""
    found = [below, top] if top.degree >= 0 else [below]
    while len(found) > 1 and (rest := -(found[-2] % found[-1])).degree >= 0:
        found.append(rest / abs(rest.coefficients[-1]))
    return _changes(_far(q, -1) for q in found) - _changes(_far(q, 1) for q in found)


class Root:
    """A real root x > 0 of a polynomial without double roots: the only one in (low, high]."""

    def __init__(self, p: Polynomial, low: Fraction, high: Fraction):
        self.p, self.low, self.high = p, low, high
        self.exact = p(high) == 0
        self.rising = sign(p(high)) > 0

    def halve(self) -> None:
        """Make the bracket half as wide."""
        middle = (self.low + self.high) / 2
        if self.exact:
            self.low = middle
            return
        now = sign(self.p(middle))
        if now == 0:
            self.low, self.high, self.exact = self.low, middle, True
        elif (now > 0) == self.rising:
            self.high = middle
        else:
            self.low = middle

    def refine(self, bits: int = BITS) -> Fraction:
        """A number next to the root, or the root where it is a plain fraction that was met."""
        while not self.exact and (self.high - self.low) * (1 << bits) > self.high:
            self.halve()
        return self.high

    def sign_of(self, q: Polynomial) -> int:
        """The sign of q at the root, decided."""
        if self.exact or q.degree < 1:
            return sign(q(self.high))
        common = chain(self.p.gcd(q))
        if count(common, self.low, self.high):
            return 0
        found = chain(q)
        while q(self.low) == 0 or count(found, self.low, self.high):
            self.halve()
            if self.exact:
                return sign(q(self.high))
        return sign(q(self.high))

    @property
    def frequency(self) -> float:
        """sqrt(x), the nearest float or its neighbour."""
        return float_root(self.refine())


def float_root(x: Fraction) -> float:
    """sqrt(x) of a fraction >= 0, to the last bit, also where x is beyond floats."""
    shift = max(0, 130 - x.numerator.bit_length() + x.denominator.bit_length()) // 2
    return float(Fraction(math.isqrt((x.numerator << (2 * shift)) // x.denominator), 1 << shift))


def positive_roots(p: Polynomial) -> list[Root]:
    """The different roots x > 0 of p, rising, each bracketed (Sturm 1829); none of the zero polynomial."""
    while p.degree > 0 and p.coefficients[0] == 0:
        p = Polynomial(p.coefficients[1:])
    if p.degree < 1:
        return []
    p = p // p.gcd(p.derivative())
    found, top = chain(p), abs(p.coefficients[-1])
    bound = Fraction(2) ** math.ceil(max(abs(x) for x in p.coefficients) / top + 1).bit_length()
    boxes, roots = [(Fraction(0), bound, count(found, Fraction(0), bound))], []
    while boxes:
        low, high, held = boxes.pop()
        if held == 1:
            roots.append(Root(p, low, high))
        elif held > 1:
            middle = (low + high) / 2
            left = count(found, low, middle)
            boxes += [(middle, high, held - left), (low, middle, left)]
    for root in roots:
        while not root.exact and root.low == 0:  # so that relative widths mean something
            root.halve()
    return roots


def count(found: list[Polynomial], low: Fraction, high: Fraction) -> int:
    """Different roots in (low, high] of the polynomial whose Sturm chain this is."""
    return _changes(sign(q(low)) for q in found) - _changes(sign(q(high)) for q in found)


def estimates(p: Polynomial) -> list[complex]:
    """All roots in floats, those farthest to the right first: for words, never for a decision."""
    if p.degree < 1:
        return []
    top = max(abs(x) for x in p.coefficients)
    found = np.roots([float(x / top) for x in reversed(p.coefficients)])
    return sorted((complex(s) for s in found), key=lambda s: (-s.real, abs(s.imag), -s.imag))


def _changes(signs) -> int:
    seen = [s for s in signs if s != 0]
    return sum(one != two for one, two in zip(seen, seen[1:], strict=False))


def _far(p: Polynomial, side: int) -> int:
    """The sign of p at side * infinity."""
    top = sign(p.coefficients[-1]) if p.degree >= 0 else 0
    return top if side > 0 or p.degree % 2 == 0 else -top
