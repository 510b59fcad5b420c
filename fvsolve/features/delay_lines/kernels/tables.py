"""Tables of delay lines, behind the same handle as those of the model."""

import functools
from collections import namedtuple

from fvsolve.core.kernels import table_handle
from fvsolve.core.kernels.dtypes import f8, i8, record
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 0
DELAY = record(  # delay line: stretches of equal travel time, friction in the middle of each
    pipe=i8,  # row of its pipe
    stretch=i8,  # first stretch
    stretches=i8,  # number of its stretches
    tau=f8,  # travel time of a stretch [s]
    hold=f8,  # age of the waves that are read: tau, or the longest step for a shorter stretch [s]
    now=f8,  # fraction that arrives instantly in a shorter stretch, 1 - tau / hold; else 0
    ring=i8,  # number of entries of `past` before its own, see `kernels.delay_lines.wave_history`
    ring_size=i8,  # number of entries of each stretch
    # fraction of a small change of flow transmitted by the friction in the middle of a stretch
    transmission=f8,
    places=i8,  # number of places of fields and envelopes
    # instantaneous flow between the ends of a shorter stretch per pressure [kg/s per Pa]
    couple=f8,
    acts=i8,  # ends whose nodes respond instantly: 1 `from`, 2 `to`, 3 both
)

LINE_SETTINGS = record(
    jumps=f8,  # least jump that is stored as a jump, as fraction of the greatest wave
    # offset in `floats` of the weights b of the method, followed by its c; number of stages
    weights=i8,
    stages=i8,  # number of stages of the method
)
# node_ends : for each node the place of its first end, then that behind the last one; then the ends, 2 line + side
# line_of : row of `delays` for each pipe, or -1; past, sharp : written by a run
LineTables = namedtuple(
    "LineTables", ("delays", "line_settings", "node_ends", "line_of", "past", "sharp")
)


@functools.cache
def line_types() -> LineTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    kinds = (
        from_dtype(DELAY),
        from_dtype(LINE_SETTINGS),
        types.int64,
        types.int64,
        types.float64,
        types.int64,
    )
    return LineTables(*(types.Array(kind, 1, "C") for kind in kinds))


if COMPILING:

    @Intrinsic
    def open_lines(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of delay lines."""
        return table_handle.open_with("LineTables", line_types, SLOT, handle)
else:

    def open_lines(handle):
        """Tables of a handle as `open_tables`, and those of delay lines."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
