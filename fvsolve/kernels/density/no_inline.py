"""Prevent LLVM from inlining a density law, so that the dispatch function stays small enough to be inlined itself."""

from fvsolve.jit import COMPILING, Intrinsic, njit

if COMPILING:

    @Intrinsic
    def prevent_inlining(typingctx):
        """Prevent LLVM from inlining the function that contains this call; halves the compile time of that function."""
        from fvsolve.compile.code_generation import no_inlining

        return no_inlining()
else:

    def prevent_inlining():
        """Do nothing, because without numba no function is inlined."""


def law_njit(function):
    """Compile by `njit` a function that only compiled functions call: without wrappers for Python and C.

    `forceinline` is set explicitly: numba otherwise takes it from the first caller that compiles the function, and
    `prevent_inlining` forbids it.
    """
    return njit(function, forceinline=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)
