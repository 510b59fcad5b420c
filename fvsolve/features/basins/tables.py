"""Tables that functions of basins read, behind the same handle as those of the model.

Scalars that basins carry are a feature of their own, which many cases do not have. Their tables stand here too, without
rows in such a case.
"""

import functools
from collections import namedtuple

from fvsolve.core.kernels import table_handle
from fvsolve.features.scalars.kernels import tables as carried
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 4
RECORDS = {"scalars": carried.SCALAR, "reactions": carried.REACTION}
BasinTables = namedtuple("BasinTables", tuple(RECORDS))


@functools.cache
def basin_types() -> BasinTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    return BasinTables(*(types.Array(from_dtype(kind), 1, "C") for kind in RECORDS.values()))


if COMPILING:

    @Intrinsic
    def open_basins(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of basins."""
        return table_handle.open_with("BasinTables", basin_types, SLOT, handle)
else:

    def open_basins(handle):
        """Tables of a handle as `open_tables`, and those of basins."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
