"""Library of validations: names, runs of their cases, and results with verdicts."""

import importlib
import math
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case import load, shipped
from fvsolve.case import text as toml
from fvsolve.case.reading import Raw, Reading, read_raw
from fvsolve.case.validation_table import (
    DIFFERENCE,
    EXACT,
    OF_ERROR,
    OF_SERIES,
    Row,
    Validation,
    read_validation,
)
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.output.unit_columns import UnitColumn
from fvsolve.core.run import model_of, solved
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.parallel import TaskPool, Work
from fvsolve.studies.resolution import refined_keys
from fvsolve.studies.validation import data_files, measures
from fvsolve.studies.validation.row_verdicts import (
    DIFFERS,
    OUTSIDE,
    VERDICTS,
    WITHIN,
    judge,
    known_values,
)

FOLDER = "validation"  # below the shipped cases
LACKING, FAULTY = "data lacking", "not run"
COARSER = 0.5  # resolution of the run from which the numerical error follows
# exit codes of the command, first one first
CODES = {FAULTY: 2, OUTSIDE: 1, LACKING: 3, DIFFERS: 0, WITHIN: 0}
PROGRAMS = {  # name in a case file -> module of this package with the function `compute`
    "ode-problems": "ode_problems",
    "epanet-networks": "epanet_networks",
    "riemann-problems": "riemann_problems",
}


@dataclass(frozen=True)
class Computed:
    """Value that a program computes for a row, with its numerical error and (code, value) of other programs beside it.

    text : further results in words; lines : as for `RowResult`
    """

    value: float
    error: float | None = None
    others: tuple[tuple[str, float], ...] = ()
    text: str = ""
    lines: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class RowResult:
    """Row of a validation with its computed value and its verdict, in SI; shown : unit in which tables show it.

    error : numerical error; coarser : value at half the resolution, None if unknown; tolerance : of the gate
    text : reason, or what is wrong; shift : shift in time [s] with which the computed series fits much better, or 0
    lines : name -> float64[n, 2], for the figure, in the unit `unit_of_lines`
    """

    row: Row
    shown: UnitColumn
    value: float
    error: float | None
    verdict: str
    tolerance: float
    text: str
    converged: float | None = None
    others: tuple[tuple[str, float], ...] = ()
    shift: float = 0.0
    coarser: float | None = None
    lines: dict[str, np.ndarray] = field(default_factory=dict)
    unit_of_lines: str = "-"

    @property
    def unit(self) -> str:
        """Unit in which the values are shown; "-" for ratios."""
        return (self.shown.span_unit if self.is_difference else self.shown.unit) or "-"

    @property
    def is_difference(self) -> bool:
        """True if the value is a difference in the unit of a probe."""
        return self.row.measure is not None and self.row.measure.function == DIFFERENCE

    def in_unit(self, value: float) -> float:
        """Convert a value of the row from SI to the unit of its tables."""
        return (
            self.shown.span_from_si(value)
            if self.is_difference
            else float(self.shown.from_si(value))
        )

    def plain(self) -> dict[str, Any]:
        """Plain data of the row."""
        row, others = self.row, [{"code": code, "value": value} for code, value in self.others]
        return {
            "what": row.what,
            "computed": row.computed,
            "value": self.value,
            "numerical_error": self.error,
            "measured": row.measured,
            "others": [*row.others, *others],
            "exact": row.exact
            if self.converged is None
            else {**(row.exact or {}), "value": self.converged},
            "gate": row.gate,
            "tolerance": self.tolerance,
            "verdict": self.verdict,
            "reason": self.text,
            "shift": self.shift,
            "because": row.because,
            "coarser": self.coarser,
        }


@dataclass(frozen=True)
class ValidationResult:
    """Result of a validation: rows, seconds of stepping, texts on data that lack, and message of a faulty case."""

    name: str
    title: str
    validation: Validation
    rows: tuple[RowResult, ...] = ()
    seconds: float = 0.0
    lacking: tuple[str, ...] = ()
    fault: str = ""

    @property
    def verdict(self) -> str:
        """Worst verdict of the rows, `LACKING`, or `FAULTY`."""
        worst = max((row.verdict for row in self.rows), key=VERDICTS.index, default=FAULTY)
        return FAULTY if self.fault else LACKING if self.lacking else worst

    def plain(self) -> dict[str, Any]:
        """Plain data of the validation."""
        about = self.validation
        return {
            "name": self.name,
            "title": self.title,
            "verdict": self.verdict,
            "source": about.source,
            "licence": about.licence,
            "get": about.get,
            "note": about.note,
            "seconds": self.seconds,
            "lacking": list(self.lacking),
            "fault": self.fault,
            "rows": [row.plain() for row in self.rows],
        }


def exit_code(results: Iterable[ValidationResult]) -> int:
    """Exit code of several validations: 2 if one is faulty, else 1 if one is outside, else 3 if data lack, else 0."""
    verdicts = {result.verdict for result in results}
    return next((code for verdict, code in CODES.items() if verdict in verdicts), 0)


def paths() -> dict[str, Path]:
    """Shipped cases with a validation : name -> path of the case file, sorted by name."""
    files = [*shipped.folder().glob("*.toml"), *(shipped.folder() / FOLDER).glob("*.toml")]
    return {
        path.stem: path
        for path in sorted(files, key=lambda path: path.stem)
        if "[validation]" in path.read_text()
    }


def find(names: Iterable[str]) -> dict[str, Path]:
    """Case files by name; all shipped ones without names. Raises FvsolveError for each unknown name."""
    known = paths()
    chosen = {}
    unknown = []
    for name in names:
        path = Path(name) if Path(name).is_file() else known.get(name)
        if path is None:
            unknown.append(f"{name}{did_you_mean(name, known)}")
        elif path.stem in chosen:
            raise FvsolveError(
                f"{chosen[path.stem]} and {path} have the same name; run each in a command of its own"
            )
        else:
            chosen[path.stem] = path
    if unknown:
        raise FvsolveError(
            f"no file and no shipped validation {', '.join(unknown)}; validations are {listing(known)}"
        )
    return chosen or known


def validate(
    names: Iterable[str] = (), data: Path | None = None, jobs: int = 1, out: Path | None = None
) -> Iterator[ValidationResult]:
    """Run validations, and yield each result when it is finished.

    names : case files, or names of shipped validations (default all); data : folder with files of measurements
    out : folder for the files of the runs, each below its name; None for none
    Raises FvsolveError for unknown names, CaseError for faults of a table [validation].
    """
    raws = {path: read_raw(path) for path in find(names).values()}
    for raw in raws.values():
        read_table(raw)  # faults before the first run
    order = sorted(raws, key=lambda path: -cell_steps(raws[path].table))  # long cases first
    with TaskPool(CaseWork(data, out), jobs) as pool:
        for _, result in pool.run(order):
            yield result


def cell_steps(table: dict[str, Any]) -> float:
    """Measure of the computing time of a case: cells times steps of its largest grid in the finest run."""
    listed = [cells for cells in values_of(table, "cells") if isinstance(cells, list)]
    grids = [math.prod(cells) for cells in listed if all(isinstance(count, int) for count in cells)]
    finer = [times for times in values_of(table, "resolution") if isinstance(times, (int, float))]
    return max(grids, default=0) ** 1.5 * max(finer, default=1.0) ** 3


def values_of(table: Any, key: str) -> Iterator[Any]:
    """Yield the values of a key in a table and in all tables below it."""
    if isinstance(table, list):
        table = dict(enumerate(table))
    for name, value in table.items() if isinstance(table, dict) else ():
        if name == key:
            yield value
        yield from values_of(value, key)


@dataclass(frozen=True)
class CaseWork(Work):
    """Task of validating one case file; data : folder of measurements; out : as for `validate`."""

    data: Path | None
    out: Path | None

    def __call__(self, path: Path) -> ValidationResult:
        return validate_file(path, self.data, self.out)

    def process_text(self, task: Path) -> str:
        return f"that validates {task.stem}"


def read_table(raw: Raw) -> Validation:
    """Table `[validation]` of a case whose parts are not read. Raises CaseError."""
    reading = Reading(raw)
    if "validation" not in raw.table:
        reading.fault(
            (), "has no table [validation]; expected source, compare and a gate for each row"
        )
    validation = read_validation(reading, None, {})
    reading.stop()
    return validation


def validate_file(
    path: Path, data: Path | None = None, out: Path | None = None
) -> ValidationResult:
    """Validate one case file; arguments as for `validate`."""
    raw = read_raw(path)
    validation, title = read_table(raw), raw.table.get("title", "")
    if lacking := data_files.missing_files(validation, data):
        return ValidationResult(path.stem, title, validation, lacking=tuple(lacking))
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) if out is None else Path(out) / path.stem
        place.mkdir(parents=True, exist_ok=True)
        try:
            data_files.prepare(validation, data, place)
            if validation.program is not None:
                rows, seconds = program_rows(validation, place), time.perf_counter() - begun
            else:
                validation, rows, seconds = scene_rows(raw, validation, place)
        except FvsolveError as error:  # the other cases go on
            return ValidationResult(path.stem, title, validation, fault=str(error))
    return ValidationResult(path.stem, title, validation, tuple(rows), seconds)


def program_rows(validation: Validation, folder: Path) -> list[RowResult]:
    """Rows of a validation whose values a program of this package computes."""
    name = validation.program
    if name not in PROGRAMS:
        raise FvsolveError(
            f"validation.program: {name} is unknown; programs are {listing(PROGRAMS)}"
        )
    found = importlib.import_module(f"fvsolve.studies.validation.{PROGRAMS[name]}").compute(
        validation, folder
    )
    rows = []
    for row in validation.compare:
        if row.computed not in found:
            near = did_you_mean(row.computed, found)
            raise FvsolveError(f"validation.compare: {name} computes no {row.computed}{near}")
        value, error, others, further, lines = astuple(found[row.computed])
        judged = judge(row, value, error, known_values(row, [number for _, number in others]))
        text = "; ".join(filter(None, (judged.text, further)))
        shown, (verdict, tolerance, _) = UnitColumn("", "number", row.unit), judged
        rows.append(
            RowResult(
                row, shown, value, error, verdict, tolerance, text, others=others, lines=lines
            )
        )
    return rows


def scene_rows(
    raw: Raw, validation: Validation, folder: Path
) -> tuple[Validation, list[RowResult], float]:
    """(validation with its measures, rows, seconds of stepping) of a scene; rows with equal overrides share runs."""
    table = data_files.completed(raw.table, validation, folder)
    raw = Raw(table, raw.name, raw.path, folder, raw.text)
    (folder / "case.toml").write_text(toml.write(table), encoding="utf-8")
    results: dict[int, RowResult] = {}
    whole = load(raw)
    groups: dict[str, list[int]] = {}
    seconds = 0.0
    for number, row in enumerate(whole.validation.compare):
        groups.setdefault(repr(row.set), []).append(number)
    for numbers in groups.values():
        runs = Runs(raw, whole.validation.compare[numbers[0]].set)
        for number in numbers:
            results[number] = scene_row(runs.own.case.validation.compare[number], runs)
        seconds += sum(
            result.summary["seconds"] for result in runs.results.values() if result is not None
        )
    return whole.validation, [results[number] for number in range(len(results))], seconds


class Runs:
    """Runs of a case at several resolutions, each made at its first use."""

    def __init__(self, raw: Raw, settings: Mapping[str, Any]) -> None:
        self.raw, self.settings, self.results = raw, dict(settings), {}
        self.own = self.at(1.0)

    def at(self, times: float) -> Any:
        """Result of a run at `times` the resolution; None if the case has no such resolution."""
        if times not in self.results:
            keys = refined_keys(self.own.case, times) if times != 1.0 else {}
            changed = bool(keys) or times == 1.0
            self.results[times] = run(load(self.raw, self.settings | keys)) if changed else None
        return self.results[times]


class FrameSink(MemorySink):
    """Receiver of a run in memory that keeps the last frame of fields."""

    takes_fields = True
    last_frame: dict[str, Any]

    def field(self, t: float, frame: dict[str, Any]) -> None:
        """Keep the fields; frame : result of `RunData.fields`"""
        self.last_frame = frame


def run(case: Any) -> Any:
    """Run a case; its result has the last frame of fields as `last_frame`. Raises FvsolveError if it stops early."""
    sink = FrameSink(model := model_of(case))
    result = solved(model, sink)
    if not result.ok:
        raise FvsolveError(f"{case.name}: the run stopped: {result.reason}")
    result.last_frame = getattr(sink, "last_frame", {})
    return result


def scene_row(row: Row, runs: Runs) -> RowResult:
    """Computed value, numerical error and verdict of a row."""
    value = measures.value_of(row, runs.own)
    finer = (row.exact or {}).get("resolution")
    other = runs.at(finer or COARSER)
    if finer and other is None:
        raise FvsolveError(
            f"{row.what}: the case has no run at {finer:g} times its resolution: its cells come from a file"
        )
    second = np.nan if other is None else measures.value_of(row, other)
    error = float(abs(value - second)) if np.isfinite(second) else None
    if (
        error is not None
        and finer is None
        and row.gate["of"] == EXACT
        and row.measure.function in OF_ERROR
    ):
        error = max(value, second)  # the value is the numerical error itself
    converged, coarser = (
        (second, None) if finer else (None, float(second) if np.isfinite(second) else None)
    )
    judged = judge(row, value, error, known_values(row, converged=converged))
    lines = measures.lines_of(row, runs.own)
    shift = 0.0
    text = judged.text
    if row.measure.function in OF_SERIES:
        shift, left = measures.best_shift(row, runs.own)
        if shift and judged.verdict != WITHIN:
            text += f"; arrival: the computed series is {abs(shift):.3g} s {'early' if shift > 0 else 'late'}"
            text += f", and differs by {left:.3g} without that"
    shown = measures.shown_in(row, runs.own.case)
    return RowResult(
        row,
        shown,
        value,
        error,
        judged.verdict,
        judged.tolerance,
        text,
        converged,
        shift=shift,
        coarser=coarser,
        lines=lines,
        unit_of_lines=measures.unit_of_lines(row, runs.own.case),
    )
