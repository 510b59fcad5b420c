"""What bands of one state tell each other, each with arrays of its own. Knows addresses; knows no law.

All bands make the same calls in the same order. Whoever tells something puts it down, and all wait for each other
before they look and before anyone may write there again. `joint` of a band's handle says where; it is empty where one
band is all there is, and then none of these functions is called. Bands are threads, which see each other's memory, or
processes, whose joint is a function of Python's (`solve.ranks`).
"""

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic, njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import RATE

# Places in `joint`, int64: number of this band, how many there are, addresses of the board that all see, of the room
# for sums, and of the system's function that lets others run; how often this band has waited; how many of its spans
# all bands have; how many runs of states it takes from others, and of flows through faces: triples from HEAD on of
# owner, first and one beyond the last; address of the function that tells processes, 0 for threads.
ME, MANY, BOARD, ROOM, YIELD, TURNS, ALIKE, STATES, FLOWS, TELL = range(10)
OF_STATES, OF_FLOWS, OF_RATES, OF_SUMS = range(4)  # what that is told: which, the address of numbers and how many
HEAD = 16
LINE = 8  # numbers of a cache line: on the board each band has one: how often it has come, what it shows, two rates
SHOWN, RATES = 1, 2
PATIENCE = 2000  # looks before others are let run

if COMPILING:

    def at_address(context, builder, kind, address, size):
        """An array of numbers that lie at an address."""
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
        """Where an array begins."""
        from numba.core import types
        from numba.np.arrayobj import make_array

        def generate(context, builder, kind, args):
            data = make_array(kind.args[0])(context, builder, args[0]).data
            return builder.ptrtoint(data, context.get_value_type(types.int64))

        return types.int64(array), generate

    @Intrinsic
    def put(typingctx, address, value):
        """Write a number that others wait for, after all that was written before."""
        from numba.core import types

        def generate(context, builder, kind, args):
            place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
            builder.store_atomic(args[1], place, ordering="release", align=8)
            return context.get_dummy_value()

        return types.none(types.int64, types.int64), generate

    @Intrinsic
    def get(typingctx, address):
        """Read such a number, before all that is read after."""
        from numba.core import types

        def generate(context, builder, kind, args):
            place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
            return builder.load_atomic(place, ordering="acquire", align=8)

        return types.int64(types.int64), generate

    @Intrinsic
    def tell(typingctx, address, what, numbers, size):
        """Call the function at an address, which tells other processes."""
        from llvmlite import ir
        from numba.core import types

        def generate(context, builder, kind, args):
            word = ir.IntType(64)
            shape = ir.FunctionType(ir.VoidType(), [word] * 3)
            builder.call(builder.inttoptr(args[0], shape.as_pointer()), args[1:])
            return context.get_dummy_value()

        return types.none(*[types.int64] * 4), generate

    @Intrinsic
    def let_run(typingctx, address):
        """Call the system's function at an address, which lets other threads run."""
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
        """Where an array begins."""
        return array.ctypes.data

    def put(address, value):
        """Write a number that others wait for."""
        ctypes.c_int64.from_address(int(address)).value = int(value)

    def get(address):
        """Read such a number."""
        return ctypes.c_int64.from_address(int(address)).value

    def tell(address, what, numbers, size):
        """Call the function at an address."""
        ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(int(address))(what, numbers, int(size))

    def let_run(address):
        """Let other threads run."""
        time.sleep(0.0)


@njit
def wait(joint):
    """Wait until all bands are here: a while for quick ones, then letting others run, who may want this core."""
    board, many = joint[BOARD], joint[MANY]
    joint[TURNS] += 1
    turn = joint[TURNS]
    put(board + 8 * LINE * joint[ME], turn)
    for k in range(many):
        looks = 0
        while get(board + 8 * LINE * k) < turn:
            looks += 1
            if looks > PATIENCE:
                let_run(joint[YIELD])


@njit
def fetch(joint, what, values):
    """Take runs of states or flows from the bands that have them, in the array that each shows in its place."""
    if joint[TELL] != 0:
        tell(joint[TELL], what, address_of(values), values.size)
        return
    first, count = HEAD, joint[STATES]
    if what == OF_FLOWS:
        first, count = HEAD + 3 * joint[STATES], joint[FLOWS]
    place = joint[BOARD] + 8 * SHOWN
    put(place + 8 * LINE * joint[ME], address_of(values))
    wait(joint)
    for r in range(count):
        at = first + 3 * r
        owner, begin, stop = joint[at], joint[at + 1], joint[at + 2]
        theirs = floats_at(get(place + 8 * LINE * owner), values.size)[begin:stop]
        ours = values[begin:stop]
        for i in range(ours.size):
            ours[i] = theirs[i]
    wait(joint)


@njit
def meet(t, y, dydt, out, handle):
    """Take the states that rates of this band hang on and others step."""
    joint = open_tables(handle).joint
    fetch(joint, OF_STATES, y)


@njit
def agree(t, y, dydt, out, handle):
    """Let the greatest rate of all bands be that of each; what is no number, of any, is infinite for all."""
    joint = open_tables(handle).joint
    if joint[TELL] != 0:
        tell(joint[TELL], OF_RATES, address_of(out), 1)
        return
    many, column = joint[MANY], RATES + joint[TURNS] % 2
    rates = floats_at(joint[BOARD], LINE * many)
    rates[LINE * joint[ME] + column] = out[RATE]
    wait(joint)
    most = 0.0
    for k in range(many):
        rate = rates[LINE * k + column]
        most = max(most, rate if rate == rate else np.inf)
    out[RATE] = most


@njit
def share(sums, spans, handle):
    """Bring to all the sums of all; spans : as of `steppers.step`, of which ALIKE are the same for all bands."""
    joint = open_tables(handle).joint
    if joint[TELL] != 0:
        tell(joint[TELL], OF_SUMS, address_of(sums), sums.size)
        return
    room = floats_at(joint[ROOM] + 8 * sums.size * (joint[TURNS] % 2), sums.size)
    for m in range(joint[ALIKE] if joint[ME] > 0 else 0, spans.shape[0]):
        for r in range(spans[m, 2], spans[m, 2] + spans[m, 3]):
            room[r] = sums[r]
    wait(joint)
    for r in range(sums.size):
        sums[r] = room[r]
