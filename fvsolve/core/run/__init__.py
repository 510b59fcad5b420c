"""Public `run()` and `open_run()`: from a case to its result, files and pictures."""

import contextlib
import time
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fvsolve.argument_checks import COUNT_FROM_ONE, FLAG, FUNCTION, PATH, TABLE, validated
from fvsolve.core.output.directory import (
    RunDirectory,
    change_text,
    existing_pictures,
    read_directory,
)
from fvsolve.core.output.restart import identity
from fvsolve.core.output.summary_file import summary_data, write_summary
from fvsolve.core.run import mpi_run
from fvsolve.core.run.result import Result
from fvsolve.core.run.verdicts import claims
from fvsolve.errors import CaseError, Notice, RunError
from fvsolve.report.draw.plot_process import Picture, PlotProcess

if TYPE_CHECKING:
    from fvsolve.case import Case
    from fvsolve.core.model import Model

__all__ = ["Result", "open_run", "run"]


@validated(
    set=TABLE,
    out=PATH,
    force=FLAG,
    resume=FLAG,
    progress=FUNCTION,
    threads=COUNT_FROM_ONE,
    pictures=FLAG,
)
def run(
    case: "str | Path | Mapping[str, Any] | Case | Model",
    set: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    progress: Callable[[float, float, int], None] | None = None,
    threads: int = 1,
    pictures: bool = True,
) -> Result:
    """Solve a case from its start to its end and return its result.

    `case` is a path, a dict shaped like the file, a `Case` or a `Model`; `set` overrides keys, for example
    `{"links.main.cells": 400}`. With `out` a run directory is written (docs/results.md). An earlier run in it is
    replaced with `force` only, and continued from its last checkpoint with `resume`; `pictures` are drawn there.
    With `threads` above 1, rows of basins are distributed over threads, with identical results (docs/command-line.md).
    `progress(t, seconds, steps)` is called about ten times a second; a KeyboardInterrupt raised in it ends the run in
    order. A run that stops early also returns a result, with `ok` False and its `reason`.
    Under MPI rank 0 does all this; the other ranks take part in the computation and return None.
    Raises CaseError, FluidError, RunError.
    """
    begun, comm = time.perf_counter(), mpi_run.world()
    if mpi_run.is_other_rank():
        mpi_run.serve_rank(lambda: model_of(case, set))
        return None
    with mpi_run.rank_zero_first(comm):
        model = model_of(case, set)
    with contextlib.closing(sink_of(model, out, force, resume, threads)) as sink:
        result = solved(model, sink, progress, threads, begun)
        if pictures:
            draw(result, PlotProcess(second_process=False))
        return result


@validated(directory=PATH)
def open_run(directory: str | Path) -> Result:
    """Read the result of a run from its run directory.

    Raises RunError if the run is not finished, was written by another version of fvsolve, or has damaged files.
    """
    return Result(*read_directory(Path(directory)))


def model_of(case, set: Mapping | None = None, like=None):
    """Model for the `case` argument of `run`; faults found in the initial state have the line numbers of the file.

    like : earlier model or None; its arrays are reused where the case is the same (`model.build.build_like`)
    """
    from fvsolve.case import Case, load, locate_faults
    from fvsolve.core.model import Model
    from fvsolve.core.model.build import build_like

    if not isinstance(case, Model):
        if set or not isinstance(case, Case):
            case = load(case, dict(set or {}))
        try:
            return build_like(case, like)
        except CaseError as error:
            raise locate_faults(error, case) from None
        except MemoryError:
            raise RunError(
                f"{case.name}: memory is too small for its model; expected fewer cells"
            ) from None
    if set:
        raise RunError(
            "keys of a Model cannot be overridden; give the argument `set` together with a case"
        )
    return case


def sink_of(model, out: str | Path | None, force: bool, resume: bool, threads: int = 1):
    """Object that stores the output of a run: in memory, or in a run directory, which is locked until it is closed.

    A run directory is followed by the sinks that the case names.
    out : run directory, None for memory; force, resume : as for `RunDirectory`. Raises RunError for `threads` above 1
    under MPI, and for `resume` without `out`.
    """
    with mpi_run.rank_zero_first(comm := mpi_run.world()):
        if comm is not None and threads > 1:
            text = f"threads = {threads}: under MPI each of the {comm.size} ranks is one thread"
            raise RunError(f"{text}; leave out `threads`")
        if out is not None:
            return with_sinks(
                model.case.output.sinks, lambda: RunDirectory(Path(out), model, force, resume)
            )
        if resume:
            raise RunError("resume needs the run directory; give it as the argument `out`")
        from fvsolve.core.output.memory_sink import MemorySink  # most runs have a run directory

        return MemorySink(model)


def with_sinks(names: tuple[str, ...], make_directory: Callable[[], RunDirectory]):
    """Run directory, followed by the sinks with these names, which are read before the directory is locked."""
    if not names:
        return make_directory()
    from fvsolve.core.output.several_sinks import SeveralSinks, read_sinks

    sinks = read_sinks(names)
    return SeveralSinks(make_directory(), sinks)


def solved(model, sink, progress=None, threads: int = 1, begun: float | None = None) -> Result:
    """Run a model and return its result; all files are written except pictures.

    sink : result of `sink_of`; if it holds a finished run, this run is read instead
    begun : time.perf_counter() at the start of the command, for the total time; None for now
    """
    begun, comm = time.perf_counter() if begun is None else begun, mpi_run.world()
    if not sink.ended:
        return _result(model, _solve(model, sink, progress, threads, comm), sink, begun)
    if comm is not None:
        comm.bcast(None)
    return open_run(sink.folder)


def draw(result: Result, painter: PlotProcess) -> None:
    """Draw the pictures that are missing in a run directory; warns of pictures that cannot be drawn."""
    missing = None if result.directory is None else existing_pictures(result.directory)
    pictures, failed = [], {}
    requests = [
        ("history.png", "history_figure", result.history_drawn),
        ("envelope.png", "envelope_figure", result.envelope_drawn),
    ]
    requests += [
        (f"run_up-{name}.png", "run_up_figure", partial(result.run_up_drawn, name))
        for name in result.run_up
    ]
    for name, function, drawn in requests:
        if missing is None or name in missing:
            continue
        path = result.directory / name
        try:
            arguments = drawn()
        except Exception as error:  # any exception: the numbers are complete without pictures
            failed[path] = f"{type(error).__name__}: {error}"
        else:
            pictures += [Picture(path, function, arguments)] if arguments else []
    for path, reason in (failed | painter.draw(pictures)).items():
        warnings.warn(f"{path} could not be drawn: {reason}", RuntimeWarning, stacklevel=3)


def _solve(model, sink, progress, threads, comm):
    from fvsolve.core.model import State
    from fvsolve.core.solve import initial_state, solve
    from fvsolve.core.solve.solve import MemoryMismatch

    if comm is not None:
        threads, comm = comm.size, mpi_run.all_ranks_ready(comm, model)
    restart = sink.restart
    state = initial_state(model) if restart is None else State(restart.t, restart.y, restart.memory)
    sink.begin(model, state)
    if comm is not None and sink.folder is not None:
        sink.share_basin_rows(comm, mpi_run.rows_of(model, comm.size))
    try:
        return solve(model, state, sink, progress, threads, comm)
    except MemoryMismatch as error:
        raise RunError(f"{sink.folder / 'restart.npz'}: {error}") from None


def _result(model, summary, sink, begun: float) -> Result:
    facts = summary_data(summary, model)
    result = Result(facts, sink.table, sink.envelope, sink.folder, sink.maxima)
    result.case = model.case
    facts |= claims(model, summary, result)
    facts["versions"] = identity(model.case)
    facts["continued"] = list(sink.continued)
    facts["warnings"] += [
        Notice("continued", "numerics", change_text(item)).plain() for item in sink.continued
    ]
    facts["ended"] = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    if sink.folder is not None:
        facts["files"] = sink.files()
        facts["seconds_total"] = time.perf_counter() - begun
        write_summary(sink.folder / "summary.json", facts)
    return result
