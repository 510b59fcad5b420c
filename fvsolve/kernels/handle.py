"""The tables of a model behind one small array of addresses. Knows where tables lie; knows no law.

Passing twenty arrays from function to function costs half a microsecond of copying a step and seconds of compiling.
A handle costs nothing: compiled code loads a table only where it asks for it. Whoever makes a handle keeps its
tables alive, and their places and sizes as they are.
"""

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic
from fvsolve.kernels.records import Called

if COMPILING:

    def places_of(tables: tuple) -> tuple:
        """Address, rows and columns of each table, one after the other."""
        return tuple(x for a in tables for x in (a.ctypes.data, a.shape[0], a.shape[-1]))

    def joined(places: tuple) -> np.ndarray:
        """int64[3 n]: the handle of tables at these places."""
        return np.array(places, dtype=np.int64)

    def room_within() -> np.ndarray:
        """Room for a handle among the tables behind another."""
        return np.zeros(3 * len(Called._fields), dtype=np.int64)

    @Intrinsic
    def open_tables(typingctx, handle):
        """The tables behind a handle, uncounted; `tables.nodes` loads one."""
        from fvsolve.kernels.opened import Tables, first_word

        return Tables()(handle), first_word
else:

    def places_of(tables: tuple) -> tuple:
        """The tables themselves: without compiling there is nothing to copy."""
        return tuple(tables)

    def joined(places: tuple) -> Called:
        """The handle of these tables."""
        return Called(*places, *[None] * (len(Called._fields) - len(places)))

    def room_within() -> np.ndarray:
        """Room for a handle among the tables behind another."""
        return np.empty(1, dtype=object)

    def open_tables(handle):
        """The tables behind a handle, or behind one that stands among others."""
        return handle[0] if isinstance(handle, np.ndarray) else handle


def make_handle(tables: tuple):
    """The handle of these tables."""
    return joined(places_of(tables))


def linked(shared: tuple, sharp: tuple, written: tuple, called: tuple):
    """The handle of a model's tables at these places and what a run writes; behind its `sharp` with others of these.

    shared, sharp : places of the model's tables, and of those that a jump of a delay line meets
    """
    own = places_of((*written, *called))
    if written.sharp.size > 0:
        within = joined((*sharp, *own))
        if COMPILING:
            written.sharp[:] = within
        else:
            written.sharp[0] = within
    return joined((*shared, *own))
