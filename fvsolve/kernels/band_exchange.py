"""Exchange between bands of a state, each with its own arrays: halo values, greatest rate, sums.

All bands make the same calls in the same order. A band writes its data, then all bands wait for each other before any
band reads them, and again before any band overwrites them. `joint` of a band's handle holds the addresses. It is empty
if there is a single band, and then none of these functions is called. Bands are threads, which share memory, or
processes, whose exchange is a Python function (`solve.ranks`).
"""

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic, njit
from fvsolve.kernels.dtypes import RATE
from fvsolve.kernels.table_handle import open_tables

# Entries of `joint`, int64: number of this band; number of bands; addresses of the board shared by all, of the buffer
# for sums, and of the system function that yields the processor; number of barriers passed; number of spans common to
# all bands; number of runs of states read from other bands, and of flows through faces; address of the function that
# exchanges between processes, 0 for threads. The runs follow from HEAD on: owner, first, and last + 1 of each.
BAND, BAND_COUNT, BOARD, SUM_BUFFER, YIELD, TURNS, COMMON_SPANS, STATES, FLOWS, PROCESS_CALL = range(10)
SEND_STATES, SEND_FLOWS, SEND_RATES, SEND_SUMS = range(4)  # kind of exchange between processes
HEAD = 16
LINE = 8  # numbers in a cache line; the line of a band on the board: barriers passed, shared address, two rates
SHARED_ADDRESS, SHARED_RATES = 1, 2
SPIN_LIMIT = 2000  # polls at a barrier before the thread yields

if COMPILING:

    def at_address(context, builder, kind, address, size):
        """Array of numbers at an address."""
        from numba.core import types
        from numba.np.arrayobj import make_array, populate_array

        array = make_array(kind)(context, builder)
        width = context.get_constant(types.intp, kind.dtype.bitwidth // 8)
        data = builder.inttoptr(address, array.data.type)
        populate_array(array, data=data, shape=[size], strides=[width], itemsize=width, meminfo=None)
        return array._getvalue()

    @Intrinsic
    def floats_at(typingctx, address, size):
        """float64[size] at an address."""
        from numba.core import types

        def generate(context, builder, kind, args):
            return at_address(context, builder, kind.return_type, *args)

        return types.float64[::1](types.int64, types.int64), generate

    @Intrinsic
    def address_of(typingctx, array):
        """Address of the first entry of an array."""
        from numba.core import types
        from numba.np.arrayobj import make_array

        def generate(context, builder, kind, args):
            data = make_array(kind.args[0])(context, builder, args[0]).data
            return builder.ptrtoint(data, context.get_value_type(types.int64))

        return types.int64(array), generate

    @Intrinsic
    def store_release(typingctx, address, value):
        """Store a number on which other bands wait, after all writes before it (release)."""
        from numba.core import types

        def generate(context, builder, kind, args):
            place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
            builder.store_atomic(args[1], place, ordering="release", align=8)
            return context.get_dummy_value()

        return types.none(types.int64, types.int64), generate

    @Intrinsic
    def load_acquire(typingctx, address):
        """Load such a number, before all reads after it (acquire)."""
        from numba.core import types

        def generate(context, builder, kind, args):
            place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
            return builder.load_atomic(place, ordering="acquire", align=8)

        return types.int64(types.int64), generate

    @Intrinsic
    def call_processes(typingctx, address, content, numbers, size):
        """Call the function at an address, which exchanges with other processes."""
        from llvmlite import ir
        from numba.core import types

        def generate(context, builder, kind, args):
            word = ir.IntType(64)
            shape = ir.FunctionType(ir.VoidType(), [word] * 3)
            builder.call(builder.inttoptr(args[0], shape.as_pointer()), args[1:])
            return context.get_dummy_value()

        return types.none(*[types.int64] * 4), generate

    @Intrinsic
    def yield_thread(typingctx, address):
        """Call the system function at an address, which yields the processor to other threads."""
        from llvmlite import ir
        from numba.core import types

        def generate(context, builder, kind, args):
            shape = ir.FunctionType(ir.IntType(32), [])
            builder.call(builder.inttoptr(args[0], shape.as_pointer()), [])
            return context.get_dummy_value()

        return types.none(types.int64), generate
else:
    import ctypes
    import time

    def floats_at(address, size):
        """float64[size] at an address."""
        return np.ctypeslib.as_array((ctypes.c_double * int(size)).from_address(int(address)))

    def address_of(array):
        """Address of the first entry of an array."""
        return array.ctypes.data

    def store_release(address, value):
        """Store a number on which other bands wait."""
        ctypes.c_int64.from_address(int(address)).value = int(value)

    def load_acquire(address):
        """Load such a number."""
        return ctypes.c_int64.from_address(int(address)).value

    def call_processes(address, content, numbers, size):
        """Call the function at an address."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(int(address))(content, numbers, int(size))

    def yield_thread(address):
        """Yield the processor to other threads."""
        time.sleep(0.0)


@njit
def barrier(joint):
    """Wait until all bands arrive: poll first, then yield the processor, which a late band may need."""
    board, count = joint[BOARD], joint[BAND_COUNT]
    joint[TURNS] += 1
    turn = joint[TURNS]
    store_release(board + 8 * LINE * joint[BAND], turn)
    for k in range(count):
        polls = 0
        while load_acquire(board + 8 * LINE * k) < turn:
            polls += 1
            if polls > SPIN_LIMIT:
                yield_thread(joint[YIELD])


@njit
def get_runs(joint, content, values):
    """Copy runs of states or flows from the bands that own them to the same places of `values`.

    content : SEND_STATES or SEND_FLOWS. Each band shares the address of its array.
    """
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], content, address_of(values), values.size)
        return
    first, count = HEAD, joint[STATES]
    if content == SEND_FLOWS:
        first, count = HEAD + 3 * joint[STATES], joint[FLOWS]
    place = joint[BOARD] + 8 * SHARED_ADDRESS
    store_release(place + 8 * LINE * joint[BAND], address_of(values))
    barrier(joint)
    for r in range(count):
        at = first + 3 * r
        owner, begin, stop = joint[at], joint[at + 1], joint[at + 2]
        theirs = floats_at(load_acquire(place + 8 * LINE * owner), values.size)[begin:stop]
        ours = values[begin:stop]
        for i in range(ours.size):
            ours[i] = theirs[i]
    barrier(joint)


@njit
def exchange_states(t, y, dydt, out, handle):
    """Copy the states of other bands on which the rates of this band depend."""
    joint = open_tables(handle).joint
    get_runs(joint, SEND_STATES, y)


@njit
def reduce_rate(t, y, dydt, out, handle):
    """Set out[RATE] of each band to the greatest rate of all bands; NaN in any band becomes infinity in all."""
    joint = open_tables(handle).joint
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], SEND_RATES, address_of(out), 1)
        return
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
    """Gather the sums of all bands in each band.

    spans : see `steppers.step_operations`; the first `joint[COMMON_SPANS]` of them are the same in all bands and are
    written by band 0
    """
    joint = open_tables(handle).joint
    if joint[PROCESS_CALL] != 0:
        call_processes(joint[PROCESS_CALL], SEND_SUMS, address_of(sums), sums.size)
        return
    buffer = floats_at(joint[SUM_BUFFER] + 8 * sums.size * (joint[TURNS] % 2), sums.size)
    for m in range(joint[COMMON_SPANS] if joint[BAND] > 0 else 0, spans.shape[0]):
        for r in range(spans[m, 2], spans[m, 2] + spans[m, 3]):
            buffer[r] = sums[r]
    barrier(joint)
    for r in range(sums.size):
        sums[r] = buffer[r]
