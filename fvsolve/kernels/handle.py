"""The tables of a model behind one small array of addresses. Knows where tables lie; knows no law.

Passing twenty arrays from function to function costs half a microsecond of copying a step and seconds of compiling.
A handle costs nothing: compiled code loads a table only where it asks for it. Whoever makes a handle keeps its
tables alive, and their places and sizes as they are.
"""

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic
from fvsolve.kernels.records import Called

if COMPILING:

    def make_handle(tables: tuple) -> np.ndarray:
        """int64[3 n]: address, rows and columns of each table."""
        return np.array([x for a in tables for x in (a.ctypes.data, a.shape[0], a.shape[-1])], dtype=np.int64)

    @Intrinsic
    def open_tables(typingctx, handle):
        """The tables behind a handle, uncounted; `tables.nodes` loads one."""
        from fvsolve.kernels.opened import Tables, first_word

        return Tables()(handle), first_word
else:

    def make_handle(tables: tuple) -> Called:
        """The tables themselves: without compiling there is nothing to copy."""
        return Called(*tables, *[None] * (len(Called._fields) - len(tables)))

    def open_tables(handle):
        """The tables behind a handle."""
        return handle
