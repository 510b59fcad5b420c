"""Margins of a loop from its return ratio L(j w), with the definitions of python-control's `stability_margins`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fvsolve.core.output.result_table import PlainData

ReturnRatio = Callable[[np.ndarray], np.ndarray]  # frequencies [rad/s] -> L(j w)
# of |L| at the frequencies beside it: a greater |L| is a pole of L, at which its sign changes too
POLE = 1e6
# greatest number of turns of a search; relative change at which it ends
ROOT_TURNS, ROOT_ROUNDING = 60, 1e-15
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


def find_margins(
    ratio: ReturnRatio, w: np.ndarray, ends: dict[float, complex]
) -> tuple[Margins, np.ndarray]:
    """(margins, gains 1 / |L| at all frequencies where L is real and negative) of a return ratio.

    w : increasing frequencies [rad/s], between which L turns little; ends : values of L where it is real and finite at
    the ends of all frequencies: at 0, and for a sampled loop at pi over the period
    """
    values = ratio(w)
    phase = [(at, float(-1.0 / value.real)) for at, value in ends.items() if value.real < 0.0]
    gain = []
    turns = np.flatnonzero(np.diff(np.signbit(values.imag)))
    places = roots(lambda x: ratio(x).imag, w[turns], w[turns + 1])
    for k, at, value in zip(turns, places.tolist(), ratio(places), strict=True):
        pole = abs(value) > POLE * max(abs(values[k]), abs(values[k + 1]))
        if value.real < 0.0 and abs(value.imag) <= REAL * abs(value) and not pole:
            phase.append((at, float(-1.0 / value.real)))
    turns = np.flatnonzero(np.diff(np.signbit(np.abs(values) - 1.0)))
    places = roots(lambda x: np.log(np.abs(ratio(x))), w[turns], w[turns + 1])
    for at, value in zip(places.tolist(), ratio(places), strict=True):
        if abs(abs(value) - 1.0) <= 1e-6:
            gain.append((at, float(np.degrees(np.angle(-value)))))
    nearest = min(phase, key=lambda pair: abs(np.log(pair[1])), default=(None, None))
    least = min(gain, key=lambda pair: abs(pair[1]), default=(None, None))
    delay = min((float(np.radians(margin % 360.0) / at) for at, margin in gain), default=None)
    at, distance = closest(ratio, w, values, ends)
    decibels = None if nearest[1] is None else float(20.0 * np.log10(nearest[1]))
    margins = Margins(nearest[1], decibels, least[1], delay, distance, least[0], nearest[0], at)
    return margins, np.array([pair[1] for pair in phase])


def roots(f: ReturnRatio, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Roots of f between pairs of frequencies at which it has unlike signs, but for rounding [rad/s].

    Ridders' method for all pairs together. Of a pair with a zero, or with equal signs, it is the end with less |f|.
    """
    a, b = low.copy(), high.copy()
    fa, fb = f(a), f(b)
    found = np.where(np.abs(fa) <= np.abs(fb), a, b)
    active = np.flatnonzero((fa < 0.0) & (fb > 0.0) | (fa > 0.0) & (fb < 0.0))
    for _ in range(ROOT_TURNS):
        if not active.size:
            break
        left = a[active]
        right = b[active]
        f_left = fa[active]
        f_right = fb[active]
        middle = 0.5 * (left + right)
        f_middle = f(middle)
        size = np.maximum(np.abs(f_middle), np.maximum(np.abs(f_left), np.abs(f_right)))
        root = np.sqrt((f_middle / size) ** 2 - (f_left / size) * (f_right / size))
        x = middle + (middle - left) * np.sign(f_left - f_right) * (f_middle / size) / root
        fx = f(x)
        # three points divide the pair: the two that enclose the root stay
        points = np.sort(np.stack([middle, x]), axis=0)
        f_points = np.where(middle <= x, np.stack([f_middle, fx]), np.stack([fx, f_middle]))
        is_left = np.sign(f_points) == np.sign(f_left)
        a[active] = np.where(is_left[1], points[1], np.where(is_left[0], points[0], left))
        fa[active] = np.where(is_left[1], f_points[1], np.where(is_left[0], f_points[0], f_left))
        b[active] = np.where(is_left[1], right, np.where(is_left[0], points[1], points[0]))
        fb[active] = np.where(is_left[1], f_right, np.where(is_left[0], f_points[1], f_points[0]))
        moved = np.abs(x - found[active])
        found[active] = x
        near = (
            (moved <= ROOT_ROUNDING * x)
            | (fx == 0.0)
            | (b[active] - a[active] <= ROOT_ROUNDING * x)
        )
        active = active[~(near | ~np.isfinite(fx))]
    return found


def closest(
    ratio: ReturnRatio, w: np.ndarray, values: np.ndarray, ends: dict[float, complex]
) -> tuple[float | None, float | None]:
    """(frequency [rad/s], least |1 + L|) of a return ratio with these values at w; ends : as for `find_margins`."""
    from scipy.optimize import minimize_scalar

    size = np.abs(1.0 + values)
    if not np.isfinite(size).any():
        return None, None
    k = int(np.nanargmin(size))
    at_end = min(
        ((float(abs(1.0 + value)), at) for at, value in ends.items()), default=(np.inf, 0.0)
    )
    if at_end[0] <= size[k]:
        return at_end[1], at_end[0]
    if k in (0, w.size - 1):  # it only tends to this value
        return None, None
    low, high = w[max(k - 1, 0)], w[min(k + 1, w.size - 1)]
    found = minimize_scalar(
        lambda x: float(np.abs(1.0 + ratio(np.array([x])))[0]),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-10 * high},
    )
    return (
        (float(found.x), float(found.fun)) if found.fun < size[k] else (float(w[k]), float(size[k]))
    )
