"""How far peaks and limits are off: those of a run beside the same at half and twice its resolution. Knows runs.

Each is bounded from the local extrema of its signal (`extrema.py`), that of a limit from those of some places of each
part. Where liquid parts no order is believed, as blows of cavities come to their limit slowly (docs/cavitation.md).
Where nothing has cells, a peak between rows is missed by an eighth of their second difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fvsolve.case import load
from fvsolve.errors import CaseError, listing
from fvsolve.run import Result, run
from fvsolve.run.result import HOLDS, OPEN
from fvsolve.run.verdicts import BESIDE, MAGNITUDES, Beside, verdict
from fvsolve.studies.extrema import greatest_error
from fvsolve.studies.levels import finer, kept
from fvsolve.studies.unresolved import NAMED, WIDE, Unresolved, parted

LEVELS = (0.5, 1.0, 2.0)
LEAST = 5e-6  # of a value: what iterations, rows between steps, and swings that have all but died leave
ROUNDING = 1e-12  # of the greatest value in that unit, of angles of a radian at least
SIGNS = {"least": -1.0, "greatest": 1.0}
SIDES = tuple(SIGNS)
QUIET = {"output.fields": 0, "output.lines": {}}
FEWEST_ROWS, MOST_ROWS = 500, 4000  # of signals, at the resolution of the run itself
PLACES, MOST_PLACES = 12, 400  # of a part under a bound, and of all limits, whose signals are followed


def peak_errors(result: Result, case: Any, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Add to the summary of a run how far its peaks and verdicts may be off, from more runs of its case.

    `peaks`: probe -> unit, and `least` and `greatest` as {value, error, order, reason}; `error` is None where another
    run did not come to its end or a pipe is too short, `order` None where there is none to believe, `reason` why an
    error is not known or wide. Expectations get their `error`, and so does every
    bound of every place of a limit: a limit is open where a margin is smaller than its error. `resolution` says how.
    """
    own = result if result.places is not None else run(case, set=QUIET, pictures=False)
    runs = levels(own, case, progress)
    said, unresolved = result.summary, Unresolved(case, runs)
    said["peaks"] = peaks(result, runs, unresolved)
    said["verdicts"] = [verdict([judged(runs, k, j, row, unresolved) for j, row in enumerate(rows)])
                        for k, rows in enumerate(own.places)]  # fmt: skip
    for k, claim in enumerate(said["expectations"]):
        claim["error"] = of_claim(runs, case.expect[claim["text"]], k, said["peaks"])
    said["resolution"] = {"levels": sorted(runs), "kept": kept(case), "words": words(runs, case),
                          "reasons": reasons(said)}  # fmt: skip
    return said


def reasons(said: dict[str, Any]) -> list[str]:
    """Why errors of peaks and limits are not known or wide, each once with what it is of."""
    found: dict[str, dict[str, None]] = {}
    for probe, peak in said["peaks"].items():
        for side in SIDES:
            found.setdefault(peak[side]["reason"], {})[probe] = None
    for one in said["verdicts"]:
        for row in one["worst"]:
            found.setdefault(row["reason"], {})[f"{one['name']} at {row['place']}"] = None
    return [f"{listing(list(of), NAMED)}: {text}" for text, of in found.items() if text is not None]


def levels(own: Result, case: Any, progress: Callable[[str], None] | None) -> dict[float, Result]:
    """Runs at half, one and twice the resolution, with rows so dense that they show every peak."""
    named = [probe.text for probe in case.output.probes]
    rows = min(max(own.summary["steps"], FEWEST_ROWS), MOST_ROWS)
    every = min(case.output.every, own.summary["t"] / rows) if own.summary["t"] > 0.0 else case.output.every
    shared, runs = QUIET | {"output.probes": [*named, *followed(own, case, named)]}, {}
    for times in LEVELS:
        keys = finer(case, times) if times != 1.0 else {}
        if keys or times == 1.0:
            if progress is not None:
                progress(f"{times:g} times the resolution")
            runs[times] = run(case, set=keys | shared | {"output.every": every / times}, pictures=False)
    return runs


def followed(own: Result, case: Any, named: list[str]) -> list[str]:
    """Probes of places of limits whose signals are read, those that the case can say."""
    rows = [row[BESIDE] for rows in own.places for row in rows]
    texts = dict.fromkeys(one.probes[at] for one in rows for at in chosen(one, len(rows)))
    extra = [text for text in texts if text not in named]
    return extra if says(case, extra) else [text for text in extra if says(case, [text])]


def chosen(one: Beside, rows: int) -> list[int]:
    """The place with the least margin, those with the least beside them, and some between."""
    margins, most = np.where(np.isfinite(one.margins), one.margins, -np.inf), max(MOST_PLACES // rows, 1)
    beside = np.pad(margins, 1, constant_values=np.inf)
    least = np.flatnonzero((margins <= beside[:-2]) & (margins <= beside[2:]))
    least = least[np.argsort(margins[least], kind="stable")][: max(min(PLACES, most) // 2, 1)]
    even = np.linspace(0, len(margins) - 1, min(PLACES, most) - len(least)).astype(int) if most > len(least) else []
    return list(dict.fromkeys([int(np.argmin(margins)), *least.tolist(), *list(even)]))


def says(case: Any, texts: list[str]) -> bool:
    """True if a case can have these probes."""
    try:
        load(case, {"output.probes": texts})
    except CaseError:
        return False
    return True


def peaks(result: Result, runs: dict[float, Result], unresolved: Unresolved) -> dict[str, Any]:
    """`peaks` of a summary."""
    said, largest, made = result.summary, {"rad": 1.0}, {}
    parts = {probe.text: (probe.part, probe.name) for probe in unresolved.case.probes}
    for one in said["extremes"].values():
        largest[one["unit"]] = max([largest.get(one["unit"], 0.0), *(abs(one[side] or 0.0) for side in SIDES)])
    for name, one in said["extremes"].items():
        made[name] = {"unit": one["unit"]}
        for side, sign in SIGNS.items():
            missed = 0.0 if said["cells"] else between_rows(result, name, side)
            triple = values(runs, lambda run, n=name, s=side: run.summary["extremes"][n][s], sign)
            unknown = parts[name] in unresolved.unknown
            error = None if unknown else bounded(runs, triple, [signals(runs, name, lambda v, sign=sign: sign * v)])
            span = (one["greatest"] or 0.0) - (one["least"] or 0.0)
            if error is not None:
                least = 2.0 * (missed + ROUNDING * largest[one["unit"]]) + LEAST * abs(one[side])
                error += least + abs(sign * one[side] - triple[1]) + unresolved.tolerance * span
                span += 2.0 * least / WIDE  # what rounding leaves of a constant is not wide
            made[name][side] = {
                "value": one[side], "error": error, "order": None if unknown else order(triple, parted(runs)),
                "reason": unresolved.reason(parts[name], triple, error, span, one["unit"])}  # fmt: skip
    return made


def bounded(runs: dict[float, Result], triple: Sequence[float | None], places: Sequence = ()) -> float | None:
    """The error of the second of three values that rise, with signals of its places; None where it is not known."""
    c, *known = triple
    if not all(one is not None and math.isfinite(one) for one in known):
        return None
    whole = c is not None and math.isfinite(c)
    places = [one if whole else one[-2:] for one in places if usable(one)]
    return greatest_error(places, triple if whole else known, not parted(runs))


def usable(one: Sequence) -> bool:
    """True if there are signals, all of numbers."""
    return len(one) > 1 and all(len(v) > 0 and bool(np.isfinite(v).all()) for _, v in one)


def signals(runs: dict[float, Result], probe: str, rising: Callable[[np.ndarray], np.ndarray]) -> list:
    """Times and values of a probe at every resolution that came to its end; none where it is no probe."""
    done = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    return [(one.seconds, rising(one[probe])) for one in done if probe in one.units]


def judged(runs: dict[float, Result], limit: int, k: int, row: dict[str, Any], unresolved: Unresolved) -> dict:
    """A row of a limit with its error: one that holds is open where its margin is smaller or nothing is known."""
    sign, magnitude = SIGNS[row["bound"]], row["quantity"] in MAGNITUDES
    triple = values(runs, lambda one: one.places[limit][k]["margin"], -1.0)
    places = []
    for at, probe in enumerate(row[BESIDE].probes):
        allowed = float(row[BESIDE].limits[at])
        places.append(signals(runs, probe, lambda v, a=allowed: sign * ((np.abs(v) if magnitude else v) - a)))
    part = (row[BESIDE].probes[0].split(".")[0], row["place"])
    error = None if part in unresolved.unknown else bounded(runs, triple, places)
    span = max((float(np.ptp(one[-2][1])) for one in places if usable(one)), default=math.inf)
    if error is not None:
        error += LEAST * abs(row["value"] or 0.0) + unresolved.tolerance * (span if math.isfinite(span) else 0.0)
    doubtful = row["state"] == HOLDS and (error is None or not row["margin"] >= error)
    reason = unresolved.reason(part, triple, error, span + 2.0 * LEAST / WIDE * abs(row["value"] or 0.0), row["unit"])
    return row | {"error": error, "reason": reason, "state": OPEN if doubtful else row["state"]}


def of_claim(runs: dict[float, Result], expect: Any, k: int, found: dict[str, Any]) -> float | None:
    """The error of what a claim is about: that of a peak, or by three values alone."""
    side = {"min": "least", "least": "least", "max": "greatest", "greatest": "greatest"}.get(expect.function)
    if side is not None and expect.probe is not None and expect.probe.text in found:
        return found[expect.probe.text][side]["error"]
    triple = values(runs, lambda one: one.summary["expectations"][k]["found"])
    error = bounded(runs, triple)
    return None if error is None else error + LEAST * abs(triple[1])


def values(runs: dict[float, Result], of: Callable, sign: float = 1.0) -> tuple[float | None, ...]:
    """Of half, one and twice the resolution; None of a run that is not there or did not come to its end."""
    found = [of(runs[times]) if times in runs and runs[times].reason == "finished" else None for times in LEVELS]
    return tuple(None if one is None else sign * one for one in found)


def order(triple: Sequence[float | None], apart: bool) -> float | None:
    """The order that three values show, 2 at most; None of less than one, or where their differences differ in sign."""
    if apart or any(one is None or not math.isfinite(one) for one in triple):
        return None
    first, second = triple[1] - triple[0], triple[2] - triple[1]
    if first == 0.0 or first * second < 0.0 or abs(second) > 0.5 * abs(first) * (1.0 + 1e-6):
        return None
    return min(math.log2(first / second), 2.0) if second else 2.0


def between_rows(result: Result, probe: str, side: str) -> float:
    """What a smooth peak may rise between rows beyond the highest of them."""
    t, v = result.t, result[probe]
    at = int(np.argmin(v) if side == "least" else np.argmax(v))
    if not 0 < at < len(v) - 1 or t[at - 1] == t[at] or t[at] == t[at + 1]:
        return 0.0
    return abs(float(v[at - 1] - 2.0 * v[at] + v[at + 1])) / 8.0


def words(runs: dict[float, Result], case: Any) -> str:
    """What was done, and what it leaves out."""
    others = " and ".join(f"{one:g}" for one in sorted(runs) if one != 1.0)
    said = f"peaks beside those of {others} times the resolution"
    if kept(case):
        said += f"; cells of {', '.join(kept(case))} come from files and stayed, so their part is not in it"
    if parted(runs):
        said += "; liquid parts, so no order is believed"
    stopped = [f"{one:g}" for one in sorted(runs) if runs[one].reason != "finished"]
    if stopped:
        said += f"; the run of {' and '.join(stopped)} did not come to its end"
    if 0.5 not in runs:
        said += "; half the resolution cannot be said (patches would begin within cells), so no order is believed"
    return said
