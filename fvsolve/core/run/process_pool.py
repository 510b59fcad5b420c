"""Pool of worker processes on this machine, with the interface of concurrent.futures; a lost process is replaced.

Executors of concurrent.futures and loky cannot replace it: after the kill of one process of three they end all six
chunks (`BrokenProcessPool`, `TerminatedWorkerError`) instead of one, and their processes survive a kill of the parent.
"""

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from typing import Any

from fvsolve.compile.child_process import safe_path
from fvsolve.errors import RunError

READY = "ready"
# threads of linear algebra in every process
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
NOT_STARTED = (
    'a worker process could not be started; a script that uses jobs needs if __name__ == "__main__"'
)


class WorkerLost(Exception):
    """Exception of a future whose process has ended before it returned a result."""


class ProcessPool(ThreadPoolExecutor):
    """Pool of up to `size` processes, which are started when needed. A thread for each process waits for its results.

    work : function that each process applies to every task of a chunk. If a process is killed, only its chunk is lost.
    """

    lost = WorkerLost

    def __init__(self, work: Any, size: int) -> None:
        super().__init__(size)
        self.work, self.capacity, self.closed = work, size, False
        self.context, self.lock = get_context("spawn"), threading.Lock()
        self.idle: list[Worker] = []
        self.workers: list[Worker] = []

    def submit(self, tasks: list) -> Future:
        """Compute a list of tasks in a free or new process : future of the result of `compute`.

        The future has the exception WorkerLost if the process ended, and RunError if it could not be started.
        """
        return super().submit(self._compute, tasks)

    def _compute(self, tasks: list) -> Any:
        with self.lock:
            if self.closed:
                raise WorkerLost
            worker = self.idle.pop() if self.idle else Worker(self.context, self.work)
            self.workers += [] if worker in self.workers else [worker]
        result = worker.compute(tasks)
        if result is None:
            raise WorkerLost if worker.started else RunError(NOT_STARTED)
        self.idle.append(worker)
        return result

    def check(self, cancelled: bool = False) -> None:
        """Do nothing: processes of this machine can always be reached."""

    def close(self) -> None:
        """End all processes; unfinished chunks are dropped."""
        with self.lock:
            self.closed = True
        for worker in self.workers:
            worker.process.terminate()
            worker.process.join()
        self.shutdown(cancel_futures=True)
        for worker in self.workers:
            worker.pipe.close()


class Worker:
    """Worker process, and the connection to it."""

    def __init__(self, context, work: Any) -> None:
        self.pipe, far_end = context.Pipe()
        self.process = context.Process(target=serve, args=(far_end, work), daemon=True)
        self.started = False
        with _no_interrupts(), _single_thread(), safe_path():
            self.process.start()
        far_end.close()  # so that the pipe ends with the process

    def compute(self, tasks: list) -> Any:
        """Result of `compute` for a list of tasks in the process; None if the process has ended."""
        try:
            self.pipe.send(tasks)
            while (message := self.pipe.recv()) == READY:
                self.started = True
            return message
        except (EOFError, OSError):
            return None


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


def results_of(work: Any, tasks: list) -> Iterator:
    """Results of all tasks, in order.

    work : function of a task; it may have a method `results` that computes many tasks together
    """
    return work.results(tasks) if hasattr(work, "results") else map(work, tasks)


def compute(work: Any, tasks: list) -> tuple[Any, float]:
    """Apply `work` to all tasks : (list of answers, duration [s]); (exception, 0) if a task raises one."""
    began = time.perf_counter()
    try:
        answers = list(results_of(work, tasks))
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
