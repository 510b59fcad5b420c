"""One run for each of many sets of values: a row of numbers apiece, failed ones with their reason. Knows runs."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.case import Case, load
from fvsolve.case.load import named
from fvsolve.case.raw import read_raw
from fvsolve.case.text import inline
from fvsolve.doors import AMOUNT, CALL, COUNT, PATH, ROW, SERIES, TABLE, TEXT, Kind, door
from fvsolve.errors import FvsolveError, RunError, did_you_mean, listing
from fvsolve.fluid.cache import coolprop
from fvsolve.output.restart import programs
from fvsolve.shown import Shown
from fvsolve.studies.many import many
from fvsolve.studies.plans import grid, of_file, refuse_unknown, sampled
from fvsolve.studies.points import Points, hashed, writing
from fvsolve.studies.row import REFUSED, RowMaker
from fvsolve.studies.sheet import Column, Sheet
from fvsolve.units import show

FIRST = ("ok", "reason", "t [s]", "marks", "warnings", "fluid")
LAST = ("expectations", "verdicts", "steps", "seconds")
KEPT = {"row": 5}  # counts up when a row holds something else: older ones on disk are not reused
WORDS = ("title", "description", "source")  # of a case, which change no row


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

    @property
    def outcomes(self) -> list[str]:
        """Columns of probes: numbers that runs have found."""
        return self.columns[len(self.keys) + len(FIRST) : -len(LAST)]

    def outcome(self, name: str) -> str:
        """The column of an outcome, with or without its unit; FvsolveError where there is none."""
        known = {one.partition(" [")[0]: one for one in self.outcomes}
        if name not in known and name not in known.values():
            said = f"{did_you_mean(name, known)}; there are {listing(known) or 'none'}"
            raise FvsolveError(f"no outcome {show(name)}{said}")
        return known.get(name, name)

    def plain(self) -> dict[str, Any]:
        """As JSON says it."""
        return {"keys": list(self.keys), "columns": self.columns, "rows": self.rows, "reused": self.reused}

    def write(self, path: Path) -> None:
        """The table as CSV, the values of the keys as `--set` reads them; whole, or what was there stays."""
        rows = ({name: self._cell(name, x) for name, x in row.items()} for row in self.rows)
        with writing(path):
            fresh = Sheet([Column(name) for name in self.columns], [*rows]).write(path.with_suffix(".tmp"))
            os.replace(fresh, path)

    def write_parquet(self, path: Path) -> bool:
        """The same as Parquet, numbers as such; False where pyarrow is not installed."""
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            return False
        columns = {name: [row.get(name) for row in self.rows] for name in self.columns}
        for name, values in columns.items():
            if not all(x is None or isinstance(x, (bool, int, float)) for x in values):
                columns[name] = [str(self._cell(name, x)) for x in values]
            elif any(isinstance(x, float) for x in values):
                columns[name] = [None if x is None else float(x) for x in values]
        with writing(path):
            pyarrow.parquet.write_table(pyarrow.table(columns), path.with_suffix(".tmp"))
            os.replace(path.with_suffix(".tmp"), path)
        return True

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
POINTS = Kind(
    lambda given: PATH.holds(given) or (ROW.holds(given) and all(TABLE.holds(one) for one in given)),
    'the path of a CSV file, or a list of tables such as {"links.main.cells": 100}',
)


@door(vary=VARY, set=TABLE, jobs=COUNT, out=PATH, progress=CALL, points=POINTS, sample=TEXT, seed=AMOUNT, dask=TEXT)
def sweep(
    case,
    vary: Mapping[str, Sequence[Any]] | None = None,
    set: Mapping[str, Any] | None = None,
    jobs: int = 1,
    out: str | Path | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    points: str | Path | Sequence[Mapping[str, Any]] | None = None,
    sample: str | None = None,
    seed: int = 0,
    dask: str | None = None,
) -> Sweep:
    """Run a case once for every combination of the values of `vary`, `jobs` at a time.

    `case` is a path, a dict shaped like the file or a `Case`; `set` overrides keys for all runs. With `sample`,
    "sobol:64" or "lhs:100", `vary` holds two values of each key, and so many points between them are run, the same for
    the same `seed`; `points` are the values of every run, or a CSV file of them, in place of `vary`. With `out`,
    finished rows are kept in that folder as they come, reused by the next sweep, and written to `sweep.csv` at the end
    or when it is interrupted. A run that is refused or stops is a row with its reason. With jobs above 1 other
    processes run, which start the program anew: a script must then stand under `if __name__ == "__main__"`. `dask` is
    the address of a scheduler whose workers run in their place.
    Raises FvsolveError where nothing varies and where every run is refused for the same reason, CaseError where the
    case itself has faults, and where it has no such key.
    """
    if jobs < 1:
        raise FvsolveError(f"jobs = {jobs}; wanted 1 or more")
    raw, base = raw_of(case), dict(set or {})
    runs = planned(case, raw, base, vary or {}, points, sample, seed)
    refuse_unknown(case, {**base, **runs[0]}, raw)
    folder = None if out is None else Path(out)
    with Points(folder) as kept:
        return Sweeping(case, raw, base, runs, kept, progress).go(folder, jobs, dask)


def planned(source: Any, raw: dict, base: dict, vary: Mapping, points, sample: str | None, seed: int) -> list[dict]:
    """The values of every run."""
    if points is not None:
        if vary or sample:
            raise FvsolveError("points say all values of every run; wanted no vary and no sample beside them")
        runs = of_file(Path(points), source, raw) if PATH.holds(points) else [dict(one) for one in points]
        if not runs or not runs[0] or any(one.keys() != runs[0].keys() for one in runs):
            raise FvsolveError("points have not all the same keys; wanted one at least, with a value in every run")
        return runs
    if sample is not None:
        if not vary:
            raise FvsolveError("nothing varies; give the two ends of a key at least, links.main.length=900,1000")
        return sampled(load(source, base), vary, sample, seed)
    if not vary or all(len(values) < 2 for values in vary.values()):
        raise FvsolveError("nothing varies; give two values of a key at least, for example links.main.cells=100,200")
    empty = [key for key, values in vary.items() if not len(values)]
    if empty:
        raise FvsolveError(f"{', '.join(empty)}: no values; wanted one at least")
    return grid(vary)


class Sweeping:
    """One sweep while it lasts."""

    def __init__(self, source, raw: dict, base: dict, runs: list[dict], kept: Points, progress) -> None:
        self.runs, self.kept, self.told = runs, kept, progress or (lambda done, total, what: None)
        self.source, self.base = source, base
        self.found: dict[int, dict] = {}
        self.digests: dict[str, str] = {}  # of files
        about = {key: one for key, one in raw.items() if key not in WORDS}
        by = programs() | {"numba": "", "coolprop": coolprop()}
        self.who = hashed({**by, "case": about, "base": base, "files": [*self.files((about, base))]})

    def go(self, folder: Path | None, jobs: int, dask: str | None) -> Sweep:
        """All rows, written where there is a folder."""
        self.began = time.perf_counter()
        try:
            self.fill(jobs, dask)
        except BaseException:
            with suppress(RunError):  # that what is there cannot be written is not what is wrong
                self.made(folder)
            raise
        return self.made(folder)

    def fill(self, jobs: int, dask: str | None) -> None:
        """Find all rows: what is there already, then what is to be run."""
        keys = [hashed({"who": self.who, "set": values, "files": [*self.files(values)]}) for values in self.runs]
        for at, key in enumerate(keys):
            if (known := self.kept.known(key)) is not None:
                self.found[at] = self.runs[at] | known
        waiting = [at for at in range(len(keys)) if at not in self.found]
        self.tell(waiting[:1])
        for number, row in many(RowMaker(self.source, self.base), [self.runs[at] for at in waiting], jobs, dask):
            at = waiting[number]
            self.found[at] = self.runs[at] | self.kept.keep(keys[at], KEPT, row)
            self.tell([at + 1] if at + 1 < len(keys) else [])

    def made(self, folder: Path | None) -> Sweep:
        """What is found so far; FvsolveError where all of it is refused for one reason."""
        made = Sweep(tuple(self.runs[0]), [self.found[at] for at in sorted(self.found)], self.kept.reused)
        refused = {row["reason"] if row["reason"].startswith(REFUSED) else "" for row in made.rows}
        if len(made.rows) == len(self.runs) and len(refused) == 1 and "" not in refused:
            raise FvsolveError(f"all {len(self.runs)} runs are {refused.pop()}")
        if folder is not None and made.rows:
            made.write(folder / "sweep.csv")
            made.write_parquet(folder / "sweep.parquet")
        return made

    def tell(self, coming: list[int]) -> None:
        """How far it is, how long it will be, and what comes."""
        own, left = len(self.found) - self.kept.reused, len(self.runs) - len(self.found)
        spent = time.perf_counter() - self.began
        rest = f"{span(spent / own * left)} left, " if own and left else ""
        self.told(len(self.found), len(self.runs), rest + "".join(_said(self.runs[at]) for at in coming))

    def files(self, said: Any) -> Iterator[str]:
        """What files hold that are named somewhere in values: one of the case's, where its text is that of a file."""
        for one in said.values() if isinstance(said, Mapping) else said if isinstance(said, (list, tuple)) else ():
            if isinstance(one, str):
                yield from self.digest(one)
            else:
                yield from self.files(one)

    def digest(self, name: str) -> list[str]:
        if name not in self.digests:
            path = folder_of(self.source) / name
            try:
                self.digests[name] = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
            except (OSError, ValueError):
                self.digests[name] = ""
        return [self.digests[name]] if self.digests[name] else []


def raw_of(source) -> dict[str, Any]:
    """The nested dicts of what `load` takes."""
    return source.raw if isinstance(source, Case) else read_raw(named(source)).table


def folder_of(source) -> Path:
    """Where the files of a case are."""
    if isinstance(source, Case):
        return source.folder or Path.cwd()
    source = named(source)
    return Path.cwd() if isinstance(source, Mapping) else Path(source).parent


def span(seconds: float) -> str:
    """A span of time in words."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


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
