"""An address as a pointer, for `numba.carray`. Knows no array."""

from numba.core import cgutils, types
from numba.extending import intrinsic


@intrinsic
def pointer(typing, address):
    """The void pointer at an integer address."""

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate
