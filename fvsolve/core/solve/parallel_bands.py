"""Threads and MPI processes that step bands of a state in parallel, all by the same compiled loop.

Every thread has its own arrays, of full size, and uses only the parts that its band reads. Python works on the arrays
of the run loop, which are also the arrays of the first worker. Before each call the other workers copy the data that
Python may have changed from these arrays; afterwards each worker copies its rows back.

Of MPI processes rank 0 runs the case; the other ranks follow. Each rank receives the data that Python may have changed
on rank 0, runs the time loop together with rank 0, and then sends the rows of its band. So only rank 0 decides by clock
or signal.
"""

import ctypes
import math
import os
import sys
import threading
import time
import traceback
from queue import SimpleQueue

import numpy as np

from fvsolve.core.assembly.model_draft import aligned_zeros
from fvsolve.core.kernels import band_exchange
from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.kernels.compiled_functions import functions
from fvsolve.core.model import RunData
from fvsolve.core.model.state_bounds import state_bounds
from fvsolve.core.solve.partition import (
    CLOSE,
    CLOSE_MESSAGE,
    RUN_LOOP,
    SEND_STATES,
    Partition,
    blocked_sums,
    postponed_interrupts,
)
from fvsolve.core.steppers import loop_records
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.run_handle import JOIN

COPIED = (
    "state",
    "control",
    "progress",
    "ledger",
    "carry",
    "g",
    "g_new",
    "pace",
    "out",
    "out_row",
    "values",
    "ledger_rates",
)
WRITTEN = ("clock", "armed", "marks", "scratch", "spare", "envelope", "extremes", "accepted")
# seconds between a message and the end of all ranks: `mpiexec` loses what it has not yet forwarded
ABORT_DELAY = 0.5


def yield_address() -> int:
    """Address of the system function that lets other threads run."""
    name = "SwitchToThread" if os.name == "nt" else "sched_yield"
    library = ctypes.windll.kernel32 if os.name == "nt" else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value


def abort_ranks(comm, text: str) -> None:
    """Print a text on stderr, then end the processes of all ranks."""
    print(text, file=sys.stderr, flush=True)
    time.sleep(ABORT_DELAY)
    comm.Abort(1)


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
        own[[band_exchange.BOARD, band_exchange.SUM_BUFFER]] = (
            team.board.ctypes.data,
            team.buffer.ctypes.data,
        )
        own[[band_exchange.COMMON_SPANS, band_exchange.STATES, band_exchange.FLOWS]] = (
            common,
            len(states),
            len(flows),
        )
        own[band_exchange.HEAD :] = np.concatenate([states, flows]).ravel()
        self.stepper.structure = blocked_sums(cut, k)
        self.own_arrays = {"bands": cut.bands(k), "joint": own, "sums": self.stepper.structure}
        self.own_arrays["maxima"] = loop.run_data.maxima  # threads write their rows into one array
        self.call_tables = team.functions.calls, team.functions.hooks
        self.open()
        at, bounds = state_bounds(loop.model)
        own_states = np.zeros(loop.model.y_size, dtype=bool)
        for begin, stop, *_ in blocks:
            own_states[begin:stop] = True
        owned = own_states[at[::3]]
        stepper.bounded_states, stepper.bounds = (
            np.ascontiguousarray(at.reshape(-1, 3)[owned]).ravel(),
            bounds[owned],
        )

    def open(self) -> None:
        """Make the handle of the arrays that the run writes; repeated when an array of a feature has grown."""
        self.opened = self.run_data.replaced
        self.written = self.run_data.written._replace(**self.own_arrays)
        self.handle = self.run_data.linked_handle(self.written, self.call_tables)

    def store(self, name: str, values: np.ndarray) -> None:
        """Copy values into the run's array `name`, which is in the list `WRITTEN`."""
        getattr(self.run_data.written, name)[...] = values

    def copy_from_loop(self, states: list[slice]) -> None:
        """Copy the arrays that Python may have changed, and the given ranges of states, from the run loop."""
        if self.number == 0:
            return
        for name in COPIED:
            getattr(self.stepper, name)[...] = getattr(self.loop.stepper, name)
        for name in WRITTEN:
            self.store(name, getattr(self.loop.run_data.written, name))
        for name, array in self.loop.run_data.arrays().items():
            self.run_data.set_array(name, array.copy())
        self.stepper.times, self.stepper.largest = (
            self.loop.stepper.times,
            self.loop.stepper.largest,
        )
        now = self.loop.progress["now"]
        for rows in states:
            self.stepper.y[now, rows] = self.loop.stepper.y[now, rows]

    def run_steps(self, functions: tuple, where: int) -> int:
        """Run the time loop on this band; returns a code of `steppers.loop_records`; arguments as `ThreadTeam.call`."""
        stepper = self.stepper
        if self.opened != self.run_data.replaced:
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
    for name in ("out", "out_row", "values", "g", "g_new", "pace", "inner", "rows"):
        setattr(copy, name, getattr(stepper, name).copy())
    return copy


def band_functions(cut: Partition) -> tuple:
    """Compiled functions of a model with exchange between bands, and compiled function that adds up partial sums."""
    features = cut.model.functions.cast._replace(bands=True, boundary_exchange=cut.exchanges_flows)
    return functions(features), compile_as(band_exchange.gather_sums, JOIN)


class ThreadTeam:
    """Threads that step the bands of a run, one worker in each; the calling thread waits for them."""

    def __init__(self, loop, cut: Partition) -> None:
        self.loop, self.cut, self.yield_address, self.callback, self.seconds = (
            loop,
            cut,
            yield_address(),
            0,
            0.0,
        )
        self.functions, self.join = band_functions(cut)
        self.board = aligned_zeros(band_exchange.LINE * cut.count)
        self.buffer = aligned_zeros(2 * cut.sum_count)
        self.members = [BandWorker(self, 0, loop.run_data, loop.stepper)]
        for k in range(1, cut.count):
            self.members.append(
                BandWorker(self, k, RunData(loop.model), copy_integrator(loop.stepper))
            )
        self.stale = True  # True where the workers do not have the present rows of the loop
        self.requests = [SimpleQueue() for _ in self.members]
        self.answers: SimpleQueue = SimpleQueue()
        # They start at the first call, so that a run that cannot begin has none to end.
        self.threads: list[threading.Thread] = []

    def start_threads(self) -> None:
        """Start a thread for each worker."""
        for task in zip(self.members, self.requests, strict=True):
            thread = threading.Thread(target=self.serve, args=task, daemon=True, name="band")
            self.threads.append(thread)
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
            if not self.threads:
                self.start_threads()
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


CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


class Exchange:
    """Exchange of array entries between ranks, with receive buffers.

    runs : for each rank int64[r, 3], the ranges that it reads, (rank that sends them, first, last + 1)
    """

    def __init__(self, comm, runs: list[np.ndarray]) -> None:
        me, self.comm = comm.rank, comm
        self.received = {k: places(runs[me], k) for k in range(comm.size) if k != me}
        self.sent = {k: places(runs[k], me) for k in range(comm.size) if k != me}
        self.buffers = {k: np.zeros(at.size) for k, at in self.received.items()}

    def __call__(self, values: np.ndarray) -> None:
        """Exchange entries of the array `values` between all ranks; received entries are written into it."""
        from mpi4py import MPI

        requests = [
            self.comm.Irecv(self.buffers[k], k) for k, at in self.received.items() if at.size
        ]
        requests += [self.comm.Isend(values[at], k) for k, at in self.sent.items() if at.size]
        MPI.Request.Waitall(requests)
        for k, at in self.received.items():
            values[at] = self.buffers[k]


def places(runs: np.ndarray, owner: int) -> np.ndarray:
    """All indices in the ranges of `runs` that belong to the rank `owner` : int64[n]."""
    mine = runs[runs[:, 0] == owner]
    return np.concatenate(
        [np.zeros(0, dtype=np.int64), *(np.arange(begin, stop) for _, begin, stop in mine)]
    )


class MpiRanks:
    """Member of a group of MPI ranks that step bands: rank 0 uses its method `call`, the other ranks `serve`."""

    def __init__(self, loop, cut: Partition, comm) -> None:
        self.loop, self.cut, self.comm, self.seconds = loop, cut, comm, 0.0
        self.functions, self.join = band_functions(cut)
        # kept as long as compiled code has its address
        self.callback_object = CALLBACK(self.exchange)
        self.callback, self.yield_address = (
            ctypes.cast(self.callback_object, ctypes.c_void_p).value,
            yield_address(),
        )
        self.board = self.buffer = np.zeros(0)
        self.member = BandWorker(self, comm.rank, loop.run_data, loop.stepper)
        ranks = range(comm.size)
        self.exchanges = (
            Exchange(comm, [cut.states(k) for k in ranks]),
            Exchange(comm, [cut.flows(k) for k in ranks]),
        )
        self.others, common = np.ones(cut.sum_count, dtype=bool), len(cut.common_states())
        for _, _, first, count, _ in self.member.stepper.row_blocks[
            common if comm.rank > 0 else 0 :
        ]:
            self.others[first : first + count] = False
        self.rows = [
            [slice(*block[:2]) for block in cut.row_blocks(k)[common:].tolist()] for k in ranks
        ]
        self.maxima_rows = [cut.maxima_rows(k) for k in ranks]
        self.stale = True

    def exchange(self, request: int, address: int, size: int) -> None:
        """Exchange values between all ranks within a step; the compiled code of every rank calls it.

        request : kind of values, a code of `kernels.band_exchange`: states, flows, greatest rate or sums
        address, size : memory address and number of the float64 values, which are replaced
        """
        try:
            values = np.ctypeslib.as_array((ctypes.c_double * size).from_address(address))
            if request in (band_exchange.SEND_STATES, band_exchange.SEND_FLOWS):
                self.exchanges[request](values)
            elif request == band_exchange.SEND_RATES:
                values[0] = self.greatest(values[0])
            else:
                values[self.others] = 0.0
                from mpi4py import MPI

                self.comm.Allreduce(MPI.IN_PLACE, values, MPI.SUM)
        except BaseException:
            abort_ranks(self.comm, traceback.format_exc())

    def greatest(self, rate: float) -> float:
        """Greatest of the values `rate` of all ranks [1/s]; infinity if a rank has NaN."""
        from mpi4py import MPI

        return self.comm.allreduce(math.inf if math.isnan(rate) else float(rate), MPI.MAX)

    def call(self, functions: tuple, where: int) -> int:
        """Run the time loop on all ranks; returns a code of `steppers.loop_records`.

        functions, where : compiled functions, and index of the first ledger rate, from `RunLoop.functions`
        """
        loop = self.loop
        now = loop.progress["now"]
        runs = [(0, loop.model.y_size)] if self.stale else self.cut.common_states()
        small = {name: getattr(loop.stepper, name) for name in COPIED}
        written = {name: getattr(loop.run_data.written, name) for name in WRITTEN}
        states = [loop.stepper.y[now, begin:stop] for begin, stop in runs]
        maxima = loop.run_data.maxima if self.stale else None
        self.stale = False
        with postponed_interrupts():
            self.comm.bcast((RUN_LOOP, (small, written, runs, states, maxima)))
            code = self.member.run_steps(functions, where)
            self.gather_results(code)
            self.seconds += sum(self.comm.gather(0.0))  # CPU time of the other ranks
        return code

    def gather(self, values: np.ndarray, ranges: list[list[slice]]) -> None:
        """Send to rank 0 the entries of an array that each rank has computed; ranges : those of each rank"""
        if self.comm.rank > 0:
            for own in ranges[self.comm.rank]:
                self.comm.Send(values[own], 0)
            return
        for k in range(1, self.comm.size):
            for own in ranges[k]:
                self.comm.Recv(values[own], k)

    def gather_results(self, code: int) -> None:
        """Send to rank 0 the state, greatest values and field of all ranks; code : result of the time loop"""
        stepper = self.loop.stepper
        self.gather(stepper.y[self.loop.progress["now"]], self.rows)
        self.gather(self.loop.run_data.maxima, self.maxima_rows)
        if code == loop_records.FIELD:
            self.gather(stepper.y_out, self.rows)

    def gather_states(self, at: int) -> None:
        """Send to rank 0 the bands of all ranks of the stored state number `at`."""
        with postponed_interrupts():
            self.comm.bcast((SEND_STATES, int(at)))
            self.gather(self.loop.stepper.y[at], self.rows)

    def close(self) -> None:
        """End the other ranks."""
        with postponed_interrupts():
            self.comm.bcast(CLOSE_MESSAGE)

    def serve(self, functions: tuple, where: int) -> None:
        """Execute the requests of rank 0 until it ends the run; arguments as in `call`."""
        stepper = self.loop.stepper
        while True:
            request, argument = self.comm.bcast(None)
            if callable(request):  # a sink of rank 0 that writes on all ranks
                request(self.comm, self.loop.model, *argument)
                continue
            if request == CLOSE:
                return
            if request == SEND_STATES:
                self.gather(stepper.y[argument], self.rows)
                continue
            small, written, runs, states, maxima = argument
            if maxima is not None:
                self.loop.run_data.maxima[:] = maxima
            for name, array in small.items():
                getattr(stepper, name)[...] = array
            for name, array in written.items():
                self.member.store(name, array)
            for (begin, stop), values in zip(runs, states, strict=True):
                stepper.y[stepper.progress[0]["now"], begin:stop] = values
            start_time = time.thread_time()
            code = self.member.run_steps(functions, where)
            self.gather_results(code)
            self.comm.gather(time.thread_time() - start_time)
