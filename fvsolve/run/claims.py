"""What a case claims, held against a run. Knows numbers over time; starts no run."""

from __future__ import annotations

import numpy as np

from fvsolve.output.column import UnitColumn, probe_columns
from fvsolve.run.comparison import comparison, interpolated


def claims(model, extremes: dict, result) -> dict:
    """`expectations` and `comparisons` of a run; `extremes` in SI, `result` for the rows."""
    columns = {one.name: one for one in probe_columns(model)}
    case = model.case
    return {
        "expectations": [
            expectation(text, expect, columns[expect.probe.text], extremes, result)
            for text, expect in case.expect.items()
        ],
        "comparisons": [comparison(compare, columns[compare.probe.text], result) for compare in case.compare.values()],
    }


def expectation(text: str, expect, column: UnitColumn, extremes: dict, result) -> dict:
    """One line of `[expect]`: claimed, found, tolerance in the unit of the probe, and whether it holds.

    `max` and `min` are over all steps and rows, `mean` is over time (trapezoids), `at` is between rows.
    """
    found = _found(expect, column.name, extremes, result)
    tolerance = expect.atol + expect.rtol * abs(expect.value)
    return {
        "text": text,
        "claimed": float(column.from_si(expect.value)),
        "found": float(column.from_si(found)),
        "tolerance": float(column.span_from_si(tolerance)),
        "unit": column.unit,
        "ok": bool(abs(found - expect.value) <= tolerance),
    }


def _found(expect, probe: str, extremes: dict, result) -> float:
    if expect.function == "min":
        return float(extremes[probe][0])
    if expect.function == "max":
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
