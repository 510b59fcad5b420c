"""The tables of a model behind one small array of addresses. Knows numba's array layout; knows no law.

Seventeen arrays in a call cost half a microsecond of copying. A handle costs nothing: compiled functions open
it and load only what they touch. Whoever makes a handle keeps its tables alive.
"""

import os

import numpy as np

from fvsolve.kernels.records import tables_type

if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    def make_handle(tables: tuple) -> np.ndarray:
        """int64[3 n]: address, rows and columns of each table."""
        return np.array([x for a in tables for x in (a.ctypes.data, a.shape[0], a.shape[-1])], dtype=np.int64)

    @intrinsic
    def open_tables(typingctx, handle):
        """The tuple of tables behind a handle, uncounted."""
        kind = tables_type()

        def generate(context, builder, signature, args):
            from numba.np.arrayobj import make_array, populate_array

            base = make_array(signature.args[0])(context, builder, args[0]).data
            word = context.get_value_type(types.intp)

            def entry(i):
                return builder.load(cgutils.gep_inbounds(builder, base, i))

            arrays = []
            for i, member in enumerate(kind.types):
                array = make_array(member)(context, builder)
                size = context.get_abi_sizeof(context.get_data_type(member.dtype))
                rows, columns = entry(3 * i + 1), entry(3 * i + 2)
                shape = [rows] if member.ndim == 1 else [rows, columns]
                strides = [word(size)] if member.ndim == 1 else [builder.mul(columns, word(size)), word(size)]
                populate_array(
                    array,
                    data=builder.inttoptr(entry(3 * i), array.data.type),
                    shape=shape,
                    strides=strides,
                    itemsize=word(size),
                    meminfo=None,
                )
                arrays.append(array._getvalue())
            return context.make_tuple(builder, kind, arrays)

        return kind(handle), generate
else:

    def make_handle(tables: tuple) -> tuple:
        """The tables themselves: without compiling there is nothing to copy."""
        return tables

    def open_tables(handle):
        """The tables behind a handle."""
        return handle
