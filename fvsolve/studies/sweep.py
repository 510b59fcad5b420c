"""Sweeps: runs of a case with many sets of values; a row of results for each run."""

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.argument_checks import COUNT_FROM_ZERO, PATH, ROW, SERIES, TABLE, TEXT, Kind, validated
from fvsolve.case import Case, load
from fvsolve.case.load import find_source
from fvsolve.case.reading import read_raw
from fvsolve.case.text import inline
from fvsolve.core.fluid.property_cache import coolprop_version
from fvsolve.core.output.restart import program_versions
from fvsolve.core.output.result_table import Column, ResultTable
from fvsolve.declarations import declared
from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError, RunError, did_you_mean, listing
from fvsolve.file_replacement import replacing
from fvsolve.studies.outcome import STUDY_ARGUMENTS
from fvsolve.studies.parallel import TaskPool
from fvsolve.studies.result_cache import ResultCache, digest_of, write_errors
from fvsolve.studies.sampling import grid, points_from_file, refuse_unknown, sample_points
from fvsolve.studies.sweep_batches import BatchedRows
from fvsolve.studies.sweep_row import RowMaker
from fvsolve.units import show

REFUSED = "refused: "


FIRST_COLUMNS = ("ok", "reason", "t [s]", "marks", "warnings", "fluid")
LAST_COLUMNS = ("expectations", "verdicts", "steps", "seconds")
# version of the content of rows: rows of older versions on disk are not reused
ROW_VERSION = {"row": 5}
TEXT_KEYS = ("title", "description", "source")  # keys of a case that do not change rows


@dataclass(frozen=True, repr=False)
class Sweep(Displayable):
    """Results of a sweep, rows in the order of the values (last key fastest); a missing value is None.

    keys : the keys that vary; reused : number of rows from earlier sweeps
    rows : for each run a dict of the values of the keys and of the columns below

    `ok` : True if the run reached its end without a warning of wrong numbers; `reason` : reason of its end or refusal
    `t [s]` : its last time; `marks` : text of the first mark, or empty; `warnings`, `fluid` : as in the summary
    `min(...)`, `max(...)`, their times, `final(...)` : of each probe in units of `[output]`, None if the run diverged
    `expectations`, `verdicts` : True if all expectations hold, and if all limits hold; None if the case has none
    `steps`, `seconds` : number of steps, and their wall time [s]
    """

    keys: tuple[str, ...]
    rows: list[dict[str, Any]]
    reused: int

    picture = "fvsolve.report.draw.object_pictures:sweep_figure"

    def summary_line(self) -> str:
        failed = sum(not row["ok"] for row in self.rows)
        return f"over {', '.join(self.keys)}: {len(self.rows)} run{'s' * (len(self.rows) != 1)}, {failed} not ok"

    def table_columns(self) -> dict[str, list]:
        return ResultTable([Column(name) for name in self.columns], self.rows).table_columns()

    @property
    def columns(self) -> list[str]:
        """Names of all columns; the columns of probes are in the order of their first appearance."""
        names = dict.fromkeys(name for row in self.rows for name in row)
        fixed = {*self.keys, *FIRST_COLUMNS, *LAST_COLUMNS}
        return [
            *self.keys,
            *FIRST_COLUMNS,
            *(name for name in names if name not in fixed),
            *LAST_COLUMNS,
        ]

    @property
    def quantities(self) -> list[str]:
        """Names of the columns of probes, such as "max(gate.pressure) [bar]"."""
        return self.columns[len(self.keys) + len(FIRST_COLUMNS) : -len(LAST_COLUMNS)]

    def quantity(self, name: str) -> str:
        """Column of the quantity `name`, given with or without its unit. Raises FvsolveError for an unknown name."""
        by_name = {column.partition(" [")[0]: column for column in self.quantities}
        if name not in by_name and name not in by_name.values():
            hint = did_you_mean(name, by_name) or f". Quantities are {listing(by_name) or 'none'}"
            raise FvsolveError(f"no quantity {show(name)}{hint}")
        return by_name.get(name, name)

    def plain(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "keys": list(self.keys),
            "columns": self.columns,
            "rows": self.rows,
            "reused": self.reused,
        }

    def write(self, path: Path) -> None:
        """Write the table as CSV, with values of keys in the format of `--set`. The file is replaced atomically."""
        rows = ({name: self._cell(name, x) for name, x in row.items()} for row in self.rows)
        with write_errors(path):
            ResultTable([Column(name) for name in self.columns], [*rows]).write(path)

    def write_parquet(self, path: Path) -> bool:
        """Write the table as Parquet, with numeric columns; returns False if pyarrow is not installed."""
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
        with write_errors(path), replacing(path) as fresh:
            pyarrow.parquet.write_table(pyarrow.table(columns), fresh)
        return True

    def _cell(self, name: str, value: Any) -> Any:
        if name == "warnings":
            return "; ".join(notice["text"] for notice in value or ())
        if name == "fluid":
            return value["name"] if value else ""
        return as_option_text(value) if name in self.keys else "" if value is None else value


VARY = Kind(
    lambda given: (
        TABLE.accepts(given)
        and all(ROW.accepts(row) or SERIES.accepts(row) for row in given.values())
    ),
    'a table of lists, for example {"links.main.cells": [100, 200]}',
)
POINTS = Kind(
    lambda given: (
        PATH.accepts(given) or (ROW.accepts(given) and all(TABLE.accepts(row) for row in given))
    ),
    'the path of a CSV file, or a list of tables such as {"links.main.cells": 100}',
)


@declared("study")
@validated(vary=VARY, out=PATH, points=POINTS, sample=TEXT, seed=COUNT_FROM_ZERO, **STUDY_ARGUMENTS)
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
    """Run a case once for every combination of the values of `vary`, `jobs` runs at a time.

    `case` is a path, a dict shaped like the file or a `Case`; `set` are overrides of all runs. With `sample`,
    "sobol:64" or "lhs:100", `vary` has two values of each key, and that number of points between them is run; equal
    values of `seed` give equal points. `points` are the values of every run, or a CSV file of them, instead of `vary`.
    With `out`, finished rows are saved in that folder at once, reused by later sweeps, and written to `sweep.csv` (with
    pyarrow also to `sweep.parquet`) at the end or at an interruption. A run that is refused or stops gives a row with
    its reason. With jobs above 1, other processes import the main script again: put its code under
    `if __name__ == "__main__"`. `dask` is the address of a scheduler whose workers are used instead.
    `progress` is called as progress(done, total, text).
    Raises FvsolveError if no key varies, and if every run is refused for the same reason; CaseError if the case cannot
    be read or a key is unknown, and with `sample` also for other faults of the case; RunError if `out` is in use.
    """
    if jobs < 1:
        raise FvsolveError(f"jobs = {jobs} is out of range; expected 1 or more")
    base = dict(set or {})
    raw = case.raw if isinstance(case, Case) else read_raw(find_source(case)).table
    runs = planned_values(case, raw, base, vary or {}, points, sample, seed)
    refuse_unknown(case, {**base, **runs[0]}, raw)
    folder = None if out is None else Path(out)
    with ResultCache(folder) as cache:
        return SweepRun(case, raw, base, runs, cache, progress).run(folder, jobs, dask)


def planned_values(
    source: Any, raw: dict, base: dict, vary: Mapping, points, sample: str | None, seed: int
) -> list[dict]:
    """Values of every run, key -> value, from points, a sample or a grid.

    source : case as for `load`; raw : its nested dicts; base : overrides of all runs; other arguments as for `sweep`
    Raises FvsolveError if no key varies, and for unsuitable arguments.
    """
    if points is not None:
        if vary or sample:
            raise FvsolveError(
                "`points` has all values of every run; expected no `vary` and no `sample` in addition"
            )
        in_file = PATH.accepts(points)
        runs = (
            points_from_file(Path(points), source, raw)
            if in_file
            else [dict(point) for point in points]
        )
        if not runs or not runs[0] or any(point.keys() != runs[0].keys() for point in runs):
            raise FvsolveError(
                "`points` is empty or has different keys; expected one or more keys, equal in every run"
            )
        return runs
    if sample is not None:
        if not vary:
            raise FvsolveError(
                "no key varies; give at least one key and its range: links.main.length=900,1000"
            )
        return sample_points(load(source, base), vary, sample, seed)
    if not vary or all(len(values) < 2 for values in vary.values()):
        raise FvsolveError(
            "no key varies; give at least two values of a key, for example links.main.cells=100,200"
        )
    empty = [key for key, values in vary.items() if not len(values)]
    if empty:
        raise FvsolveError(f"{', '.join(empty)}: no values; expected at least one value")
    return grid(vary)


class SweepRun:
    """Sweep in progress: values of all runs, finished rows and the cache of earlier rows.

    source : case as for `load`; raw : its nested dicts; base : overrides of all runs; runs : values of every run
    """

    def __init__(
        self, source, raw: dict, base: dict, runs: list[dict], cache: ResultCache, progress
    ) -> None:
        self.runs, self.cache, self.progress = (
            runs,
            cache,
            progress or (lambda done, total, text: None),
        )
        self.source, self.base, self.folder = source, base, folder_of(source)
        self.rows: dict[int, dict] = {}
        self.digests: dict[str, str] = {}  # name of a file -> hash of its content
        relevant = {key: value for key, value in raw.items() if key not in TEXT_KEYS}
        versions_used = program_versions() | {"numba": "", "coolprop": coolprop_version()}
        files = [*self.files((relevant, base))]
        self.identity = digest_of({**versions_used, "case": relevant, "base": base, "files": files})

    def run(self, folder: Path | None, jobs: int, dask: str | None) -> Sweep:
        """Compute all rows; files are written if there is a folder, also after an interruption."""
        self.began = time.perf_counter()
        try:
            self.fill(jobs, dask)
        except BaseException:
            with suppress(RunError):  # a failure to write must not hide the original exception
                self.write(folder)
            raise
        return self.write(folder)

    def fill(self, jobs: int, dask: str | None) -> None:
        """Read the rows of earlier sweeps, then run the remaining ones."""
        identities = [
            {"who": self.identity, "set": values, "files": [*self.files(values)]}
            for values in self.runs
        ]
        keys = [digest_of(identity) for identity in identities]
        for index, key in enumerate(keys):
            if (earlier := self.cache.lookup(key)) is not None:
                self.rows[index] = self.runs[index] | earlier
        waiting = [index for index in range(len(keys)) if index not in self.rows]
        self.report_progress(waiting[:1])
        tasks = [self.runs[index] for index in waiting]
        with TaskPool(BatchedRows(RowMaker(self.source, self.base)), jobs, dask) as pool:
            for number, row in pool.run(tasks):
                index = waiting[number]
                self.rows[index] = self.runs[index] | self.cache.store(
                    keys[index], ROW_VERSION, row
                )
                self.report_progress([index + 1] if index + 1 < len(keys) else [])

    def write(self, folder: Path | None) -> Sweep:
        """Collect the rows so far in a `Sweep`, and write them to the folder if there is one.

        Raises FvsolveError if all runs are refused for the same reason.
        """
        result = Sweep(
            tuple(self.runs[0]),
            [self.rows[index] for index in sorted(self.rows)],
            self.cache.reused,
        )
        refused = {
            row["reason"] if row["reason"].startswith(REFUSED) else "" for row in result.rows
        }
        if len(result.rows) == len(self.runs) and len(refused) == 1 and "" not in refused:
            raise FvsolveError(f"all {len(self.runs)} runs are {refused.pop()}")
        if folder is not None and result.rows:
            result.write(folder / "sweep.csv")
            result.write_parquet(folder / "sweep.parquet")
        return result

    def report_progress(self, coming: list[int]) -> None:
        """Report finished rows, the estimated remaining time and the next values; coming : indices of the next runs."""
        own, remaining = len(self.rows) - self.cache.reused, len(self.runs) - len(self.rows)
        spent = time.perf_counter() - self.began
        text = f"{duration_text(spent / own * remaining)} left, " if own and remaining else ""
        for index in coming:
            text += ", ".join(
                f"{key} = {as_option_text(value)}" for key, value in self.runs[index].items()
            )
        self.progress(len(self.rows), len(self.runs), text)

    def files(self, values: Any) -> Iterator[str]:
        """Hashes of the contents of all files whose names occur in nested dicts and lists of values."""
        inner = values.values() if isinstance(values, Mapping) else values
        for value in inner if isinstance(values, (Mapping, list, tuple)) else ():
            if isinstance(value, str):
                yield from self.digest(value)
            else:
                yield from self.files(value)

    def digest(self, name: str) -> list[str]:
        if name not in self.digests:
            path = self.folder / name
            try:
                self.digests[name] = (
                    hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
                )
            except (OSError, ValueError):
                self.digests[name] = ""
        return [self.digests[name]] if self.digests[name] else []


def folder_of(source) -> Path:
    """Folder to which the paths of files in a case are relative; source : as for `load`."""
    if isinstance(source, Case):
        return source.folder or Path.cwd()
    source = find_source(source)
    return Path.cwd() if isinstance(source, Mapping) else Path(source).parent


def duration_text(seconds: float) -> str:
    """Text of a duration [s] in s, min or h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def as_option_text(value: Any) -> str:
    """Text of a value in the format of `--set`: TOML, with quotes around words only if necessary."""
    import tomllib

    if not isinstance(value, str) or value != value.strip() or {*value} & {*",[]{}\"'\n"}:
        return inline(value)
    try:
        tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return value or inline(value)
    return inline(value)
