"""Impedance of a lossless line, and a sweep test for positive realness of any function, with an error bound."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import (
    COMPLEX,
    FUNCTION,
    NUMBER,
    POSITIVE,
    Kind,
    instance_of,
    is_number,
    validated,
)
from fvsolve.core.output.result_table import PlainData
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError
from fvsolve.units import show

MAX_SAMPLES = 200_000  # greatest number of samples of a sweep
ROUNDING = 1e-12  # rounding error of a sample, relative to |H|


@declared("study")
@dataclass(frozen=True)
class LineImpedance:
    """Input impedance of a lossless line with a reflection at its end.

    H(s) = Z0 (1 + g e) / (1 - g e) with e = exp(-2 s T).
    z0 : characteristic impedance Z0 = rho a / A [Pa s/m3]; time : travel time T = L / a [s], for a line with length L,
    area A, wave speed a and density rho
    reflection : reflection factor g of pressure at the far end: 1 closed (Z0 coth s T), -1 open (Z0 tanh s T),
    (R - Z0) / (R + Z0) at a resistance R
    """

    z0: float
    time: float
    reflection: float = -1.0

    def __post_init__(self) -> None:
        for name, kind in (("z0", POSITIVE), ("time", POSITIVE), ("reflection", NUMBER)):
            if not kind.accepts(getattr(self, name)):
                text = f"LineImpedance {name} = {show(getattr(self, name))} is not valid"
                raise FvsolveError(f"{text}; expected {kind.expected}")

    @validated(s=COMPLEX)
    def __call__(self, s):
        """Impedance H [Pa s/m3] at complex numbers s [1/s] with Re s >= 0."""
        back = self.reflection * np.exp(-2.0 * self.time * np.asarray(s))
        return self.z0 * (1.0 + back) / (1.0 - back)

    @property
    def period(self) -> float:
        """Period of the impedance along the imaginary axis [rad/s], pi / T."""
        return math.pi / self.time

    def slope(self, shift: float, low, high):
        """Bound of |dH/ds| for Re s = shift [1/s], between the frequencies low and high [rad/s].

        It is the greatest 4 Z0 T u / |1 - g e|^2 there, with u = |g e| and e = exp(-2 s T).
        """
        u = abs(self.reflection) * math.exp(-2.0 * self.time * shift)
        phase = 2.0 * self.time * np.asarray([low, high]) + (
            math.pi if self.reflection < 0.0 else 0.0
        )
        # angle between g e and the positive real axis
        phase_distance = np.min(np.abs((phase + math.pi) % (2.0 * math.pi) - math.pi), axis=0)
        contains_axis = np.floor(phase[1] / (2.0 * math.pi)) > np.floor(phase[0] / (2.0 * math.pi))
        phase_distance = np.where(contains_axis, 0.0, phase_distance)
        with np.errstate(divide="ignore"):
            return (
                4.0
                * self.z0
                * self.time
                * u
                / ((1.0 - u) ** 2 + 4.0 * u * np.sin(0.5 * phase_distance) ** 2)
            )

    @property
    def rightmost(self) -> float:
        """Real part of all poles [1/s]: ln|g| / (2 T), -inf without reflection."""
        return math.log(abs(self.reflection)) / (2.0 * self.time) if self.reflection else -math.inf


@dataclass(frozen=True)
class SweepVerdict(PlainData):
    """Result of a sweep of H(s) along the line Re s = shift [1/s], over frequencies w from 0 to `high` [rad/s].

    positive_real : False if Re H < 0 at a sample or if a known pole is right of the line, True if the bound proves
    Re H >= 0, otherwise None
    reason : result in words; samples : number of samples, 0 if a known pole decides
    least : least sample of Re H, at the frequency `worst` [rad/s], both nan without samples
    floor : proven lower bound of Re H, -inf without samples
    """

    positive_real: bool | None
    reason: str
    least: float
    worst: float
    floor: float
    shift: float
    high: float
    samples: int


SLOPE_BOUND = Kind(
    lambda given: callable(given) or (is_number(given) and given >= 0),
    "a number from 0 on, or a function",
)
NOT_NEGATIVE = Kind(lambda given: is_number(given) and given >= 0, "a number from 0 on")

POLE_ABSCISSA = Kind(
    lambda given: is_number(given) or str(given) == "-inf", "a finite number, or -infinity"
)


@declared("study")
@validated(
    h=FUNCTION,
    slope=SLOPE_BOUND,
    high=POSITIVE,
    shift=NOT_NEGATIVE,
    tolerance=POSITIVE,
    rightmost=POLE_ABSCISSA,
)
def sweep_positive_real(
    h: Callable,
    slope,
    high: float,
    shift: float = 0.0,
    tolerance: float = 1e-6,
    rightmost: float = -math.inf,
) -> SweepVerdict:
    """Test if Re H >= 0 on the line Re s = shift from w = 0 to w = high, with a lower bound between the samples.

    h : function of a complex array s [1/s], real for real s; shift : real part of s on the line [1/s]
    slope : bound of |dH/ds| on this line, a number or a function of arrays (low, high) of frequencies [rad/s]
    high : greatest frequency w [rad/s]; the period of a periodic H covers the whole line
    tolerance : difference of samples and lower bound, relative to |H|, below which an interval is not halved
    rightmost : real part of the rightmost poles [1/s], if known; right of the line it makes the result False
    If H is analytic and bounded right of the line, Re H >= 0 on the line implies Re H >= 0 everywhere right of it.
    Between two samples Re H_1 and Re H_2 at w_1 and w_2, Re H is at least (Re H_1 + Re H_2 - slope (w_2 - w_1)) / 2.
    The result is None if 200 000 samples do not decide. Raises FvsolveError for an invalid range or bound, and if H is
    not finite on the line.
    """
    if rightmost > shift:
        text = f"a pole with Re s = {rightmost:.6g} 1/s lies right of the line Re s = {shift:g} 1/s"
        return SweepVerdict(False, text, math.nan, math.nan, -math.inf, shift, high, 0)
    w = np.linspace(0.0, high, 257)
    value = _sampled(h, shift, w)
    while True:
        real, size = value.real, np.maximum(np.abs(value[1:]), np.abs(value[:-1]))
        bound = 0.5 * (real[1:] + real[:-1] - _slopes(slope, w, shift) * np.diff(w))
        proven, violated = bound >= -ROUNDING * size, real < -ROUNDING * np.abs(value)
        wide = ~proven & (np.minimum(real[1:], real[:-1]) - bound > tolerance * size)
        if violated.any() or not wide.any() or len(w) + wide.sum() > MAX_SAMPLES:
            break
        middle = 0.5 * (w[:-1] + w[1:])[wide]
        order = np.argsort(np.concatenate([w, middle]), kind="stable")
        w, value = (
            np.concatenate(pair)[order]
            for pair in ((w, middle), (value, _sampled(h, shift, middle)))
        )
    k = int(np.argmin(real))
    least = float(real[k])
    worst = float(w[k])
    floor = float(min(bound.min(), real.min()))
    holds = False if violated.any() else True if proven.all() else None
    text = _verdict_text(holds, least, worst, floor, shift, high)
    return SweepVerdict(holds, text, least, worst, floor, shift, high, len(w))


def _value_per_point(name: str, given, shape: tuple, kind: type) -> np.ndarray:
    """Result `given` of the function `name` as an array for all points. Raises FvsolveError if this is impossible."""
    try:
        return np.broadcast_to(np.asarray(given, kind), shape)
    except (TypeError, ValueError):
        raise FvsolveError(
            f"{name} returned {show(given)} for {shape[0]} points; expected a number for each"
        ) from None


def _slopes(slope, w: np.ndarray, shift: float) -> np.ndarray:
    values = slope(w[:-1], w[1:]) if callable(slope) else slope
    bounds = _value_per_point("the slope", values, (len(w) - 1,), float)
    if not np.all(np.isfinite(bounds) & (bounds >= 0.0)):
        raise FvsolveError(
            f"the bound of the slope of H is negative or not finite on the line Re s = {shift:g} 1/s; "
            "expected finite numbers of at least 0. If poles lie on this line, use a greater shift"
        )
    return bounds


@declared("study")
@validated(line=instance_of(LineImpedance), shift=NOT_NEGATIVE, tolerance=POSITIVE)
def line_positive_real(
    line: LineImpedance, shift: float | None = None, tolerance: float = 1e-6
) -> SweepVerdict:
    """Test if the impedance H of a lossless pipe has Re H >= 0 along Re s = shift [1/s], over a whole period of H.

    line : impedance of the pipe
    shift : default: 1e-3 / T with the travel time T. Without losses at the end of the pipe, Re H = 0 on the imaginary
    axis, with poles on it, and Re H > 0 right of it.
    tolerance : as for `sweep_positive_real`
    """
    shift = 1e-3 / line.time if shift is None else shift
    return sweep_positive_real(
        line,
        lambda low, high: line.slope(shift, low, high),
        line.period,
        shift,
        tolerance,
        line.rightmost,
    )


def _sampled(h: Callable, shift: float, w: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        value = _value_per_point("H", h(shift + 1j * w), w.shape, complex)
    if not np.all(np.isfinite(value)):
        raise FvsolveError(
            f"H is not finite on Re s = {shift:g} 1/s; use a shift to the right of its poles"
        )
    return value


def _verdict_text(holds, least, worst, floor, shift, high) -> str:
    where = f"on Re s = {shift:.6g} 1/s, 0 <= w <= {high:.6g} rad/s"
    if holds is False:
        return f"Re H = {least:.6g} at w = {worst:.9g} rad/s {where}"
    if holds:
        return f"Re H >= 0 {where}: least sample {least:.6g} at w = {worst:.6g} rad/s, proven bound {floor:.6g}"
    return f"undecided: Re H >= {floor:.3g} is proven {where}, least sample {least:.3g} at w = {worst:.6g} rad/s"
