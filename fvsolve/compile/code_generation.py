"""Numba types and machine code that numba does not offer: handles of tables, calls by address, views of memory.

This module imports numba, so others import it within functions that run only when something is compiled.
Arguments of all code generators: context, builder of numba's code generation; kind : signature of the call; args :
its arguments as values of LLVM.
"""

from collections.abc import Callable

from llvmlite import ir
from numba.core import cgutils, errors, types
from numba.core.datamodel import register_default
from numba.core.datamodel.models import ArrayModel
from numba.core.imputils import lower_cast, lower_getattr_generic
from numba.core.types.npytypes import Array
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import models, register_model
from numba.np.arrayobj import make_array, populate_array


class Tables(types.Opaque):
    """Open handle: a bare address, whose attributes are the tables.

    name : name of the kind of handle
    members : function without arguments that returns the numba types of its tables, a named tuple
    own : as `members`, for further tables of a feature, whose handle is entry `slot` of the table `features`
    """

    def __init__(
        self,
        name: str,
        members: Callable[[], tuple],
        own: Callable[[], tuple] | None = None,
        slot=0,
    ) -> None:
        super().__init__(name)
        self.members, self.own, self.slot = members, own, slot


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
        member = getattr(kind.members(), name, None)
        return (
            getattr(kind.own(), name, None) if member is None and kind.own is not None else member
        )


@lower_getattr_generic(Tables)
def load_table(context, builder, kind, value, name):
    """Generate code that loads the array of the table `name` from a handle.

    Address, rows and columns of the table are three words of the handle, which never change.
    """
    members, word = kind.members(), context.get_value_type(types.intp)
    base = builder.bitcast(value, word.as_pointer())

    def load(base, i):
        loaded = builder.load(cgutils.gep_inbounds(builder, base, i))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if not hasattr(members, name):  # a table of a feature
        slots = builder.inttoptr(
            load(base, 3 * members._fields.index("features")), word.as_pointer()
        )
        base, members = builder.inttoptr(load(slots, kind.slot), word.as_pointer()), kind.own()
    member, first = getattr(members, name), 3 * members._fields.index(name)

    def entry(i):
        return load(base, first + i)

    array = make_array(member)(context, builder)
    size = word(context.get_abi_sizeof(context.get_data_type(member.dtype)))
    address = entry(0)
    rows = entry(1)
    columns = entry(2)
    populate_array(
        array,
        data=builder.inttoptr(address, array.data.type),
        shape=[rows] if member.ndim == 1 else [rows, columns],
        strides=[size] if member.ndim == 1 else [builder.mul(columns, size), size],
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()


class Vector(Array):
    """Numba type of a contiguous vector of numbers, passed as a memory address and a length.

    Numba passes an array as seven words, of which five are equal for all vectors. Four arrays in a call then cost more
    than a small function of the right-hand side.
    """

    def __init__(self, dtype: types.Type) -> None:
        super().__init__(dtype, 1, "C", name=f"vector({dtype})")


@register_default(Vector)
class VectorModel(ArrayModel):
    """Data model of `Vector`: an array whose other five words are set by the called function."""

    def get_argument_type(self) -> tuple:
        """Types of the two words that are passed: address and length."""
        return self._of("data").get_argument_type(), self._of("nitems").get_argument_type()

    def _of(self, field: str):
        return self.get_model(self.get_field_position(field))

    def as_argument(self, builder, value) -> tuple:
        """Two words that are passed for an array: address and length."""
        return self.get(builder, value, "data"), self.get(builder, value, "nitems")

    def from_argument(self, builder, value):
        """Array from its two words, address and length; it has no reference count, and a single row without gaps."""
        data, count = value
        size = count.type(self.fe_type.dtype.bitwidth // 8)
        empty = cgutils.get_null_value(self.get_value_type())
        for field, word in (("data", data), ("nitems", count), ("itemsize", size)):
            empty = self.set(builder, empty, word, field)
        for field, word in (("shape", count), ("strides", size)):
            place = self.get_field_position(field)
            empty = builder.insert_value(empty, word, [place, 0])
        return empty


@lower_cast(Array, Vector)
@lower_cast(Vector, Array)
def identity_cast(context, builder, from_type, to_type, value):
    """Convert an array to a vector or back: the words are equal, so nothing is converted."""
    return value


def call_by_address(kinds: tuple, results: tuple):
    """Numba signature and code generator of a call whose first argument is the address of the function.

    kinds, results : numba types of the other arguments and of the results
    """
    result = (
        types.none if not results else results[0] if len(results) == 1 else types.Tuple(results)
    )

    def generate(context, builder, kind, args):
        shape = context.call_conv.get_function_type(result, kinds)
        pointer = builder.inttoptr(args[0], shape.as_pointer())
        _, value = context.call_conv.call_function(builder, pointer, result, kinds, args[1:])
        return value if results else context.get_dummy_value()

    return result(types.int64, *kinds), generate


def call_in_table(loop, given, row: int, kinds: tuple, results: tuple):
    """Signature and code generator of a call of a function whose address is an entry of a table in memory.

    loop, given : types of a function, which is not used, and of the tuple of arguments; functions in it are left out
    row : row of the table, whose address is the second argument; kinds, results : as for `call_by_address`
    Raises TypingError if the arguments cannot be passed as `kinds`.
    """
    places = [k for k, kind in enumerate(given.types) if not isinstance(kind, types.Dispatcher)]
    if tuple(_passed(given.types[k]) for k in places) != kinds:
        raise errors.TypingError(
            f"{loop} is called with {given}; its entry in the table has {kinds}"
        )
    signature, call = call_by_address(kinds, results)

    def generate(context, builder, kind, args):
        word = context.get_value_type(types.int64)
        table = builder.inttoptr(args[1], word.as_pointer())
        address = builder.load(cgutils.gep_inbounds(builder, table, row))
        return call(
            context, builder, None, [address, *(builder.extract_value(args[2], k) for k in places)]
        )

    return signature.return_type(loop, types.int64, given), generate


def _passed(kind):
    """Type by which an argument of a numba type is passed: vectors as two words; literal numbers as numbers."""
    if isinstance(kind, types.BaseTuple):
        return types.UniTuple(_passed(kind.types[0]), len(kind))
    if isinstance(kind, Array) and kind.ndim == 1 and kind.layout == "C":
        return Vector(kind.dtype)
    return types.unliteral(kind)


def c_call(arguments: int, bits: int = 0):
    """Signature and code generator of a call of a C function, whose address is the first argument.

    arguments : number of its arguments, 64-bit integers; bits : size of its result, which is not used; 0 without one
    """

    def generate(context, builder, kind, args):
        shape = ir.FunctionType(
            ir.IntType(bits) if bits else ir.VoidType(), [ir.IntType(64)] * arguments
        )
        builder.call(builder.inttoptr(args[0], shape.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.none(types.int64, *[types.int64] * arguments), generate


def floats_at_address():
    """Signature and code generator of a view of the memory at an address as an array of float64, without a copy."""

    def generate(context, builder, kind, args):
        array = make_array(kind.return_type)(context, builder)
        width = context.get_constant(types.intp, kind.return_type.dtype.bitwidth // 8)
        data = builder.inttoptr(args[0], array.data.type)
        populate_array(
            array, data=data, shape=[args[1]], strides=[width], itemsize=width, meminfo=None
        )
        return array._getvalue()

    return types.float64[::1](types.int64, types.int64), generate


def address_of_array(array):
    """Signature and code generator of the memory address of the first entry of an array of this numba type."""

    def generate(context, builder, kind, args):
        data = make_array(kind.args[0])(context, builder, args[0]).data
        return builder.ptrtoint(data, context.get_value_type(types.int64))

    return types.int64(array), generate


def atomic_store():
    """Signature and code generator of a store of an integer at an address, with release ordering."""

    def generate(context, builder, kind, args):
        place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
        builder.store_atomic(args[1], place, ordering="release", align=8)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64), generate


def atomic_load():
    """Signature and code generator of a load of an integer from an address, with acquire ordering."""

    def generate(context, builder, kind, args):
        place = builder.inttoptr(args[0], context.get_value_type(types.int64).as_pointer())
        return builder.load_atomic(place, ordering="acquire", align=8)

    return types.int64(types.int64), generate


def estimated_cube_root_reciprocal():
    """Signature and code generator of an estimate of x^(-1/3) for x > 0, within 4 %, from the bits of x.

    A third of the upper half of the bits divides exponent and mantissa by about 3. Loops with it vectorise.
    """

    def generate(context, builder, kind, args):
        word = ir.IntType(64)
        upper = builder.lshr(builder.bitcast(args[0], word), word(32))
        third = builder.lshr(builder.mul(upper, word(0xAAAAAAAB)), word(33))
        return builder.bitcast(
            builder.shl(builder.sub(word(0x553EF0FF), third), word(32)), ir.DoubleType()
        )

    return types.float64(types.float64), generate


def no_inlining():
    """Signature and code generator of a mark that LLVM does not inline the function that contains it."""

    def generate(context, builder, kind, args):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.none(), generate
