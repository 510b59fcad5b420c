"""Stability function R(s) of a method in exact arithmetic: a step h of y' = lambda y gives R(s) y with s = h lambda."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial

import numpy as np

from fvsolve.argument_checks import COUNT_FROM_ZERO, Kind, is_array, validated
from fvsolve.core.steppers.analysis.trees import short
from fvsolve.core.steppers.numbers.polynomial import Polynomial
from fvsolve.core.steppers.tableau import Method, method_named

NOTHING = Polynomial([])
PLANE = Kind(lambda given: is_array(given, "fiuc", 0, 9, finite=False), "complex numbers")


@dataclass(frozen=True)
class StabilityFunction:
    """Rational function numerator / denominator in lowest terms, with denominator(0) = 1.

    doubts : uncertainties of the coefficients of both polynomials, due to rounded coefficients of the method
    """

    numerator: Polynomial
    denominator: Polynomial
    doubts: tuple[Polynomial, Polynomial] = (NOTHING, NOTHING)

    @validated(s=PLANE)
    def __call__(self, s):
        """Value R(s) of the stability function in floating point; s : complex number or array."""
        s = np.asarray(s, dtype=np.complex128)
        up, down = self.floats
        return np.polyval(up, s) / np.polyval(down, s)

    @functools.cached_property
    def floats(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of numerator and denominator in floating point, highest power first."""
        up, down = (
            [float(x) for x in p.coefficients][::-1] for p in (self.numerator, self.denominator)
        )
        return np.array(up), np.array(down)

    @functools.cached_property
    def pade(self) -> tuple[int, int] | None:
        """Degrees (k, m) of numerator and denominator if R is a Pade approximation of e^s, otherwise None."""
        k, m = self.numerator.degree, self.denominator.degree
        pairs = zip((self.numerator, self.denominator), pade(k, m), self.doubts, strict=True)
        return (
            (k, m)
            if all(chopped(x - y, uncertainty).degree < 0 for x, y, uncertainty in pairs)
            else None
        )

    @functools.cached_property
    def error_constant(self) -> tuple[int, object]:
        """Order q and error constant C on y' = lambda y, exact: R(s) - e^s = C s^(q+1) + higher powers."""
        last = self.numerator.degree + self.denominator.degree + 1
        series = [Fraction(1)]  # power series of e^s
        for j in range(1, last + 1):
            series.append(series[-1] / j)
        uncertainty = self.doubts[0] + self.doubts[1] * Polynomial(series)
        rest = chopped(
            self.numerator - self.denominator * Polynomial(series), uncertainty
        ).coefficients[: last + 1]
        return next(((j - 1, x) for j, x in enumerate(rest) if x != 0), (last, Fraction(0)))


def stability_function(method: str | Method) -> StabilityFunction:
    """Stability function R of a method in lowest terms, as a quotient of determinants.

    Its formula is equation (26) of docs/course.md, and equation (16) for an explicit method.
    """
    return _lowest(method_named(method))


@functools.lru_cache(maxsize=256)
def _lowest(method: Method) -> StabilityFunction:
    numerator, denominator = by_determinants(method.exact.a, method.exact.b)
    uncertainties = (NOTHING, NOTHING)
    if method.rounding:
        uncertainties = _doubts(method)
        pair = (Polynomial(map(short, p.coefficients)) for p in (numerator, denominator))
        numerator, denominator = (
            chopped(p, uncertainty) for p, uncertainty in zip(pair, uncertainties, strict=True)
        )
    # A common factor would count as a pole that R does not have.
    common = numerator.gcd(denominator)
    numerator, denominator = numerator // common, denominator // common
    constant = denominator.coefficients[0]
    return StabilityFunction(numerator / constant, denominator / constant, uncertainties)


def by_determinants(a: Sequence[Sequence], b: Sequence) -> tuple[Polynomial, Polynomial]:
    """Numerator det(I - s (A - 1 b^T)) and denominator det(I - s A) of R(s), equations (16), (26) of docs/course.md.

    a, b : A and b of the Butcher array; 1 is the vector of ones.
    """
    return determinant([[x - y for x, y in zip(row, b, strict=True)] for row in a]), determinant(a)


def by_resolvent(a: Sequence[Sequence], b: Sequence) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of R(s) = 1 + s b^T (I - s A)^-1 1, equation (25) of docs/course.md."""
    down, adjugate = _leverrier(a)
    up = [
        sum((x * sum(row, Fraction(0)) for x, row in zip(b, m, strict=True)), Fraction(0))
        for m in adjugate
    ]
    return Polynomial(down) + Polynomial([0, *up]), Polynomial(down)


def determinant(m: Sequence[Sequence]) -> Polynomial:
    """Determinant det(I - s m) of a square matrix m of exact numbers, as a polynomial in s."""
    return Polynomial(_leverrier(m)[0])


def chopped(p: Polynomial, uncertainty: Polynomial) -> Polynomial:
    """Polynomial p without the coefficients that do not exceed their uncertainty.

    uncertainty : polynomial whose coefficients are bounds of the errors of the coefficients of p
    """
    bounds = [*uncertainty.coefficients, *[Fraction(0)] * len(p.coefficients)]
    return Polynomial(
        x if abs(x) > bound else Fraction(0)
        for x, bound in zip(p.coefficients, bounds, strict=False)
    )


def _doubts(method: Method) -> tuple[Polynomial, Polynomial]:
    """First-order bounds of the errors in numerator and denominator caused by rounded coefficients.

    They follow from the same sums with all terms positive: 1 / det(I - s |A|) for the denominator, and the product of
    it with 1 + s |b|^T (I - s |A|)^-1 1 for the numerator.
    """
    a = np.abs(method.a)
    b = np.abs(method.b)
    s = method.stages
    traces = []
    moments = [1.0]
    power = np.ones(s)
    for k in range(s):
        moments.append(float(b @ power))
        power = a @ power
        traces.append(float(np.trace(np.linalg.matrix_power(a, k + 1))))
    # Newton's identities give the series of 1 / det(I - s |A|) from the traces of powers.
    sums = [1.0]
    for k in range(1, s + 1):
        sums.append(sum(traces[i] * sums[k - 1 - i] for i in range(k)) / k)
    both = np.convolve(sums, moments)[: s + 1]
    return tuple(
        Polynomial(4 * k * method.rounding * Fraction(float(x)) for k, x in enumerate(bounds))
        for bounds in (both, sums)
    )


def _leverrier(a: Sequence[Sequence]) -> tuple[list, list]:
    """Coefficients of the determinant and of the adjugate of I - s A, lowest power first (Faddeev and Leverrier)."""
    s = len(a)
    rows = [[(j, x) for j, x in enumerate(row) if x != 0] for row in a]
    characteristic, m = [Fraction(1)], [[Fraction(i == j) for j in range(s)] for i in range(s)]
    adjugate = []
    # Recurrence: c_k = -trace(A M_k) / k, M_(k+1) = A M_k + c_k I.
    for k in range(1, s + 1):
        adjugate.append(m)
        m = [
            [
                sum((x * m[j][col] for j, x in row if m[j][col] != 0), Fraction(0))
                for col in range(s)
            ]
            for row in rows
        ]
        characteristic.append(sum((m[i][i] for i in range(s)), Fraction(0)) / -k)
        for i in range(s):
            m[i][i] = m[i][i] + characteristic[-1]
    return characteristic, adjugate


@validated(k=COUNT_FROM_ZERO, m=COUNT_FROM_ZERO)
def pade(k: int, m: int) -> tuple[Polynomial, Polynomial]:
    """Numerator N(s) and denominator D(s) of the Pade approximation of e^s, with the degrees k and m.

    Its power series agrees with that of e^s in the first k + m + 1 terms.
    N(s) = sum_j (k+m-j)! k! / ((k+m)! j! (k-j)!) s^j; D is the same sum with m in place of k and -s in place of s
    (Hairer and Wanner 1996, IV.3).
    """

    def part(degree: int, sign: int) -> Polynomial:
        weight = Fraction(factorial(degree), factorial(k + m))
        return Polynomial(
            weight * sign**j * Fraction(factorial(k + m - j), factorial(j) * factorial(degree - j))
            for j in range(degree + 1)
        )

    return part(k, 1), part(m, -1)
