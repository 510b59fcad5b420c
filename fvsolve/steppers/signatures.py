"""The declared types of what the time loop calls, and functions compiled for them alone. Knows no function's meaning.

Declared, so that the loop is compiled once, cached, and serves every method and every model.
"""

import functools

from fvsolve.jit import argument, njit, once


@functools.cache
def function_types():
    """Numba types of (attempt, leap, observe, record, events, rhs, and linear algebra, real and complex)."""
    from numba import types

    f, c, i = types.float64, types.complex128, types.int64
    v, z, handle = types.float64[::1], types.complex128[::1], types.int64[::1]
    rhs = types.FunctionType(types.void(f, v, v, v, handle))
    algebra = (
        types.FunctionType(i(handle, v, f, v)), types.FunctionType(types.void(handle, v, v)),
        types.FunctionType(i(handle, v, c, z)), types.FunctionType(types.void(handle, z, z)),
    )  # fmt: skip
    attempt = types.FunctionType(f(*attempt_arguments(rhs, *algebra)))
    leap = types.FunctionType(types.void(f, f, v, v, v, handle, v))
    observe = types.FunctionType(types.void(f, v, v, handle, v))
    events = types.FunctionType(types.void(f, v, handle, v))
    return attempt, leap, observe, observe, events, rhs, *algebra


def attempt_arguments(*functions):
    """Numba types of what a step takes, after rhs and linear algebra; see `erk.attempt`."""
    from numba import types

    f, i, v, w = types.float64, types.int64, types.float64[::1], types.float64[:, ::1]
    ints = types.int64[::1]
    return (*functions, ints, v, ints, f, f, w, i, i, w, w, i, v, v, v, v, v, w, v, types.complex128[::1])


def no_factor(shape, jacobian, shift, store):
    """In place of a factorisation, where nothing is solved."""
    return 0


def no_solve(shape, store, x):
    """In place of a solution, where nothing is solved."""


@once
def no_algebra():
    """(factor, solve, factor_complex, solve_complex) for steps that solve nothing."""
    types = [kind.signature.args for kind in function_types()[6:]]
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((no_factor, no_solve) * 2, types, strict=True))


@once
def compiled_as(function, kinds: tuple):
    """A function compiled for arguments of these types alone, as the loop takes it."""
    if hasattr(function, "compile"):
        if not function.overloads:
            function.compile(kinds)
            function.disable_compile()
        function = argument(function)
    return function


def compiled_step(attempt):
    """A step compiled for the one signature that the loop calls."""
    return compiled_as(attempt, attempt_arguments(*function_types()[5:]))
