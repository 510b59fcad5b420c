"""Runs under MPI: tasks of rank 0 and of the other ranks, with a check that all have the same case."""

import hashlib
import os
import signal
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache

from fvsolve.core.solve.partition import make_partition, threads_of
from fvsolve.core.solve.run_checks import RunChecks
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.errors import FvsolveError

# environment variables by which MPI launchers state the number of processes
SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "PALS_SIZE")
EXTRA = 'pip install "fvsolve[mpi]"'


@cache
def world():
    """MPI communicator of all ranks; None for a single process.

    Raises FvsolveError if mpi4py is not installed or belongs to another MPI.
    """
    count = max(int(os.environ.get(name, "1")) for name in SIZES)
    if count < 2:
        return None
    try:
        from mpi4py import MPI
    except ImportError as error:
        text = f"MPI started {count} processes, but mpi4py is not installed ({error})"
        raise FvsolveError(f"{text}; {EXTRA} installs mpi4py") from None
    if MPI.COMM_WORLD.size < 2:
        text = f"MPI started {count} processes, but the MPI of mpi4py sees each of them as a single process"
        raise FvsolveError(
            f"{text}; start them with the mpiexec of the MPI that mpi4py uses; {EXTRA} installs an MPI"
        )
    return MPI.COMM_WORLD


def is_other_rank() -> bool:
    """True if this process is an MPI rank other than 0."""
    return (comm := world()) is not None and comm.rank > 0


def digest(model) -> str:
    """Hash of a model, equal for equal models."""
    hashed = hashlib.sha256()
    for array in (*model.tables, model.start, model.scale):
        hashed.update(array.tobytes())
    return hashed.hexdigest() + repr(model.case.numerics)


@contextmanager
def rank_zero_first(comm):
    """Context manager for work of rank 0 while the other ranks wait; an exception in it ends their waiting."""
    try:
        yield
    except BaseException:
        if comm is not None:
            comm.bcast(None)
        raise


def all_ranks_ready(comm, model):
    """Communicator `comm` when all ranks have the model; None if the model cannot be divided and rank 0 runs alone.

    Rank 0 compiles before the others begin. Raises FvsolveError if a rank fails or has another case.
    """
    with rank_zero_first(comm):
        count = threads_of(model, comm.size)[0]
        RunLoop(model)
    if count == 1:
        comm.bcast(None)
        return None
    comm.bcast(digest(model))
    faults = [text for text in comm.gather("") if text]
    comm.bcast(faults)
    if faults:
        raise FvsolveError(faults[0])
    return comm


def rows_of(model, count: int) -> dict:
    """Rows of cells of each rank, for each distributed grid: name -> first row of each rank, then the number of rows.

    count : number of ranks; the values are int64[count + 1]
    """
    partition = make_partition(model, count)
    divided = zip(partition.divided, partition.firsts, strict=True)
    return {part.name: rows for part, rows in divided if part.is_grid}


def serve_rank(make: Callable) -> None:
    """Take part in a run as a rank other than 0; make : function that returns the model."""
    comm = world()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # rank 0 handles it
    expected = comm.bcast(None)
    if expected is None:
        return
    model, fault = None, ""
    try:
        model = make()
        if digest(model) != expected:
            fault = f"rank {comm.rank} has another case than rank 0; expected the same file and --set on all ranks"
    except Exception as error:
        fault = f"rank {comm.rank}: {error}"
    comm.gather(fault)
    if comm.bcast(None):
        return
    try:
        loop = RunLoop(model, comm=comm)
        loop.stepper.largest = RunChecks(loop.run_data).largest_if_needed
        loop.team.serve(*loop.functions)
    except BaseException as error:  # the other ranks wait for this rank
        from fvsolve.core.solve.parallel_bands import abort_ranks

        abort_ranks(comm, f"fvsolve: rank {comm.rank}: {type(error).__name__}: {error}")
