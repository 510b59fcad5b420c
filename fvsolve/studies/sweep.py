"""One run for each combination of values: a row of numbers apiece, failed ones with their reason. Knows runs."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.case.text import inline
from fvsolve.doors import CALL, COUNT, PATH, ROW, SERIES, TABLE, Kind, door
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.shown import Shown
from fvsolve.studies.outcome import grown, refusal
from fvsolve.studies.points import Points
from fvsolve.studies.sheet import Column, Sheet

FIRST = ("ok", "reason", "t [s]", "marks", "warnings", "fluid")
LAST = ("expectations", "steps", "seconds")
REFUSED = "refused: "
KEPT = {"row": 4}  # counts up when a row holds something else: older ones on disk are not reused


@dataclass(frozen=True, repr=False)
class Sweep(Shown):
    """Rows in the order of the values, the last key fastest; a value that a run does not have is None.

    keys : the keys that vary
    rows : their values, `ok`, `reason`, `t [s]`, `marks` (the first thing that the model could not follow, in words,
    or nothing); `warnings` and `fluid` as in the summary; of each probe `min(...)`, `max(...)`, their times and
    `final(...)` in the units of `[output]`, None where the run ended in a value that is not finite; `expectations`
    (whether all hold), `steps`, `seconds` of stepping
    reused : how many rows were there before
    """

    keys: tuple[str, ...]
    rows: list[dict[str, Any]]
    reused: int

    picture = "fvsolve.draw.objects:sweep_figure"

    def said(self) -> str:
        wrong = sum(not row["ok"] for row in self.rows)
        return f"over {', '.join(self.keys)}: {len(self.rows)} runs, {wrong} of them not ok"

    def listed(self) -> dict[str, list]:
        return Sheet([Column(name) for name in self.columns], self.rows).listed()

    @property
    def columns(self) -> list[str]:
        """All columns, those of the probes in the order in which they first appear."""
        seen = dict.fromkeys(name for row in self.rows for name in row)
        own = {*self.keys, *FIRST, *LAST}
        return [*self.keys, *FIRST, *(name for name in seen if name not in own), *LAST]

    def plain(self) -> dict[str, Any]:
        """As JSON says it."""
        return {"keys": list(self.keys), "columns": self.columns, "rows": self.rows, "reused": self.reused}

    def write(self, path: Path) -> None:
        """The table as CSV, the values of the keys as `--set` reads them."""
        rows = ({name: self._cell(name, x) for name, x in row.items()} for row in self.rows)
        Sheet([Column(name) for name in self.columns], [*rows]).write(path)

    def _cell(self, name: str, value: Any) -> Any:
        if name == "warnings":
            return "; ".join(one["text"] for one in value or ())
        if name == "fluid":
            return value["name"] if value else ""
        return pasted(value) if name in self.keys else "" if value is None else value


VARY = Kind(
    lambda given: TABLE.holds(given) and all(ROW.holds(row) or SERIES.holds(row) for row in given.values()),
    'a table of lists, for example {"links.main.cells": [100, 200]}',
)


@door(vary=VARY, set=TABLE, jobs=COUNT, out=PATH, progress=CALL)
def sweep(
    case,
    vary: Mapping[str, Sequence[Any]],
    set: Mapping[str, Any] | None = None,
    jobs: int = 1,
    out: str | Path | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Sweep:
    """Run a case once for every combination of the values of `vary`, `jobs` at a time.

    `case` is a path, a dict shaped like the file or a `Case`; `set` overrides keys for all runs. With `out`, finished
    rows are kept in that folder as they come, reused by the next sweep, and written to `sweep.csv` at the end or when
    it is interrupted. A run that is refused or stops is a row with its reason. With jobs above 1 other processes run,
    which start the program anew: a script must then stand under `if __name__ == "__main__"`.
    Raises FvsolveError where nothing varies and where every run is refused for the same reason, CaseError where the
    case itself has faults.
    """
    if not vary or all(len(values) < 2 for values in vary.values()):
        raise FvsolveError("nothing varies; give two values of a key at least, for example links.main.cells=100,200")
    if jobs < 1:
        raise FvsolveError(f"jobs = {jobs}; wanted 1 or more")
    folder = None if out is None else Path(out)
    source, base = _source(case), dict(set or {})
    combinations = [dict(zip(vary, values, strict=True)) for values in itertools.product(*vary.values())]
    found, told = {}, progress or (lambda done, total, what: None)
    told(0, len(combinations), _said(combinations[0]))
    with Points(folder) as points:
        try:
            for at, row in _rows(source, base, combinations, points, jobs):
                found[at] = combinations[at] | row
                told(len(found), len(combinations), _said(combinations[min(at + 1, len(combinations) - 1)]))
        finally:
            made = Sweep(tuple(vary), [found[at] for at in sorted(found)], points.reused)
            refused = {row["reason"] if row["reason"].startswith(REFUSED) else "" for row in made.rows}
            useless = len(made.rows) == len(combinations) and len(refused) == 1 and "" not in refused
            if folder is not None and found and not useless:
                made.write(folder / "sweep.csv")
    if useless:
        raise FvsolveError(f"all {len(combinations)} runs are {refused.pop()}")
    return made


def _source(case):
    """What another process can read the case from."""
    return case if not hasattr(case, "raw") else case.path or case.raw


def _said(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {pasted(value)}" for key, value in values.items())


def pasted(value: Any) -> str:
    """A value as `--set` reads it back: TOML, words without quotes where they stay what they are."""
    import tomllib

    if not isinstance(value, str) or value != value.strip() or {*value} & {*",[]{}\"'\n"}:
        return inline(value)
    try:
        tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return value or inline(value)
    return inline(value)


def _rows(source, base: dict, combinations: list[dict], points: Points, jobs: int) -> Iterator[tuple[int, dict]]:
    """(number, row) as they are finished: what is there already, then what is to be run."""
    waiting = []
    for at, values in enumerate(combinations):
        settings = base | values
        try:
            case = _load(source, settings)
        except CaseError as error:
            yield at, _refused(error)
            continue
        known = points.find(case, KEPT)
        if known is None:
            waiting.append((at, case, settings))
        else:
            yield at, known
    for at, case, row in _made(source, waiting, jobs):
        yield at, points.get(case, KEPT, lambda row=row: row)


def _made(source, waiting: list, jobs: int) -> Iterator[tuple[int, Any, dict]]:
    """Rows of runs: the first one here, which compiles what they need, the others `jobs` at a time."""
    for at, case, settings in waiting if jobs == 1 else waiting[:1]:
        yield at, case, row_of(source, settings)
    if jobs == 1 or len(waiting) < 2:
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import active_children, get_context

    others, workers = {*active_children()}, []
    pool = ProcessPoolExecutor(min(jobs, len(waiting) - 1), mp_context=get_context("spawn"))
    try:
        with _no_interrupts():
            asked = {pool.submit(row_of, source, settings): (at, case) for at, case, settings in waiting[1:]}
            workers += [one for one in active_children() if one not in others]
        for done in as_completed(asked):
            yield *asked[done], done.result()
    finally:
        for one in workers:  # they are idle, or what they run is not wanted any more
            one.terminate()
        pool.shutdown(cancel_futures=True)


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Processes that are started meanwhile never hear Ctrl-C, which goes to all of a terminal: this one ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _load(source, settings: dict):
    from fvsolve.case import load

    return load(source, {**settings, "output.fields": 0})


def row_of(source, settings: dict) -> dict[str, Any]:
    """The row of one run."""
    from fvsolve.run import run

    try:
        result = run(_load(source, settings))
    except CaseError as error:
        return _refused(error)
    if result.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    row = {"ok": result.ok, "reason": result.reason, "t [s]": result.summary["t"]}
    row["marks"] = min(result.marks, key=lambda mark: mark.time).text if result.marks else ""
    row |= {key: result.summary[key] for key in ("warnings", "fluid")}
    blown = grown(result.reason)  # the numbers before it mean nothing
    for name, one in result.extremes.items():
        unit = f"[{result.units[name]}]"
        said = {f"min({name}) {unit}": one.least, f"t_min({name}) [s]": one.t_least}
        said |= {f"max({name}) {unit}": one.greatest, f"t_max({name}) [s]": one.t_greatest}
        said[f"final({name}) {unit}"] = float(result[name][-1])
        row |= dict.fromkeys(said) if blown else said
    row["expectations"] = all(claim.ok for claim in result.expectations) if result.expectations else None
    return row | {"steps": result.summary["steps"], "seconds": result.summary["seconds"]}


def _refused(error: CaseError) -> dict[str, Any]:
    return {"ok": False, "reason": refusal(error)}
