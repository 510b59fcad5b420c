"""Series held against each other: measured ones against a run, a run against a run. Starts no run."""

from __future__ import annotations

import numpy as np

from fvsolve.output.column import UnitColumn

FOUND = (
    "rms",
    "greatest_difference",
    "t_greatest_difference",
    "measured_peak",
    "t_measured_peak",
    "computed_peak",
    "t_computed_peak",
)


def comparison(compare, column: UnitColumn, result) -> dict:
    """One line of `[compare]`: differences at the measured times within the run, and the two peaks.

    Differences (computed less measured) and peaks in the unit of the probe, times in s; all None where no
    measured time lies within the run.
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
        return head | dict.fromkeys(FOUND)
    difference = interpolated(t, computed, time) - measured
    overlap = (t >= time.min()) & (t <= time.max())
    peak, top = int(np.argmax(measured)), int(np.argmax(np.where(overlap, computed, -np.inf)))
    worst = int(np.argmax(np.abs(difference)))
    found = [np.sqrt(np.mean(difference**2)), difference[worst], time[worst]]
    found += [measured[peak], time[peak], computed[top], t[top]]
    return head | dict(zip(FOUND, map(float, found), strict=True))


def interpolated(t: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """`values` at times `wanted`, linear between rows; at a jump, two rows of one time, the later one."""
    wanted = np.asarray(wanted, float)
    after = np.clip(np.searchsorted(t, wanted, side="right"), 1, max(len(t) - 1, 1))
    if len(t) == 1:
        return np.full(wanted.shape, values[0])
    before = after - 1
    gap = t[after] - t[before]
    part = np.where(gap > 0.0, (wanted - t[before]) / np.where(gap > 0.0, gap, 1.0), 1.0)
    exact = values[before] + part * (values[after] - values[before])
    return np.where(part >= 1.0, values[after], np.where(part <= 0.0, values[before], exact))


def differences(a, b) -> dict:
    """How far two runs are apart, per probe that both have: greatest and rms difference, b - a.

    In the units of `a`, at the rows of `a` within both runs; `b` is interpolated where its times are others.
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
