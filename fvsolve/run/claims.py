"""What a case claims, held against a run. Knows numbers over time; starts no run."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.output.column import UnitColumn, column, probe_columns
from fvsolve.run.comparison import comparison, interpolated
from fvsolve.run.met import in_quantity, met
from fvsolve.run.result import FAILS, HOLDS, OPEN
from fvsolve.run.verdicts import places, verdict


def claims(model, summary, result) -> dict:
    """`expectations`, `comparisons` and `verdicts` of a run; `result` has rows, and gets the places of limits."""
    columns = {one.name: one for one in probe_columns(model)}
    case = model.case
    result.places = places(model, summary)
    return {
        "expectations": expectations(model, summary, result),
        "verdicts": [verdict(rows) for rows in result.places],
        "comparisons": [comparison(compare, columns[compare.probe.text], result) for compare in case.compare.values()],
    }


def expectations(model, summary, result) -> list[dict]:
    """What the case claims, line by line."""
    columns = {one.name: one for one in probe_columns(model)}
    first = min((mark.time for mark in summary.marks), default=math.inf)
    found = []
    for text, expect in model.case.expect.items():
        if expect.extent is None:
            shown = columns[expect.probe.text]
            value, time = _found(expect, shown.name, summary, result)
        else:
            shown = column(text, expect.extent.dimension, model.case)
            value, time = _whole(model, summary, expect)
        value = value if time < summary.invalid_from else math.nan
        found.append(expectation(text, expect, shown, value, bool(summary.ok and time < first)))
    return found


def expectation(text: str, expect, column: UnitColumn, found: float, sound: bool) -> dict:
    """One line of `[expect]`: claimed, found, tolerance in the unit of the probe, and its state, as that of a limit.

    `max` and `min` are over all steps and rows, as are `greatest` and `least`, over all places of a part as well;
    `mean` is over time (trapezoids), `at` is between rows. `error` is for who asks how far `found` is off.
    """
    tolerance = expect.atol + expect.rtol * abs(expect.value)
    known = math.isfinite(found)
    state = FAILS if known and abs(found - expect.value) > tolerance else HOLDS if known and sound else OPEN
    return {
        "text": text,
        "claimed": float(column.from_si(expect.value)),
        "found": float(column.from_si(found)) if known else None,
        "tolerance": float(column.span_from_si(tolerance)),
        "unit": column.unit,
        "state": state,
        "ok": state == HOLDS,
        "error": None,
    }


def _whole(model, summary, expect) -> tuple[float, float]:
    """Greatest or least of all places of an extent, and when."""
    extent, low = expect.extent, expect.function == "least"
    values, times = [], []
    for part in met(model, summary, extent):
        one = part.least if low else part.greatest
        times.append(part.t_least if low else part.t_greatest)
        values.append(
            in_quantity(model, extent.quantity, one, part.elevation) if extent.quantity in OF_PRESSURE else one
        )
    at = int((np.argmin if low else np.argmax)(np.concatenate(values)))
    return float(np.concatenate(values)[at]), float(np.concatenate(times)[at])


def _found(expect, probe: str, summary, result) -> tuple[float, float]:
    """The value of a probe that a claim asks for, and when it was; the end of the run of a mean."""
    if expect.function in ("min", "least"):
        return summary.extremes[probe][:2]
    if expect.function in ("max", "greatest"):
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
