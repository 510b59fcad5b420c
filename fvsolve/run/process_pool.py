"""Pool of worker processes on this machine; a process that ends is replaced."""

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
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # threads of linear algebra in every process
NOT_STARTED = 'a worker process could not be started; a script that uses jobs needs if __name__ == "__main__"'


class ProcessPool:
    """Pool of up to `size` processes, which are started when needed.

    work : function that each process applies to every task of a chunk. If a process is killed, only its chunk is lost.
    The caller keeps the number of unfinished chunks at most `capacity`.
    """

    def __init__(self, work: Any, size: int) -> None:
        self.work, self.capacity = work, size
        self.context = get_context("spawn")
        self.idle: list[Worker] = []
        self.busy: list[Worker] = []

    def submit(self, chunk: int, tasks: list) -> None:
        """Send a list of tasks, with the number `chunk`, to a free or new process."""
        worker = self.idle.pop() if self.idle else Worker(self.context, self.work)
        self.busy.append(worker)
        worker.submit(chunk, tasks)

    def next_result(self) -> tuple[int, list | None, float]:
        """Wait for a finished chunk; returns its number, the answers (None if the process ended) and its time [s].

        Raises the exception that a task raised, and RunError if a process could not be started.
        """
        while True:
            ready = wait([worker.pipe for worker in self.busy])
            worker = next(candidate for candidate in self.busy if candidate.pipe in ready)
            message = worker.receive()
            if message == READY:
                continue
            self.busy.remove(worker)
            if message is None:
                worker.end()
                if not worker.started:
                    raise RunError(NOT_STARTED)
                return worker.chunk, None, 0.0
            self.idle.append(worker)
            answers, seconds = message
            if isinstance(answers, BaseException):
                raise answers
            return worker.chunk, answers, seconds

    def close(self) -> None:
        """End all processes; unfinished chunks are dropped."""
        for worker in (*self.idle, *self.busy):
            worker.end()


class Worker:
    """Worker process, and the connection to it."""

    def __init__(self, context, work: Any) -> None:
        self.pipe, far_end = context.Pipe()
        self.process = context.Process(target=serve, args=(far_end, work), daemon=True)
        self.started, self.chunk = False, -1
        with _no_interrupts(), _single_thread():
            self.process.start()
        far_end.close()  # so that the pipe ends with the process

    def submit(self, chunk: int, tasks: list) -> None:
        self.chunk = chunk
        try:
            self.pipe.send(tasks)
        except OSError:  # the process has just ended; `receive` will detect it
            pass

    def receive(self) -> Any:
        """Next message of the process; None if it has ended."""
        try:
            message = self.pipe.recv()
        except (EOFError, OSError):
            return None
        self.started = True
        return message

    def end(self) -> None:
        self.process.terminate()
        self.process.join()
        self.pipe.close()


def serve(pipe: Connection, work: Any) -> None:
    """Compute the chunks that a pipe receives and send back the results, until its other end is closed."""
    # Ctrl-C reaches all processes of a terminal; the parent process ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()
    try:
        pipe.send(READY)
        while True:
            tasks = pipe.recv()
            pipe.send(compute(work, tasks))
    except (EOFError, OSError):
        return


def end_with_parent() -> None:
    """End this process when its parent process ends."""
    parent_process().join()
    os._exit(1)


def compute(work: Any, tasks: list) -> tuple[Any, float]:
    """Apply `work` to all tasks : (list of answers, duration [s]); (exception, 0) if a task raises one."""
    began = time.perf_counter()
    try:
        answers = [work(task) for task in tasks]
    except Exception as error:  # any exception is returned to the parent process
        return error, 0.0
    return answers, time.perf_counter() - began


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Block Ctrl-C in processes started within the context, until they set their own handler."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _single_thread() -> Iterator[None]:
    """Limit linear algebra to 1 thread in processes started within the context, unless the environment sets it."""
    unset = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            del os.environ[name]
