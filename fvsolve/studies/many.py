"""Many tasks in chunks of about a second: here, in other processes, or on the workers of Dask. Knows no runs.

What a task gives does not depend on where it is done, nor in which order or company.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from fvsolve.errors import FvsolveError

CHUNK = 1.0  # s that a chunk is to take
LEAPS = 8  # times that a chunk may be as long as the one before
TRIES = 2  # processes that a task may end before it counts as lost


class Work(Protocol):
    """What is done with tasks wherever: it is sent there once or with each chunk, so it can be pickled."""

    def __call__(self, task: Any) -> Any: ...

    def lost(self, task: Any) -> Any:
        """What stands for the answer of a task that has ended the process it was done in, time and again."""


class Hands(Protocol):
    """Processes that do chunks: `room` of them at once."""

    room: int

    def give(self, chunk: int, tasks: list) -> None: ...

    def take(self) -> tuple[int, list | None, float]:
        """(chunk, answers, seconds) of the next that is done; None in place of answers where its process ended."""

    def close(self) -> None: ...


def many(work: Work, tasks: Sequence, jobs: int = 1, dask: str | None = None) -> Iterator[tuple[int, Any]]:
    """(number, answer) of every task as they are done; see `Bench`."""
    with Bench(work, jobs, dask) as bench:
        yield from bench.do(tasks)


class Bench:
    """Who does tasks of one kind, time and again: the first of all this process, which compiles what all need.

    jobs : processes of this machine; dask : address of a scheduler, in place of these. A context: nobody stays.
    """

    def __init__(self, work: Work, jobs: int = 1, dask: str | None = None) -> None:
        if jobs < 1:
            raise FvsolveError(f"jobs = {jobs}; wanted 1 or more")
        self.work, self.jobs, self.dask = work, jobs, dask
        self.alone, self.begun = dask is None and jobs == 1, False
        self.hands: Hands | None = None

    def do(self, tasks: Sequence) -> Iterator[tuple[int, Any]]:
        """(number, answer) of every task as they are done."""
        here = len(tasks) if self.alone else min(len(tasks), int(not self.begun))
        for number in range(here):
            self.begun = True
            yield number, self.work(tasks[number])
        if here < len(tasks):
            self.hands = self.hands or opened(self.work, self.jobs, self.dask)
            yield from handed(self.work, tasks, self.hands, here)

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: Any) -> None:
        if self.hands is not None:
            self.hands.close()


def opened(work: Work, jobs: int, dask: str | None) -> Hands:
    """Processes, here or there."""
    if dask is not None:
        from fvsolve.studies.cluster import Cluster

        return Cluster(work, dask)
    from fvsolve.run.crew import Crew

    return Crew(work, jobs)


def handed(work: Work, tasks: Sequence, hands: Hands, first: int) -> Iterator[tuple[int, Any]]:
    """Answers of all tasks from `first` on.

    What a process was given that ended is given again in halves: all but what ends processes gets done.
    """
    waiting, again = deque(range(first, len(tasks))), deque()
    given: dict[int, list[int]] = {}
    died: dict[int, int] = {}
    size, count = 1, 0  # a row that took no time may stand beside one without end: each has to have shown what it takes
    while waiting or again or given:
        while (waiting or again) and len(given) < hands.room:
            fair = -(-len(waiting) // hands.room)  # so that none waits for another at the end
            some = again.popleft() if again else [waiting.popleft() for _ in range(min(size, fair))]
            given[count] = some
            hands.give(count, [tasks[k] for k in some])
            count += 1
        chunk, answers, seconds = hands.take()
        numbers = given.pop(chunk)
        if answers is not None:
            size = sized(len(numbers), seconds, size)
            yield from zip(numbers, answers, strict=True)
        elif len(numbers) > 1:
            again += [numbers[: len(numbers) // 2], numbers[len(numbers) // 2 :]]
        elif died.setdefault(numbers[0], 1) < TRIES:
            died[numbers[0]] += 1
            again.append(numbers)
        else:
            yield numbers[0], work.lost(tasks[numbers[0]])


def sized(done: int, seconds: float, size: int) -> int:
    """Tasks of the next chunk, after one of `done` took so long."""
    return max(1, min(LEAPS * size, int(done * CHUNK / max(seconds, 1e-6))))
