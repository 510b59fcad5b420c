"""How far peaks are off: those of a run beside the same at half and twice its resolution. Knows runs; draws nothing.

Of values c, m, f at half, one and twice the resolution an order q = log2(|m - c| / |f - m|) of 1 to 2 is believed
where the differences agree in sign and those of all peaks in that unit together show as much. Then m is off by
(f - m) 2^q / (2^q - 1), or (m - c) / (2^q - 1), whichever is more (Richardson 1927), times 1.25 (Roache 1994). Where
there is no such order, the band is that of order one half: 3.4 times the greater difference; so it is where liquid
parts, as blows of cavities come to their limit at an order below one (docs/cavitation.md), whatever three grids show.
Where nothing has cells, a peak between rows is missed by an eighth of their second difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.run import Result, run
from fvsolve.studies.levels import finer, kept

LEVELS = (0.5, 1.0, 2.0)
SAFETY = 1.25  # Roache's, of three grids
HALF = math.sqrt(2.0) / (math.sqrt(2.0) - 1.0)  # of order one half, to what twice the resolution leaves and all beyond
MOST = 2.0  # order that is believed at most
LEAST = 5e-6  # of a value: what iterations, rows between steps, and swings that have all but died leave
ROUNDING = 1e-12  # of the greatest value in that unit, of angles of a radian at least
SIDES = ("least", "greatest")


def peak_errors(result: Result, case: Any, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Add to the summary of a run how far its peaks and verdicts may be off, from two more runs of its case.

    `peaks`: probe -> unit, and `least` and `greatest` as {value, error, order}; `error` is None where another run did
    not come to its end, `order` None where there is none to believe. Verdicts and expectations get their `error`; a
    limit whose margin is smaller is open, and not ok. `resolution` says how.
    """
    runs = {1.0: result}
    for times in (one for one in LEVELS if one != 1.0):
        keys = finer(case, times)
        if keys:
            if progress is not None:
                progress(f"{times:g} times the resolution")
            every = {"output.every": case.output.every / times, "output.fields": 0, "output.lines": {}}
            runs[times] = run(case, set=keys | every, pictures=False)
    said = result.summary
    triples = {(name, side): values(runs, lambda one, n=name, s=side: one.summary["extremes"][n][s])
               for name in said["extremes"] for side in SIDES}  # fmt: skip
    shared = pooled({key: (said["extremes"][key[0]]["unit"], triple) for key, triple in triples.items()})
    apart = parted(runs)
    if apart:
        shared = dict.fromkeys(shared, 0.0)
    smooth, largest = not said["cells"], {"rad": 1.0}
    for one in said["extremes"].values():
        largest[one["unit"]] = max([largest.get(one["unit"], 0.0), *(abs(one[side] or 0.0) for side in SIDES)])
    said["peaks"] = {}
    for name, one in said["extremes"].items():
        made: dict[str, Any] = {"unit": one["unit"]}
        rounded = ROUNDING * largest[one["unit"]]
        for side in SIDES:
            missed = rounded + (between_rows(result, name, side) if smooth else 0.0)
            made[side] = {"value": one[side], **band(triples[name, side], shared[one["unit"]], missed)}
        said["peaks"][name] = made
    for k, verdict in enumerate(said["verdicts"]):
        triple = values(runs, lambda one, k=k, verdict=verdict: of_bound(one.summary["verdicts"][k], verdict["bound"]))
        verdict["error"] = alone(triple, verdict["unit"], shared, apart)
        if verdict["error"] is not None and verdict["margin"] is not None:
            verdict["ok"] = verdict["ok"] and verdict["margin"] >= verdict["error"]
    for k, claim in enumerate(said["expectations"]):
        triple = values(runs, lambda one, k=k: one.summary["expectations"][k]["found"])
        claim["error"] = alone(triple, claim["unit"], shared, apart)
    said["resolution"] = {"levels": sorted(runs), "kept": kept(case), "words": words(runs, case)}
    return said


def alone(triple: tuple[float | None, ...], unit: str, shared: dict[str, float], apart: bool) -> float | None:
    """The band of what is no peak of a probe; its order is its own where none is shared in that unit."""
    own = 0.0 if apart else pooled({0: ("", triple)})[""]
    return band(triple, shared.get(unit, own))["error"]


def parted(runs: dict[float, Result]) -> bool:
    """Whether liquid parted in one of them."""
    return any(one.summary["cavities"] for one in runs.values())


def of_bound(verdict: dict[str, Any], bound: str) -> float | None:
    """The value of a limit at its worst place for one of its bounds."""
    return next((one["value"] for one in verdict["worst"] if one["bound"] == bound), None)


def values(runs: dict[float, Result], of: Callable) -> tuple[float | None, ...]:
    """Of half, one and twice the resolution; None of a run that is not there or did not come to its end."""
    return tuple(of(runs[times]) if times in runs and runs[times].reason == "finished" else None for times in LEVELS)


def order(first: float, second: float) -> float:
    """By which differences fall from one halving to the next."""
    return math.log2(first / second) if first > 0.0 and second > 0.0 else math.inf if first > 0.0 else 0.0


def pooled(triples: dict) -> dict[str, float]:
    """Unit -> the order of all peaks in it together: an order that one of them shows alone is luck."""
    sums: dict[str, list[float]] = {}
    for unit, (c, m, f) in triples.values():
        both = sums.setdefault(unit, [0.0, 0.0])
        if None not in (c, m, f):
            both[0] += abs(m - c)
            both[1] += abs(f - m)
    return {unit: order(*both) for unit, both in sums.items()}


def band(triple: tuple[float | None, ...], shared: float, missed: float = 0.0) -> dict[str, float | None]:
    """`error` and `order` of the middle one of three values, see the top."""
    c, m, f = triple
    if m is None or f is None or not all(map(math.isfinite, (m, f))):
        return {"error": None, "order": None}
    second = f - m
    if c is None or not math.isfinite(c):
        return {"error": HALF * abs(second) + 2.0 * missed + LEAST * abs(m), "order": None}
    first = m - c
    own = order(abs(first), abs(second)) if first * second >= 0.0 else 0.0
    q = min(own, shared, MOST)
    if max(abs(first), abs(second)) == 0.0:
        error, q = 0.0, None
    elif q >= 1.0 - 1e-6:
        error = SAFETY * max(abs(second) * 2.0**q, abs(first)) / (2.0**q - 1.0)
    else:
        error, q = HALF * max(abs(first), abs(second)), None
    return {"error": error + 2.0 * missed + LEAST * abs(m), "order": q}


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
