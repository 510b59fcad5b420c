"""Comparison of a run with its case (expected values, limits, measured series), and of two runs."""

import math

import numpy as np

from fvsolve.case.probe import OF_PRESSURE
from fvsolve.output.unit_columns import UnitColumn, column, probe_columns
from fvsolve.run.result import FAILS, HOLDS, OPEN, Comparison
from fvsolve.run.verdicts import in_quantity, part_extremes, places, verdict


def comparison(compare, column: UnitColumn, result) -> dict:
    """Entry of the summary for one measured series: differences at the measured times in the run, and both peaks.

    compare : series of the case; column : unit of its probe. Differences are computed minus measured values; they and
    the peaks are in the unit of the probe, times in s. All are None if no measured time is within the run.
    """
    t, computed = result.seconds, result[column.name]
    time, measured = compare.t + compare.shift, column.from_si(compare.v)
    within = (time >= t[0]) & (time <= t[-1]) if len(t) else np.zeros(len(time), bool)
    time, measured = time[within], measured[within]
    head = [column.name, column.unit, compare.file, float(compare.shift), len(time)]
    if not len(time):
        return dict.fromkeys(Comparison._fields) | dict(zip(Comparison._fields, head, strict=False))
    difference = interpolated(t, computed, time) - measured
    overlap = (t >= time.min()) & (t <= time.max())
    peak, top = int(np.argmax(measured)), int(np.argmax(np.where(overlap, computed, -np.inf)))
    worst = int(np.argmax(np.abs(difference)))
    values = [np.sqrt(np.mean(difference**2)), difference[worst], time[worst]]
    values += [measured[peak], time[peak], computed[top], t[top]]
    return dict(zip(Comparison._fields, [*head, *map(float, values)], strict=True))


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


def claims(model, summary, result) -> dict:
    """Entries `expectations`, `verdicts` and `comparisons` of the summary of a run; also sets `result.places`."""
    columns = {column_.name: column_ for column_ in probe_columns(model)}
    case = model.case
    result.places = places(model, summary)
    return {
        "expectations": expectations(model, summary, result),
        "verdicts": [verdict(rows) for rows in result.places],
        "comparisons": [comparison(compare, columns[compare.probe.text], result) for compare in case.compare.values()],
    }


def expectations(model, summary, result) -> list[dict]:
    """Entries of the summary for `[expect]`, in the order of the file."""
    columns = {column_.name: column_ for column_ in probe_columns(model)}
    first = min((mark.time for mark in summary.marks), default=math.inf)
    rows = []
    for text, expect in model.case.expect.items():
        if expect.extent is None:
            shown = columns[expect.probe.text]
            value, time = _at_probe(expect, shown.name, summary, result)
        else:
            shown = column(text, expect.extent.dimension, model.case)
            value, time = _at_places(model, summary, expect)
        value = value if time < summary.invalid_from else math.nan
        rows.append(expectation(text, expect, shown, value, bool(summary.ok and time < first)))
    return rows


def expectation(text: str, expect, column: UnitColumn, value: float, complete: bool) -> dict:
    """Entry of the summary for one claim: claimed and found value and tolerance in the unit of `column`, and state.

    text, expect : name and data of the claim; value : value in the run [SI], not finite if unknown
    complete : True if the run is ok and valid at the time of the value; if False, a claim that is met is open
    `error` of the entry is None until an error estimate sets it.
    """
    tolerance = expect.atol + expect.rtol * abs(expect.value)
    known = math.isfinite(value)
    state = FAILS if known and abs(value - expect.value) > tolerance else HOLDS if known and complete else OPEN
    return {
        "text": text,
        "claimed": float(column.from_si(expect.value)),
        "found": float(column.from_si(value)) if known else None,
        "tolerance": float(column.span_from_si(tolerance)),
        "unit": column.unit,
        "state": state,
        "ok": state == HOLDS,
        "error": None,
    }


def _at_places(model, summary, expect) -> tuple[float, float]:
    """Greatest or least value [SI] in all parts of the extent of a claim, over all steps, and its time [s].

    It is nan if an extreme of a part is not valid.
    """
    extent, low = expect.extent, expect.function == "min"
    values, times = [], []
    for part in part_extremes(model, summary, extent):
        extreme = part.minimum if low else part.maximum
        times.append(part.t_min if low else part.t_max)
        values.append(
            in_quantity(model, extent.quantity, extreme, part.elevation) if extent.quantity in OF_PRESSURE else extreme
        )
    at = int((np.argmin if low else np.argmax)(np.concatenate(values)))
    return float(np.concatenate(values)[at]), float(np.concatenate(times)[at])


def _at_probe(expect, probe: str, summary, result) -> tuple[float, float]:
    """Value of a probe [SI] for a claim, and its time [s].

    `max` and `min` are over all steps and rows; `final` is the last row; `at` is interpolated between rows; `mean` is
    over time (trapezoids), with the end of the run as its time. The value is nan if there are no rows, and for an `at`
    outside their times.
    """
    if expect.function == "min":
        return summary.extremes[probe][:2]
    if expect.function == "max":
        return summary.extremes[probe][2:]
    t, values = result.seconds, result.si(probe)
    if not len(t):
        return math.nan, summary.t
    if expect.function == "final":
        return float(values[-1]), summary.t
    if expect.function == "at":
        inside = t[0] <= expect.time <= t[-1]
        return float(interpolated(t, values, np.array([expect.time]))[0]) if inside else math.nan, expect.time
    span = t[-1] - t[0]
    area = np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t))
    return float(area / span) if span > 0.0 else float(values[0]), summary.t
