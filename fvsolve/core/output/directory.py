"""Run directory: the object that writes all files of a run, and functions that lock, read and clear the directory."""

import contextlib
import shutil
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from filelock import FileLock, Timeout

from fvsolve.case.case import STEP_KEYS
from fvsolve.case.resource_checks import LEAST_TEXT, byte_text, disk_size
from fvsolve.core.assembly.features import frames_of
from fvsolve.core.output import csv_files
from fvsolve.core.output.csv_files import read_envelope, read_table
from fvsolve.core.output.fields import FieldSeries, ParallelBasinWriter
from fvsolve.core.output.restart import (
    OtherCase,
    Restart,
    changed_steps,
    identity,
    other_steps,
    read_restart,
    write_restart,
)
from fvsolve.core.output.summary_file import read_summary
from fvsolve.core.output.unit_columns import probe_columns, time_column
from fvsolve.errors import RunError, listing
from fvsolve.file_replacement import remove_unfinished, replacing, write_file
from fvsolve.units import show

LOCK_FILE = ".lock"
RUN_FILES = ("restart.npz", "history.csv", "envelope.csv", "routes.csv", "fields.pvd", "case.toml")
SUMMARY_FILE = "summary.json"
PICTURE_FILES = ("history.png", "envelope.png")
# Glob patterns of the files of greatest values, run-ups and grids
GRID_FILES = "grids/*.*"
MAXIMA_FILES, RUN_UP_FILES = "maxima-*.vtu", "run_up-*.csv"
RUN_UP_PICTURES = "run_up-*.png"
# Files of `fvsolve report` and `plot`; those of an earlier run are deleted, since they show other numbers.
REPORT_FILES = (
    "report.html",
    "report.pdf",
    "report.xlsx",
    "section.png",
    "probes.png",
    "phase.png",
)
# of `fvsolve plot` and `fvsolve view`
PICTURE_PATTERNS = ("section-*.png", "map-*.png", "view-*.png", "view-*.gif")


def lock_folder(folder: Path, writer: str) -> FileLock:
    """Create a folder if needed and lock it; return the lock.

    writer : name of another user of the folder in the message, for example "a run"
    Raises RunError if another process has locked the folder, or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(
            folder / LOCK_FILE, blocking=False, thread_local=False, fallback_to_soft=False
        )
        lock.acquire()
    except Timeout:
        raise RunError(
            f"{folder} is in use: {writer} still writes there. Wait until it ends, stop it, or choose "
            "another directory with --out DIR"
        ) from None
    except NotImplementedError:
        raise RunError(
            f"{folder} is on a file system without locks; choose another directory with --out DIR"
        ) from None
    except OSError as error:
        text = f"{folder}: cannot be written: {error.strerror or error}"
        raise RunError(f"{text}; choose another directory with --out DIR") from None
    return lock


def release(lock: FileLock) -> None:
    """Release a lock if it is held and delete its file; waiting processes then lock a new file."""
    if lock.is_locked:
        with contextlib.suppress(OSError):  # Windows cannot delete an open file
            Path(lock.lock_file).unlink()
        lock.release()


class RunDirectory:
    """Writer of the files of a run: appends to history.csv and the fields, replaces restart.npz at every checkpoint.

    The run is unfinished while summary.json is absent. Raises RunError if the directory contains another run and
    neither `force` nor `resume` is set, if its restart.npz does not fit the case, or if it cannot be locked or written.
    """

    def __init__(self, folder: Path, model, force: bool = False, resume: bool = False):
        self.folder = Path(folder)
        self.model = model
        if force and resume:
            raise RunError(
                "--resume continues a run and --force starts it again; state only one of them"
            )
        _refuse_reserved_names(model.case)
        self.identity = identity(model.case)
        self.history = csv_files.HistoryFile(
            self.folder / "history.csv",
            time_column(model.case),
            probe_columns(model),
            model.case.numerics.start_time,
        )
        drawn = (
            model.case.output.fields > 0
            and len(model.pipes) + len(model.meshed) + len(frames_of(model)) > 0
        )
        self.fields = FieldSeries(self.folder, model) if drawn else None
        self.lines = csv_files.LineSeries(self.folder, model) if model.case.output.lines else None
        if self.folder.exists() and not self.folder.is_dir():
            raise RunError(
                f"{self.folder} is a file; expected a directory; choose another directory with --out DIR"
            )
        self.lock = lock_folder(self.folder, "a run")
        try:
            self.restart = self._checkpoint() if resume else None
            self.continued = changed_steps(self.restart, model.case) if self.restart else []
            if self.restart is None and not force:
                _refuse_existing_run(self.folder)
            if self.restart is None:
                _refuse_full_disk(self.folder, model.case)
        except BaseException:
            release(self.lock)
            raise

    @property
    def ended(self) -> bool:
        """True if `resume` is set and the directory holds the finished run of this case up to numerics.end.

        Case and versions must agree with those of the run.
        """
        if self.restart is None or not (self.folder / SUMMARY_FILE).is_file():
            return False
        summary = read_summary(self.folder / SUMMARY_FILE)
        ended = (
            summary["ok"]
            and summary["versions"] == self.identity
            and summary["t"] >= self.model.case.numerics.end
        )
        if ended and (changes := other_steps(self.restart, self.model.case)):
            text = f"{self.folder} holds the finished run, so nothing can be continued with {value_text(changes)}"
            raise RunError(f"{text}; replace it with --force, or keep both runs with --out DIR")
        return ended

    def begin(self, model, state) -> None:
        """Open the files: new files, or the files of an earlier part of the run, truncated to the checkpoint.

        Deletes summary.json, pictures and reports of earlier results. Raises RunError, before anything is deleted, if
        the files do not fit the checkpoint.
        """
        restart, entries = self.restart, []
        if restart is not None:
            self.history.refuse_unfit(restart.rows, restart.history_bytes, restart.t)
            entries = self.fields.entries_until(restart.frames, restart.t) if self.fields else []
        for path in (
            self.folder / SUMMARY_FILE,
            *picture_paths(self.folder),
            *maxima_paths(self.folder),
        ):
            path.unlink(missing_ok=True)
        clear_reports(self.folder)
        for folder in (
            self.folder,
            self.folder / "fields",
            self.folder / "lines",
            self.folder / "grids",
        ):
            remove_unfinished(folder)
        if restart is None:
            clear_run_files(self.folder)
            for series in (self.history, self.fields, self.lines):
                if series:
                    series.start()
            self._write_case()
            self.checkpoint(state)
            return
        self._write_case()
        self.history.continue_from(restart.rows, restart.history_bytes)
        if self.fields:
            self.fields.continue_from(restart.frames, entries)
        if self.lines:
            self.lines.continue_from(restart.frames)

    def rows(self, t, values) -> None:
        """Append rows of probe values to history.csv. t : float64[k] [s]; values : float64[k, probes] in SI"""
        with self.report_write_errors():
            self.history.write(t, values)

    def field(self, t: float, frame: dict) -> None:
        """Write the fields of all pipes, basins and bodies at time `t` [s]; frame : result of `RunData.fields`."""
        with self.report_write_errors():
            if self.lines:
                self.lines.write(self.fields.frames, frame)
            if self.fields:
                self.fields.write(t, frame)

    def share_basin_rows(self, comm, rows: dict) -> None:
        """Let every MPI rank write the fields of its own rows of a basin; see `ParallelBasinWriter`.

        comm : MPI communicator; rows : basin -> first row of each rank, and the number of rows
        """
        if self.fields:
            self.fields.pieces = ParallelBasinWriter(comm, rows)

    def checkpoint(self, state) -> None:
        """Replace restart.npz by a checkpoint.

        It contains the state with its memory, and the numbers of rows and frames written so far.
        """
        with self.report_write_errors():
            size = self.history.flush()
            frames = self.fields.frames if self.fields else 0
            steps = self.model.case.step_keys, self.continued
            restart = Restart(
                state.t, state.y, state.memory, self.history.rows, size, frames, *steps
            )
            write_restart(self.folder / "restart.npz", restart, self.identity)

    def end(self, summary) -> None:
        """Close history.csv and write the files of extremes; the caller writes summary.json last."""
        with self.report_write_errors():
            self.history.close()
            if summary.maxima:
                from fvsolve.core.output.maxima_files import write_maxima, write_run_up

                write_maxima(self.folder, self.model, summary.maxima)
                for name, table in summary.run_ups.items():
                    write_run_up(self.folder / f"run_up-{name}.csv", table, self.model.case)
            if self.model.case.output.grids:
                from fvsolve.core.output.grid_files import write_grids

                write_grids(self.folder, self.model, summary)
            if summary.envelope:
                case = self.model.case
                envelope = csv_files.with_initial_heads(summary, self.model)
                envelope = csv_files.envelope_in_units(envelope, case)
                csv_files.write_envelope(self.folder / "envelope.csv", envelope, case)
                if case.routes:
                    csv_files.write_routes(self.folder / "routes.csv", envelope, case)

    def close(self) -> None:
        """Close open files and release the lock of the directory, also after a failed run."""
        try:
            with self.report_write_errors():
                self.history.close()
        finally:
            release(self.lock)

    @contextlib.contextmanager
    def report_write_errors(self) -> Iterator[None]:
        """Context manager that raises a RunError with the path in place of an OSError."""
        try:
            yield
        except OSError as error:
            path = error.filename or self.folder
            raise RunError(
                f"{path}: cannot be written: {error.strerror or error}. Free disk space, or "
                "correct the access rights, and continue with --resume, or choose another directory "
                "with --out DIR"
            ) from None

    def table(self):
        """Contents of history.csv : float64[rows, 1 + probes], time and probes in the units of the file."""
        return read_table(self.folder / "history.csv")

    def envelope(self) -> dict:
        """Contents of envelope.csv: pipe -> quantity -> float64[cells] in the units of the file; {} without a file."""
        path = self.folder / "envelope.csv"
        return read_envelope(path) if path.is_file() else {}

    def maxima(self) -> dict:
        """Greatest values in the cells of basins: basin -> quantity -> float64[cells] in SI; {} without files."""
        return maxima_in(self.folder)

    def files(self) -> list[str]:
        """Sorted names of the existing files of the run, with summary.json and without pictures."""
        names = [*RUN_FILES, *self.model.case.copies]
        existing = [name for name in dict.fromkeys(names) if (self.folder / name).is_file()]
        return sorted(
            [
                *existing,
                *(path.relative_to(self.folder).as_posix() for path in maxima_paths(self.folder)),
                SUMMARY_FILE,
            ]
        )

    def _checkpoint(self) -> Restart | None:
        path = self.folder / "restart.npz"
        try:
            restart = read_restart(path, self.identity) if path.is_file() else None
        except OtherCase as error:
            found = listing(_differences(self.folder / "case.toml", self.model.case), 6)
            text = (
                f"{error}{': ' if found else ''}{found}. A continued run may change end (which also changes the "
                f"default of output.every), {', '.join(STEP_KEYS)} of [numerics], title, expectations and comparisons"
            )
            raise RunError(
                f"{text}; start again with --force, or keep both runs with --out DIR"
            ) from None
        if restart and restart.y.size != self.model.y_size:
            raise RunError(
                f"{path} holds {restart.y.size} states, but the case has {self.model.y_size}; start the run "
                "again with --force"
            )
        if restart and not self.model.case.numerics.start <= restart.t:
            text = f"is at t = {restart.t:.6g} s, before numerics.start"
            raise RunError(f"{path} {text}; start the run again with --force")
        if restart and (text := count_fault(restart, self.fields is not None)):
            raise RunError(f"{path}: {text}; start the run again with --force")
        if restart and restart.t > self.model.case.numerics.end:
            raise RunError(
                f"{path} is at t = {restart.t:.6g} s, after numerics.end; start the run again with --force"
            )
        return restart

    def _write_case(self) -> None:
        case = self.model.case
        with self.report_write_errors():
            changes = "".join(f"# {change_text(change)}\n" for change in self.continued)
            write_file(self.folder / "case.toml", changes + case.resolved())
        for name, path in case.copies.items():
            copy = self.folder / name
            if copy.resolve() != Path(path).resolve():
                with replacing(copy) as fresh:
                    shutil.copyfile(path, fresh)


def count_fault(restart: Restart, has_frames: bool) -> str:
    """Text if the counts of a checkpoint contradict its record of the steps; "" if they agree or there is no record.

    has_frames : True if the run writes frames
    """
    record = restart.memory.get("state")
    if (
        record is None
        or record.size != 1
        or not {"next_output", "next_field"} <= {*(record.dtype.names or ())}
    ):
        return ""
    due = record.reshape(-1)[0]
    if not restart.rows >= due["next_output"]:  # each output has a row, a jump has more
        return f"{restart.rows} rows of history.csv; expected at least {due['next_output']:g}"
    if has_frames and restart.frames != due["next_field"]:
        return f"{restart.frames} frames of fields; expected {due['next_field']:g}"
    return ""


def change_text(change: dict) -> str:
    """Text of a change of keys in a continued run, an item of `changed_steps`."""
    return f"from t = {change['t']:.9g} s on: {value_text(change['keys'])}"


def value_text(changes: dict[str, list]) -> str:
    """Text of keys with their values before and after a change."""
    texts = {
        key: [show(x) if x is not None else "not stated" for x in values]
        for key, values in changes.items()
    }
    return ", ".join(
        f"{key} = {after} (before: {before})" for key, (before, after) in texts.items()
    )


def _differences(path: Path, case) -> list[str]:
    """Texts of keys that differ between a file case.toml and a case; empty if the file cannot be read."""
    try:
        tables = [
            tomllib.loads(text) for text in (path.read_text(encoding="utf-8"), case.resolved())
        ]
    except (OSError, ValueError):
        return []
    before, after = (dict(_leaves(table)) for table in tables)
    keys = [key for key in before | after if before.get(key) != after.get(key)]
    keys = [
        key
        for key in keys
        if key.partition(".")[0] not in case.report_keys and key != "numerics.end"
    ]
    return [
        f"{key} {show(before.get(key, 'not stated'))} (now {show(after.get(key, 'not stated'))})"
        for key in keys
    ]


def _leaves(table: dict, head: str = "") -> Iterator[tuple[str, object]]:
    for key, value in table.items():
        yield from (
            _leaves(value, f"{head}{key}.")
            if isinstance(value, dict)
            else [(f"{head}{key}", value)]
        )


def read_directory(folder: Path) -> tuple:
    """Read a finished run: summary, functions for history.csv and envelope.csv, folder, and function for maxima.

    The functions read the files when called. Raises RunError if the folder contains no finished run.
    """
    summary = read_summary(folder / SUMMARY_FILE)
    envelope = folder / "envelope.csv"
    read = (lambda: read_envelope(envelope)) if envelope.name in summary["files"] else dict
    return (
        summary,
        lambda: read_table(folder / "history.csv"),
        read,
        folder,
        lambda: maxima_in(folder),
    )


def clear_run_files(folder: Path) -> None:
    """Delete the files of an earlier run in `folder`; other files stay."""
    for path in (
        *(folder / name for name in (SUMMARY_FILE, *RUN_FILES)),
        *picture_paths(folder),
        *maxima_paths(folder),
    ):
        path.unlink(missing_ok=True)
    for path in (folder / "fields").glob("*.*vtu"):
        path.unlink()
    csv_files.clear_lines(folder)


def clear_reports(folder: Path) -> None:
    """Delete the report, the workbook and the pictures of earlier results in `folder`."""
    drawn = [path for name in PICTURE_PATTERNS for path in folder.glob(name)]
    for path in [*(folder / name for name in REPORT_FILES), *drawn]:
        path.unlink(missing_ok=True)


def _refuse_reserved_names(case) -> None:
    for name, path in case.copies.items():
        patterns = MAXIMA_FILES, RUN_UP_FILES, RUN_UP_PICTURES, *PICTURE_PATTERNS
        reserved = name in (SUMMARY_FILE, *RUN_FILES, *PICTURE_FILES, *REPORT_FILES)
        if reserved or any(fnmatch(name, pattern) for pattern in patterns):
            text = f"{path} has the name of a file that a run writes ({name})"
            raise RunError(f"{text}; rename your file, and correct the case")


def _refuse_full_disk(folder: Path, case) -> None:
    least, free = disk_size(case, LEAST_TEXT, 0), shutil.disk_usage(folder).free
    if least > free:
        text = f"{folder}: history.csv needs at least {byte_text(least)}, but {byte_text(free)} are free"
        raise RunError(
            f"{text}; expected a longer interval `output.every`, or another directory with --out DIR"
        )


def picture_paths(folder: Path) -> list[Path]:
    """Paths of the pictures of a run in its directory; the first two may be missing."""
    return [*(folder / name for name in PICTURE_FILES), *sorted(folder.glob(RUN_UP_PICTURES))]


def maxima_in(folder: Path) -> dict:
    """Greatest values in the cells of basins in a run directory: basin -> quantity -> float64[cells] in SI."""
    paths = sorted(folder.glob(MAXIMA_FILES))
    if not paths:
        return {}
    from fvsolve.core.output.maxima_files import read_maxima

    return read_maxima(paths)


def maxima_paths(folder: Path) -> list[Path]:
    """Paths of the existing files of greatest values in basins, run-ups and grids, in a run directory."""
    return sorted(
        [*folder.glob(MAXIMA_FILES), *folder.glob(RUN_UP_FILES), *folder.glob(GRID_FILES)]
    )


def existing_pictures(folder: Path) -> list[str]:
    """Names of the existing pictures of a run directory."""
    return [path.name for path in picture_paths(folder) if path.is_file()]


def _refuse_existing_run(folder: Path) -> None:
    if (folder / SUMMARY_FILE).exists():
        raise RunError(
            f"{folder} holds a run; replace it with --force, or keep it and choose another --out DIR"
        )
    if (folder / "restart.npz").exists():
        text = f"{folder} holds an unfinished run; continue it with --resume, start it again with --force"
        raise RunError(f"{text}, or choose another directory with --out DIR")
