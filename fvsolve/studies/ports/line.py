"""Transfer functions that are not rational: closed forms of lines, and a sweep with an error bound. Knows no case."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fvsolve.doors import CALL, COMPLEX, NUMBER, POSITIVE, Kind, door, is_number, made
from fvsolve.errors import FvsolveError
from fvsolve.studies.sheet import Plain
from fvsolve.units import show

MOST = 200_000  # samples of one sweep
ROUNDING = 1e-12  # of |H|: what a float sample may be wrong by


@dataclass(frozen=True)
class LineImpedance:
    """Pressure over flow into a lossless line that ends in a reflection: Z0 (1 + g e) / (1 - g e), e = exp(-2 s T).

    z0 : impedance rho a / A [Pa s/m3]; time : T = L / a [s]; reflection : g of pressure at the far end, 1 closed
    (Z0 coth s T), -1 open (Z0 tanh s T), (R - Z0) / (R + Z0) at a resistance R
    """

    z0: float
    time: float
    reflection: float = -1.0

    def __post_init__(self) -> None:
        for name, kind in (("z0", POSITIVE), ("time", POSITIVE), ("reflection", NUMBER)):
            if not kind.holds(getattr(self, name)):
                raise FvsolveError(f"LineImpedance {name} = {show(getattr(self, name))}; wanted {kind.wanted}")

    @door(s=COMPLEX)
    def __call__(self, s):
        """H at complex numbers s [1/s], Re s >= 0."""
        back = self.reflection * np.exp(-2.0 * self.time * np.asarray(s))
        return self.z0 * (1.0 + back) / (1.0 - back)

    @property
    def period(self) -> float:
        """H(s + j period) = H(s) [rad/s]."""
        return math.pi / self.time

    def slope(self, shift: float, low, high):
        """Bound of |dH/ds| on Re s = shift from low to high [rad/s]: 4 Z0 T u / |1 - g e|^2 where that is greatest."""
        u = abs(self.reflection) * math.exp(-2.0 * self.time * shift)
        turn = 2.0 * self.time * np.asarray([low, high]) + (math.pi if self.reflection < 0.0 else 0.0)
        apart = np.min(np.abs((turn + math.pi) % (2.0 * math.pi) - math.pi), axis=0)  # of g e from the positive axis
        holds_one = np.floor(turn[1] / (2.0 * math.pi)) > np.floor(turn[0] / (2.0 * math.pi))
        apart = np.where(holds_one, 0.0, apart)
        with np.errstate(divide="ignore"):
            return 4.0 * self.z0 * self.time * u / ((1.0 - u) ** 2 + 4.0 * u * np.sin(0.5 * apart) ** 2)

    @property
    def rightmost(self) -> float:
        """Re s of the poles: ln|g| / 2 T [1/s], -inf without reflection."""
        return math.log(abs(self.reflection)) / (2.0 * self.time) if self.reflection else -math.inf


@dataclass(frozen=True)
class SweepVerdict(Plain):
    """What a sweep proved: Re H >= `floor` on Re s = shift, 0 <= w <= high [rad/s], or where Re H < 0.

    positive_real : False with a frequency where Re H < 0, True where the bound shows Re H >= 0, None between
    least : smallest sample, at `worst` [rad/s]; floor : proven lower bound; samples : how many
    """

    positive_real: bool | None
    reason: str
    least: float
    worst: float
    floor: float
    shift: float
    high: float
    samples: int


BOUND = Kind(lambda given: callable(given) or (is_number(given) and given >= 0), "a number from 0 on, or a function")
BESIDE = Kind(lambda given: is_number(given) and given >= 0, "a number from 0 on")

LEFT = Kind(lambda given: is_number(given) or str(given) == "-inf", "a finite number, or -infinity")


@door(h=CALL, slope=BOUND, high=POSITIVE, shift=BESIDE, tolerance=POSITIVE, rightmost=LEFT)
def sweep_positive_real(
    h: Callable, slope, high: float, shift: float = 0.0, tolerance: float = 1e-6, rightmost: float = -math.inf
) -> SweepVerdict:
    """Whether Re H >= 0 on the line Re s = shift up to w = high, with a bound between the samples.

    h : callable of complex arrays, real for real s; slope : bound of |dH/ds| on that line, a number or a function of
    arrays (low, high) [rad/s]; high : [rad/s], a period of H where it has one, so that the whole line is covered;
    tolerance : of |H|, below which a gap in the proof is not halved further; rightmost : Re s of the poles farthest
    right, where they are known [1/s]. With H analytic and bounded right of the line, Re H >= 0 on it means Re H >= 0
    everywhere right of it. Between two samples Re H >= (sum - slope * distance) / 2. Raises FvsolveError for a range
    or bound that is none and where H is not finite on the line.
    """
    if rightmost > shift:
        return SweepVerdict(False, f"a pole with Re s = {rightmost:.6g} 1/s, right of the line", math.nan, math.nan,
                            -math.inf, shift, high, 0)  # fmt: skip
    w = np.linspace(0.0, high, 257)
    value = _sampled(h, shift, w)
    while True:
        real, size = value.real, np.maximum(np.abs(value[1:]), np.abs(value[:-1]))
        bound = 0.5 * (real[1:] + real[:-1] - _slopes(slope, w, shift) * np.diff(w))
        proven, violated = bound >= -ROUNDING * size, real < -ROUNDING * np.abs(value)
        wide = ~proven & (np.minimum(real[1:], real[:-1]) - bound > tolerance * size)
        if violated.any() or not wide.any() or len(w) + wide.sum() > MOST:
            break
        middle = 0.5 * (w[:-1] + w[1:])[wide]
        order = np.argsort(np.concatenate([w, middle]), kind="stable")
        w, value = (np.concatenate(pair)[order] for pair in ((w, middle), (value, _sampled(h, shift, middle))))
    k = int(np.argmin(real))
    least, worst, floor = float(real[k]), float(w[k]), float(min(bound.min(), real.min()))
    holds = False if violated.any() else True if proven.all() else None
    return SweepVerdict(holds, _said(holds, least, worst, floor, shift, high), least, worst, floor, shift, high, len(w))


def _each(name: str, given, shape: tuple, kind: type) -> np.ndarray:
    """What a function gave as one number for each point; FvsolveError where it is none."""
    try:
        return np.broadcast_to(np.asarray(given, kind), shape)
    except (TypeError, ValueError):
        raise FvsolveError(f"{name} gave {show(given)} of {shape[0]} points; wanted a number for each") from None


def _slopes(slope, w: np.ndarray, shift: float) -> np.ndarray:
    given = slope(w[:-1], w[1:]) if callable(slope) else slope
    found = _each("the slope", given, (len(w) - 1,), float)
    if not np.all(np.isfinite(found) & (found >= 0.0)):
        raise FvsolveError(f"the slope is not bounded on Re s = {shift:g} 1/s; where poles lie on it, move it right")
    return found


@door(line=made(LineImpedance), shift=BESIDE, tolerance=POSITIVE)
def line_positive_real(line: LineImpedance, shift: float | None = None, tolerance: float = 1e-6) -> SweepVerdict:
    """Whether a line is positive real on Re s = shift: one period, which is all of the line. Default 1e-3 / T.

    Without losses at its end Re H = 0 on the axis itself, with poles there; right of it Re H > 0.
    """
    shift = 1e-3 / line.time if shift is None else shift
    return sweep_positive_real(
        line, lambda low, high: line.slope(shift, low, high), line.period, shift, tolerance, line.rightmost
    )  # fmt: skip


def _sampled(h: Callable, shift: float, w: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        value = _each("H", h(shift + 1j * w), w.shape, complex)
    if not np.all(np.isfinite(value)):
        raise FvsolveError(f"H is not finite on Re s = {shift:g} 1/s; move the line to the right of its poles")
    return value


def _said(holds, least, worst, floor, shift, high) -> str:
    where = f"on Re s = {shift:.6g} 1/s, 0 <= w <= {high:.6g} rad/s"
    if holds is False:
        return f"Re H = {least:.6g} at w = {worst:.9g} rad/s {where}"
    if holds:
        return f"Re H >= 0 {where}: smallest sample {least:.6g} at w = {worst:.6g} rad/s, proven bound {floor:.6g}"
    return f"undecided: Re H >= {floor:.3g} is proven {where}, smallest sample {least:.3g} at w = {worst:.6g} rad/s"
