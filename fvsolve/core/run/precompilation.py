"""Compilation of all machine code for later runs, by several processes.

Code and fluid properties are stored in the cache folder, which can be copied to machines of the same kind.
"""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

from fvsolve import jit
from fvsolve.compile import store
from fvsolve.compile.cache_folders import CODE_SUFFIX
from fvsolve.core.run.process_pool import ProcessPool, WorkerLost
from fvsolve.errors import FvsolveError, RunError
from fvsolve.report.draw.plot_process import processor_count

LINEAR = ("dense", "banded", "sparse")  # kinds of `steppers.structure`
STEPS = ("explicit", "damped", "diagonal", "full", "linear")  # kinds of methods


@dataclass(frozen=True)
class CacheState:
    """State of the cache of compiled code.

    directory : folder of the code for this type of machine; target : name of this type of machine
    compiled : number of functions that were added; functions, bytes : number and size of all stored functions
    seconds : duration of the compilation [s]
    """

    directory: str
    target: str
    compiled: int
    functions: int
    bytes: int
    seconds: float


def warm(
    cases: Sequence[Path],
    whole: bool,
    jobs: int | None = None,
    progress: Callable[[int, int, str], None] = lambda done, total, task: None,
) -> CacheState:
    """Compile the code that some cases need, in several processes, and return the state of the cache.

    cases : paths of case files; whole : True to compile the steps and linear algebra of all kinds of methods too
    jobs : number of processes; progress : called as progress(done, total, task) after each task
    Raises CaseError, FvsolveError, and RunError if a process is killed.
    """
    folder, began = _folder(), time.perf_counter()
    before = code_files(folder)
    tasks = [("steps", "")]
    if whole:
        tasks += [*(("attempt", kind) for kind in STEPS), *(("algebra", kind) for kind in LINEAR)]
    count, total = jobs or processor_count(), len(tasks) + len(cases)
    _all(tasks, count, lambda done, task: progress(done, total, task))
    case_tasks = [("case", str(path)) for path in cases]
    _all(case_tasks, count, lambda done, task: progress(len(tasks) + done, total, task))
    after = code_files(folder)
    return CacheState(
        str(folder),
        store.target()["name"],
        len(after.keys() - before.keys()),
        len(after),
        sum(after.values()),
        time.perf_counter() - began,
    )


def _folder() -> Path:
    """Folder of compiled code. Raises FvsolveError if nothing is compiled, or if the requested one cannot be used."""
    if not jit.COMPILING:
        raise FvsolveError("NUMBA_DISABLE_JIT is set, so nothing is compiled; unset this variable")
    requested, folder = os.environ.get("FVSOLVE_CACHE"), jit.cache_folder()
    if requested and Path(requested).expanduser().absolute() != folder:
        text = f"FVSOLVE_CACHE = {requested}: cannot be written"
        raise FvsolveError(f"{text}; expected a writable folder for compiled code")
    return jit.code_folder()


def code_files(folder: Path) -> dict[str, int]:
    """Paths of the files of compiled code in a folder, with their sizes [bytes]."""
    return {str(path): path.stat().st_size for path in folder.rglob(f"*{CODE_SUFFIX}")}


def _all(tasks: list[tuple[str, str]], jobs: int, progress: Callable[[int, str], None]) -> None:
    """Run tasks (kind, name) in up to `jobs` processes, in order; tasks that take longest should be first.

    Raises the exception of a task, and RunError if a process is killed.
    """
    pool = ProcessPool(run_task, min(jobs, len(tasks)))
    progress(0, "compiling")
    try:
        futures = {pool.submit([task]): task for task in tasks}
        for count, future in enumerate(as_completed(futures), 1):
            kind, name = futures[future]
            try:
                answers, _ = future.result()
            except WorkerLost:
                text = f"the process that compiled {kind} {name} has ended; possibly memory was too small"
                raise RunError(text) from None
            if isinstance(answers, BaseException):
                raise answers
            progress(count, Path(name).stem if kind == "case" else f"{kind} {name}".strip())
    finally:
        pool.close()


def run_task(task: tuple[str, str]) -> None:
    """Compile the code of a task (kind, name) in this process.

    Kinds of tasks: "steps", the time loop and the empty linear algebra of explicit methods; "attempt", the step of a
    kind of methods, such as "explicit"; "algebra", the linear solver of a kind, for real and for complex matrices;
    "case", the code that a case file needs.
    """
    from fvsolve.core.steppers import run_handle, structure, time_loop
    from fvsolve.core.steppers.integrator import attempt_of

    kind, name = task
    if kind == "steps":
        time_loop.compiled()
        run_handle.no_algebra()
    elif kind == "attempt":
        attempt_of(name)
    elif kind == "algebra":
        for complex in (False, True):
            structure.functions(name, complex)
    else:
        compile_case(name)


def compile_case(path: str) -> None:
    """Compile the code that a case needs: initial state, checks, first steps and energies."""
    from fvsolve.core.output.memory_sink import MemorySink
    from fvsolve.core.run import model_of
    from fvsolve.core.solve import initial_state, solve

    def stop(t: float, seconds: float, steps: int) -> None:
        raise KeyboardInterrupt

    model = model_of(path)
    _ = model.checks, model.functions.energies
    sink, state = MemorySink(model), initial_state(model)
    sink.begin(model, state)
    solve(model, state, sink, stop)
