"""What keeps machine code of a law in one place: the ladder stays small enough to be part of its callers."""

from fvsolve.jit import COMPILING, Intrinsic, njit

if COMPILING:

    @Intrinsic
    def outside(typingctx):
        """Keep LLVM from copying the function around this call into its callers: halves what it adds to compiling."""
        from numba.core import types

        def generate(context, builder, kind, args):
            builder.function.attributes.add("noinline")
            return context.get_dummy_value()

        return types.none(), generate
else:

    def outside():
        """Nothing, without numba."""


def part(function):
    """`njit` for what the questions of this folder alone call: no door to Python.

    Inlining is told, since numba takes it over from whichever caller compiles first, and `outside` forbids it.
    """
    return njit(function, forceinline=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)
