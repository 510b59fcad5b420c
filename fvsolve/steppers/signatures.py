"""Declared types of the functions that the time loop calls, and functions compiled for exactly these types.

With declared types the loop is compiled once, cached, and used for every method and every model. A letter stands for
the type of an argument, as in `jit.plain_kinds`: t float64, i int64, c complex128; arrays with one and two dimensions
v and w of float64, h and s of int64; z array of complex128.
"""

import functools

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic, declare_function, njit, plain_kinds

FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX = "hvtv", "hvv", "hvcz", "hzz"
ATTEMPT = "hvhsvttwiiwwivvvvvwvz"  # arguments of a step, after its functions
FUSED_STEP, OBSERVE, EVENTS, RHS, JOIN = "ttvvvhv", "tvvhv", "tvhv", "tvvvh", "vsh"


@functools.cache
def function_types():
    """Numba types of the functions attempt, fused step, observe, record, events, rhs, linear algebra and join."""
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
    """Numba types of arguments given as letters of `jit.plain_kinds`; F stands for all functions that a step takes."""
    kinds = plain_kinds()
    return tuple(kind for letter in letters for kind in (function_types()[5:] if letter == "F" else (kinds[letter],)))


if COMPILING:

    def function_from_address(index: int):
        """Intrinsic that turns an address into a callable function of type number `index` in `function_types`."""

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
    """Functions factor, solve, factor_complex and solve_complex that do nothing, for explicit steps."""
    letters = (FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX)
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((no_factor, no_solve) * 2, letters, strict=True))


def single_band(sums, row_blocks, handle):
    """Do nothing, in place of an exchange between bands, for a single band."""


@functools.cache
def no_exchange():
    """Compiled function that exchanges no data, for a model that is not divided into bands."""
    return compiled_as(njit(single_band), JOIN)


def compiled_as(function, letters: str):
    """Compile a function for arguments of the types `letters` only, in the form that the time loop calls."""
    return declare_function(function, letters, argument_types)


def compiled_step(attempt):
    """Compile the step of a method for the argument types that the time loop uses."""
    return compiled_as(attempt, "F" + ATTEMPT)
