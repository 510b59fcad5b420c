"""Declared types of the functions that the time loop calls, and functions compiled for exactly these types.

With declared types the loop is compiled once, cached, and used for every method and every model. Letters are those of
`jit.plain_kinds`: t, i numbers, c a complex number, v, w rows and tables of floats, h, s of integers, z of complex
numbers.
"""

import functools

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic, declare_function, njit, plain_kinds

FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX = "hvtv", "hvv", "hvcz", "hzz"
ATTEMPT = "hvhsvttwiiwwivvvvvwvz"  # arguments of a step, after its functions
FUSED_STEP, OBSERVE, EVENTS, RHS, JOIN = "ttvvvhv", "tvvhv", "tvhv", "tvvvh", "vsh"


@functools.cache
def function_types():
    """Numba types of (attempt, fused step, observe, record, events, rhs, real and complex linear algebra, join)."""
    from numba import types

    def of(letters, returned=types.void):
        return types.FunctionType(returned(*argument_types(letters)))

    algebra = (
        of(FACTOR, types.int64), of(SOLVE),
        of(FACTOR_COMPLEX, types.int64), of(SOLVE_COMPLEX),
    )  # fmt: skip
    attempt = types.FunctionType(types.float64(of(RHS), *algebra, of(JOIN), *argument_types(ATTEMPT)))
    return attempt, of(FUSED_STEP), of(OBSERVE), of(OBSERVE), of(EVENTS), of(RHS), *algebra, of(JOIN)


def argument_types(letters: str) -> tuple:
    """Numba types of the arguments; F stands for the functions that a step takes."""
    kinds = plain_kinds()
    return tuple(kind for letter in letters for kind in (function_types()[5:] if letter == "F" else (kinds[letter],)))


if COMPILING:

    def function_from_address(index: int):
        """Intrinsic that turns an address into a callable of type `index` in `function_types`."""

        @Intrinsic
        def function_at(typingctx, address):
            from numba.core import cgutils, types

            kind = function_types()[index]

            def generate(context, builder, signature, arguments):
                proxy = cgutils.create_struct_proxy(kind)(context, builder)
                proxy.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
                proxy.py_addr = proxy.jit_addr = cgutils.voidptr_t(None)
                return proxy._getvalue()

            return kind(types.int64), generate

        return function_at

    attempt_at, fused_step_at, observe_at, record_at, events_at, rhs_at = map(function_from_address, range(6))
    factor_at, solve_at, factor_complex_at, solve_complex_at, join_at = map(function_from_address, range(6, 11))


def addresses(functions: tuple):
    """Addresses of functions, to pass from Python to compiled code : int64[n]; the functions themselves without JIT."""
    return np.array([function.address for function in functions]) if COMPILING else functions


def no_factor(structure, jacobian, shift, factors):
    """Do nothing, in place of a factorisation, for steps that solve no equations."""
    return 0


def no_solve(structure, factors, x):
    """Do nothing, in place of a solution, for steps that solve no equations."""


@functools.cache
def no_algebra():
    """(factor, solve, factor_complex, solve_complex) for steps that solve no equations."""
    letters = (FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX)
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((no_factor, no_solve) * 2, letters, strict=True))


def single_band(sums, row_blocks, handle):
    """Do nothing, in place of an exchange between bands, for a single band."""


@functools.cache
def no_exchange():
    """Compiled exchange for a single band."""
    return compiled_as(njit(single_band), JOIN)


def compiled_as(function, letters: str):
    """Compile a function for arguments of these types only, in the form that the loop calls."""
    return declare_function(function, letters, argument_types)


def compiled_step(attempt):
    """Compile a step for the signature that the loop calls."""
    return compiled_as(attempt, "F" + ATTEMPT)
