"""Margins of a loop from its return ratio L(j w), with the definitions of python-control's `stability_margins`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fvsolve.studies.result_table import PlainData

ReturnRatio = Callable[[np.ndarray], np.ndarray]  # frequencies [rad/s] -> L(j w)
POLE = 1e6  # of |L| at the frequencies beside it: a greater |L| is a pole of L, at which its sign changes too
REAL = 1e-9  # of |L|: imaginary parts below are zero where L is real


@dataclass(frozen=True)
class Margins(PlainData):
    """Margins of a loop; None where there is none.

    gain_margin : factor 1 / |L| where L is real and negative, the one nearest to 1; gain_margin_db : the same in dB
    phase_margin : phase of L plus 180 degrees where |L| = 1, the least in size [deg]
    delay_margin : least additional delay at which L passes -1 [s]; stability_margin : least |1 + L|
    gain_crossover, phase_crossover, stability_crossover : frequencies of the phase margin, gain margin and stability
    margin [rad/s]
    """

    gain_margin: float | None
    gain_margin_db: float | None
    phase_margin: float | None
    delay_margin: float | None
    stability_margin: float | None
    gain_crossover: float | None
    phase_crossover: float | None
    stability_crossover: float | None


def find_margins(ratio: ReturnRatio, w: np.ndarray, ends: dict[float, complex]) -> tuple[Margins, np.ndarray]:
    """(margins, gains 1 / |L| at all frequencies where L is real and negative) of a return ratio.

    w : increasing frequencies [rad/s], between which L turns little; ends : values of L where it is real and finite at
    the ends of all frequencies: at 0, and for a sampled loop at pi over the period
    """
    values = ratio(w)
    phase = [(at, float(-1.0 / value.real)) for at, value in ends.items() if value.real < 0.0]
    gain = []
    for k in np.flatnonzero(np.diff(np.signbit(values.imag))):
        at = root(lambda x: ratio(x).imag, w[k], w[k + 1])
        value = ratio(np.array([at]))[0]
        pole = abs(value) > POLE * max(abs(values[k]), abs(values[k + 1]))
        if value.real < 0.0 and abs(value.imag) <= REAL * abs(value) and not pole:
            phase.append((at, float(-1.0 / value.real)))
    for k in np.flatnonzero(np.diff(np.signbit(np.abs(values) - 1.0))):
        at = root(lambda x: np.log(np.abs(ratio(x))), w[k], w[k + 1])
        value = ratio(np.array([at]))[0]
        if abs(abs(value) - 1.0) <= 1e-6:
            gain.append((at, float(np.degrees(np.angle(-value)))))
    nearest = min(phase, key=lambda pair: abs(np.log(pair[1])), default=(None, None))
    least = min(gain, key=lambda pair: abs(pair[1]), default=(None, None))
    delay = min((float(np.radians(margin % 360.0) / at) for at, margin in gain), default=None)
    at, distance = closest(ratio, w, values, ends)
    decibels = None if nearest[1] is None else float(20.0 * np.log10(nearest[1]))
    margins = Margins(nearest[1], decibels, least[1], delay, distance, least[0], nearest[0], at)
    return margins, np.array([pair[1] for pair in phase])


def root(f: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> float:
    """Root of f between two frequencies at which it has unlike signs, but for rounding [rad/s]."""
    from scipy.optimize import brentq

    first, last = (float(f(np.array([x]))[0]) for x in (low, high))
    if not first * last < 0.0:  # one of both is zero, or rounding
        return low if abs(first) <= abs(last) else high
    return float(brentq(lambda x: float(f(np.array([x]))[0]), low, high, xtol=4e-16 * high, rtol=1e-15))


def closest(
    ratio: ReturnRatio, w: np.ndarray, values: np.ndarray, ends: dict[float, complex]
) -> tuple[float | None, float | None]:
    """(frequency [rad/s], least |1 + L|) of a return ratio with these values at w; ends : as for `find_margins`."""
    from scipy.optimize import minimize_scalar

    size = np.abs(1.0 + values)
    if not np.isfinite(size).any():
        return None, None
    k = int(np.nanargmin(size))
    at_end = min(((float(abs(1.0 + value)), at) for at, value in ends.items()), default=(np.inf, 0.0))
    if at_end[0] <= size[k]:
        return at_end[1], at_end[0]
    if k in (0, w.size - 1):  # it only tends to this value
        return None, None
    low, high = w[max(k - 1, 0)], w[min(k + 1, w.size - 1)]
    found = minimize_scalar(lambda x: float(np.abs(1.0 + ratio(np.array([x])))[0]), bounds=(low, high),
                            method="bounded", options={"xatol": 1e-10 * high})  # fmt: skip
    return (float(found.x), float(found.fun)) if found.fun < size[k] else (float(w[k]), float(size[k]))
