"""Processes of this machine that do chunks of work, each started anew where it ended. Knows no work."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import Any

from fvsolve.errors import RunError

READY = "ready"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # of linear algebra, in every process
NOT_STARTED = 'another process could not be started; a script that asks for jobs stands under if __name__ == "__main__"'


class Crew:
    """So many processes, started when they are first needed; one that is killed costs what it was doing."""

    def __init__(self, work: Any, room: int) -> None:
        self.work, self.room = work, room
        self.context = get_context("spawn")
        self.idle: list[Worker] = []
        self.busy: list[Worker] = []

    def give(self, chunk: int, tasks: list) -> None:
        """Let a process do a chunk."""
        worker = self.idle.pop() if self.idle else Worker(self.context, self.work)
        self.busy.append(worker)
        worker.give(chunk, tasks)

    def take(self) -> tuple[int, list | None, float]:
        """The next chunk that is done; what a process raised is raised here."""
        while True:
            ready = wait([worker.pipe for worker in self.busy])
            worker = next(one for one in self.busy if one.pipe in ready)
            said = worker.hear()
            if said == READY:
                continue
            self.busy.remove(worker)
            if said is None:
                worker.end()
                if not worker.started:
                    raise RunError(NOT_STARTED)
                return worker.chunk, None, 0.0
            self.idle.append(worker)
            answers, seconds = said
            if isinstance(answers, BaseException):
                raise answers
            return worker.chunk, answers, seconds

    def close(self) -> None:
        """End all: they are idle, or what they do is not wanted any more."""
        for worker in (*self.idle, *self.busy):
            worker.end()


class Worker:
    """One process and the pipe to it."""

    def __init__(self, context, work: Any) -> None:
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, work), daemon=True)
        self.started, self.chunk = False, -1
        with _no_interrupts(), _one_thread():
            self.process.start()
        theirs.close()  # so that the pipe ends with the process

    def give(self, chunk: int, tasks: list) -> None:
        self.chunk = chunk
        try:
            self.pipe.send(tasks)
        except OSError:  # it has just ended, as `hear` will find
            pass

    def hear(self) -> Any:
        """What it says next; None where it has ended."""
        try:
            said = self.pipe.recv()
        except (EOFError, OSError):
            return None
        self.started = True
        return said

    def end(self) -> None:
        self.process.terminate()
        self.process.join()
        self.pipe.close()


def serve(pipe: Connection, work: Any) -> None:
    """Do chunks that come by a pipe, until its other end is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all of a terminal: who started this one ends it
    threading.Thread(target=follow, daemon=True).start()
    try:
        pipe.send(READY)
        while True:
            tasks = pipe.recv()
            pipe.send(done(work, tasks))
    except (EOFError, OSError):
        return


def follow() -> None:
    """End with the process that started this one, however that ends: nobody wants the chunk any more."""
    parent_process().join()
    os._exit(1)


def done(work: Any, tasks: list) -> tuple[Any, float]:
    """(answers to tasks, or what was raised; seconds)."""
    began = time.perf_counter()
    try:
        answers = [work(task) for task in tasks]
    except Exception as error:  # whatever it is, the one who asked gets it
        return error, 0.0
    return answers, time.perf_counter() - began


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Processes that are started meanwhile do not hear Ctrl-C until they say how they take it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that are started meanwhile do linear algebra on one thread, if nobody has said on how many."""
    said = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(said, "1"))
    try:
        yield
    finally:
        for name in said:
            del os.environ[name]
