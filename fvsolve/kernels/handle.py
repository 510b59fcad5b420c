"""The tables of a model behind one small array of addresses. Knows numba's array layout; knows no law.

Passing twenty arrays from function to function costs half a microsecond of copying a step and seconds of compiling.
A handle costs nothing: compiled code loads a table only where it asks for it. Whoever makes a handle keeps its
tables alive, and their places and sizes as they are.
"""

import os

import numpy as np

from fvsolve.kernels.records import Called, table_types

if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
    from numba.core import cgutils, types
    from numba.core.imputils import lower_getattr_generic
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.extending import intrinsic, models, register_model

    class Tables(types.Opaque):
        """What `open_tables` gives: a bare address, whose attributes are the tables."""

        def __init__(self) -> None:
            super().__init__("Tables")

    register_model(Tables)(models.OpaqueModel)

    def make_handle(tables: tuple) -> np.ndarray:
        """int64[3 n]: address, rows and columns of each table."""
        return np.array([x for a in tables for x in (a.ctypes.data, a.shape[0], a.shape[-1])], dtype=np.int64)

    @intrinsic
    def open_tables(typingctx, handle):
        """The tables behind a handle, uncounted; `tables.nodes` loads one."""
        from numba.np.arrayobj import make_array

        def generate(context, builder, kind, args):
            base = make_array(kind.args[0])(context, builder, args[0]).data
            return builder.bitcast(base, context.get_value_type(kind.return_type))

        return Tables()(handle), generate

    @infer_getattr
    class TableOf(AttributeTemplate):
        """The type of `tables.name`."""

        key = Tables

        def generic_resolve(self, kind, name):
            return getattr(table_types(), name, None)

    @lower_getattr_generic(Tables)
    def load_table(context, builder, kind, value, name):
        """The array whose address, rows and columns are three words of the handle; they never change."""
        from numba.np.arrayobj import make_array, populate_array

        member, word = getattr(table_types(), name), context.get_value_type(types.intp)
        base, first = builder.bitcast(value, word.as_pointer()), 3 * Called._fields.index(name)

        def entry(i):
            loaded = builder.load(cgutils.gep_inbounds(builder, base, first + i))
            loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
            return loaded

        array = make_array(member)(context, builder)
        size = word(context.get_abi_sizeof(context.get_data_type(member.dtype)))
        address, rows, columns = entry(0), entry(1), entry(2)
        populate_array(
            array,
            data=builder.inttoptr(address, array.data.type),
            shape=[rows] if member.ndim == 1 else [rows, columns],
            strides=[size] if member.ndim == 1 else [builder.mul(columns, size), size],
            itemsize=size,
            meminfo=None,
        )
        return array._getvalue()
else:

    def make_handle(tables: tuple) -> Called:
        """The tables themselves: without compiling there is nothing to copy."""
        return Called(*tables, *[None] * (len(Called._fields) - len(tables)))

    def open_tables(handle):
        """The tables behind a handle."""
        return handle
