"""All machine code that runs may ask for, compiled ahead by several processes. Knows what is compiled; runs no case.

What is kept, code and fluid properties, lies in the cache folder, which may be copied to machines of the same kind.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fvsolve import jit, store
from fvsolve.draw.beside import processors
from fvsolve.errors import FvsolveError, RunError
from fvsolve.run.crew import Crew

LINEAR = ("dense", "banded", "sparse")  # kinds of `steppers.structure`
STEPS = ("explicit", "damped", "diagonal", "full", "linear")  # kinds of methods


@dataclass(frozen=True)
class Warmed:
    """What is there now: the folder of this machine's code, what machine that is, and how much.

    compiled : functions that were not there before; functions, bytes : of all that are kept
    """

    directory: str
    target: str
    compiled: int
    functions: int
    bytes: int
    seconds: float


def warm(
    cases: Sequence[Path], whole: bool, jobs: int | None = None,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Warmed:  # fmt: skip
    """Compile what these cases ask for, and with `whole` all kinds of steps too, `jobs` at a time.

    progress(done, total, what) is called as they are done. Raises CaseError, FvsolveError.
    """
    folder, began = _folder(), time.perf_counter()
    before = kept(folder)
    tasks = (
        [("steps", "")]
        + [("attempt", kind) for kind in STEPS if whole]
        + [("algebra", kind) for kind in LINEAR if whole]
    )
    _all(tasks, jobs or processors(), lambda done, what: progress(done, len(tasks) + len(cases), what))
    found = [("case", str(path)) for path in cases]
    _all(found, jobs or processors(), lambda done, what: progress(len(tasks) + done, len(tasks) + len(cases), what))
    after = kept(folder)
    return Warmed(
        str(folder), store.target()["name"], len(after.keys() - before.keys()), len(after), sum(after.values()),
        time.perf_counter() - began,
    )  # fmt: skip


def _folder() -> Path:
    """Where code is kept; FvsolveError where none can be, or not where it was asked for."""
    if not jit.COMPILING:
        raise FvsolveError("NUMBA_DISABLE_JIT is set, so nothing is compiled; wanted it unset")
    asked, found = os.environ.get("FVSOLVE_CACHE"), jit.cache_folder()
    if asked and Path(asked).expanduser().absolute() != found:
        raise FvsolveError(f"FVSOLVE_CACHE = {asked}: cannot be written; wanted a folder with room for compiled code")
    return jit.code_folder()


def kept(folder: Path) -> dict[str, int]:
    """Files of machine code and their sizes [bytes]."""
    return {str(path): path.stat().st_size for path in folder.rglob(f"*{store.SUFFIX}")}


def _all(tasks: list[tuple[str, str]], jobs: int, progress: Callable[[int, str], None]) -> None:
    """Do tasks, each in some process; those that take longest stand first."""
    crew, given = Crew(do, min(jobs, len(tasks))), 0
    progress(0, "compiling")
    try:
        for count in range(len(tasks)):
            while given < len(tasks) and given - count < crew.room:
                crew.give(given, [tasks[given]])
                given += 1
            at, answers, _ = crew.take()
            kind, name = tasks[at]
            if answers is None:
                raise RunError(f"the process that compiled {kind} {name} has ended; was memory too small?")
            progress(count + 1, Path(name).stem if kind == "case" else f"{kind} {name}".strip())
    finally:
        crew.close()


def do(task: tuple[str, str]) -> None:
    """Compile what a task names, in this process."""
    kind, name = task
    TASKS[kind](name)


def steps(_: str) -> None:
    """The time loop and what stands in for linear algebra."""
    from fvsolve.steppers.march import compiled, compiled_attempt
    from fvsolve.steppers.signatures import no_algebra

    compiled(), compiled_attempt(), no_algebra()


def attempt(kind: str) -> None:
    """The step of a kind of methods."""
    from fvsolve.steppers.stepper import attempt_of

    attempt_of(kind)


def algebra(kind: str) -> None:
    """Factors and solutions of a kind, for real and complex shifts."""
    from fvsolve.steppers.structure import functions

    for complex in (False, True):
        functions(kind, complex)


def case(path: str) -> None:
    """What a case asks for: its start, its checks, its first steps, its energies."""
    from fvsolve.output.memory import MemorySink
    from fvsolve.run import model_of
    from fvsolve.solve import initial_state, solve

    def enough(t: float, seconds: float, steps: int) -> None:
        raise KeyboardInterrupt

    model = model_of(path)
    _ = model.checks, model.functions.energies
    sink, state = MemorySink(model), initial_state(model)
    sink.begin(model, state)
    solve(model, state, sink, enough)


TASKS = {"steps": steps, "attempt": attempt, "algebra": algebra, "case": case}
