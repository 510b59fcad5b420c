"""MPI processes that step bands of a state in parallel.

Rank 0 runs the case; the other ranks follow. Each rank receives the data that Python may have changed on rank 0, runs
the time loop together with rank 0, and then sends the rows of its band. So only rank 0 decides by clock or signal.
"""

from __future__ import annotations

import ctypes
import math
import time
import traceback

import numpy as np

from fvsolve.kernels import band_exchange
from fvsolve.solve.partition import Partition
from fvsolve.solve.thread_team import COPIED, WRITTEN, BandWorker, band_functions, postponed_interrupts, yield_address
from fvsolve.steppers import loop_records

CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
RUN_LOOP, SEND_STATES, CLOSE = range(3)  # requests of rank 0: run the time loop, send states, end
CLOSE_MESSAGE = CLOSE, None


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

        requests = [self.comm.Irecv(self.buffers[k], k) for k, at in self.received.items() if at.size]
        requests += [self.comm.Isend(values[at], k) for k, at in self.sent.items() if at.size]
        MPI.Request.Waitall(requests)
        for k, at in self.received.items():
            values[at] = self.buffers[k]


def places(runs: np.ndarray, owner: int) -> np.ndarray:
    """All indices in the ranges of `runs` that belong to the rank `owner` : int64[n]."""
    mine = runs[runs[:, 0] == owner]
    return np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(begin, stop) for _, begin, stop in mine)])


class MpiRanks:
    """Member of a group of MPI ranks that step bands: rank 0 uses its method `call`, the other ranks `serve`."""

    def __init__(self, loop, cut: Partition, comm) -> None:
        self.loop, self.cut, self.comm, self.seconds = loop, cut, comm, 0.0
        self.functions, self.join = band_functions(cut)
        self.callback_object = CALLBACK(self.exchange)  # kept as long as compiled code has its address
        self.callback, self.yield_address = ctypes.cast(self.callback_object, ctypes.c_void_p).value, yield_address()
        self.board = self.buffer = np.zeros(0)
        self.member = BandWorker(self, comm.rank, loop.run_data, loop.stepper)
        ranks = range(comm.size)
        self.exchanges = Exchange(comm, [cut.states(k) for k in ranks]), Exchange(comm, [cut.flows(k) for k in ranks])
        self.others = np.ones(cut.sum_count, dtype=bool)
        for _, _, first, count in self.member.stepper.row_blocks[len(cut.common_states()) if comm.rank > 0 else 0 :]:
            self.others[first : first + count] = False
        self.rows = [
            [slice(*block[:2]) for block in cut.row_blocks(k)[len(cut.common_states()) :].tolist()] for k in ranks
        ]
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
            traceback.print_exc()
            self.comm.Abort(1)

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
        self.stale = False
        with postponed_interrupts():
            self.comm.bcast((RUN_LOOP, (small, written, runs, states)))
            code = self.member.run_steps(functions, where)
            self.gather("y", loop.progress["now"])
            if code == loop_records.FIELD:
                self.gather("y_out", ...)
            self.seconds += sum(self.comm.gather(0.0))  # CPU time of the other ranks
        return code

    def gather(self, name: str, at) -> None:
        """Send to rank 0 the entries of the bands of all ranks in row `at` of the integrator's array `name`."""
        values = getattr(self.loop.stepper, name)[at]
        if self.comm.rank > 0:
            for rows in self.rows[self.comm.rank]:
                self.comm.Send(values[rows], 0)
            return
        for k in range(1, self.comm.size):
            for rows in self.rows[k]:
                self.comm.Recv(values[rows], k)

    def gather_states(self, at: int) -> None:
        """Send to rank 0 the bands of all ranks of the stored state number `at`."""
        with postponed_interrupts():
            self.comm.bcast((SEND_STATES, int(at)))
            self.gather("y", at)

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
                self.gather("y", argument)
                continue
            small, written, runs, states = argument
            for name, array in small.items():
                getattr(stepper, name)[...] = array
            for name, array in written.items():
                self.member.store(name, array)
            for (begin, stop), values in zip(runs, states, strict=True):
                stepper.y[stepper.progress[0]["now"], begin:stop] = values
            start_time = time.thread_time()
            code = self.member.run_steps(functions, where)
            self.gather("y", stepper.progress[0]["now"])
            if code == loop_records.FIELD:
                self.gather("y_out", ...)
            self.comm.gather(time.thread_time() - start_time)
