"""Is a rational transfer function positive real? Decided from its coefficients; knows no grid of frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from fvsolve.errors import FvsolveError
from fvsolve.steppers.numbers.polynomial import Polynomial, sign
from fvsolve.steppers.numbers.sturm import odd_part
from fvsolve.studies.ports.rational import (
    Places,
    Root,
    coefficients,
    estimates,
    float_root,
    places,
    positive_roots,
    shared,
    sides,
)
from fvsolve.studies.sheet import Plain

FATES = {  # of a pole that the numerator cancels
    "right": "in the right half plane: a system that holds it is unstable, which H does not show",
    "axis": "on the imaginary axis: a system that holds it is not asymptotically stable, which H does not show",
    "left": "in the left half plane",
}


@dataclass(frozen=True)
class RootSaid:
    """A root in words: near : an estimate in floats [1/s]; side : right, axis or left, decided."""

    near: complex
    side: str


@dataclass(frozen=True)
class AxisPole:
    """A pole at s = j frequency [rad/s] (inf: at infinity); `residue` of a simple one, `fault` where it has one."""

    frequency: float
    order: int
    residue: complex | None
    fault: str | None


@dataclass(frozen=True)
class Band:
    """low < w < high [rad/s] in which Re H(jw) < 0; `least` is its infimum and `worst` where that is [rad/s]."""

    low: float
    high: float
    width: float
    worst: float
    least: float


@dataclass(frozen=True)
class Verdict(Plain):
    """What `positive_real` decided, and why.

    positive_real : the course's definition (4.1), pole at infinity included
    strictly : H(s - e) is positive real for some e > 0 (Khalil, Nonlinear Systems, definition 6.4)
    lossless : positive real with Re H(jw) = 0 at every w
    reason, reasons : in words; every fault that was found, or what makes it hold
    poles : of the reduced function; axis_poles : those on the axis and at infinity, w >= 0
    bands : where Re H(jw) < 0, w >= 0; zeros : where Re H(jw) = 0 [rad/s], none listed where it is zero everywhere
    hidden : poles that the numerator cancels: H does not show them, a system may still have them
    numerator, denominator : reduced, highest power first
    """

    positive_real: bool
    strictly: bool
    lossless: bool
    reasons: tuple[str, ...]
    poles: tuple[RootSaid, ...]
    axis_poles: tuple[AxisPole, ...]
    bands: tuple[Band, ...]
    zeros: tuple[float, ...]
    hidden: tuple[RootSaid, ...]
    numerator: tuple[Fraction, ...]
    denominator: tuple[Fraction, ...]

    also = ("reason", "hidden_unstable")

    @property
    def reason(self) -> str:
        """All reasons in one line."""
        return "; ".join(self.reasons)

    @property
    def hidden_unstable(self) -> bool:
        """Whether a cancelled pole lies in the right half plane or on the axis."""
        return any(mode.side != "left" for mode in self.hidden)

    def __bool__(self) -> bool:
        return self.positive_real


def positive_real(numerator, denominator) -> Verdict:
    """Whether H(s) = numerator / denominator is positive real; coefficients HIGHEST power FIRST, as in numpy and SciPy.

    Exact: no pole with Re s > 0 (Cauchy index), poles on the axis and at infinity simple with a positive real
    residue, and E(w^2) = Re N(jw) D(-jw) >= 0 for all w (Sturm), after common factors are taken out. Coefficients are
    whole numbers, fractions, text such as "0.1" or floats; a float is the binary fraction that it is, so that 0.1 is
    not 1/10. Raises FvsolveError for what is no real coefficient and for a denominator of zeros.
    """
    n, d = coefficients(numerator, "numerator"), coefficients(denominator, "denominator")
    if d.degree < 0:
        raise FvsolveError("the denominator is zero; wanted at least one coefficient other than 0")
    common = n.gcd(d)
    n, d = n // common, d // common
    where = places(d)
    axis = [*_infinity(n, d), *_origin(n, d, where), *(_pair(n, d, x, order) for x, order in where.pairs)]
    even, below = _real_part(n, d)
    bands, zeros = _bands(even, below), _zeros(even, below)
    hidden = _modes(common, places(common))
    poles = _modes(d, where)
    faults = [*_right(poles), *(pole.fault for pole in axis if pole.fault), *(_says(band) for band in bands)]
    holds = not faults
    lossless = holds and even.degree < 0 and n.degree >= 0
    reasons = faults or _praise(axis, zeros, lossless, n)
    return Verdict(
        holds, holds and _strictly(n, d, where, even, zeros), lossless, (*reasons, *_cancelled(hidden)), poles,
        tuple(axis), tuple(bands), tuple(zeros), hidden, n.coefficients[::-1] or (Fraction(0),), d.coefficients[::-1],
    )  # fmt: skip


# poles ----------------------------------------------------------------------------------------------------------


def _modes(p: Polynomial, where: Places) -> tuple[RootSaid, ...]:
    names = ["right"] * where.right + ["axis"] * where.axis + ["left"] * where.left
    found = zip(estimates(p), names, strict=True)
    return tuple(RootSaid(complex(0.0, s.imag) if side == "axis" else s, side) for s, side in found)


def _infinity(n: Polynomial, d: Polynomial) -> list[AxisPole]:
    order = n.degree - d.degree
    if order < 1:
        return []
    residue = n.coefficients[-1] / d.coefficients[-1]
    fault = None
    if order > 1:
        fault = f"the pole at infinity has order {order}; a positive real function has at most a simple one there"
    elif residue < 0:
        fault = f"the pole at infinity has the negative residue {_float(residue):.6g}"
    return [AxisPole(math.inf, order, complex(_float(residue)) if order == 1 else None, fault)]


def _origin(n: Polynomial, d: Polynomial, where: Places) -> list[AxisPole]:
    if not where.zero:
        return []
    if where.zero > 1:
        return [AxisPole(0.0, where.zero, None, f"the pole at s = 0 has order {where.zero}; wanted a simple one")]
    residue = n.coefficients[0] / d.coefficients[1]
    fault = f"the pole at s = 0 has the negative residue {_float(residue):.6g}" if residue < 0 else None
    return [AxisPole(0.0, 1, complex(_float(residue)), fault)]


def _pair(n: Polynomial, d: Polynomial, x: Root, order: int) -> AxisPole:
    """The pole at s = j sqrt(x): with D = C(s^2) R(s), its residue is N / (2 s C' R)."""
    name = f"the pole at w = {x.frequency:.12g} rad/s"
    if order > 1:
        return AxisPole(x.frequency, order, None, f"{name} has order {order}; wanted a simple one")
    c = shared(d)
    (ne, no), (de, do) = sides(n), sides(d)
    re, ro = de // c, do // c
    turned, straight = ne * re + Polynomial([0, 1]) * no * ro, no * re - ne * ro
    slope, at = c.derivative(), x.refine()
    below = -2 * slope(at) * (re(at) ** 2 + at * ro(at) ** 2)
    real = x.sign_of(turned) == 0
    residue = complex(_float(straight(at) / below), 0.0 if real else -_float(turned(at) / below) / float_root(at))
    if not real:
        return AxisPole(x.frequency, 1, residue, f"{name} has the residue {residue:.6g}, which is not real")
    negative = x.sign_of(straight) * x.sign_of(slope) > 0
    return AxisPole(
        x.frequency, 1, residue, f"{name} has the negative residue {residue.real:.6g}" if negative else None
    )


# the real part on the axis --------------------------------------------------------------------------------------


def _real_part(n: Polynomial, d: Polynomial) -> tuple[Polynomial, Polynomial]:
    """(E, P) with Re H(jw) = E / P, polynomials in x = w^2; P = |D|^2."""
    (ne, no), (de, do), x = sides(n), sides(d), Polynomial([0, 1])
    return ne * de + x * no * do, de * de + x * do * do


def _bands(even: Polynomial, below: Polynomial) -> list[Band]:
    """The open intervals of x > 0 with E < 0, by the roots at which E changes its sign."""
    if even.degree < 0:
        return []
    edges = positive_roots(odd_part(even)) if even.degree > 0 else []
    negative = sign(next(c for c in even.coefficients if c != 0)) < 0
    found = []
    for low, high in zip([None, *edges], [*edges, None], strict=True):
        if negative:
            found.append(_band(even, below, low, high))
        negative = not negative
    return found


def _band(even: Polynomial, below: Polynomial, low: Root | None, high: Root | None) -> Band:
    while low and high and high.low - low.high <= (high.high - high.low) + (low.high - low.low):
        low.halve()
        high.halve()
    left, right = low.refine() if low else Fraction(0), high.refine() if high else None
    a, b = float_root(left), float_root(right) if high else math.inf
    width = _float((right - left) / (Fraction(a) + Fraction(b))) if high else math.inf
    worst, least = _least(even, below, left, right)
    return Band(a, b, width, worst, least)


def _least(even: Polynomial, below: Polynomial, left: Fraction, right: Fraction | None) -> tuple[float, float]:
    """(frequency, infimum) of E / P between left and right."""
    common = even.gcd(below)
    top, below = even // common, below // common
    inside = [left, *(() if right is None else (right,))]
    for at in _between(below, left, right) + [x for x in inside if below(x) == 0]:
        return float_root(at), -math.inf  # a pole that bends Re H
    if right is None and top.degree > below.degree:
        return math.inf, -math.inf
    slope = top.derivative() * below - top * below.derivative()
    inside += _between(slope, left, right) + ([(left + right) / 2] if right is not None else [])
    found = [(_float(top(x) / below(x)), float_root(x)) for x in inside]
    if right is None:
        far = top.coefficients[-1] / below.coefficients[-1] if top.degree == below.degree else Fraction(0)
        found.append((_float(far), math.inf))
    least, worst = min(found)
    return worst, least


def _between(p: Polynomial, left: Fraction, right: Fraction | None) -> list[Fraction]:
    found = [x.refine() for x in positive_roots(p)]
    return [x for x in found if left <= x and (right is None or x <= right)]


def _zeros(even: Polynomial, below: Polynomial) -> list[float]:
    if even.degree < 0:
        return []
    top = even // even.gcd(below)
    return [*([0.0] if top.coefficients[0] == 0 else []), *(x.frequency for x in positive_roots(top))]


def _strictly(n: Polynomial, d: Polynomial, where: Places, even: Polynomial, zeros: list[float]) -> bool:
    """Poles left of the axis, Re H(jw) > 0 at every finite w, and w^2 Re H not to zero for w to infinity."""
    far = even.degree == (d.degree - 1 if n.degree < d.degree else d.degree)
    return where.axis == 0 and not zeros and even.degree >= 0 and far


# words ----------------------------------------------------------------------------------------------------------


def _right(poles: tuple[RootSaid, ...]) -> list[str]:
    found = [mode.near for mode in poles if mode.side == "right"]
    if not found:
        return []
    many = "a pole" if len(found) == 1 else f"{len(found)} poles"
    return [f"{many} in the right half plane, near s = {_listed(found)}"]


def _says(band: Band) -> str:
    if math.isinf(band.high):
        where = "at every w > 0" if band.low == 0.0 else f"for w > {band.low:.12g} rad/s"
    else:
        where = f"for {band.low:.12g} < w < {band.high:.12g} rad/s (width {band.width:.4g})"
    worst = "w to infinity" if math.isinf(band.worst) else f"w = {band.worst:.12g} rad/s"
    return f"Re H(jw) < 0 {where}, least {band.least:.6g} at {worst}"


def _praise(axis: list[AxisPole], zeros: list[float], lossless: bool, n: Polynomial) -> list[str]:
    if n.degree < 0:
        return ["H = 0: positive real, and neither gives nor takes energy"]
    found = ["no pole in the right half plane"]
    if lossless:
        found.append("Re H(jw) = 0 at every w: lossless, on the boundary")
    else:
        touch = f", zero at w = {', '.join(f'{w:.12g}' for w in zeros)} rad/s" if zeros else ""
        found.append(f"Re H(jw) >= 0 at every w{touch}")
    for pole in axis:
        place = "infinity" if math.isinf(pole.frequency) else f"w = {pole.frequency:.12g} rad/s"
        found.append(f"the pole at {place} is simple with the positive residue {pole.residue.real:.6g}")
    return found


def _cancelled(hidden: tuple[RootSaid, ...]) -> list[str]:
    found = []
    for side, where in FATES.items():
        near = [mode.near for mode in hidden if mode.side == side]
        if near:
            poles = "pole" if len(near) == 1 else "poles"
            found.append(f"hidden: {len(near)} cancelled {poles} near s = {_listed(near)}, {where}")
    return found


def _listed(found: list[complex]) -> str:
    return ", ".join(f"{s.real:.6g}" if s.imag == 0 else f"{s:.6g}" for s in found)


def _float(x: Fraction) -> float:
    """The nearest float; infinite beyond them."""
    try:
        return float(x)
    except OverflowError:
        return math.copysign(math.inf, x)
