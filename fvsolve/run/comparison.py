"""Comparison of series: measured ones with a run, a run with a run."""

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
    """Entry of `[compare]`: differences at the measured times within the run, and both peaks.

    Differences (computed minus measured) and peaks in the unit of the probe, times in s; all None if no measured time
    is within the run.
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
    """Values at given times, linear between rows; at a jump (two rows with the same time) the later row."""
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
    """Differences of two runs, for each probe that both have: greatest and rms difference, b - a.

    In the units of `a`, at the rows of `a` within both runs; `b` is interpolated where its times differ.
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
