"""The sink that writes a run directory. Knows when which file is written; knows no physics."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from fvsolve.case.size import LEAST_TEXT, on_disk, size
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
# Of `fvsolve report` and `plot`: another run's must not stand beside this one's numbers.
REPORTS = ("report.html", "report.xlsx", "section.png", "probes.png", "phase.png")
DRAWN = ("section-*.png", "view-*.png", "view-*.gif")  # the last two of `fvsolve view`


class RunDirectory:
    """Sink of a run: history.csv and fields are streamed, restart.npz is replaced at every checkpoint.

    While summary.json is absent the run is unfinished. RunError where the directory holds something that
    must not be lost, or a restart that does not fit.
    """

    def __init__(self, folder: Path, model, force: bool = False, resume: bool = False):
        self.folder = Path(folder)
        self.model = model
        if force and resume:
            raise RunError("--resume goes on with a run and --force starts it again; state one of them")
        _refuse_names(model.case)
        self.who = identity(model.case)
        self.history = HistoryFile(self.folder / "history.csv", time_column(model.case), probe_columns(model))
        drawn = model.case.output.fields > 0 and len(model.pipes) + len(model.basins) + len(model.body_names) > 0
        self.fields = FieldSeries(self.folder, model) if drawn else None
        self.lines = LineSeries(self.folder, model) if model.case.output.lines else None
        if self.folder.exists() and not self.folder.is_dir():
            raise RunError(f"{self.folder} is a file; state another place with --out DIR")
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
        """True where there is nothing to go on with: this very run in the directory came to its end."""
        if self.restart is None or not (self.folder / ENDED).is_file():
            return False
        said = read_summary(self.folder / ENDED)
        return said["ok"] and said["versions"] == self.who and said["t"] >= self.model.case.numerics.end

    def begin(self, model, state) -> None:
        """Open the files: empty ones, or those of the checkpoint cut to where it was made."""
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
        """Write a frame of all pipes and basins at time `t` [s]."""
        with self.writing():
            if self.lines:
                self.lines.write(self.fields.frames, frame)
            if self.fields:
                self.fields.write(t, frame)

    def among(self, comm, rows: dict) -> None:
        """Let ranks write frames of basins together, each its rows; see `pieces.Shares`."""
        if self.fields:
            self.fields.pieces = Shares(comm, rows)

    def checkpoint(self, state, extra: dict) -> None:
        """Replace restart.npz by one that knows this state and all rows and frames so far."""
        with self.writing():
            size = self.history.flush()
            frames = self.fields.frames if self.fields else 0
            restart = Restart(state.t, state.y, state.memory, extra, self.history.rows, size, frames)
            write_restart(self.folder / "restart.npz", restart, self.who)

    def end(self, summary) -> None:
        """Close the history and write the envelope; summary.json is the caller's last word."""
        with self.writing():
            self.history.close()
            if summary.envelope:
                case = self.model.case
                envelope = in_units(with_start(summary, self.model), case)
                write_envelope(self.folder / "envelope.csv", envelope, case)
                if case.routes:
                    write_routes(self.folder / "routes.csv", envelope, case)

    def close(self) -> None:
        """Let go of open files and of the directory, also when a run broke off."""
        try:
            with self.writing():
                self.history.close()
        finally:
            let_go(self.lock)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """What cannot be written is told with its place: RunError."""
        try:
            yield
        except OSError as error:
            place = error.filename or self.folder
            raise RunError(f"{place}: cannot be written: {error.strerror or error}; make room and go on with --resume, "
                           "or state another place with --out DIR") from None  # fmt: skip

    def table(self):
        """`float64[rows, 1 + probes]`: time and probes as history.csv has them."""
        return read_table(self.folder / "history.csv")

    def envelope(self) -> dict:
        """Pipe -> quantity -> float64[cells] as envelope.csv has them, empty where there is none."""
        path = self.folder / "envelope.csv"
        return read_envelope(path) if path.is_file() else {}

    def files(self) -> list[str]:
        """Names of the files that a reader will look for, as far as they are there; pictures come after them."""
        names = [*OWN, *self.model.case.copies]
        there = [name for name in dict.fromkeys(names) if (self.folder / name).is_file()]
        return sorted([*there, ENDED])

    def _checkpoint(self) -> Restart | None:
        path = self.folder / "restart.npz"
        found = read_restart(path, self.who) if path.is_file() else None
        if found and found.y.size != self.model.y_size:
            raise RunError(f"{path} holds {found.y.size} states, and the case has {self.model.y_size}; start the run "
                           "again with --force")  # fmt: skip
        if found and found.t > self.model.case.numerics.end:
            raise RunError(f"{path} is at t = {found.t:.6g} s, after numerics.end; start again with --force")
        return found

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
    """(summary, table(), envelope(), folder) of a run that ended; RunError where there is none."""
    said = read_summary(folder / ENDED)
    return (
        said,
        lambda: read_table(folder / "history.csv"),
        lambda: read_envelope(folder / "envelope.csv") if "envelope.csv" in said["files"] else {},
        folder,
    )


def clear(folder: Path) -> None:
    """Delete what an earlier run left in `folder`, and nothing else."""
    for name in (ENDED, *OWN, *PICTURES):
        (folder / name).unlink(missing_ok=True)
    for path in (folder / "fields").glob("*.*vtu"):
        path.unlink()
    clear_lines(folder)


def clear_reports(folder: Path) -> None:
    """Delete the page, the workbook and the pictures that were made of earlier results in `folder`."""
    drawn = [path for name in DRAWN for path in folder.glob(name)]
    for path in [*(folder / name for name in REPORTS), *drawn]:
        path.unlink(missing_ok=True)


def _refuse_names(case) -> None:
    for name, path in case.copies.items():
        if name in (ENDED, *OWN, *PICTURES, *REPORTS):
            raise RunError(f"{path} has the name of a file that every run writes; give it another name")


def _refuse_size(folder: Path, case) -> None:
    least, free = on_disk(case, LEAST_TEXT, 0), shutil.disk_usage(folder).free
    if least > free:
        raise RunError(f"{folder}: history.csv would take {size(least)} at least, and {size(free)} are free; wanted a "
                       "longer [output] every, or another place with --out DIR")  # fmt: skip


def pictures_there(folder: Path) -> list[str]:
    """Names of the pictures that are there."""
    return [name for name in PICTURES if (folder / name).is_file()]


def _refuse(folder: Path) -> None:
    if (folder / ENDED).exists():
        raise RunError(f"{folder} holds a run; replace it with --force, or keep it and state --out DIR")
    if (folder / "restart.npz").exists():
        raise RunError(
            f"{folder} holds an unfinished run; go on with --resume, start again with --force, "
            "or state another place with --out DIR"
        )
