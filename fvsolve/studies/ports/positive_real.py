"""Exact test of a rational transfer function for positive realness, from its coefficients."""

import math
from dataclasses import dataclass
from fractions import Fraction

from fvsolve.errors import FvsolveError
from fvsolve.steppers.numbers.polynomial import Polynomial, odd_part, sign
from fvsolve.studies.ports.rational import (
    Root,
    RootLocations,
    axis_factor,
    coefficients,
    estimates,
    even_odd_parts,
    float_root,
    locate_roots,
    positive_roots,
)
from fvsolve.studies.result_table import PlainData

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


def positive_real(numerator, denominator) -> Verdict:
    """Test if H(s) = numerator / denominator is positive real, from coefficients, HIGHEST power FIRST as in numpy.

    Exact conditions, after common factors are removed: no pole with Re s > 0 (Cauchy index), simple poles with positive
    real residue on the imaginary axis and at infinity, and Re N(jw) D(-jw) >= 0 for all w, with numerator N and
    denominator D (Sturm). Coefficients are whole numbers, fractions, text such as "0.1" or floats. A float is taken as
    its binary fraction, so that 0.1 is not 1/10. Raises FvsolveError for invalid coefficients and for a zero
    denominator.
    """
    n, d = coefficients(numerator, "numerator"), coefficients(denominator, "denominator")
    if d.degree < 0:
        raise FvsolveError("the denominator is zero. Expected at least one coefficient other than 0")
    common = n.gcd(d)
    n, d = n // common, d // common
    where = locate_roots(d)
    axis = [*_infinity(n, d), *_origin(n, d, where), *(_pair(n, d, x, order) for x, order in where.pairs)]
    even, below = _real_part(n, d)
    bands, zeros = _bands(even, below), _zeros(even, below)
    hidden = _root_places(common, locate_roots(common))
    poles = _root_places(d, where)
    faults = _unstable_text(poles) + [pole.fault for pole in axis if pole.fault] + [_band_text(band) for band in bands]
    holds = not faults
    lossless = holds and even.degree < 0 and n.degree >= 0
    reasons = faults or _proof_text(axis, zeros, lossless, n)
    return Verdict(
        holds, holds and _strictly(n, d, where, even, zeros), lossless, (*reasons, *_hidden_text(hidden)), poles,
        tuple(axis), tuple(bands), tuple(zeros), hidden, n.coefficients[::-1] or (Fraction(0),), d.coefficients[::-1],
    )  # fmt: skip


# poles ----------------------------------------------------------------------------------------------------------


def _root_places(p: Polynomial, locations: RootLocations) -> tuple[RootPlace, ...]:
    names = ["right"] * locations.right + ["axis"] * locations.axis + ["left"] * locations.left
    pairs = zip(estimates(p), names, strict=True)
    return tuple(RootPlace(complex(0.0, s.imag) if side == "axis" else s, side) for s, side in pairs)


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
    fault = f"the pole at s = 0 has the negative residue {_float(residue):.6g}" if residue < 0 else None
    return [AxisPole(0.0, 1, complex(_float(residue)), fault)]


def _pair(n: Polynomial, d: Polynomial, x: Root, order: int) -> AxisPole:
    """Pole of n / d at s = j sqrt(x), of the given order.

    With d = C(-s^2) R(s), where C(x) is the result of `axis_factor`, the residue of a simple pole is -n / (2 s C' R).
    """
    name = f"the pole at w = {x.frequency:.12g} rad/s"
    if order > 1:
        return AxisPole(x.frequency, order, None, f"{name} has order {order}; expected a simple pole")
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
        return AxisPole(x.frequency, 1, residue, f"{name} has the residue {residue:.6g}, which is not real")
    negative = x.sign_of(straight) * x.sign_of(slope) > 0
    fault = f"{name} has the negative residue {residue.real:.6g}" if negative else None
    return AxisPole(x.frequency, 1, residue, fault)


# the real part on the axis --------------------------------------------------------------------------------------


def _real_part(n: Polynomial, d: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Polynomials E and P in x = w^2 with Re H(jw) = E / P, for H = n / d; P = |d(jw)|^2."""
    (ne, no), (de, do), x = even_odd_parts(n), even_odd_parts(d), Polynomial([0, 1])
    return ne * de + x * no * do, de * de + x * do * do


def _bands(even: Polynomial, below: Polynomial) -> list[Band]:
    """Bands of frequencies with Re H = E / P < 0, between the roots x = w^2 > 0 at which E changes sign.

    even, below : polynomials E and P from `_real_part`
    """
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


def _least(even: Polynomial, below: Polynomial, left: Fraction, right: Fraction | None) -> tuple[float, float]:
    """Frequency [rad/s] and value of the infimum of E / P between x = left and x = right, x the squared frequency.

    even, below : polynomials E and P from `_real_part`; right : None for infinity
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
        limit = top.coefficients[-1] / below.coefficients[-1] if top.degree == below.degree else Fraction(0)
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
    return [*([0.0] if top.coefficients[0] == 0 else []), *(x.frequency for x in positive_roots(top))]


def _strictly(n: Polynomial, d: Polynomial, locations: RootLocations, even: Polynomial, zeros: list[float]) -> bool:
    """True if a positive real H is strictly so: no pole on the axis, Re H(jw) > 0 at every w, and a slow decay of Re H.

    At infinity w^2 Re H must not tend to zero if H does, and otherwise Re H must not tend to zero.
    n, d : numerator and denominator of H; locations : locations of the roots of d; even : polynomial E of `_real_part`
    zeros : frequencies with Re H(jw) = 0 [rad/s]
    """
    bounded_decay = even.degree == (d.degree - 1 if n.degree < d.degree else d.degree)
    return locations.axis == 0 and not zeros and even.degree >= 0 and bounded_decay


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


def _proof_text(axis: list[AxisPole], zeros: list[float], lossless: bool, n: Polynomial) -> list[str]:
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
        texts.append(f"the pole at {place} is simple with the positive residue {pole.residue.real:.6g}")
    return texts


def _hidden_text(hidden: tuple[RootPlace, ...]) -> list[str]:
    texts = []
    for side, where in HIDDEN_POLES.items():
        roots = [mode.near for mode in hidden if mode.side == side]
        if roots:
            poles = "pole" if len(roots) == 1 else "poles"
            texts.append(f"hidden: {len(roots)} cancelled {poles} near s = {_roots_text(roots)}, {where}")
    return texts


def _roots_text(roots: list[complex]) -> str:
    return ", ".join(f"{s.real:.6g}" if s.imag == 0 else f"{s:.6g}" for s in roots)


def _float(x: Fraction) -> float:
    """Float nearest to the fraction x; infinity outside the range of floats."""
    try:
        return float(x)
    except OverflowError:
        return math.copysign(math.inf, x)
