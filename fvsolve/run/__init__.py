"""The public `run()`: case in, result out, files and pictures where asked. Knows no physics."""

from __future__ import annotations

import contextlib
import os
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from fvsolve.doors import CALL, FLAG, PATH, TABLE, door
from fvsolve.errors import CaseError, RunError
from fvsolve.output.directory import RunDirectory, pictures, read_directory
from fvsolve.output.memory import MemorySink
from fvsolve.output.restart import identity
from fvsolve.output.summary import described, write_summary
from fvsolve.run.claims import claims
from fvsolve.run.result import Result

__all__ = ["Result", "open_run", "run"]


@door(set=TABLE, out=PATH, force=FLAG, resume=FLAG, progress=CALL)
def run(
    case,
    set: Mapping | None = None,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    progress: Callable[[float, float, int], None] | None = None,
) -> Result:
    """Solve a case from its start to its end and hand back what it has to show.

    `case` is a path, a dict shaped like the file, a `Case` or a `Model`; `set` overrides keys, for example
    `{"links.main.cells": 400}`. With `out` a run directory is written (docs/results.md); an earlier run in
    it is only replaced with `force`, and goes on from its last checkpoint with `resume`.
    `progress(t, seconds, steps)` is called about ten times a second; KeyboardInterrupt raised there ends the
    run cleanly. A run that stops early still returns, `ok` False and its `reason` said.
    Raises CaseError, FluidError, RunError.
    """
    begun = time.perf_counter()
    model = model_of(case, set)
    if out is None:
        if resume:
            raise RunError("a run goes on in its directory: state it with out=")
        sink = MemorySink(model)
    else:
        sink = RunDirectory(Path(out), model, force, resume)
    try:
        result = open_run(out) if sink.ended else _result(model, _solve(model, sink, progress), sink, begun)
        if sink.folder is not None:
            _draw(result)
        return result
    finally:
        sink.close()


@door(directory=PATH)
def open_run(directory: str | Path) -> Result:
    """Read a run directory back; RunError where it holds no run that ended."""
    return Result(*read_directory(Path(directory)))


def model_of(case, set: Mapping | None = None):
    """The model of what `run` takes; what cannot start is a fault with its line, as what cannot be read is."""
    from fvsolve.case import load, located
    from fvsolve.model import Model, build

    if not isinstance(case, Model):
        case = load(case, dict(set or {}))
        try:
            return build(case)
        except CaseError as error:
            raise located(error, case) from None
        except MemoryError:
            raise RunError(f"{case.name}: memory is too small for its model; wanted fewer cells") from None
    if set:
        raise RunError("a Model is made and cannot be overridden; give set= together with the case")
    return case


def _solve(model, sink, progress):
    from fvsolve.model import State
    from fvsolve.solve import initial_state, solve
    from fvsolve.solve.solve import MemoryMisfit

    kept = sink.restart
    state = initial_state(model) if kept is None else State(kept.t, kept.y, kept.memory)
    sink.begin(model, state)
    try:
        return solve(model, state, sink, progress)
    except MemoryMisfit as error:
        raise RunError(f"{sink.folder / 'restart.npz'}: {error}") from None


def _result(model, summary, sink, begun: float) -> Result:
    said = described(summary, model)
    result = Result(said, sink.table, sink.envelope, sink.folder)
    result.case = model.case
    said |= claims(model, summary.extremes, result)
    said["versions"] = identity(model.case)
    if sink.folder is not None:
        said["files"] = sink.files()
        said["seconds_total"] = time.perf_counter() - begun
        write_summary(sink.folder / "summary.json", said)
    return result


def _draw(result: Result) -> None:
    """Write the pictures of a run directory that are not there, each whole or not at all; a warning of what fails."""
    there = pictures(result.directory)
    drawn = {"history.png": result.plot if result.probes else None,
             "envelope.png": result.plot_envelope if result.envelope else None}  # fmt: skip
    for name, draw in drawn.items():
        if name in there or draw is None:
            continue
        path, fresh = result.directory / name, result.directory / f"fresh-{name}"
        try:
            draw(fresh)
            os.replace(fresh, path)
        except Exception as error:  # whatever it is, the numbers are there
            with contextlib.suppress(OSError):
                fresh.unlink()
            warnings.warn(f"{path} could not be drawn: {type(error).__name__}: {error}", RuntimeWarning, stacklevel=3)
