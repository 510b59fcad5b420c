"""Run directory: the sink that writes all files of a run, and functions that read and clear it."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from fvsolve.case.resource_checks import LEAST_TEXT, byte_text, disk_size
from fvsolve.errors import RunError
from fvsolve.output.column import probe_columns, time_column
from fvsolve.output.envelope import in_units, read_envelope, with_start, write_envelope
from fvsolve.output.fields import FieldSeries
from fvsolve.output.history import HistoryFile, read_table
from fvsolve.output.lines import LineSeries, clear_lines
from fvsolve.output.lock import let_go, locked
from fvsolve.output.pieces import Shares
from fvsolve.output.restart import Restart, identity, read_restart, write_restart
from fvsolve.output.routes import write_routes
from fvsolve.output.summary import read_summary

OWN = ("restart.npz", "history.csv", "envelope.csv", "routes.csv", "fields.pvd", "case.toml")
ENDED = "summary.json"
PICTURES = ("history.png", "envelope.png")
# Files of `fvsolve report` and `plot`; those of an earlier run are deleted, since they show other numbers.
REPORTS = ("report.html", "report.xlsx", "section.png", "probes.png", "phase.png")
DRAWN = ("section-*.png", "view-*.png", "view-*.gif")  # the last two of `fvsolve view`


class RunDirectory:
    """Sink of a run: streams history.csv and fields, replaces restart.npz at every checkpoint.

    The run is unfinished while summary.json is absent. Raises RunError if the directory holds another run and
    neither `force` nor `resume` is set, or if its restart.npz does not fit the case.
    """

    def __init__(self, folder: Path, model, force: bool = False, resume: bool = False):
        self.folder = Path(folder)
        self.model = model
        if force and resume:
            raise RunError("--resume continues a run and --force starts it again; state only one of them")
        _refuse_names(model.case)
        self.who = identity(model.case)
        self.history = HistoryFile(self.folder / "history.csv", time_column(model.case), probe_columns(model))
        drawn = model.case.output.fields > 0 and len(model.pipes) + len(model.basins) + len(model.body_names) > 0
        self.fields = FieldSeries(self.folder, model) if drawn else None
        self.lines = LineSeries(self.folder, model) if model.case.output.lines else None
        if self.folder.exists() and not self.folder.is_dir():
            raise RunError(f"{self.folder} is a file. Expected a directory; choose another one with --out DIR")
        self.lock = locked(self.folder, "a run")
        try:
            self.restart = self._checkpoint() if resume else None
            if self.restart is None and not force:
                _refuse(self.folder)
            if self.restart is None:
                _refuse_size(self.folder, model.case)
        except BaseException:
            let_go(self.lock)
            raise

    @property
    def ended(self) -> bool:
        """True if the directory holds the finished run of the same case and versions, up to numerics.end."""
        if self.restart is None or not (self.folder / ENDED).is_file():
            return False
        summary = read_summary(self.folder / ENDED)
        return summary["ok"] and summary["versions"] == self.who and summary["t"] >= self.model.case.numerics.end

    def begin(self, model, state) -> None:
        """Open the files: new empty ones, or those of the checkpoint, truncated to its time."""
        for name in (ENDED, *PICTURES):
            (self.folder / name).unlink(missing_ok=True)
        clear_reports(self.folder)
        if self.restart is None:
            self._start()
            self._write_case()
            self.checkpoint(state, {})
            return
        self._write_case()
        self.history.continue_from(self.restart.rows, self.restart.history_bytes)
        if self.fields:
            self.fields.continue_from(self.restart.frames)
        if self.lines:
            self.lines.continue_from(self.restart.frames)

    def rows(self, t, values) -> None:
        """Append probe rows: `t : float64[k]` [s], `values : float64[k, probes]` in SI."""
        with self.writing():
            self.history.write(t, values)

    def field(self, t: float, frame: dict) -> None:
        """Write a frame of all pipes, basins and bodies at time `t` [s]."""
        with self.writing():
            if self.lines:
                self.lines.write(self.fields.frames, frame)
            if self.fields:
                self.fields.write(t, frame)

    def among(self, comm, rows: dict) -> None:
        """Make all ranks write frames of basins in parallel, each rank its rows; see `ParallelBasinWriter`."""
        if self.fields:
            self.fields.pieces = Shares(comm, rows)

    def checkpoint(self, state, extra: dict) -> None:
        """Replace restart.npz: state, solver arrays and the number of rows and frames written so far."""
        with self.writing():
            size = self.history.flush()
            frames = self.fields.frames if self.fields else 0
            restart = Restart(state.t, state.y, state.memory, extra, self.history.rows, size, frames)
            write_restart(self.folder / "restart.npz", restart, self.who)

    def end(self, summary) -> None:
        """Close the history and write envelope.csv and routes.csv; the caller writes summary.json last."""
        with self.writing():
            self.history.close()
            if summary.envelope:
                case = self.model.case
                envelope = in_units(with_start(summary, self.model), case)
                write_envelope(self.folder / "envelope.csv", envelope, case)
                if case.routes:
                    write_routes(self.folder / "routes.csv", envelope, case)

    def close(self) -> None:
        """Close open files and release the lock of the directory, also after a failed run."""
        try:
            with self.writing():
                self.history.close()
        finally:
            let_go(self.lock)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Turn an OSError of the body into a RunError with the path."""
        try:
            yield
        except OSError as error:
            path = error.filename or self.folder
            raise RunError(f"{path}: cannot be written: {error.strerror or error}. Free disk space and continue with "
                           "--resume, or choose another directory with --out DIR") from None  # fmt: skip

    def table(self):
        """Read history.csv : float64[rows, 1 + probes], time and probes in the units of the file."""
        return read_table(self.folder / "history.csv")

    def envelope(self) -> dict:
        """Read envelope.csv: pipe -> quantity -> float64[cells] in the units of the file; {} if there is no file."""
        path = self.folder / "envelope.csv"
        return read_envelope(path) if path.is_file() else {}

    def files(self) -> list[str]:
        """Sorted names of the existing files of the run, with summary.json and without pictures."""
        names = [*OWN, *self.model.case.copies]
        existing = [name for name in dict.fromkeys(names) if (self.folder / name).is_file()]
        return sorted([*existing, ENDED])

    def _checkpoint(self) -> Restart | None:
        path = self.folder / "restart.npz"
        restart = read_restart(path, self.who) if path.is_file() else None
        if restart and restart.y.size != self.model.y_size:
            raise RunError(f"{path} holds {restart.y.size} states, but the case has {self.model.y_size}; start the run "
                           "again with --force")  # fmt: skip
        if restart and restart.t > self.model.case.numerics.end:
            raise RunError(f"{path} is at t = {restart.t:.6g} s, after numerics.end; start the run again with --force")
        return restart

    def _start(self) -> None:
        clear(self.folder)
        self.history.start()
        if self.fields:
            self.fields.start()
        if self.lines:
            self.lines.start()

    def _write_case(self) -> None:
        case = self.model.case
        with self.writing():
            (self.folder / "case.toml").write_text(case.resolved(), encoding="utf-8")
        for name, path in case.copies.items():
            copy = self.folder / name
            if copy.resolve() != Path(path).resolve():
                shutil.copyfile(path, copy)


def read_directory(folder: Path) -> tuple:
    """(summary, table(), envelope(), folder) of a finished run; raises RunError if there is none.

    `table` and `envelope` are functions: they read history.csv and envelope.csv when called.
    """
    summary = read_summary(folder / ENDED)
    return (
        summary,
        lambda: read_table(folder / "history.csv"),
        lambda: read_envelope(folder / "envelope.csv") if "envelope.csv" in summary["files"] else {},
        folder,
    )


def clear(folder: Path) -> None:
    """Delete the files of an earlier run in `folder`; other files stay."""
    for name in (ENDED, *OWN, *PICTURES):
        (folder / name).unlink(missing_ok=True)
    for path in (folder / "fields").glob("*.*vtu"):
        path.unlink()
    clear_lines(folder)


def clear_reports(folder: Path) -> None:
    """Delete the report, the workbook and the pictures of earlier results in `folder`."""
    drawn = [path for name in DRAWN for path in folder.glob(name)]
    for path in [*(folder / name for name in REPORTS), *drawn]:
        path.unlink(missing_ok=True)


def _refuse_names(case) -> None:
    for name, path in case.copies.items():
        if name in (ENDED, *OWN, *PICTURES, *REPORTS):
            raise RunError(f"{path} has the name of a file of the run directory ({name}); rename it")


def _refuse_size(folder: Path, case) -> None:
    least, free = disk_size(case, LEAST_TEXT, 0), shutil.disk_usage(folder).free
    if least > free:
        raise RunError(f"{folder}: history.csv needs at least {byte_text(least)}, but {byte_text(free)} are free. Expected a "
                       "longer [output] every, or another directory with --out DIR")  # fmt: skip


def pictures_there(folder: Path) -> list[str]:
    """Names of the existing pictures of a run directory."""
    return [name for name in PICTURES if (folder / name).is_file()]


def _refuse(folder: Path) -> None:
    if (folder / ENDED).exists():
        raise RunError(f"{folder} holds a run; replace it with --force, or keep it and choose another --out DIR")
    if (folder / "restart.npz").exists():
        raise RunError(
            f"{folder} holds an unfinished run; continue it with --resume, start it again with --force, "
            "or choose another directory with --out DIR"
        )
