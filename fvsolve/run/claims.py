"""What a case claims, held against a run. Knows numbers over time; starts no run."""

from __future__ import annotations

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.output.column import UnitColumn, column, probe_columns
from fvsolve.run.comparison import comparison, interpolated
from fvsolve.run.met import in_quantity, met
from fvsolve.run.verdicts import verdicts


def claims(model, summary, result) -> dict:
    """`expectations`, `comparisons` and `verdicts` of a run; `result` for the rows."""
    columns = {one.name: one for one in probe_columns(model)}
    case = model.case
    return {
        "expectations": expectations(model, summary, result),
        "verdicts": verdicts(model, summary) if case.limits else [],
        "comparisons": [comparison(compare, columns[compare.probe.text], result) for compare in case.compare.values()],
    }


def expectations(model, summary, result) -> list[dict]:
    """What the case claims, line by line."""
    columns = {one.name: one for one in probe_columns(model)}
    found = []
    for text, expect in model.case.expect.items():
        if expect.extent is None:
            shown = columns[expect.probe.text]
            found.append(expectation(text, expect, shown, _found(expect, shown.name, summary.extremes, result)))
        else:
            shown = column(text, expect.extent.dimension, model.case)
            found.append(expectation(text, expect, shown, _whole(model, summary, expect)))
    return found


def expectation(text: str, expect, column: UnitColumn, found: float) -> dict:
    """One line of `[expect]`: claimed, found, tolerance in the unit of the probe, and whether it holds.

    `max` and `min` are over all steps and rows, as are `greatest` and `least`, over all places of a part as well;
    `mean` is over time (trapezoids), `at` is between rows. `error` is for who asks how far `found` is off.
    """
    tolerance = expect.atol + expect.rtol * abs(expect.value)
    return {
        "text": text,
        "claimed": float(column.from_si(expect.value)),
        "found": float(column.from_si(found)),
        "tolerance": float(column.span_from_si(tolerance)),
        "unit": column.unit,
        "ok": bool(abs(found - expect.value) <= tolerance),
        "error": None,
    }


def _whole(model, summary, expect) -> float:
    """Greatest or least of all places of an extent."""
    extent, low = expect.extent, expect.function == "least"
    values = []
    for part in met(model, summary, extent):
        one = part.least if low else part.greatest
        values.append(
            in_quantity(model, extent.quantity, one, part.elevation) if extent.quantity in OF_PRESSURE else one
        )
    return float((np.min if low else np.max)(np.concatenate(values)))


def _found(expect, probe: str, extremes: dict, result) -> float:
    if expect.function in ("min", "least"):
        return float(extremes[probe][0])
    if expect.function in ("max", "greatest"):
        return float(extremes[probe][2])
    t, values = result.seconds, result.si(probe)
    if not len(t):
        return float("nan")
    if expect.function == "final":
        return float(values[-1])
    if expect.function == "at":
        inside = t[0] <= expect.time <= t[-1]
        return float(interpolated(t, values, np.array([expect.time]))[0]) if inside else float("nan")
    span = t[-1] - t[0]
    area = np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t))
    return float(area / span) if span > 0.0 else float(values[0])
