"""R(s), what one step makes of y' = lambda y with s = h lambda: y+ = R(s) y (12). Knows exact numbers, no time loop."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fvsolve.doors import Kind, door, is_array
from fvsolve.steppers.analysis.pade import pade
from fvsolve.steppers.analysis.trees import short
from fvsolve.steppers.numbers.polynomial import Polynomial
from fvsolve.steppers.tableau import Method, method_named

NOTHING = Polynomial([])
PLANE = Kind(lambda given: is_array(given, "fiuc", 0, 9, finite=False), "complex numbers")


@dataclass(frozen=True)
class StabilityFunction:
    """numerator / denominator in lowest terms, denominator(0) = 1.

    doubts : for both, what each coefficient may be off by where the source rounds; zero where it does not.
    """

    numerator: Polynomial
    denominator: Polynomial
    doubts: tuple[Polynomial, Polynomial] = (NOTHING, NOTHING)

    @door(s=PLANE)
    def __call__(self, s):
        """R(s) in floating point, s a complex number or an array of them."""
        s = np.asarray(s, dtype=np.complex128)
        up, down = self.floats
        return np.polyval(up, s) / np.polyval(down, s)

    @functools.cached_property
    def floats(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of both, the highest first."""
        up, down = ([float(x) for x in p.coefficients][::-1] for p in (self.numerator, self.denominator))
        return np.array(up), np.array(down)

    @functools.cached_property
    def pade(self) -> tuple[int, int] | None:
        """Degrees (k, m) where R is the Pade approximation P^k_m of e^s, else None; decided by comparison."""
        k, m = self.numerator.degree, self.denominator.degree
        pairs = zip((self.numerator, self.denominator), pade(k, m), self.doubts, strict=True)
        return (k, m) if all(chopped(x - y, doubt).degree < 0 for x, y, doubt in pairs) else None

    @functools.cached_property
    def error_constant(self) -> tuple[int, object]:
        """(q, C) of R(s) - e^s = C s^(q+1) + ...: order q on the test system, exact."""
        last = self.numerator.degree + self.denominator.degree + 1
        series = [Fraction(1)]  # of e^s
        for j in range(1, last + 1):
            series.append(series[-1] / j)
        doubt = self.doubts[0] + self.doubts[1] * Polynomial(series)
        rest = chopped(self.numerator - self.denominator * Polynomial(series), doubt).coefficients[: last + 1]
        return next(((j - 1, x) for j, x in enumerate(rest) if x != 0), (last, Fraction(0)))


def stability_function(method: str | Method) -> StabilityFunction:
    """R of a method by the determinants of (26), which is (16) for explicit ones, in lowest terms."""
    return _lowest(method_named(method))


@functools.lru_cache(maxsize=256)
def _lowest(method: Method) -> StabilityFunction:
    numerator, denominator = by_determinants(method.exact.a, method.exact.b)
    doubts = (NOTHING, NOTHING)
    if method.rounding:
        doubts = _doubts(method)
        pair = (Polynomial(map(short, p.coefficients)) for p in (numerator, denominator))
        numerator, denominator = (chopped(p, doubt) for p, doubt in zip(pair, doubts, strict=True))
    common = numerator.gcd(denominator)
    numerator, denominator = numerator // common, denominator // common
    one = denominator.coefficients[0]
    return StabilityFunction(numerator / one, denominator / one, doubts)


def by_determinants(a: Sequence[Sequence], b: Sequence) -> tuple[Polynomial, Polynomial]:
    """det(I - s (A - 1 b^T)) and det(I - s A) of (16) and (26)."""
    return determinant([[x - y for x, y in zip(row, b, strict=True)] for row in a]), determinant(a)


def by_resolvent(a: Sequence[Sequence], b: Sequence) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of 1 + s b^T (I - s A)^-1 1, (25)."""
    down, adjugate = _leverrier(a)
    up = [sum((x * sum(row, Fraction(0)) for x, row in zip(b, m, strict=True)), Fraction(0)) for m in adjugate]
    return Polynomial(down) + Polynomial([0, *up]), Polynomial(down)


def determinant(m: Sequence[Sequence]) -> Polynomial:
    """det(I - s M)."""
    return Polynomial(_leverrier(m)[0])


def chopped(p: Polynomial, doubt: Polynomial) -> Polynomial:
    """p without the coefficients that are no larger than what they may be off by."""
    bounds = [*doubt.coefficients, *[Fraction(0)] * len(p.coefficients)]
    return Polynomial(x if abs(x) > bound else Fraction(0) for x, bound in zip(p.coefficients, bounds, strict=False))


def _doubts(method: Method) -> tuple[Polynomial, Polynomial]:
    """Bounds of what rounded coefficients do to numerator and denominator, to first order.

    The same sums with all terms positive: 1 / det(I - s |A|) for the denominator, that times 1 + s |b| ... for both.
    """
    a, b, s = np.abs(method.a), np.abs(method.b), method.stages
    traces, moments, power = [], [1.0], np.ones(s)
    for k in range(s):
        moments.append(float(b @ power))
        power = a @ power
        traces.append(float(np.trace(np.linalg.matrix_power(a, k + 1))))
    sums = [1.0]
    for k in range(1, s + 1):
        sums.append(sum(traces[i] * sums[k - 1 - i] for i in range(k)) / k)
    both = np.convolve(sums, moments)[: s + 1]
    return tuple(
        Polynomial(4 * k * method.rounding * Fraction(float(x)) for k, x in enumerate(one)) for one in (both, sums)
    )


def _leverrier(a: Sequence[Sequence]) -> tuple[list, list]:
    """Coefficients of det(I - s A) and of adj(I - s A), lowest first (Faddeev and Leverrier)."""
    s = len(a)
    rows = [[(j, x) for j, x in enumerate(row) if x != 0] for row in a]
    found, m = [Fraction(1)], [[Fraction(i == j) for j in range(s)] for i in range(s)]
    adjugate = []
    for k in range(1, s + 1):
        adjugate.append(m)
        m = [[sum((x * m[j][col] for j, x in row if m[j][col] != 0), Fraction(0)) for col in range(s)] for row in rows]
        found.append(sum((m[i][i] for i in range(s)), Fraction(0)) / -k)
        for i in range(s):
            m[i][i] = m[i][i] + found[-1]
    return found, adjugate
