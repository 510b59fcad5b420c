"""A run under MPI: who leads, who follows, and that all have one case. Knows processes; knows no physics."""

from __future__ import annotations

import hashlib
import os
import signal
import sys
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache

from fvsolve.errors import FvsolveError
from fvsolve.solve.bands import cut, threads_of
from fvsolve.solve.loop import Loop
from fvsolve.solve.soundness import Soundness

SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "PALS_SIZE")  # how MPI's starters say how many processes there are
EXTRA = 'pip install "fvsolve[mpi]"'


@cache
def world():
    """MPI's communicator of all ranks where there are several, None else; FvsolveError without mpi4py."""
    many = max(int(os.environ.get(name, "1")) for name in SIZES)
    if many < 2:
        return None
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise FvsolveError(
            f"MPI started {many} processes, and there is no mpi4py ({error}); {EXTRA} brings it"
        ) from None
    if MPI.COMM_WORLD.size < 2:
        text = f"MPI started {many} processes that mpi4py's own MPI takes for one each"
        raise FvsolveError(f"{text}; start them with the mpiexec of the MPI that mpi4py finds, {EXTRA} brings one")
    return MPI.COMM_WORLD


def follows() -> bool:
    """Whether this is a rank that follows another."""
    return (comm := world()) is not None and comm.rank > 0


def digest(model) -> str:
    """The same for the same model."""
    found = hashlib.sha256()
    for array in (*model.tables, model.start, model.scale):
        found.update(array.tobytes())
    numerics = model.case.numerics
    return found.hexdigest() + repr(numerics)


@contextmanager
def leading(comm):
    """What rank 0 does before all run; where it fails the others are let go."""
    try:
        yield
    except BaseException:
        if comm is not None:
            comm.bcast(None)
        raise


def gathered(comm, model):
    """The communicator, once all ranks have the model; None where rank 0 steps it alone.

    Rank 0 has compiled before the others begin. Raises FvsolveError where one cannot, or has another case.
    """
    with leading(comm):
        many = threads_of(model, comm.size)[0]
        Loop(model)
    if many == 1:
        comm.bcast(None)
        return None
    comm.bcast(digest(model))
    faults = [text for text in comm.gather("") if text]
    comm.bcast(faults)
    if faults:
        raise FvsolveError(faults[0])
    return comm


def rows_of(model, many: int) -> dict:
    """First rows of ranks, and how many there are, of the basins that they share out : name -> int64[many + 1]."""
    found = cut(model, many)
    return {model.basins[b].name: rows for b, rows in zip(found.basins, found.firsts, strict=True)}


def follow(make: Callable) -> None:
    """What a rank does that follows rank 0 through one run, of the model that `make` gives."""
    comm = world()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # rank 0 hears it
    wanted = comm.bcast(None)
    if wanted is None:
        return
    model, fault = None, ""
    try:
        model = make()
        if digest(model) != wanted:
            fault = f"rank {comm.rank} has another case than rank 0; wanted the same file and the same --set on all"
    except Exception as error:
        fault = f"rank {comm.rank}: {error}"
    comm.gather(fault)
    if comm.bcast(None):
        return
    try:
        loop = Loop(model, comm=comm)
        loop.stepper.largest = Soundness(loop.slate).watched
        loop.team.serve(*loop.functions)
    except BaseException as error:  # the others wait for this one
        print(f"fvsolve: rank {comm.rank}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        comm.Abort(1)
