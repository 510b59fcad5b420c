"""Parallel computation of tasks in chunks of about a second: in this process, other processes or on Dask workers.

The result of a task must not depend on the process, the order or the other tasks of its chunk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from fvsolve.errors import FvsolveError

CHUNK = 1.0  # intended time of a chunk [s]
LEAPS = 8  # greatest ratio of sizes of successive chunks
TRIES = 2  # number of processes that a task may crash before it counts as lost


class Work(Protocol):
    """Callable that computes a task. It is sent to processes once or with each chunk, so it must be picklable."""

    def __call__(self, task: Any) -> Any: ...

    def lost(self, task: Any) -> Any:
        """Substitute for the answer of a task that crashed its process repeatedly."""


class Hands(Protocol):
    """Processes that compute chunks; room : greatest number of chunks in work."""

    room: int

    def give(self, chunk: int, tasks: list) -> None: ...

    def take(self) -> tuple[int, list | None, float]:
        """(chunk, answers, seconds) of the next finished chunk; answers is None if its process crashed."""

    def close(self) -> None: ...


def many(work: Work, tasks: Sequence, jobs: int = 1, dask: str | None = None) -> Iterator[tuple[int, Any]]:
    """Compute tasks with a `TaskPool`; yields (index, answer) of each task when it is finished."""
    with Bench(work, jobs, dask) as pool:
        yield from pool.do(tasks)


class Bench:
    """Pool for tasks of one kind. The first task is computed in this process, which compiles the functions for all.

    jobs : number of local processes; dask : address of a scheduler, used instead of local processes.
    Context manager: workers are closed on exit.
    """

    def __init__(self, work: Work, jobs: int = 1, dask: str | None = None) -> None:
        if jobs < 1:
            raise FvsolveError(f"jobs = {jobs} is out of range. Expected 1 or more")
        self.work, self.jobs, self.dask = work, jobs, dask
        self.alone, self.begun = dask is None and jobs == 1, False
        self.hands: Hands | None = None

    def do(self, tasks: Sequence) -> Iterator[tuple[int, Any]]:
        """Compute tasks; yields (index, answer) of each task when it is finished."""
        local = len(tasks) if self.alone else min(len(tasks), int(not self.begun))
        for number in range(local):
            self.begun = True
            yield number, self.work(tasks[number])
        if local < len(tasks):
            self.hands = self.hands or opened(self.work, self.jobs, self.dask)
            yield from handed(self.work, tasks, self.hands, local)

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: Any) -> None:
        if self.hands is not None:
            self.hands.close()


def opened(work: Work, jobs: int, dask: str | None) -> Hands:
    """Start local processes, or connect to a Dask scheduler."""
    if dask is not None:
        from fvsolve.studies.cluster import Cluster

        return Cluster(work, dask)
    from fvsolve.run.process_pool import ProcessPool

    return ProcessPool(work, jobs)


def handed(work: Work, tasks: Sequence, workers: Hands, first: int) -> Iterator[tuple[int, Any]]:
    """Distribute the tasks from index `first` on to workers; yields (index, answer).

    If a process crashes, its chunk is split in two halves and repeated, so that only tasks that crash are lost.
    """
    waiting, retry = deque(range(first, len(tasks))), deque()
    in_work: dict[int, list[int]] = {}
    crashes: dict[int, int] = {}
    size, next_chunk = 1, 0  # start with single tasks: computing times of tasks may differ by orders of magnitude
    while waiting or retry or in_work:
        while (waiting or retry) and len(in_work) < workers.room:
            fair_share = -(-len(waiting) // workers.room)  # limits chunks near the end, so that no worker is idle
            numbers_given = retry.popleft() if retry else [waiting.popleft() for _ in range(min(size, fair_share))]
            in_work[next_chunk] = numbers_given
            workers.give(next_chunk, [tasks[k] for k in numbers_given])
            next_chunk += 1
        chunk, answers, seconds = workers.take()
        numbers = in_work.pop(chunk)
        if answers is not None:
            size = sized(len(numbers), seconds, size)
            yield from zip(numbers, answers, strict=True)
        elif len(numbers) > 1:
            retry += [numbers[: len(numbers) // 2], numbers[len(numbers) // 2 :]]
        elif crashes.setdefault(numbers[0], 1) < TRIES:
            crashes[numbers[0]] += 1
            retry.append(numbers)
        else:
            yield numbers[0], work.lost(tasks[numbers[0]])


def sized(done: int, seconds: float, size: int) -> int:
    """Number of tasks of the next chunk, after a chunk of `done` tasks took `seconds`."""
    return max(1, min(LEAPS * size, int(done * CHUNK / max(seconds, 1e-6))))
