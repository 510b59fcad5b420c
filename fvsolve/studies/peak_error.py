"""Error bounds of peaks and limit margins, from runs at half, one and twice the resolution.

Each error is bounded from the local extrema of a signal (`extrema.py`). The error of the margin of a design limit is
bounded from the signals at some places of each part to which the limit applies. With column separation no order of
convergence is assumed, because peaks after cavity collapse converge slowly (docs/cavitation.md). Without cells, a peak
between two rows of output is higher than the rows by up to an eighth of their second difference.

Arguments of several functions : runs, results at all resolutions, as from `refined_runs`; triple, values at half, one
and twice the resolution
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fvsolve.case import load
from fvsolve.errors import CaseError, listing
from fvsolve.run import Result, run
from fvsolve.run.result import HOLDS, OPEN
from fvsolve.run.verdicts import MAGNITUDES, PLACES_KEY, PlaceMargins, verdict
from fvsolve.studies.extrema import greatest_error
from fvsolve.studies.outcome import NO_FIELDS
from fvsolve.studies.resolution import basins_from_files, refined_keys
from fvsolve.studies.unresolved import MAX_NAMES, WIDE_ERROR, Unresolved, has_separation

LEVELS = (0.5, 1.0, 2.0)
RELATIVE_FLOOR = 5e-6  # least relative error, from iterations, interpolated rows and nearly decayed oscillations
ROUNDING = 1e-12  # rounding error relative to the greatest value in that unit (for angles at least 1 rad)
SIGNS = {"minimum": -1.0, "maximum": 1.0}
SIDES = tuple(SIGNS)
MIN_ROWS, MAX_ROWS = 500, 4000  # limits of the number of rows of signals, at the resolution of the run itself
PLACES_PER_PART = 12  # greatest number of places of a part with signals, under a bound
MAX_PLACES = 400  # greatest number of places with signals, of all limits


def peak_errors(result: Result, case: Any, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Add errors of peaks, expectations and limit verdicts to the summary of a run, from further runs of its case.

    Returns the summary. Its entry `peaks` has for each probe the `unit`, and `minimum` and `maximum` as {value, error,
    order, reason}. The `error` is None if it is not known, for example if the run at twice the resolution did not
    finish, or a pipe is too short. The `order` is None if no order can be determined. The `reason` is that of an
    unknown or wide error, otherwise None. Each expectation and each bound of a limit at each place gets its `error`; a
    limit that holds becomes open if an error is unknown or above its margin. The entry `resolution` describes the
    method.
    progress : called with a text before each run
    """
    own = result if result.places is not None else run(case, set=NO_FIELDS, pictures=False)
    runs = refined_runs(own, case, progress)
    summary, unresolved = result.summary, Unresolved(case, runs)
    summary["peaks"] = peak_rows(result, runs, unresolved)
    summary["verdicts"] = [verdict([limit_row(runs, k, j, row, unresolved) for j, row in enumerate(rows)])
                        for k, rows in enumerate(own.places)]  # fmt: skip
    for k, claim in enumerate(summary["expectations"]):
        claim["error"] = expectation_error(runs, case.expect[claim["text"]], k, summary["peaks"])
    summary["resolution"] = {"levels": sorted(runs), "kept": basins_from_files(case), "words": description(runs, case),
                          "reasons": reason_texts(summary)}  # fmt: skip
    return summary


def reason_texts(summary: dict[str, Any]) -> list[str]:
    """Reasons of unknown or wide errors in a summary, each once, after the names of its peaks and limits."""
    names_by_reason: dict[str, dict[str, None]] = {}
    for probe, peak in summary["peaks"].items():
        for side in SIDES:
            names_by_reason.setdefault(peak[side]["reason"], {})[probe] = None
    for limit in summary["verdicts"]:
        for row in limit["worst"]:
            names_by_reason.setdefault(row["reason"], {})[f"{limit['name']} at {row['place']}"] = None
    return [f"{listing(list(names), MAX_NAMES)}: {text}" for text, names in names_by_reason.items() if text is not None]


def refined_runs(own: Result, case: Any, progress: Callable[[str], None] | None) -> dict[float, Result]:
    """Run a case at half, one and twice the resolution, with about as many rows of output as steps.

    At resolution 1 the number of rows is that of the steps, limited to `MIN_ROWS` to `MAX_ROWS`, or that of the case if
    it is larger. Returns {0.5 | 1.0 | 2.0: result}, without resolutions that the case cannot have.
    own : result of the case itself; progress : called with a text before each run
    """
    named = [probe.text for probe in case.output.probes]
    rows = min(max(own.summary["steps"], MIN_ROWS), MAX_ROWS)
    every = min(case.output.every, own.summary["t"] / rows) if own.summary["t"] > 0.0 else case.output.every
    settings, runs = NO_FIELDS | {"output.probes": [*named, *limit_probes(own, case, named)]}, {}
    for times in LEVELS:
        keys = refined_keys(case, times) if times != 1.0 else {}
        if keys or times == 1.0:
            if progress is not None:
                progress(f"{times:g} times the resolution")
            runs[times] = run(case, set=keys | settings | {"output.every": every / times}, pictures=False)
    return runs


def limit_probes(own: Result, case: Any, named: list[str]) -> list[str]:
    """Names of additional probes, at selected places of the parts to which design limits apply (see `selected_places`).

    Probes that the case does not accept are left out. own : result of the case; named : names of the probes of the case
    """
    rows = [row[PLACES_KEY] for rows in own.places for row in rows]
    texts = dict.fromkeys(
        neighbours.probes[position] for neighbours in rows for position in selected_places(neighbours, len(rows))
    )
    extra = [text for text in texts if text not in named]
    return extra if accepts_probes(case, extra) else [text for text in extra if accepts_probes(case, [text])]


def selected_places(neighbours: PlaceMargins, rows: int) -> list[int]:
    """Indices of the places of a part whose signals are recorded, for one bound of a design limit.

    They are the place with the least margin, local minima of the margin along the part, and some evenly spaced places.
    neighbours : margins at all places of the part; rows : number of pairs of a part and a bound in all limits of the
    case
    """
    margins, most = np.where(np.isfinite(neighbours.margins), neighbours.margins, -np.inf), max(MAX_PLACES // rows, 1)
    padded = np.pad(margins, 1, constant_values=np.inf)
    least = np.flatnonzero((margins <= padded[:-2]) & (margins <= padded[2:]))
    least = least[np.argsort(margins[least], kind="stable")][: max(min(PLACES_PER_PART, most) // 2, 1)]
    count = max(min(PLACES_PER_PART, most) - len(least), 0)
    spaced = np.linspace(0, len(margins) - 1, count).astype(int)
    return list(dict.fromkeys([int(np.argmin(margins)), *least.tolist(), *list(spaced)]))


def accepts_probes(case: Any, texts: list[str]) -> bool:
    """True if the case accepts these probes; texts : their names."""
    try:
        load(case, {"output.probes": texts})
    except CaseError:
        return False
    return True


def peak_rows(result: Result, runs: dict[float, Result], unresolved: Unresolved) -> dict[str, Any]:
    """Entry `peaks` of a summary, as in `peak_errors`: unit, least and greatest value of each probe, with their errors.

    result : result of the case
    """
    summary, largest, rows = result.summary, {"rad": 1.0}, {}
    parts = {probe.text: (probe.part, probe.name) for probe in unresolved.case.probes}
    for extreme in summary["extremes"].values():
        values = [abs(extreme[side] or 0.0) for side in SIDES]
        largest[extreme["unit"]] = max(largest.get(extreme["unit"], 0.0), *values)
    for name, extreme in summary["extremes"].items():
        rows[name] = {"unit": extreme["unit"]}
        for side, sign in SIGNS.items():
            missed = 0.0 if summary["cells"] else between_rows(result, name, side)
            triple = values_of_runs(runs, lambda run, n=name, s=side: run.summary["extremes"][n][s], sign)
            unknown = parts[name] in unresolved.unknown
            error = None if unknown else error_bound(runs, triple, [signals(runs, name, lambda v, sign=sign: sign * v)])
            span = (extreme["maximum"] or 0.0) - (extreme["minimum"] or 0.0)
            if error is not None:
                least = 2.0 * (missed + ROUNDING * largest[extreme["unit"]]) + RELATIVE_FLOOR * abs(extreme[side])
                error += least + abs(sign * extreme[side] - triple[1]) + unresolved.tolerance * span
                span += 2.0 * least / WIDE_ERROR  # so that the rounding error of a constant does not count as wide
            rows[name][side] = {
                "value": extreme[side],
                "error": error,
                "order": None if unknown else observed_order(triple, has_separation(runs)),
                "reason": unresolved.reason(parts[name], triple, error, span, extreme["unit"]),
            }
    return rows


def error_bound(runs: dict[float, Result], triple: Sequence[float | None], places: Sequence = ()) -> float | None:
    """Error bound of the second of three values at increasing resolutions; None if it is not known.

    places : for each place, its signals at these resolutions, with a sign such that the peak is a maximum
    """
    c, *finer = triple
    if not all(value is not None and math.isfinite(value) for value in finer):
        return None
    all_finite = c is not None and math.isfinite(c)
    places = [value if all_finite else value[-2:] for value in places if usable(value)]
    return greatest_error(places, triple if all_finite else finer, not has_separation(runs))


def usable(signals_of_place: Sequence) -> bool:
    """True if there are at least two signals and all values are finite.

    signals_of_place : signals (times, values) of one place at several resolutions
    """
    return len(signals_of_place) > 1 and all(len(v) > 0 and bool(np.isfinite(v).all()) for _, v in signals_of_place)


def signals(runs: dict[float, Result], probe: str, rising: Callable[[np.ndarray], np.ndarray]) -> list:
    """Signals (times [s], rising(values)) of a probe, from all finished runs that recorded it, coarsest first.

    rising : function that converts the values so that the peak is a maximum
    """
    finished = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    return [(run.seconds, rising(run[probe])) for run in finished if probe in run.units]


def limit_row(runs: dict[float, Result], limit: int, k: int, row: dict[str, Any], unresolved: Unresolved) -> dict:
    """Row of a limit with its error. A limit that holds becomes open if the error is unknown or above the margin.

    limit, k : indices of the limit and of the row in these
    results; row : row of `run.verdicts.places`
    """
    sign, magnitude = SIGNS[row["bound"]], row["quantity"] in MAGNITUDES
    triple = values_of_runs(runs, lambda run: run.places[limit][k]["margin"], -1.0)
    places = []
    for position, probe in enumerate(row[PLACES_KEY].probes):
        allowed = float(row[PLACES_KEY].limits[position])
        places.append(signals(runs, probe, lambda v, a=allowed: sign * ((np.abs(v) if magnitude else v) - a)))
    part = (row[PLACES_KEY].probes[0].split(".")[0], row["place"])
    error = None if part in unresolved.unknown else error_bound(runs, triple, places)
    span = max((float(np.ptp(run[-2][1])) for run in places if usable(run)), default=math.inf)
    size = abs(row["value"] or 0.0)
    if error is not None:
        error += RELATIVE_FLOOR * size + unresolved.tolerance * (span if math.isfinite(span) else 0.0)
    doubtful = row["state"] == HOLDS and (error is None or not row["margin"] >= error)
    span_and_floor = span + 2.0 * RELATIVE_FLOOR / WIDE_ERROR * size
    reason = unresolved.reason(part, triple, error, span_and_floor, row["unit"])
    return row | {"error": error, "reason": reason, "state": OPEN if doubtful else row["state"]}


def expectation_error(runs: dict[float, Result], expect: Any, k: int, peak_rows: dict[str, Any]) -> float | None:
    """Error of the value in an expectation: the error of the peak if it is a peak, else from the values of all runs.

    expect : expectation of the case; k : its index in the summaries; peak_rows : entry `peaks` of the summary
    """
    side = {"min": "minimum", "max": "maximum"}.get(expect.function)
    if side is not None and expect.probe is not None and expect.probe.text in peak_rows:
        return peak_rows[expect.probe.text][side]["error"]
    triple = values_of_runs(runs, lambda run: run.summary["expectations"][k]["found"])
    error = error_bound(runs, triple)
    return None if error is None else error + RELATIVE_FLOOR * abs(triple[1])


def values_of_runs(runs: dict[float, Result], of: Callable, sign: float = 1.0) -> tuple[float | None, ...]:
    """Values at half, one and twice the resolution, times `sign`; None for a missing or unfinished run.

    of : function of a result that returns the value, or None
    """
    results = [of(runs[times]) if times in runs and runs[times].reason == "finished" else None for times in LEVELS]
    return tuple(None if value is None else sign * value for value in results)


def observed_order(triple: Sequence[float | None], separated: bool) -> float | None:
    """Observed order of three values, at most 2; None below order 1, or if the differences have opposite signs.

    It is also None if a value is missing, and if the first two are equal.
    separated : True if column separation occurred; no order is then assumed, and the result is None
    """
    if separated or any(value is None or not math.isfinite(value) for value in triple):
        return None
    first, second = triple[1] - triple[0], triple[2] - triple[1]
    if first == 0.0 or first * second < 0.0 or abs(second) > 0.5 * abs(first) * (1.0 + 1e-6):
        return None
    return min(math.log2(first / second), 2.0) if second else 2.0


def between_rows(result: Result, probe: str, side: str) -> float:
    """Greatest height of a smooth peak above the highest row of a probe (or depth of a minimum below the lowest row).

    It is an eighth of the second difference of the three rows around this row, in the unit of the probe. It is 0 if the
    row is the first or last, or beside a jump. side : "minimum" or "maximum"
    """
    t, v = result.t, result[probe]
    position = int(np.argmin(v) if side == "minimum" else np.argmax(v))
    if not 0 < position < len(v) - 1 or t[position - 1] == t[position] or t[position] == t[position + 1]:
        return 0.0
    return abs(float(v[position - 1] - 2.0 * v[position] + v[position + 1])) / 8.0


def description(runs: dict[float, Result], case: Any) -> str:
    """Sentence that describes how the errors of peaks were found, and the restrictions for this case."""
    others = " and ".join(f"{factor:g}" for factor in sorted(runs) if factor != 1.0)
    if not others:
        files = listing(basins_from_files(case))
        return f"errors are unknown: cells of {files} come from files, and there are no other cells"
    text = f"peaks compared with those at {others} times the resolution"
    if basins_from_files(case):
        text += f"; cells of {', '.join(basins_from_files(case))} come from files and did not change"
        text += ": their error is not included"
    if has_separation(runs):
        text += "; column separation, so no order of convergence is assumed"
    stopped = [f"{factor:g}" for factor in sorted(runs) if runs[factor].reason != "finished"]
    if stopped:
        runs_text = f"run{'s' if len(stopped) > 1 else ''} at {' and '.join(stopped)} times the resolution"
        text += f"; the {runs_text} did not finish"
    if 0.5 not in runs:
        text += "; half the resolution is not possible (patches would begin within cells), so no order is assumed"
    return text
