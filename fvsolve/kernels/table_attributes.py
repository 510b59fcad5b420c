"""Numba type of an open handle: its attributes load the tables."""

from numba.core import cgutils, types
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import models, register_model
from numba.np.arrayobj import make_array, populate_array

from fvsolve.kernels.dtypes import table_types


class Tables(types.Opaque):
    """Open handle: a bare address, whose attributes are the tables.

    name : name of the kind of handle; members : function without arguments that returns the numba types of its tables,
    a named tuple. The default is the handle of a model, opened by `open_tables`.
    """

    def __init__(self, name: str = "Tables", members=table_types) -> None:
        super().__init__(name)
        self.members = members


register_model(Tables)(models.OpaqueModel)


def handle_address(context, builder, kind, args):
    """Generate code for the memory address of the first word of a handle."""
    base = make_array(kind.args[0])(context, builder, args[0]).data
    return builder.bitcast(base, context.get_value_type(kind.return_type))


@infer_getattr
class TableOf(AttributeTemplate):
    """Numba type of an attribute of an open handle, such as `tables.nodes`: the type of the table of this name."""

    key = Tables

    def generic_resolve(self, kind, name):
        return getattr(kind.members(), name, None)


@lower_getattr_generic(Tables)
def load_table(context, builder, kind, value, name):
    """Generate code that loads the array of the table `name` from a handle.

    Address, rows and columns of the table are three words of the handle, which never change.
    """
    members, word = kind.members(), context.get_value_type(types.intp)
    member, first = getattr(members, name), 3 * members._fields.index(name)
    base = builder.bitcast(value, word.as_pointer())

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
