"""Conversion of an address to a pointer, for `numba.carray`."""

from numba.core import cgutils, types
from numba.extending import intrinsic


@intrinsic
def pointer(typing, address):
    """Void pointer at an integer address."""

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate
