"""Threads that step bands of a state in parallel, all by the same compiled loop.

Every worker has its own arrays, of full size, and uses only the parts that its band reads. Python works on the arrays
of the run loop, which are also the arrays of the first worker. Before each call the other workers copy the data that
Python may have changed from these arrays; afterwards each worker copies its rows back.
"""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from queue import SimpleQueue

import numpy as np

from fvsolve.assembly.model_draft import aligned_zeros
from fvsolve.kernels import band_exchange
from fvsolve.kernels.calls import compile_as
from fvsolve.kernels.compiled_functions import functions
from fvsolve.model import RunData
from fvsolve.model.state_bounds import state_bounds
from fvsolve.solve.partition import Partition, blocked_sums
from fvsolve.steppers import loop_records
from fvsolve.steppers.integrator import Integrator
from fvsolve.steppers.run_handle import JOIN

COPIED = (
    "state",
    "control",
    "progress",
    "ledger",
    "carry",
    "g",
    "g_new",
    "out",
    "out_row",
    "values",
    "ledger_rates",
)
WRITTEN = ("clock", "armed", "marks", "scratch", "spare", "envelope", "extremes", "past")


def yield_address() -> int:
    """Address of the system function that lets other threads run."""
    name = "SwitchToThread" if os.name == "nt" else "sched_yield"
    library = ctypes.windll.kernel32 if os.name == "nt" else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value


class BandWorker:
    """Worker of a band: its arrays, and the handle through which compiled code reads them.

    team : a `ThreadTeam` or `MpiRanks`, with the addresses and arrays for the exchange in `kernels.band_exchange`
    k : number of the band
    """

    def __init__(self, team, k: int, run_data: RunData, stepper: Integrator) -> None:
        cut, loop = team.cut, team.loop
        self.loop, self.number, self.run_data, self.stepper = loop, k, run_data, stepper
        self.stepper.join, self.stepper.row_blocks = team.join, cut.row_blocks(k)
        self.stepper.sums = np.zeros(cut.sum_count)
        blocks, common = self.stepper.row_blocks.tolist(), len(cut.common_states())
        self.own = [slice(begin, stop) for begin, stop, *_ in blocks[common:]]
        states, flows = cut.states(k), cut.flows(k)
        own = np.zeros(band_exchange.HEAD + 3 * (len(states) + len(flows)), dtype=np.int64)
        own[[band_exchange.BAND, band_exchange.BAND_COUNT]] = k, cut.count
        own[[band_exchange.YIELD, band_exchange.PROCESS_CALL]] = team.yield_address, team.callback
        own[[band_exchange.BOARD, band_exchange.SUM_BUFFER]] = team.board.ctypes.data, team.buffer.ctypes.data
        own[[band_exchange.COMMON_SPANS, band_exchange.STATES, band_exchange.FLOWS]] = common, len(states), len(flows)
        own[band_exchange.HEAD :] = np.concatenate([states, flows]).ravel()
        self.stepper.structure = blocked_sums(cut, k)
        self.own_arrays = {"bands": cut.bands(k), "joint": own, "sums": self.stepper.structure}
        self.call_tables = team.functions.calls, team.functions.hooks
        self.open()
        at, bounds = state_bounds(loop.model)
        own_states = np.zeros(loop.model.y_size, dtype=bool)
        for begin, stop, *_ in blocks:
            own_states[begin:stop] = True
        owned = own_states[at[::3]]
        stepper.bounded_states, stepper.bounds = np.ascontiguousarray(at.reshape(-1, 3)[owned]).ravel(), bounds[owned]

    def open(self) -> None:
        """Make the handle of the arrays that the run writes; repeated when the wave history has grown."""
        self.written = self.run_data.written._replace(**self.own_arrays)
        self.handle = self.run_data.linked_handle(self.written, self.call_tables)

    def store(self, name: str, values: np.ndarray) -> None:
        """Copy values into the run's array `name`, which is in the list `WRITTEN`."""
        if name == "past" and values.size != self.run_data.past.size:
            self.run_data.past = values.copy()
        getattr(self.run_data.written, name)[...] = values

    def copy_from_loop(self, states: list[slice]) -> None:
        """Copy the arrays that Python may have changed, and the given ranges of states, from the run loop."""
        if self.number == 0:
            return
        for name in COPIED:
            getattr(self.stepper, name)[...] = getattr(self.loop.stepper, name)
        for name in WRITTEN:
            self.store(name, getattr(self.loop.run_data.written, name))
        self.stepper.times, self.stepper.largest = self.loop.stepper.times, self.loop.stepper.largest
        now = self.loop.progress["now"]
        for rows in states:
            self.stepper.y[now, rows] = self.loop.stepper.y[now, rows]

    def run_steps(self, functions: tuple, where: int) -> int:
        """Run the time loop on this band; returns a code of `steppers.loop_records`; arguments as `ThreadTeam.call`."""
        stepper = self.stepper
        if self.run_data.past is not self.written.past:
            self.open()
        return stepper.call(*functions, self.handle, where, self.run_data.armed)

    def copy_to_loop(self, name: str, at) -> None:
        """Copy the rows of this band, in row `at` of the integrator's array `name`, to the run loop."""
        if self.number > 0:
            source, target = getattr(self.stepper, name)[at], getattr(self.loop.stepper, name)[at]
            for rows in self.own:
                target[rows] = source[rows]


def copy_integrator(stepper: Integrator) -> Integrator:
    """Integrator with the method, settings and events of another, but without its states and step data.

    The two share only arrays that steps do not change.
    """
    copy = Integrator(
        stepper.method,
        stepper.scale.size,
        stepper.ledger_rates.shape[1],
        stepper.jacobian_structure,
        stepper.scale,
        stepper.damped,
    )
    copy.stored, copy.carry = stepper.stored, stepper.carry.copy()
    for name in ("out", "out_row", "values", "g", "g_new", "rows"):
        setattr(copy, name, getattr(stepper, name).copy())
    return copy


def band_functions(cut: Partition) -> tuple:
    """Compiled functions of a model with exchange between bands, and compiled function that adds up partial sums."""
    features = replace(cut.model.functions.cast, bands=True, boundary_exchange=cut.exchanges_flows)
    return functions(features), compile_as(band_exchange.gather_sums, JOIN)


class ThreadTeam:
    """Threads that step the bands of a run, one worker in each; the calling thread waits for them."""

    def __init__(self, loop, cut: Partition) -> None:
        self.loop, self.cut, self.yield_address, self.callback, self.seconds = loop, cut, yield_address(), 0, 0.0
        self.functions, self.join = band_functions(cut)
        self.board = aligned_zeros(band_exchange.LINE * cut.count)
        self.buffer = aligned_zeros(2 * cut.sum_count)
        self.members = [BandWorker(self, 0, loop.run_data, loop.stepper)]
        self.members += [
            BandWorker(self, k, RunData(loop.model), copy_integrator(loop.stepper)) for k in range(1, cut.count)
        ]
        self.stale = True  # True where the workers do not have the present rows of the loop
        self.requests = [SimpleQueue() for _ in self.members]
        self.answers: SimpleQueue = SimpleQueue()
        tasks = zip(self.members, self.requests, strict=True)
        self.threads = [threading.Thread(target=self.serve, args=task, daemon=True, name="band") for task in tasks]
        for thread in self.threads:
            thread.start()

    def serve(self, member: BandWorker, requests: SimpleQueue) -> None:
        """Run the time loop on the band of `member` for each entry of the queue `requests`, until an entry is None."""
        while (task := requests.get()) is not None:
            start = time.thread_time()
            try:
                answer = member.run_steps(*task)
                member.copy_to_loop("y", member.stepper.progress[0]["now"])
                if answer == loop_records.FIELD:
                    member.copy_to_loop("y_out", ...)
            except BaseException as error:  # raised again in the calling thread
                answer = error
            self.answers.put((answer, time.thread_time() - start))

    def call(self, functions: tuple, where: int) -> int:
        """Run the time loop on all bands; returns a code of `steppers.loop_records`.

        functions, where : compiled functions, and index of the first ledger rate, from `RunLoop.functions`
        An exception in a thread is raised again here.
        """
        for member in self.members:
            alike = [slice(*block) for block in self.cut.common_states()]
            member.copy_from_loop(alike + (member.own if self.stale else []))
        self.stale = False
        with postponed_interrupts():
            for requests in self.requests:
                requests.put((functions, where))
            answers = [self.answers.get() for _ in self.members]
        self.seconds += sum(seconds for _, seconds in answers)
        for answer, _ in answers:
            if isinstance(answer, BaseException):
                raise answer
        return answers[0][0]

    def gather_states(self, at: int) -> None:
        """Copy the bands of all workers of the stored state number `at` to the run loop."""
        for member in self.members:
            member.copy_to_loop("y", at)

    def close(self) -> None:
        """End the threads."""
        for requests in self.requests:
            requests.put(None)
        for thread in self.threads:
            thread.join()


@contextmanager
def postponed_interrupts():
    """Postpone Ctrl-C until all workers have returned, because they wait for each other."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals, before = [], signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *arguments: signals.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if signals and callable(before):
        before(*signals[0])
