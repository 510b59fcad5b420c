"""Exact test of a rational transfer function for positive realness, from its coefficients and the location of roots."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

import numpy as np

from fvsolve.core.output.result_table import PlainData
from fvsolve.core.steppers.numbers.polynomial import Polynomial, chain, odd_part, sign
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError

BITS = 200  # relative precision of a bracketed root in bits, before values are computed from it


def coefficients(given, name: str) -> Polynomial:
    """Exact polynomial from its coefficients `given`, highest power FIRST; a single number is a constant.

    Whole numbers, fractions, decimals and text ("0.1", "1/3", "2e-7") are taken exactly. A float is taken as its binary
    fraction: 0.1 is 3602879701896397 / 2^55. Raises FvsolveError for an invalid coefficient; name : name of the
    polynomial in the error message
    """
    if (
        isinstance(given, (str, Real, Decimal, complex))
        or np.ndim(given) == 0
        and isinstance(given, np.ndarray)
    ):
        given = [given[()] if isinstance(given, np.ndarray) else given]
    if isinstance(given, (bytes, Mapping)) or not isinstance(given, Iterable):
        raise FvsolveError(
            f"{name} = {given!r} is not a polynomial; expected its coefficients, highest power first"
        )
    values = [_exact(x, f"{name}[{k}]") for k, x in enumerate(given)]
    if not values:
        raise FvsolveError(
            f"{name} has no coefficients; expected at least one, highest power first"
        )
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
        f"{name} = {x!r} is not a coefficient; expected a finite real number: "
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
    signed = [x if k % 4 < 2 else -x for k, x in enumerate(p.coefficients)]
    u, v = (Polynomial(x if k % 2 == odd else 0 for k, x in enumerate(signed)) for odd in (0, 1))
    # left roots minus right roots
    more_left = -cauchy_index(v, u) if p.degree % 2 == 0 else cauchy_index(u, v)
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
    """Common divisor of both parts of p(jw); its roots x > 0 are the squares w^2 of the roots s = jw of p."""
    even, odd = even_odd_parts(p)
    return even.gcd(odd)


def cauchy_index(top: Polynomial, below: Polynomial) -> int:
    """Cauchy index of the rational function top / below on the real line.

    It is the number of jumps from -infinity to infinity minus the number of jumps from infinity to -infinity.
    """
    remainders = [below, top] if top.degree >= 0 else [below]
    while len(remainders) > 1 and (remainder := -(remainders[-2] % remainders[-1])).degree >= 0:
        remainders.append(remainder / abs(remainder.coefficients[-1]))
    left, right = (
        _sign_changes(_sign_at_infinity(q, side) for q in remainders) for side in (-1, 1)
    )
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
    return _sign_changes(sign(q(low)) for q in sequence) - _sign_changes(
        sign(q(high)) for q in sequence
    )


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


HIDDEN_POLES = {  # location of a cancelled pole -> text
    "right": "in the right half plane: a system with this pole is unstable, which H does not show",
    "axis": "on the imaginary axis: a system with this pole is not asymptotically stable, which H does not show",
    "left": "in the left half plane",
}


@dataclass(frozen=True)
class RootPlace:
    """Root of a polynomial, as stated in texts.

    near : floating-point estimate [1/s]
    side : exact location: "right" or "left" of the imaginary axis, or "axis" if the root is on it
    """

    near: complex
    side: str


@dataclass(frozen=True)
class AxisPole:
    """Pole on the imaginary axis, at s = j frequency [rad/s] (inf: at infinity).

    residue : residue of a simple pole, otherwise None; fault : text if the pole is not allowed, otherwise None
    """

    frequency: float
    order: int
    residue: complex | None
    fault: str | None


@dataclass(frozen=True)
class Band:
    """Interval of frequencies low < w < high [rad/s] with Re H(jw) < 0.

    width : high - low [rad/s], accurate also for nearly equal ends, inf for an infinite `high`
    least : infimum of Re H(jw), -inf if it is unbounded; worst : frequency of the infimum [rad/s]
    """

    low: float
    high: float
    width: float
    worst: float
    least: float


@dataclass(frozen=True)
class Verdict(PlainData):
    """Result of `positive_real` for a transfer function H(s), with reasons.

    positive_real : True if H is positive real by definition (4.1) of docs/course.md, extended to a pole at infinity
    strictly : True if H(s - e) is positive real for some e > 0 (Khalil, Nonlinear Systems, definition 6.4)
    lossless : True if H is positive real with Re H(jw) = 0 at every w, and H is not 0
    reason, reasons : texts with all faults, or with the proof; then texts on hidden poles
    poles : poles after common factors are removed; axis_poles : poles on the imaginary axis and at infinity, w >= 0
    bands : intervals with Re H(jw) < 0, w >= 0
    zeros : frequencies with Re H(jw) = 0 [rad/s], empty if it is zero everywhere
    hidden : poles that the numerator cancels; H does not show them, but a system may have them
    numerator, denominator : coefficients without common factors, highest power first
    """

    positive_real: bool
    strictly: bool
    lossless: bool
    reasons: tuple[str, ...]
    poles: tuple[RootPlace, ...]
    axis_poles: tuple[AxisPole, ...]
    bands: tuple[Band, ...]
    zeros: tuple[float, ...]
    hidden: tuple[RootPlace, ...]
    numerator: tuple[Fraction, ...]
    denominator: tuple[Fraction, ...]

    also = ("reason", "hidden_unstable")

    @property
    def reason(self) -> str:
        """All reasons in a single text."""
        return "; ".join(self.reasons)

    @property
    def hidden_unstable(self) -> bool:
        """True if a cancelled pole is in the right half plane or on the imaginary axis."""
        return any(mode.side != "left" for mode in self.hidden)

    def __bool__(self) -> bool:
        return self.positive_real


@declared("study")
def positive_real(numerator, denominator) -> Verdict:
    """Test if H(s) = numerator / denominator is positive real, from coefficients, HIGHEST power FIRST as in numpy.

    Exact conditions, after common factors are removed: no pole with Re s > 0 (Cauchy index), simple poles with positive
    real residue on the imaginary axis and at infinity, and Re N(jw) D(-jw) >= 0 for all w, with numerator N and
    denominator D (Sturm). Coefficients are whole numbers, fractions, text such as "0.1" or floats. A float is taken as
    its binary fraction, so that 0.1 is not 1/10. Raises FvsolveError for invalid coefficients, for a zero denominator,
    and for so many digits that exact arithmetic takes minutes.
    """
    n, d = coefficients(numerator, "numerator"), coefficients(denominator, "denominator")
    refuse_digits(n, d)
    if d.degree < 0:
        raise FvsolveError(
            "the denominator is zero; expected at least one coefficient other than 0"
        )
    common = n.gcd(d)
    n, d = n // common, d // common
    where = locate_roots(d)
    axis = [
        *_infinity(n, d),
        *_origin(n, d, where),
        *(_pair(n, d, x, order) for x, order in where.pairs),
    ]
    # polynomials E (even) and P (below) in x = w^2 with Re H(jw) = E / P, where P = |d(jw)|^2
    (n_even, n_odd), (d_even, d_odd), x = even_odd_parts(n), even_odd_parts(d), Polynomial([0, 1])
    even = n_even * d_even + x * n_odd * d_odd
    below = d_even * d_even + x * d_odd * d_odd
    bands, zeros = _bands(even, below), _zeros(even, below)
    hidden = _root_places(common, locate_roots(common))
    poles = _root_places(d, where)
    faults = (
        _unstable_text(poles)
        + [pole.fault for pole in axis if pole.fault]
        + [_band_text(band) for band in bands]
    )
    holds = not faults
    lossless = holds and even.degree < 0 and n.degree >= 0
    # strictly: no pole on the axis, Re H(jw) > 0 at every w, and a slow decay of Re H to infinity: w^2 Re H must not
    # tend to zero if H does, and otherwise Re H must not tend to zero
    slow_decay = even.degree == (d.degree - 1 if n.degree < d.degree else d.degree)
    strictly = holds and where.axis == 0 and not zeros and even.degree >= 0 and slow_decay
    reasons = faults or _proof_text(axis, zeros, lossless, n)
    return Verdict(
        holds,
        strictly,
        lossless,
        (*reasons, *_hidden_text(hidden)),
        poles,
        tuple(axis),
        tuple(bands),
        tuple(zeros),
        hidden,
        n.coefficients[::-1] or (Fraction(0),),
        d.coefficients[::-1],
    )


# binary digits of the longest coefficient times the squared degree, about 10 s
MOST_DIGITS = 50_000


def refuse_digits(n: Polynomial, d: Polynomial) -> None:
    """Raise FvsolveError if the degree and the digits of coefficients are too great for exact arithmetic."""
    values = [
        part for x in (*n.coefficients, *d.coefficients) for part in (x.numerator, x.denominator)
    ]
    degree = max(n.degree, d.degree)
    digits = max((value.bit_length() for value in values), default=0)
    if degree**2 * digits > MOST_DIGITS:
        raise FvsolveError(
            f"coefficients of degree {degree} with up to {digits} binary digits take too long in exact "
            f"arithmetic; expected {MOST_DIGITS // digits} or less for the squared degree: give rounded "
            "coefficients as texts, or the state-space form to state_positive_real"
        )


# poles ----------------------------------------------------------------------------------------------------------


def _root_places(p: Polynomial, locations: RootLocations) -> tuple[RootPlace, ...]:
    names = ["right"] * locations.right + ["axis"] * locations.axis + ["left"] * locations.left
    pairs = zip(estimates(p), names, strict=True)
    return tuple(
        RootPlace(complex(0.0, s.imag) if side == "axis" else s, side) for s, side in pairs
    )


def _infinity(n: Polynomial, d: Polynomial) -> list[AxisPole]:
    order = n.degree - d.degree
    if order < 1:
        return []
    residue = n.coefficients[-1] / d.coefficients[-1]
    fault = None
    if order > 1:
        fault = f"the pole at infinity has order {order}; a positive real function has at most a simple pole there"
    elif residue < 0:
        fault = f"the pole at infinity has the negative residue {_float(residue):.6g}"
    return [AxisPole(math.inf, order, complex(_float(residue)) if order == 1 else None, fault)]


def _origin(n: Polynomial, d: Polynomial, locations: RootLocations) -> list[AxisPole]:
    if not locations.zero:
        return []
    if locations.zero > 1:
        fault = f"the pole at s = 0 has order {locations.zero}; expected a simple pole"
        return [AxisPole(0.0, locations.zero, None, fault)]
    residue = n.coefficients[0] / d.coefficients[1]
    fault = (
        f"the pole at s = 0 has the negative residue {_float(residue):.6g}" if residue < 0 else None
    )
    return [AxisPole(0.0, 1, complex(_float(residue)), fault)]


def _pair(n: Polynomial, d: Polynomial, x: Root, order: int) -> AxisPole:
    """Pole of n / d at s = j sqrt(x), of the given order.

    With d = C(-s^2) R(s), where C(x) is the result of `axis_factor`, the residue of a simple pole is -n / (2 s C' R).
    """
    name = f"the pole at w = {x.frequency:.12g} rad/s"
    if order > 1:
        return AxisPole(
            x.frequency, order, None, f"{name} has order {order}; expected a simple pole"
        )
    c = axis_factor(d)
    (ne, no), (de, do) = even_odd_parts(n), even_odd_parts(d)
    re, ro = de // c, do // c
    turned, straight = ne * re + Polynomial([0, 1]) * no * ro, no * re - ne * ro
    slope, x_value = c.derivative(), x.refine()
    below = -2 * slope(x_value) * (re(x_value) ** 2 + x_value * ro(x_value) ** 2)
    real = x.sign_of(turned) == 0
    imaginary = 0.0 if real else -_float(turned(x_value) / below) / float_root(x_value)
    residue = complex(_float(straight(x_value) / below), imaginary)
    if not real:
        return AxisPole(
            x.frequency, 1, residue, f"{name} has the residue {residue:.6g}, which is not real"
        )
    negative = x.sign_of(straight) * x.sign_of(slope) > 0
    fault = f"{name} has the negative residue {residue.real:.6g}" if negative else None
    return AxisPole(x.frequency, 1, residue, fault)


# the real part on the axis --------------------------------------------------------------------------------------


def _bands(even: Polynomial, below: Polynomial) -> list[Band]:
    """Bands with Re H = E / P < 0 (see `positive_real`), between the roots x = w^2 > 0 at which E changes sign."""
    if even.degree < 0:
        return []
    edges = positive_roots(odd_part(even)) if even.degree > 0 else []
    negative = sign(next(c for c in even.coefficients if c != 0)) < 0
    bands = []
    for low, high in zip([None, *edges], [*edges, None], strict=True):
        if negative:
            bands.append(_band(even, below, low, high))
        negative = not negative
    return bands


def _band(even: Polynomial, below: Polynomial, low: Root | None, high: Root | None) -> Band:
    while low and high and high.low - low.high <= (high.high - high.low) + (low.high - low.low):
        low.bisect()
        high.bisect()
    left, right = low.refine() if low else Fraction(0), high.refine() if high else None
    a, b = float_root(left), float_root(right) if high else math.inf
    width = _float((right - left) / (Fraction(a) + Fraction(b))) if high else math.inf
    worst, least = _least(even, below, left, right)
    return Band(a, b, width, worst, least)


def _least(
    even: Polynomial, below: Polynomial, left: Fraction, right: Fraction | None
) -> tuple[float, float]:
    """Frequency [rad/s] and value of the infimum of E / P between x = left and x = right, x the squared frequency.

    even, below : polynomials E and P as in `positive_real`; right : None for infinity
    """
    common = even.gcd(below)
    top, below = even // common, below // common
    candidates = [left, *(() if right is None else (right,))]
    for x_value in _between(below, left, right) + [x for x in candidates if below(x) == 0]:
        return float_root(x_value), -math.inf  # Re H is unbounded at a pole
    if right is None and top.degree > below.degree:
        return math.inf, -math.inf
    slope = top.derivative() * below - top * below.derivative()
    candidates += _between(slope, left, right) + ([(left + right) / 2] if right is not None else [])
    values = [(_float(top(x) / below(x)), float_root(x)) for x in candidates]
    if right is None:
        limit = (
            top.coefficients[-1] / below.coefficients[-1]
            if top.degree == below.degree
            else Fraction(0)
        )
        values.append((_float(limit), math.inf))
    least, worst = min(values)
    return worst, least


def _between(p: Polynomial, left: Fraction, right: Fraction | None) -> list[Fraction]:
    roots = [x.refine() for x in positive_roots(p)]
    return [x for x in roots if left <= x and (right is None or x <= right)]


def _zeros(even: Polynomial, below: Polynomial) -> list[float]:
    if even.degree < 0:
        return []
    top = even // even.gcd(below)
    return [
        *([0.0] if top.coefficients[0] == 0 else []),
        *(x.frequency for x in positive_roots(top)),
    ]


# words ----------------------------------------------------------------------------------------------------------


def _unstable_text(poles: tuple[RootPlace, ...]) -> list[str]:
    unstable = [mode.near for mode in poles if mode.side == "right"]
    if not unstable:
        return []
    count_text = "a pole" if len(unstable) == 1 else f"{len(unstable)} poles"
    return [f"{count_text} in the right half plane, near s = {_roots_text(unstable)}"]


def _band_text(band: Band) -> str:
    if math.isinf(band.high):
        where = "at every w > 0" if band.low == 0.0 else f"for w > {band.low:.12g} rad/s"
    else:
        where = f"for {band.low:.12g} < w < {band.high:.12g} rad/s (width {band.width:.4g})"
    worst = "w to infinity" if math.isinf(band.worst) else f"w = {band.worst:.12g} rad/s"
    return f"Re H(jw) < 0 {where}, least {band.least:.6g} at {worst}"


def _proof_text(
    axis: list[AxisPole], zeros: list[float], lossless: bool, n: Polynomial
) -> list[str]:
    if n.degree < 0:
        return ["H = 0: positive real, neither supplies nor absorbs energy"]
    texts = ["no pole in the right half plane"]
    if lossless:
        texts.append("Re H(jw) = 0 at every w: lossless, at the limit of positive realness")
    else:
        zeros_text = f", zero at w = {', '.join(f'{w:.12g}' for w in zeros)} rad/s" if zeros else ""
        texts.append(f"Re H(jw) >= 0 at every w{zeros_text}")
    for pole in axis:
        place = "infinity" if math.isinf(pole.frequency) else f"w = {pole.frequency:.12g} rad/s"
        texts.append(
            f"the pole at {place} is simple with the positive residue {pole.residue.real:.6g}"
        )
    return texts


def _hidden_text(hidden: tuple[RootPlace, ...]) -> list[str]:
    texts = []
    for side, where in HIDDEN_POLES.items():
        roots = [mode.near for mode in hidden if mode.side == side]
        if roots:
            poles = "pole" if len(roots) == 1 else "poles"
            texts.append(
                f"hidden: {len(roots)} cancelled {poles} near s = {_roots_text(roots)}, {where}"
            )
    return texts


def _roots_text(roots: list[complex]) -> str:
    return ", ".join(f"{s.real:.6g}" if s.imag == 0 else f"{s:.6g}" for s in roots)


def _float(x: Fraction) -> float:
    """Float nearest to the fraction x; infinity outside the range of floats."""
    try:
        return float(x)
    except OverflowError:
        return math.copysign(math.inf, x)
