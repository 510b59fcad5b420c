"""Error bounds of peaks after column separation, from runs at one, two and four times the resolution.

Peaks after the collapse of a cavity converge slowly, and each further collapse less regularly than the one before. So
the bound is that of the change to the finest run, which is known, plus the remainder beyond it. The first peak of a
signal has its own bound, which later peaks do not widen.

A local maximum has the values m, f and g at one, two and four times the resolution. Its remainder beyond g is
|g - f| r / (1 - r) with r = |g - f| / |f - m|, limited to the range from 1/4 to 0.6, and 0.6 if the differences differ
in sign. It is multiplied by a factor of safety, and by up to 2 if the differences grow.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

QUICK, SLOW, GROWTH = 0.25, 0.6, 2.0  # limits of r, and of the factor for differences that grow
SAFETY = 1.8
RISE = 0.05  # drop between two separate maxima, as a fraction of the range of a signal
FIRST_SHARE = 0.25  # rise of the first peak above the start, as a fraction of that of the greatest
Signal = tuple[np.ndarray, np.ndarray]  # times and values


def separated_error(
    values: Sequence[float], maxima: np.ndarray, ceiling: float = math.inf
) -> float:
    """Error bound of the greatest value at the first of three resolutions.

    values : greatest values at one, two and four times the resolution; maxima : float64[maxima, 3]  local maxima at
    these resolutions; ceiling : value that no solution exceeds
    """
    rows = np.vstack([np.array([values], float), maxima.reshape(-1, 3)])
    rest = remainders_beyond(rows)
    above = min(max(float(np.max(rows[:, 2] + rest)), rows[0, 2]), max(ceiling, rows[0, 0]))
    below = float(np.max(rows[:, 2] - rest))
    return float(max(above - rows[0, 0], rows[0, 0] - below, 0.0))


def remainders_beyond(maxima: np.ndarray) -> np.ndarray:
    """Bounds of the changes of values by resolutions beyond the last : float64[n]; maxima : float64[n, 3]."""
    first, second = np.diff(maxima, axis=1).T
    a, b = np.abs(first), np.abs(second)
    ratio = np.divide(b, a, out=np.where(b > 0.0, np.inf, 0.0), where=a > 0.0)
    r = np.where(first * second < 0.0, SLOW, np.clip(ratio, QUICK, SLOW))
    return (
        SAFETY
        * b
        * r
        / (1.0 - r)
        * np.clip(np.where(first * second < 0.0, 1.0, ratio), 1.0, GROWTH)
    )


def separate_maxima(signals: Sequence[Signal], troughs: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Local maxima of a signal at several resolutions : (values, times), float64[maxima, resolutions] each.

    They are separated at the troughs of the finest signal, which `troughs(values, rise)` finds. Maxima on a slope, at
    a time that separates two maxima, are left out: a signal that is late has none there.
    """
    t, v = signals[-1]
    cuts = t[troughs(v, RISE * float(np.ptp(v)))]
    edges = np.concatenate([[-np.inf], cuts, [np.inf]])
    values = np.full((len(edges) - 1, len(signals)), np.nan)
    times = values.copy()
    for k, (at, height) in enumerate(signals):
        bounds = np.searchsorted(at, edges)
        for j, (begin, stop) in enumerate(zip(bounds, bounds[1:], strict=False)):
            if begin == stop:
                continue
            top = begin + int(np.argmax(height[begin:stop]))
            left, right = height[max(top - 1, 0)], height[min(top + 1, len(height) - 1)]
            if height[top] >= left and height[top] >= right:
                values[j, k], times[j, k] = height[top], at[top]
    known = np.isfinite(values).all(axis=1)
    return values[known], times[known]


def first_peak(
    signals: Sequence[Signal], troughs: Callable, ceiling: float = math.inf
) -> dict[str, float] | None:
    """Value at the first resolution, time [s] and error of the first peak of a signal; None without a peak.

    The first peak is the first local maximum that is above the value at the start by a fraction `FIRST_SHARE` of the
    greatest rise. If no later value is above that of the start, this is the peak, and exact. ceiling : as for
    `separated_error`; troughs : function `peak_error.troughs`
    """
    start = float(signals[0][1][0])
    values, times = separate_maxima(signals, troughs)
    rise = float(np.max(signals[0][1])) - start
    if rise <= RISE * float(np.ptp(signals[0][1])):
        return {"value": start, "time": float(signals[0][0][0]), "error": 0.0}
    for row, at in zip(values, times, strict=True):
        if row[0] - start >= FIRST_SHARE * rise:
            error = separated_error(row.tolist(), row, ceiling)
            return {"value": float(row[0]), "time": float(at[0]), "error": error}
    return None
