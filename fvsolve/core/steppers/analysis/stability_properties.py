"""Properties of a Runge-Kutta method in exact arithmetic: stability region |R(s)| <= 1, and all facts of a tableau.

Numbers in brackets are equations and sections of docs/course.md.
"""

import functools
import math
from dataclasses import dataclass, fields
from fractions import Fraction

import numpy as np

from fvsolve.argument_checks import COUNT_FROM_ZERO, NAME, NUMBER, POINT, POSITIVE, validated
from fvsolve.core.steppers.analysis.stability_function import (
    StabilityFunction,
    chopped,
    stability_function,
)
from fvsolve.core.steppers.numbers.polynomial import (
    Polynomial,
    first_sign_change,
    nowhere_negative,
    roots_right,
    sign,
)
from fvsolve.core.steppers.tableau import Method, method_named

ANGLE_BITS = 36  # precision of the cosine of alpha in A(alpha)


def e_polynomial(r: StabilityFunction) -> Polynomial:
    """Polynomial E(x) = |D(iy)|^2 - |N(iy)|^2 with x = y^2, for R = N / D (Norsett 1975).

    |R(iy)| <= 1 where E >= 0.
    """
    uncertainty = Polynomial(_square_doubt(r).coefficients[0::2])
    return chopped(_modulus(r.denominator) - _modulus(r.numerator), uncertainty)


def i_stable(r: StabilityFunction) -> bool:
    """True if |R(iy)| <= 1 for all real y."""
    return nowhere_negative(e_polynomial(r))


def a_stable(r: StabilityFunction) -> bool:
    """True if |R(s)| <= 1 for all Re s <= 0: I-stable, and all poles in the right half plane (docs/course.md, 5.8)."""
    return i_stable(r) and roots_right(r.denominator)


def l_stable(r: StabilityFunction) -> bool:
    """True if the method is A-stable and R(s) -> 0 as s -> infinity."""
    return r.numerator.degree < r.denominator.degree and a_stable(r)


def real_interval(r: StabilityFunction) -> float:
    """Greatest x with |R(s)| <= 1 for all real s from -x to 0; inf if unbounded, 0 if no interval is stable."""
    down, up = (
        Polynomial(-x if k % 2 else x for k, x in enumerate(p.coefficients))
        for p in (r.denominator, r.numerator)
    )
    # At s = -x, R <= 1 where D - N >= 0 and R >= -1 where D + N >= 0.
    edges = [chopped(p, r.doubts[0] + r.doubts[1]) for p in (down - up, down + up)]
    if any(_negative_near_zero(p) for p in edges):
        return 0.0
    return min((x for p in edges if (x := first_sign_change(p)) is not None), default=math.inf)


def imaginary_interval(r: StabilityFunction) -> float:
    """Greatest y with |R| <= 1 on the imaginary axis up to iy; inf if unbounded, 0 if |R(iy)| > 1 for all small y."""
    e = e_polynomial(r)
    if _negative_near_zero(e):
        return 0.0
    end = first_sign_change(e)
    return math.inf if end is None else math.sqrt(end)


def angle(r: StabilityFunction) -> float | None:
    """Angle alpha of A(alpha) stability [degrees]; None if not even the negative real axis is stable.

    It is the greatest alpha with |R(s)| <= 1 for all |arg(-s)| <= alpha and no pole in this sector, found by bisection
    over rays with rational cosine.
    """
    if a_stable(r):
        return 90.0
    if not _stable_ray(r, Fraction(1)):
        return None
    steep, flat = Fraction(0), Fraction(1)
    for _ in range(ANGLE_BITS):
        middle = (steep + flat) / 2
        if _stable_ray(r, middle):
            flat = middle
        else:
            steep = middle
    return math.degrees(math.acos(float(flat)))


def _stable_ray(r: StabilityFunction, cosine: Fraction) -> bool:
    """True if |R| <= 1 along the ray s = -x exp(i phi), x >= 0, and no pole is between this ray and the negative axis.

    cosine : cos(phi)
    """
    if nowhere_negative(
        chopped(_along(r.denominator, cosine) - _along(r.numerator, cosine), _square_doubt(r))
    ):
        poles = np.roots([float(x) for x in r.denominator.coefficients][::-1])
        # Rounding must not move a pole on the ray into the sector.
        return not np.any(-poles.real > float(cosine) * np.abs(poles) * (1 + 1e-9))
    return False


def _along(p: Polynomial, cosine: Fraction) -> Polynomial:
    """|p(-x exp(i phi))|^2 as a polynomial in x: sum_jk p_j p_k (-x)^(j+k) cos((j - k) phi); cosine : cos(phi)."""
    # cos(k phi) by Chebyshev's recurrence stays a fraction.
    cosines = [Fraction(1), cosine]
    while len(cosines) <= p.degree:
        cosines.append(2 * cosine * cosines[-1] - cosines[-2])
    coefficients = [Fraction(0)] * (2 * p.degree + 1)
    for j, x in enumerate(p.coefficients):
        for k, y in enumerate(p.coefficients):
            coefficients[j + k] = (
                coefficients[j + k] + (-1) ** (j + k) * cosines[abs(j - k)] * x * y
            )
    return Polynomial(coefficients)


def _square_doubt(r: StabilityFunction) -> Polynomial:
    """Uncertainty of the coefficients of N^2 - D^2, as a polynomial, due to the rounded coefficients of R = N / D."""
    pairs = zip((r.numerator, r.denominator), r.doubts, strict=True)
    return sum(
        (2 * Polynomial(map(abs, p.coefficients)) * uncertainty for p, uncertainty in pairs),
        Polynomial([]),
    )


def _modulus(p: Polynomial) -> Polynomial:
    """|p(iy)|^2 as a polynomial in x = y^2."""
    even, odd = (
        Polynomial(x if k % 2 == 0 else -x for k, x in enumerate(p.coefficients[i::2]))
        for i in (0, 1)
    )
    return even * even + Polynomial([0, 1]) * odd * odd


def _negative_near_zero(p: Polynomial) -> bool:
    """True if p(x) < 0 for small x > 0."""
    return next((sign(x) < 0 for x in p.coefficients if x != 0), False)


BITS = 52  # precision of the radius
LONGEST = Fraction(1 << 64)  # a larger radius counts as infinite


def ssp_radius(method: Method) -> float:
    """SSP radius r of a method: if Euler steps up to h do not increase a norm, steps of the method up to r h do not.

    It is the greatest r with (I + r K)^-1 e >= 0 and r K (I + r K)^-1 >= 0, for K = [[A, 0], [b^T, 0]] and the vector e
    of ones. It is 0 if no r > 0 is possible, inf if every r is possible.
    """
    k = _used(method)
    if any(x < 0 for row in k for x in row) or not _has_no_fill_in(k):
        return 0.0
    # A radius without bound would double for ever below.
    if _monotone(k, LONGEST):
        return math.inf
    low, high = Fraction(0), Fraction(1)
    while _monotone(k, high):
        low, high = high, 2 * high
    for _ in range(BITS):
        middle = (low + high) / 2
        if _monotone(k, middle):
            low = middle
        else:
            high = middle
    # Most radii are simple fractions, which bisection only approaches.
    simple = low.limit_denominator(1000)
    return float(
        simple if abs(simple - low) < Fraction(1, 1 << 40) and _monotone(k, simple) else low
    )


@functools.cache
def in_euler_steps(method: Method) -> bool:
    """True if a method is explicit, has SSP radius 1 and no error estimate, and c_2 = 1 if it has more than one stage.

    Then every stage is a convex combination of Euler steps of the full length.
    """
    if not method.explicit or method.adaptive or method.kind == "linear":
        return False
    return (method.stages == 1 or method.c[1] == 1.0) and ssp_radius(method) == 1.0


def _used(method: Method) -> list[list]:
    """Matrix K = [[A, 0], [b^T, 0]] of a method, restricted to the stages that the new state depends on."""
    a, b = method.exact.a, method.exact.b
    used, new = set(), {j for j, x in enumerate(b) if x != 0}
    while new - used:
        used |= new
        new = {j for i in used for j, x in enumerate(a[i]) if x != 0}
    stages = sorted(used)
    return [[row[j] for j in stages] + [Fraction(0)] for row in (*(a[i] for i in stages), b)]


def _has_no_fill_in(k: list[list]) -> bool:
    """True if K^2 has no nonzero entry where K has a zero; otherwise the SSP radius is 0. k : matrix K of `_used`"""
    n = len(k)
    return all(
        k[i][j] != 0 or not any(k[i][m] != 0 and k[m][j] != 0 for m in range(n))
        for i in range(n)
        for j in range(n)
    )


def _monotone(k: list[list], r: Fraction) -> bool:
    """True if both conditions of `ssp_radius` hold at r: no entry of (I + r K)^-1 [e, r K] is negative.

    It is False if I + r K is singular. The computation is exact. k : matrix K
    """
    n = len(k)
    # Gauss-Jordan elimination of I + r K with the right-hand sides e and r K.
    rows = [
        [(i == j) + r * k[i][j] for j in range(n)] + [Fraction(1)] + [r * x for x in k[i]]
        for i in range(n)
    ]
    for i in range(n):
        pivot = next((m for m in range(i, n) if rows[m][i] != 0), None)
        if pivot is None:
            return False
        rows[i], rows[pivot] = rows[pivot], rows[i]
        top = rows[i] = [x / rows[i][i] if x != 0 else x for x in rows[i]]
        for m in range(n):
            if m != i and rows[m][i] != 0:
                factor = rows[m][i]
                rows[m] = [
                    x - factor * y if y != 0 else x for x, y in zip(rows[m], top, strict=True)
                ]
    return all(x >= 0 for row in rows for x in row[n:])


@dataclass(frozen=True)
class Facts:
    """Properties of a method: order, cost, stability.

    error_order : order of the embedded solution, 0 without an embedded solution
    digits : number of significant digits in the published coefficients, None if they are exact
    rounded_order : order with exact numbers in place of decimals of few digits, None if it is not above the order
    kind : explicit, diagonal (stages solved one by one), full (stages solved together) or linear (Rosenbrock)
    angle : alpha of A(alpha) stability [degrees], None if the negative real axis is not stable
    real_interval, imaginary_interval : lengths of the stable intervals of h lambda on the negative real and on the
    positive imaginary axis, inf if unbounded
    ssp_radius : greatest step in Euler steps in which a norm cannot grow, inf if unbounded
    pade : degrees (k, m) if the stability function R(s) is a Pade approximation of e^s, otherwise None
    error_constant : coefficient of the lowest power of s in R(s) - e^s
    """

    name: str
    source: str
    order: int
    error_order: int
    stage_order: int
    stages: int
    digits: int | None
    rounded_order: int | None
    kind: str
    explicit: bool
    diagonally_implicit: bool
    adaptive: bool
    stiffly_accurate: bool
    first_same_as_last: bool
    a_stable: bool
    l_stable: bool
    i_stable: bool
    angle: float | None
    real_interval: float
    imaginary_interval: float
    ssp_radius: float
    pade: tuple[int, int] | None
    error_constant: float
    stability_function: StabilityFunction

    def plain(self) -> dict:
        """Return the properties for JSON: None for infinity, numerator and denominator of R lowest power first."""
        values = {field.name: getattr(self, field.name) for field in fields(self)[:-1]}
        r = self.stability_function
        values["numerator"], values["denominator"] = (
            [float(x) for x in p.coefficients] for p in (r.numerator, r.denominator)
        )
        return {name: None if value == math.inf else value for name, value in values.items()}


def analyse(method: str | Method) -> Facts:
    """Compute the properties of a method in exact arithmetic from its published coefficients.

    Raises FvsolveError for an unknown method name.
    """
    return _facts(method_named(method))


@functools.cache
def _facts(m: Method) -> Facts:
    r = stability_function(m)
    given = {
        field.name: getattr(m, field.name) for field in fields(Facts) if hasattr(m, field.name)
    }
    return Facts(
        **given,
        a_stable=a_stable(r),
        l_stable=l_stable(r),
        i_stable=i_stable(r),
        angle=angle(r),
        real_interval=real_interval(r),
        imaginary_interval=imaginary_interval(r),
        ssp_radius=ssp_radius(m),
        pade=r.pade,
        error_constant=float(r.error_constant[1]),
        stability_function=r,
    )


@validated(method=NAME, lam=POINT, h=NUMBER, y=POINT)
def local_error(method: str | Method, lam: complex, h: float, y: complex = 1.0) -> complex:
    """Error R(h lambda) y - exp(h lambda) y of one step from y, of order h^(p+1).

    It is given by equations (5), (28), (29) of docs/course.md.
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) - np.exp(h * lam)) * y)


@validated(method=NAME, lam=POINT, h=NUMBER, steps=COUNT_FROM_ZERO, y=POINT)
def global_error(
    method: str | Method, lam: complex, h: float, steps: int, y: complex = 1.0
) -> complex:
    """Error R(h lambda)^n y - exp(n h lambda) y after n = `steps` steps from y, of order h^p at a fixed time n h.

    It is the sum of the propagated local errors e_k: sum_k R^(n-1-k) e_k+1 (docs/course.md, (6)).
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) ** steps - np.exp(steps * h * lam)) * y)


@validated(method=NAME, omega=NUMBER, h=POSITIVE)
def seen_frequency(method: str | Method, omega: float, h: float) -> float:
    """Frequency of the numerical solution [rad/s] for an oscillation with the frequency `omega` [rad/s].

    It is |arg R(i omega h)| / h with the stability function R and the step h [s]. It never exceeds pi / h: an A-stable
    method aliases faster oscillations to slower oscillations (docs/course.md, 5.8).
    """
    r = analyse(method).stability_function
    return float(abs(np.angle(r(1j * omega * h))) / h)
