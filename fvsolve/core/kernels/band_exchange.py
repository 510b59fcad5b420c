"""Exchange of data between bands of a state: states of other bands, greatest wave rate, partial sums.

A band is a part of the states, which one thread or process steps with its own arrays. All bands make the same calls in
the same order. A band writes its data, then all bands wait for each other before any band reads them, and again before
any band overwrites them. The array `joint` of each band holds the addresses for this. It is empty for a single band,
which calls none of these functions. Threads share memory; processes exchange data by a Python function
(`solve.parallel_bands`).
"""

import numpy as np

from fvsolve.core.kernels.dtypes import RATE
from fvsolve.core.kernels.table_handle import floats_at, open_tables
from fvsolve.jit import COMPILING, Intrinsic, njit

# Entries of `joint`, int64: number of this band; number of bands; addresses of the board shared by all, of the buffer
# for sums, and of the system function that yields the processor; number of barriers passed; number of spans common to
# all bands; number of runs of states read from other bands, and of flows through faces; address of the function that
# exchanges between processes, 0 for threads. The runs follow from HEAD on: owner, first, and last + 1 of each.
BAND, BAND_COUNT, BOARD, SUM_BUFFER, YIELD, TURNS, COMMON_SPANS, STATES, FLOWS, PROCESS_CALL = (
    range(10)
)
SEND_STATES, SEND_FLOWS, SEND_RATES, SEND_SUMS = range(4)  # kind of exchange between processes
HEAD = 16
# numbers in a cache line; the line of a band on the board: barriers passed, shared address, two rates
LINE = 8
SHARED_ADDRESS, SHARED_RATES = 1, 2
SPIN_LIMIT = 2000  # polls at a barrier before the thread yields

if COMPILING:

    @Intrinsic
    def address_of(typingctx, array):
        """Memory address of the first entry of an array."""
        from fvsolve.compile.code_generation import address_of_array

        return address_of_array(array)

    @Intrinsic
    def store_release(typingctx, address, value):
        """Store an integer at an address, after all earlier writes are visible to other threads (release)."""
        from fvsolve.compile.code_generation import atomic_store

        return atomic_store()

    @Intrinsic
    def load_acquire(typingctx, address):
        """Load an integer from an address, before all later reads (acquire); counterpart of `store_release`."""
        from fvsolve.compile.code_generation import atomic_load

        return atomic_load()

    @Intrinsic
    def call_processes(typingctx, address, content, numbers, size):
        """Call the function at `address`, which exchanges an array with other processes.

        content : kind of exchange, SEND_STATES, SEND_FLOWS, SEND_RATES or SEND_SUMS
        numbers, size : memory address and length of the array
        """
        from fvsolve.compile.code_generation import c_call

        return c_call(3)

    @Intrinsic
    def yield_thread(typingctx, address):
        """Call the system function at an address, which yields the processor to other threads."""
        from fvsolve.compile.code_generation import c_call

        return c_call(0, bits=32)
else:
    import ctypes
    import time

    def address_of(array):
        """Address of the first entry of an array."""
        return array.ctypes.data

    def store_release(address, value):
        """Store an integer at an address that other bands read while they wait."""
        ctypes.c_int64.from_address(int(address)).value = int(value)

    def load_acquire(address):
        """Load an integer from an address; counterpart of `store_release`."""
        return ctypes.c_int64.from_address(int(address)).value

    def call_processes(address, content, numbers, size):
        """Call the function at `address`, with arguments as in compiled code."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(int(address))(content, numbers, int(size))

    def yield_thread(address):
        """Yield the processor to other threads; the address is not used."""
        time.sleep(0.0)


@njit
def barrier(joint):
    """Wait until all bands have called this function.

    It polls the counters of the bands. After SPIN_LIMIT polls it also yields the processor, which a late band may need.
    A band is a part of the states, which one thread or process steps.
    joint : int64 array of this band with counters and memory addresses shared by all bands
    """
    board, count = joint[BOARD], joint[BAND_COUNT]
    joint[TURNS] += 1
    turn = joint[TURNS]
    # Release and acquire order the data: who sees the counter also sees what was written before it.
    store_release(board + 8 * LINE * joint[BAND], turn)
    for k in range(count):
        polls = 0
        while load_acquire(board + 8 * LINE * k) < turn:
            polls += 1
            if polls > SPIN_LIMIT:
                yield_thread(joint[YIELD])


@njit
def get_runs(joint, content, values):
    """Copy the states or face flows that other bands own and this band reads into the same entries of `values`.

    A band is a part of the states, which one thread or process steps.
    joint : int64 array of this band with counters, shared memory addresses, and the ranges of entries to copy
    content : SEND_STATES or SEND_FLOWS; values : array of all states or of all flows through faces
    """
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], content, address_of(values), values.size)
        return
    first, count = HEAD, joint[STATES]
    if content == SEND_FLOWS:
        first, count = HEAD + 3 * joint[STATES], joint[FLOWS]
    place = joint[BOARD] + 8 * SHARED_ADDRESS
    # Each band uses rows of its own arrays in turn, so the address is given for every exchange.
    store_release(place + 8 * LINE * joint[BAND], address_of(values))
    barrier(joint)
    # All bands have written their data and addresses.
    for r in range(count):
        at = first + 3 * r
        owner = joint[at]
        begin = joint[at + 1]
        stop = joint[at + 2]
        theirs = floats_at(load_acquire(place + 8 * LINE * owner), values.size)[begin:stop]
        ours = values[begin:stop]
        for i in range(ours.size):
            ours[i] = theirs[i]
    # No band may overwrite its values while another band still reads them.
    barrier(joint)


@njit
def exchange_states(t, y, dydt, out, handle):
    """Copy into y the states of other bands on which the rates of this band depend.

    A band is a part of the states, which one thread or process steps.
    """
    joint = open_tables(handle).joint
    get_runs(joint, SEND_STATES, y)


@njit
def reduce_rate(t, y, dydt, out, handle):
    """Set out[RATE] of each band, the rate that limits the step [1/s], to the greatest of all bands.

    A band is a part of the states, which one thread or process steps. If the rate of one band is NaN, it becomes
    infinite in all bands.
    """
    joint = open_tables(handle).joint
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], SEND_RATES, address_of(out), 1)
        return
    # Two columns in turn: a quick band may write its next rate while a slow one reads the last.
    count, column = joint[BAND_COUNT], SHARED_RATES + joint[TURNS] % 2
    rates = floats_at(joint[BOARD], LINE * count)
    rates[LINE * joint[BAND] + column] = out[RATE]
    barrier(joint)
    most = 0.0
    for k in range(count):
        rate = rates[LINE * k + column]
        most = max(most, rate if rate == rate else np.inf)
    out[RATE] = most


@njit
def gather_sums(sums, spans, handle):
    """Copy partial sums between bands, so that each band has all entries of `sums`.

    A band is a part of the states, which one thread or process steps.
    spans : int64[q, 5]  blocks of states of this band (`row_blocks` in `steppers.step_operations`); columns 2 and 3 are
        the first entry of the block in `sums` and its number of entries. The first `joint[COMMON_SPANS]` blocks are the
        same in all bands and are written by band 0.
    """
    joint = open_tables(handle).joint
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], SEND_SUMS, address_of(sums), sums.size)
        return
    # Two halves in turn, so that no second barrier is needed after reading.
    buffer = floats_at(joint[SUM_BUFFER] + 8 * sums.size * (joint[TURNS] % 2), sums.size)
    for m in range(joint[COMMON_SPANS] if joint[BAND] > 0 else 0, spans.shape[0]):
        for r in range(spans[m, 2], spans[m, 2] + spans[m, 3]):
            buffer[r] = sums[r]
    barrier(joint)
    for r in range(sums.size):
        sums[r] = buffer[r]
