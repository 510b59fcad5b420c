"""Comparison of a run with measured series, and of two runs."""

from __future__ import annotations

import numpy as np

from fvsolve.output.unit_columns import UnitColumn

RESULT_KEYS = (
    "rms",
    "greatest_difference",
    "t_greatest_difference",
    "measured_peak",
    "t_measured_peak",
    "computed_peak",
    "t_computed_peak",
)


def comparison(compare, column: UnitColumn, result) -> dict:
    """Entry of the summary for one measured series: differences at the measured times in the run, and both peaks.

    compare : series of the case; column : unit of its probe. Differences are computed minus measured values; they and
    the peaks are in the unit of the probe, times in s. All are None if no measured time is within the run.
    """
    t, computed = result.seconds, result[column.name]
    time, measured = compare.t + compare.shift, column.from_si(compare.v)
    within = (time >= t[0]) & (time <= t[-1]) if len(t) else np.zeros(len(time), bool)
    time, measured = time[within], measured[within]
    head = {
        "probe": column.name,
        "unit": column.unit,
        "file": compare.file,
        "shift": float(compare.shift),
        "points": len(time),
    }
    if not len(time):
        return head | dict.fromkeys(RESULT_KEYS)
    difference = interpolated(t, computed, time) - measured
    overlap = (t >= time.min()) & (t <= time.max())
    peak, top = int(np.argmax(measured)), int(np.argmax(np.where(overlap, computed, -np.inf)))
    worst = int(np.argmax(np.abs(difference)))
    values = [np.sqrt(np.mean(difference**2)), difference[worst], time[worst]]
    values += [measured[peak], time[peak], computed[top], t[top]]
    return head | dict(zip(RESULT_KEYS, map(float, values), strict=True))


def interpolated(t: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values at `times`, linear between rows (t, values); at a jump (two rows at one time) the value of the later row.

    Beyond the rows they are those of the first and last row.
    """
    times = np.asarray(times, float)
    after = np.clip(np.searchsorted(t, times, side="right"), 1, max(len(t) - 1, 1))
    if len(t) == 1:
        return np.full(times.shape, values[0])
    before = after - 1
    gap = t[after] - t[before]
    part = np.where(gap > 0.0, (times - t[before]) / np.where(gap > 0.0, gap, 1.0), 1.0)
    exact = values[before] + part * (values[after] - values[before])
    return np.where(part >= 1.0, values[after], np.where(part <= 0.0, values[before], exact))


def differences(a, b) -> dict:
    """Greatest and rms difference `b` - `a` of two results, for each probe that both have.

    The differences are in the units of `a`, at those times of `a` that are within both runs; if the times of `b`
    differ, its values are interpolated. The greatest is that of the greatest magnitude, with its sign. Without common
    times they are None. "only_a" and "only_b" list probes of one run only.
    """
    shared = [probe for probe in a.probes if probe in b.units]
    return {
        "a": str(a.directory),
        "b": str(b.directory),
        "probes": {probe: _difference(a, b, probe) for probe in shared},
        "only_a": [probe for probe in a.probes if probe not in b.units],
        "only_b": [probe for probe in b.probes if probe not in a.units],
    }


def _difference(a, b, probe: str) -> dict:
    column = a.column(probe)
    other = b[probe] if a.units[probe] == b.units[probe] else column.from_si(b.si(probe))
    t, ours, theirs = a.seconds, a[probe], b.seconds
    if not np.array_equal(t, theirs):
        within = (t >= theirs[0]) & (t <= theirs[-1])
        t, ours = t[within], ours[within]
        other = interpolated(theirs, other, t)
    difference = other - ours
    worst = int(np.argmax(np.abs(difference))) if len(t) else 0
    return {
        "unit": column.unit,
        "rows": len(t),
        "greatest": float(difference[worst]) if len(t) else None,
        "t_greatest": float(t[worst]) if len(t) else None,
        "rms": float(np.sqrt(np.mean(difference**2))) if len(t) else None,
    }
