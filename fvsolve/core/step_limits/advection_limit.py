"""Exact Courant limit of linear advection on a uniform periodic grid (von Neumann).

A wave of phase theta per cell is multiplied by R(nu z(theta)) in a step, with the stability function R of the time
method, the symbol z of the scheme and the Courant number nu. With R = N / D and t = sin^2(theta / 2),
E(nu, t) = |D|^2 - |N|^2 is a polynomial with rational coefficients; a Courant number is stable if E >= 0 for all t.
Common powers of nu and t are divided out, so that the sign is found for slowly growing waves of any length as well; the
quotient at t = 0 applies to the longest waves.

The sign of that polynomial in two variables on a box is proved in integers. A polynomial lies between its least and its
greatest coefficient in Bernstein's basis. Coefficients at the corners of the box are values of the polynomial there.
Bisection of the box moves all coefficients towards values of the polynomial (Lane and Riesenfeld 1981). Coefficients
are rounded down to integer multiples of 2^-400 of the largest coefficient, so that a proof that they are not negative
holds for the polynomial.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from math import comb
from numbers import Rational

import numpy as np

from fvsolve.argument_checks import NAME, NAMES, POSITIVE, TEXT, Kind, is_row, validated
from fvsolve.core.step_limits.symbol import WEIGHTS, real_part, square, symbol, weights_of
from fvsolve.core.steppers.analysis.stability_function import StabilityFunction, stability_function
from fvsolve.core.steppers.analysis.stability_properties import a_stable
from fvsolve.core.steppers.numbers.polynomial import Polynomial, count_roots, odd_part, sign
from fvsolve.core.steppers.tableau import METHODS, Method, method_named
from fvsolve.declarations import declared

BITS = 400
MOST_BOXES = 400  # number of boxes after which the sign is left undecided

Matrix = Sequence[Sequence[int]]  # g[m][i] of x^m y^i


def polynomial_value(g: Matrix, x: Fraction, y: Fraction) -> Fraction:
    """Value of the polynomial sum g[m][i] x^m y^i at (x, y)."""
    total = Fraction(0)
    for row in reversed(g):
        inner = Fraction(0)
        for coefficient in reversed(row):
            inner = inner * y + coefficient
        total = total * x + inner
    return total


def negative_point(
    g: Matrix, low: Fraction, high: Fraction
) -> tuple[Fraction, Fraction] | str | None:
    """Point (x, y) with low <= x <= high, 0 <= y <= 1 where the polynomial g is negative.

    g : coefficients g[m][i] of x^m y^i
    Returns None if g >= 0 in the whole box, and "open" if the search ends undecided.
    """
    boxes, seen = [(_bernstein(g, low, high), low, high, Fraction(0), Fraction(1))], 0
    while boxes:
        b, x0, x1, y0, y1 = boxes.pop()
        if all(left >= 0 for left in b.flat):
            continue
        for corner, x, y in (
            (b[0, 0], x0, y0),
            (b[0, -1], x0, y1),
            (b[-1, 0], x1, y0),
            (b[-1, -1], x1, y1),
        ):
            if corner < 0 and polynomial_value(g, x, y) < 0:
                return x, y
        seen += 1
        if seen > MOST_BOXES:
            return "open"
        if _curvature(b) >= _curvature(b.T):
            left, right = _bisect(b)
            middle = (x0 + x1) / 2
            boxes += [(left, x0, middle, y0, y1), (right, middle, x1, y0, y1)]
        else:
            left, right = _bisect(b.T)
            middle = (y0 + y1) / 2
            boxes += [(left.T, x0, x1, y0, middle), (right.T, x0, x1, middle, y1)]
    return None


def _bernstein(g: Matrix, low: Fraction, high: Fraction) -> np.ndarray:
    """Bernstein coefficients of the polynomial g on low <= x <= high, 0 <= y <= 1, scaled to integers, rounded down.

    g : coefficients g[m][i] of x^m y^i
    """
    a = np.array([[Fraction(entry) for entry in row] for row in g], dtype=object)
    for k in range(a.shape[0] - 1):  # x = low + s, by repeated Horner schemes
        for m in range(a.shape[0] - 2, k - 1, -1):
            a[m] = a[m] + low * a[m + 1]
    width, power = high - low, Fraction(1)
    for m in range(a.shape[0]):
        a[m], power = a[m] * power, power * width
    a = _to_bernstein(_to_bernstein(a).T).T
    largest = max(abs(entry) for entry in a.flat) or Fraction(1)
    scaled = [
        (entry.numerator << BITS) * largest.denominator // (entry.denominator * largest.numerator)
        for entry in a.flat
    ]
    return np.array(scaled, dtype=object).reshape(a.shape)


def _to_bernstein(a: np.ndarray) -> np.ndarray:
    """Convert coefficients a of powers to Bernstein's basis along the first axis.

    b_j = sum_i C(j, i) / C(n, i) a_i, with binomial coefficients C and the degree n.
    """
    n = a.shape[0] - 1
    return np.array(
        [sum(Fraction(comb(j, i), comb(n, i)) * a[i] for i in range(j + 1)) for j in range(n + 1)]
    )


def _bisect(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bernstein coefficients on the lower and upper half of a box along the first axis (de Casteljau), rounded down.

    b : Bernstein coefficients on the whole box
    """
    left = [b[0]]
    right = [b[-1]]
    now = b
    for _ in range(b.shape[0] - 1):
        now = (now[:-1] + now[1:]) >> 1
        left.append(now[0])
        right.append(now[-1])
    return np.array(left, dtype=object), np.array(right[::-1], dtype=object)


def _curvature(b: np.ndarray) -> int:
    """Greatest absolute second difference of Bernstein coefficients b along the first axis, times the squared degree.

    It is 0 for a degree below 2.
    """
    if b.shape[0] < 3:
        return 0
    return (
        max(abs(difference) for difference in (b[:-2] - 2 * b[1:-1] + b[2:]).flat)
        * (b.shape[0] - 1) ** 2
    )


RAYS = 240  # number of waves whose roots are computed first
ZOOMS, ZOOM_RAYS = 9, 17
MARGIN = Fraction(1, 10**9)  # relative margin on both sides of the limit in the proof
TURNS = 8  # greatest number of searches, each after a failed proof
ALGEBRAIC_DIGITS = 30  # digits to which algebraic numbers are rounded
# Courant number at which growth is reported: relative to the limit; absolute if the limit is 0.
GROWTH_MARGIN, DEFAULT_COURANT = 1.01, 0.5
THOUSANDFOLD = 1e3
LEAST_FLOAT_GROWTH = 1e-8  # |R| - 1 above which floating point gives seven digits
SLOW_WAVES, SLOW_ZOOMS = 24, 6
EVERY, LONGEST, SHORTEST, BETWEEN, GROWS = "all", "longest", "shortest", "between", "grows"


@dataclass(frozen=True)
class RangeEnd:
    """End of a range of stable Courant numbers, and the wave of phase theta per cell that determines it.

    t : sin^2(theta / 2); wave : the wave in words
    """

    courant: float
    t: Fraction = Fraction(0)
    wave: str = ""

    @property
    def theta(self) -> float:
        """Phase of the wave per cell [rad]."""
        return 2 * math.asin(math.sqrt(self.t))


ALL_STABLE = [(RangeEnd(0.0), RangeEnd(math.inf))]


@dataclass(frozen=True)
class AdvectionLimit:
    """Stable Courant numbers of a scheme and a method on a uniform periodic grid.

    limit : Courant number up to which every smaller one is stable; 0 if there is none, inf without an upper end
    theta, wave : phase [rad per cell] and name of the waves that determine the limit, None for an infinite limit
    stable : ranges (low, high) of stable Courant numbers; more than one range if higher numbers are stable again
    proved : True if each range is proved in exact numbers to 1 part in 10^9
    digits : significant digits of the method's published coefficients, None for exact coefficients
    courant : Courant number of `growth`: as given, otherwise 1 % above the limit (0.5 if the limit is 0)
    growth : growth factor per step, minus 1, of the fastest growing wave at `courant`; 0 where it is stable
    steps : number of steps in which that wave grows 1000 times, None without growth
    For an infinite limit courant and growth are None unless a number is given.
    """

    scheme: str
    method: str
    limit: float
    theta: float | None
    wave: str | None
    stable: tuple[tuple[float, float], ...]
    proved: bool
    digits: int | None
    courant: float | None
    growth: float | None
    steps: float | None

    def plain(self) -> dict:
        """Return the values for JSON: None for infinity."""
        values = asdict(self)
        values["limit"] = _finite(self.limit)
        values["stable"] = [[low, _finite(high)] for low, high in self.stable]
        return values


@declared("study")
@validated(scheme=NAME, method=NAME, courant=POSITIVE)
def advection_limit(scheme: str, method: str, courant: float | None = None) -> AdvectionLimit:
    """Exact Courant limit of a linear scheme and a time method, and the growth of waves at the number `courant`.

    Raises FvsolveError for unknown names, and for schemes that are not linear.
    """
    return limit_of(weights_of(scheme), scheme, method, courant)


@declared("study")
@validated(schemes=NAMES, methods=NAMES, courant=POSITIVE)
def advection_limits(
    schemes: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    courant: float | None = None,
) -> list[AdvectionLimit]:
    """Courant limits of all pairs of the given schemes and methods, method by method.

    schemes, methods : names, or None for all linear schemes or all methods
    courant : Courant number at which growth is computed, see `AdvectionLimit`
    Raises FvsolveError for unknown names, and for schemes that are not linear.
    """
    schemes, methods = ([x] if isinstance(x, str) else x for x in (schemes, methods))
    schemes = list(dict.fromkeys(schemes or WEIGHTS))
    for name in schemes:
        weights_of(name)
    named = (
        [method_named(name).name for name in methods]
        if methods
        else [m.name for m in METHODS.values()]
    )
    return [
        advection_limit(scheme, name, courant)
        for name in dict.fromkeys(named)
        for scheme in schemes
    ]


FACE_WEIGHTS = Kind(
    lambda given: (
        is_row(given, lambda x: isinstance(x, Rational)) and len(given) == 5 and sum(given) == 1
    ),
    "five integers or fractions with sum 1",
)


@declared("study")
@validated(weights=FACE_WEIGHTS, scheme=TEXT, method=NAME, courant=POSITIVE)
def limit_of(
    weights: Sequence[Fraction], scheme: str, method: str, courant: float | None = None
) -> AdvectionLimit:
    """Exact Courant limit of the linear scheme with the given face weights, and the growth at the number `courant`.

    weights : five weights, with sum 1, of the cells from two upstream to two downstream in the value at a face
    scheme : name of the scheme in the result
    """
    tableau = method_named(method)
    gaps, proved = _stable_ranges(tuple(weights), *_rational(method), _is_a_stable(tableau))
    edge = gaps[0][1] if gaps and gaps[0][0].courant == 0 else None
    limit = edge.courant if edge else 0.0
    stable = tuple((low.courant, high.courant) for low, high in gaps)
    if courant is None and math.isfinite(limit):
        courant = limit * GROWTH_MARGIN or DEFAULT_COURANT
    growth = steps = None
    if courant is not None:
        stable_there = any(low <= courant <= high for low, high in stable)
        growth, fastest = (0.0, 0.0) if stable_there else growth_of(weights, method, courant)
        steps = math.log(THOUSANDFOLD) / math.log1p(growth) if growth > 0 else None
    theta, wave = (
        (None, None) if math.isinf(limit) else (edge.theta, edge.wave) if edge else (fastest, GROWS)
    )
    return AdvectionLimit(
        scheme,
        tableau.name,
        limit,
        theta,
        wave,
        stable,
        proved,
        tableau.digits,
        courant,
        growth,
        steps,
    )


def growth_of(weights: Sequence[Fraction], method: str, courant: float) -> tuple[float, float]:
    """Growth factor per step, minus 1, of the fastest growing wave at a Courant number, and phase of that wave [rad].

    weights : face weights as in `limit_of`. Growth too small for floating point is computed in fractions.
    """
    r = stability_function(method)
    theta = np.linspace(0.0, np.pi, 4001)
    for _ in range(6):
        size = np.abs(r(courant * symbol(weights, theta)))
        at = int(np.argmax(size))
        best, most = float(theta[at]), float(size[at]) - 1
        theta = np.linspace(theta[max(at - 1, 0)], theta[min(at + 1, theta.size - 1)], 201)
    return (
        (most, best)
        if most > LEAST_FLOAT_GROWTH
        else _slow_growth(weights, method, Fraction(courant))
    )


def _slow_growth(
    weights: Sequence[Fraction], method: str, courant: Fraction
) -> tuple[float, float]:
    """Result of `growth_of`, computed in fractions on few waves, whose phases are refined repeatedly.

    With R = N / D, |R| - 1 = (|N|^2 - |D|^2) / (|D|^2 (1 + |R|)).
    """
    (r, _), a, q = _rational(method), real_part(weights), square(weights)
    theta = [k * math.pi / SLOW_WAVES for k in range(SLOW_WAVES + 1)]
    for _ in range(SLOW_ZOOMS):
        growths = []
        for x in theta:
            t = _dyadic(math.sin(x / 2) ** 2, 60)
            up, down = (
                _modulus(p, courant * a(t), courant**2 * q(t)) for p in (r.numerator, r.denominator)
            )
            growths.append(float((up - down) / down))
        at = int(np.argmax(growths))
        low, high = theta[max(at - 1, 0)], theta[min(at + 1, len(theta) - 1)]
        best, most = theta[at], growths[at]
        theta = [low + (high - low) * k / SLOW_WAVES for k in range(SLOW_WAVES + 1)]
    return most / (1 + math.sqrt(1 + most)), best


def _modulus(p: Polynomial, real: Fraction, size: Fraction) -> Fraction:
    """|p(s)|^2 of the polynomial p at a complex number s with the real part `real` and the squared modulus `size`.

    It is the sum over j, k of p_j p_k |s|^2k Re(s^(j-k)).
    """
    cosines = [Fraction(1), real]
    while len(cosines) <= p.degree:
        cosines.append(2 * real * cosines[-1] - size * cosines[-2])
    terms = (
        (1 if j == k else 2) * p.coefficients[j] * p.coefficients[k] * size**k * cosines[j - k]
        for j in range(p.degree + 1)
        for k in range(j + 1)
    )
    return sum(terms, Fraction(0))


# ---- the polynomial E


@functools.cache
def _is_a_stable(method: Method) -> bool:
    return a_stable(stability_function(method))


def _rational(method: str) -> tuple[StabilityFunction, Fraction]:
    """Stability function R with rational coefficients, and relative size below which a coefficient of E is rounding.

    E is the polynomial of `_e_polynomial`.
    """
    tableau, r = method_named(method), stability_function(method)
    parts = (*r.numerator.coefficients, *r.denominator.coefficients)
    exact = all(isinstance(x, Fraction) for x in parts)
    digits = tableau.digits - 2 if tableau.digits else ALGEBRAIC_DIGITS
    tolerance = Fraction(0) if exact and not tableau.digits else Fraction(1, 10**digits)
    if exact:
        return r, tolerance
    up, down = (
        Polynomial(_fraction(x) for x in p.coefficients) for p in (r.numerator, r.denominator)
    )
    return StabilityFunction(up, down), tolerance


def _fraction(x) -> Fraction:
    if isinstance(x, Fraction):
        return x
    low, high = x.bracket()
    return (low + high) / 2


def _e_polynomial(
    weights: Sequence[Fraction], r: StabilityFunction, tolerance: Fraction
) -> list[list[int]]:
    """Integer coefficients g[m][i] of nu^m t^i of a positive multiple of E(nu, t), without common factors of the terms.

    A wave of phase theta per cell grows at the Courant number nu if E < 0 at t = sin^2(theta / 2). With the
    coefficients n and d of numerator and denominator of the stability function r, and the symbol z of the scheme:
    E = sum_jk (d_j d_k - n_j n_k) nu^(j+k) Re(z^j conj(z)^k);
    Re(z^j conj(z)^k) = |z|^2k c_j-k, c_0 = 1, c_1 = Re z, c_m+1 = 2 Re z c_m - |z|^2 c_m-1.
    tolerance : relative size below which a coefficient is rounding
    """
    size = max(r.numerator.degree, r.denominator.degree)
    pairs = (r.denominator, 1), (r.numerator, -1)
    a, q = real_part(weights), square(weights)
    c, powers = [Polynomial([1]), a], [Polynomial([1])]
    for _ in range(2 * size):
        c.append(2 * a * c[-1] - q * c[-2])
        powers.append(powers[-1] * q)
    rows = []
    for m in range(2 * size + 1):
        row, doubt = Polynomial([]), Polynomial([])
        for k in range(max(0, m - size), m // 2 + 1):
            factor = powers[k] * c[m - 2 * k]
            parts = [
                s * _coefficient(p, k) * _coefficient(p, m - k) * (1 if 2 * k == m else 2)
                for p, s in pairs
            ]
            row = row + sum(parts) * factor
            doubt = (
                doubt + sum(map(abs, parts)) * Polynomial(map(abs, factor.coefficients))
                if tolerance
                else doubt
            )
        rows.append(_without_rounding(row, doubt, tolerance))
    return _reduced(rows)


def _coefficient(p: Polynomial, k: int) -> Fraction:
    return p.coefficients[k] if k <= p.degree else Fraction(0)


def _without_rounding(p: Polynomial, doubt: Polynomial, tolerance: Fraction) -> Polynomial:
    return Polynomial(
        x if abs(x) > tolerance * _coefficient(doubt, i) else Fraction(0)
        for i, x in enumerate(p.coefficients)
    )


def _reduced(rows: list[Polynomial]) -> list[list[int]]:
    """Integer coefficients g[m][i] of nu^m t^i, without common powers of nu and the common factor in t.

    rows : polynomials in t, the coefficients of the powers of nu in E(nu, t) (see `_e_polynomial`)
    The result is empty for the zero polynomial. The common factor is zero where the symbol of the scheme is zero: at t
    = 0, and for central differences also at t = 1. If it changes its sign in between, E is negative somewhere at every
    nu, and [[-1]] is returned.
    """
    while rows and rows[0].degree < 0:
        rows = rows[1:]
    while rows and rows[-1].degree < 0:
        rows = rows[:-1]
    if not rows:
        return []
    common = Polynomial([])
    for p in sorted((p for p in rows if p.degree >= 0), key=lambda p: p.degree):
        common = common.gcd(p)
    if _signs(common) == {-1, 1}:
        return [[-1]]
    common = common if 1 in _signs(common) else -common
    rows = [p // common for p in rows]
    wide = max(p.degree for p in rows) + 1
    denominator = math.lcm(*(x.denominator for p in rows for x in p.coefficients))
    return [[int(_coefficient(p, i) * denominator) for i in range(wide)] for p in rows]


def _signs(p: Polynomial) -> set[int]:
    """Signs (-1, 1) that the polynomial p has on 0 < t < 1, in exact arithmetic."""
    changes = odd_part(p) if p.degree > 0 else p
    for end in (0, 1):
        while changes.degree > 0 and changes(Fraction(end)) == 0:
            changes = changes // Polynomial([-end, 1])
    if changes.degree > 0 and count_roots(changes, Fraction(0), Fraction(1)):
        return {-1, 1}
    return {sign(p(t)) for t in (Fraction(k, 64) for k in range(1, 64))} - {0}


# ---- where it is negative


def _stable_ranges(
    weights: tuple, r: StabilityFunction, tolerance: Fraction, left_half_plane: bool
):
    """Stable ranges of Courant numbers as pairs of `RangeEnd`, and True if they are proved.

    weights : face weights as in `limit_of`; r, tolerance : result of `_rational`
    left_half_plane : True for an A-stable method
    """
    if left_half_plane and 1 not in _signs(real_part(weights)):
        return ALL_STABLE, True
    return _cached_stable_ranges(
        weights, r.numerator.coefficients, r.denominator.coefficients, tolerance
    )


@functools.cache
def _cached_stable_ranges(
    weights: tuple, numerator: tuple, denominator: tuple, tolerance: Fraction
):
    g = _e_polynomial(
        weights, StabilityFunction(Polynomial(numerator), Polynomial(denominator)), tolerance
    )
    if not g:
        return ALL_STABLE, True
    rays = {_dyadic(math.sin(k * math.pi / (2 * RAYS)) ** 2, 24) for k in range(RAYS + 1)}
    gaps: list = []
    for _ in range(TURNS):
        gaps = _candidates(g, sorted(rays))
        counterexamples = [_counterexample(g, low.courant, high.courant) for low, high in gaps]
        points = [point for point in counterexamples if isinstance(point, tuple)]
        if not points:
            return gaps, not any(counterexamples) and _fails_outside(g, gaps, rays)
        for _, t in points:
            rays |= {t, *(min(t * Fraction(k, 8), Fraction(1)) for k in (4, 6, 7, 9, 10, 16))}
    return [
        gap
        for gap, point in zip(gaps, counterexamples, strict=True)
        if not isinstance(point, tuple)
    ], False


def _counterexample(g, low: float, high: float):
    """Courant number from low to high at which a wave grows, and t = sin^2(theta / 2) of this wave.

    The search keeps a margin from the finite ends. Returns None if no wave grows, and "open" if the search ends
    undecided, as `negative_point`.
    g : integer coefficients from `_e_polynomial`
    """
    start = Fraction(low) * (1 + MARGIN)
    if math.isfinite(high):
        return negative_point(g, start, Fraction(high) * (1 - MARGIN))
    middle = max(start, Fraction(1))
    below = negative_point(g, start, middle) if start < middle else None
    above = negative_point(g[::-1], Fraction(0), 1 / middle) if below is None else below
    return (
        (1 / above[0], above[1])
        if isinstance(above, tuple) and below is None and above[0]
        else above
    )


def _fails_outside(g, gaps, rays) -> bool:
    """True if a wave grows just outside each end of the stable ranges `gaps`, in exact arithmetic.

    If no range starts at 0, a wave must also grow at all small Courant numbers.
    g : integer coefficients from `_e_polynomial`; rays : tested values of t = sin^2(theta / 2)
    """
    if (not gaps or gaps[0][0].courant > 0) and not any(_negative_at_small_nu(g, t) for t in rays):
        return False
    ends = [(low, 1 - MARGIN) for low, _ in gaps if low.courant > 0]
    ends += [(high, 1 + MARGIN) for _, high in gaps if math.isfinite(high.courant)]
    return all(
        polynomial_value(g, Fraction(edge.courant) * factor, edge.t) < 0 for edge, factor in ends
    )


def _negative_at_small_nu(g, t: Fraction) -> bool:
    """True if E(nu, t) is negative for all small Courant numbers nu > 0; g : its coefficients from `_e_polynomial`."""
    return next((x < 0 for x in _coefficients_at(g, t) if x), False)


def _candidates(g, rays: list[Fraction]):
    """Ranges of Courant numbers, as pairs of `RangeEnd`, that are stable for all tested t.

    The ends are refined between the tested values.
    g : integer coefficients from `_e_polynomial`; rays : tested values of t = sin^2(theta / 2), sorted
    """
    unstable = sorted(range_ for t in rays for range_ in _negative(_coefficients_at(g, t)))
    gaps, at = [], 0.0
    for low, high in [*unstable, (math.inf, math.inf)]:
        if low > at * (1 + 1e-9):
            gaps.append((at, low))
        at = max(at, high)
    return [range_ for low, high in gaps if (range_ := _sharpened(g, rays, low, high))]


def _sharpened(g, rays, low: float, high: float):
    """Ends (`RangeEnd`) of the stable range of Courant numbers from low to high; None if the range becomes empty.

    The ends are refined between the tested values of t; g, rays : as in `_candidates`
    """
    inside = (low + high) / 2 if math.isfinite(high) else 2 * low + 1
    start = _edge(g, rays, inside, -1) if low > 0 else RangeEnd(0.0)
    end = _edge(g, rays, inside, 1) if math.isfinite(high) else RangeEnd(math.inf)
    return (start, end) if start.courant < end.courant else None


def _edge(g, rays: list[Fraction], inside: float, side: int) -> RangeEnd:
    """End of the stable range that contains the Courant number `inside`.

    It is the nearest change of sign of E (see `_e_polynomial`) over all t, refined between the tested values `rays`.
    g, rays : as in `_candidates`; side : 1 for the upper end, -1 for the lower end
    """

    def reach(t: Fraction) -> float:
        ranges = _negative(_coefficients_at(g, t))
        if side > 0:
            return min(
                (max(low, inside) for low, high in ranges if high > inside), default=math.inf
            )
        return -max((min(high, inside) for low, high in ranges if low < inside), default=0.0)

    ends = reach(Fraction(0)), reach(Fraction(1))
    all_of = [reach(t) for t in rays]
    at = int(np.argmin(all_of))
    best, best_t = float(all_of[at]), rays[at]
    low, high = rays[max(at - 1, 0)], rays[min(at + 1, len(rays) - 1)]
    for _ in range(ZOOMS):
        points = [low + (high - low) * Fraction(k, ZOOM_RAYS - 1) for k in range(ZOOM_RAYS)]
        reaches = [reach(t) for t in points]
        k = int(np.argmin(reaches))
        if reaches[k] < best:
            best, best_t = float(reaches[k]), points[k]
        low, high = points[max(k - 1, 0)], points[min(k + 1, ZOOM_RAYS - 1)]
        low, high = _dyadic(low, 60), _dyadic(high, 60)
    close = [abs(reached - best) <= 1e-11 * abs(best) for reached in (*ends, *all_of)]
    if all(close):
        return RangeEnd(abs(best), Fraction(1), EVERY)
    for is_close, t, wave in ((close[0], Fraction(0), LONGEST), (close[1], Fraction(1), SHORTEST)):
        if is_close:
            return RangeEnd(abs(best), t, wave)
    return RangeEnd(abs(best), best_t, BETWEEN)


def _dyadic(x, bits: int) -> Fraction:
    return Fraction(round(x * (1 << bits)), 1 << bits)


def _coefficients_at(g, t: Fraction) -> np.ndarray:
    """Coefficients of the powers of nu in E(nu, t) at t, as floats up to a common positive factor, lowest power first.

    g : integer coefficients from `_e_polynomial`
    """
    powers = [1]  # of the denominator of t, so that all numbers are integers
    for _ in range(len(g[0]) - 1):
        powers.append(powers[-1] * t.denominator)
    coefficients = []
    for row in g:
        total = 0
        for entry, power in zip(reversed(row), powers, strict=True):
            total = total * t.numerator + entry * power
        coefficients.append(total)
    largest = max(map(abs, coefficients))
    return np.array([x / largest for x in coefficients]) if largest else np.zeros(1)


def _negative(p: np.ndarray) -> list[tuple[float, float]]:
    """Ranges (low, high) of nu > 0 where the polynomial with coefficients p, lowest power first, is negative."""
    if not p.any():
        return []
    roots = np.roots(p[::-1])
    real = np.sort(roots.real[(np.abs(roots.imag) <= 1e-7 * np.abs(roots)) & (roots.real > 1e-13)])
    ends = [0.0, *map(float, real), math.inf]
    ranges = []
    for low, high in zip(ends, ends[1:], strict=False):
        inside = (low + high) / 2 if math.isfinite(high) else 2 * low + 1
        if high > low and np.polyval(p[::-1], inside) < 0:
            joined = ranges and ranges[-1][1] == low
            ranges[-1:] = [(ranges[-1][0], high)] if joined else [*ranges[-1:], (low, high)]
    return ranges


def _finite(x: float) -> float | None:
    return None if math.isinf(x) else x
