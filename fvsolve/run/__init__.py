"""The public `run()`: case in, result out, files and pictures where asked. Knows no physics."""

from __future__ import annotations

import contextlib
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from fvsolve.doors import CALL, FLAG, PATH, TABLE, THREADS, door
from fvsolve.draw.beside import Painter, Picture
from fvsolve.errors import CaseError, RunError
from fvsolve.output.directory import ENDED, RunDirectory, pictures_there, read_directory
from fvsolve.output.memory import MemorySink
from fvsolve.output.restart import identity
from fvsolve.output.summary import described, write_summary
from fvsolve.run import ranks
from fvsolve.run.claims import claims
from fvsolve.run.result import Result

__all__ = ["Result", "open_run", "run"]


@door(set=TABLE, out=PATH, force=FLAG, resume=FLAG, progress=CALL, threads=THREADS, pictures=FLAG)
def run(
    case,
    set: Mapping | None = None,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    progress: Callable[[float, float, int], None] | None = None,
    threads: int = 1,
    pictures: bool = True,
) -> Result:
    """Solve a case from its start to its end and hand back what it has to show.

    `case` is a path, a dict shaped like the file, a `Case` or a `Model`; `set` overrides keys, for example
    `{"links.main.cells": 400}`. With `out` a run directory is written (docs/results.md); an earlier run in
    it is only replaced with `force`, and goes on from its last checkpoint with `resume`; `pictures` are drawn there.
    With `threads` above one, rows of basins are shared out among so many threads, to the same bits (docs/threads.md).
    `progress(t, seconds, steps)` is called about ten times a second; KeyboardInterrupt raised there ends the
    run cleanly. A run that stops early still returns, `ok` False and its `reason` said.
    Under MPI rank 0 does all this, and the others, which follow it, get None.
    Raises CaseError, FluidError, RunError.
    """
    begun, comm = time.perf_counter(), ranks.world()
    if ranks.follows():
        ranks.follow(lambda: model_of(case, set))
        return None
    with ranks.leading(comm):
        model = model_of(case, set)
    with contextlib.closing(sink_of(model, out, force, resume, threads)) as sink:
        result = solved(model, sink, progress, threads, begun)
        if pictures:
            draw(result, Painter(beside=False))
        return result


@door(directory=PATH)
def open_run(directory: str | Path) -> Result:
    """Read a run directory back; RunError where it holds no run that ended, or one of another version."""
    from fvsolve.run.complete import check

    said = read_directory(Path(directory))
    check(said[0], Path(directory) / ENDED)
    return Result(*said)


def model_of(case, set: Mapping | None = None, like=None):
    """The model of what `run` takes; what cannot start is a fault with its line, as what cannot be read is.

    like : a model, as `model.build.built` has it
    """
    from fvsolve.case import Case, load, located
    from fvsolve.model import Model
    from fvsolve.model.build import built

    if not isinstance(case, Model):
        if set or not isinstance(case, Case):
            case = load(case, dict(set or {}))
        try:
            return built(case, like)
        except CaseError as error:
            raise located(error, case) from None
        except MemoryError:
            raise RunError(f"{case.name}: memory is too small for its model; wanted fewer cells") from None
    if set:
        raise RunError("a Model is made and cannot be overridden; give set= together with the case")
    return case


def sink_of(model, out: str | Path | None, force: bool, resume: bool, threads: int = 1):
    """Where a run goes: memory, or a run directory, which is ours until it is closed."""
    with ranks.leading(comm := ranks.world()):
        if comm is not None and threads > 1:
            raise RunError(f"threads = {threads}: under MPI each of the {comm.size} ranks is one thread; leave it out")
        if out is not None:
            return RunDirectory(Path(out), model, force, resume)
        if resume:
            raise RunError("a run goes on in its directory: state it with out=")
        return MemorySink(model)


def solved(model, sink, progress=None, threads: int = 1, begun: float | None = None) -> Result:
    """What a run has to show, all of it but pictures written; `begun` as time.perf_counter() said."""
    begun, comm = time.perf_counter() if begun is None else begun, ranks.world()
    if not sink.ended:
        return _result(model, _solve(model, sink, progress, threads, comm), sink, begun)
    if comm is not None:
        comm.bcast(None)
    return open_run(sink.folder)


def draw(result: Result, painter: Painter) -> None:
    """Write the pictures of a run directory that are not there; a warning of what fails."""
    there = None if result.directory is None else pictures_there(result.directory)
    wanted, failed = [], {}
    for name, function, drawn in (("history.png", "history_figure", result.history_drawn),
                                  ("envelope.png", "envelope_figure", result.envelope_drawn)):  # fmt: skip
        if there is None or name in there:
            continue
        path = result.directory / name
        try:
            arguments = drawn()
        except Exception as error:  # whatever it is, the numbers are there
            failed[path] = f"{type(error).__name__}: {error}"
        else:
            wanted += [Picture(path, function, arguments)] if arguments else []
    for path, why in (failed | painter.draw(wanted)).items():
        warnings.warn(f"{path} could not be drawn: {why}", RuntimeWarning, stacklevel=3)


def _solve(model, sink, progress, threads, comm):
    from fvsolve.model import State
    from fvsolve.solve import initial_state, solve
    from fvsolve.solve.solve import MemoryMisfit

    if comm is not None:
        threads, comm = comm.size, ranks.gathered(comm, model)
    kept = sink.restart
    state = initial_state(model) if kept is None else State(kept.t, kept.y, kept.memory)
    sink.begin(model, state)
    if comm is not None and sink.folder is not None:
        sink.among(comm, ranks.rows_of(model, comm.size))
    try:
        return solve(model, state, sink, progress, threads, comm)
    except MemoryMisfit as error:
        raise RunError(f"{sink.folder / 'restart.npz'}: {error}") from None


def _result(model, summary, sink, begun: float) -> Result:
    said = described(summary, model)
    result = Result(said, sink.table, sink.envelope, sink.folder)
    result.case = model.case
    said |= claims(model, summary, result)
    said["versions"] = identity(model.case)
    said["ended"] = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    if sink.folder is not None:
        said["files"] = sink.files()
        said["seconds_total"] = time.perf_counter() - begun
        write_summary(sink.folder / "summary.json", said)
    return result
