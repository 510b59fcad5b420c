"""The declared types of what the time loop calls, and functions compiled for them alone. Knows no function's meaning.

Declared, so that the loop is compiled once, cached, and serves every method and every model. Letters are those of
`jit.plain_kinds`: t, i numbers, c a complex one, v, w rows and tables of numbers, h, s of integers, z of complex ones.
"""

import functools

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic, declared, njit, plain_kinds

FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX = "hvtv", "hvv", "hvcz", "hzz"
ATTEMPT = "hvhsvttwiiwwivvvvvwvz"  # of a step, after its functions
LEAP, OBSERVE, EVENTS, RHS, JOIN = "ttvvvhv", "tvvhv", "tvhv", "tvvvh", "vsh"


@functools.cache
def function_types():
    """Numba types of (attempt, leap, observe, record, events, rhs, linear algebra, real and complex, and join)."""
    from numba import types

    def of(letters, returned=types.void):
        return types.FunctionType(returned(*kinds_of(letters)))

    algebra = (
        of(FACTOR, types.int64), of(SOLVE),
        of(FACTOR_COMPLEX, types.int64), of(SOLVE_COMPLEX),
    )  # fmt: skip
    attempt = types.FunctionType(types.float64(of(RHS), *algebra, of(JOIN), *kinds_of(ATTEMPT)))
    return attempt, of(LEAP), of(OBSERVE), of(OBSERVE), of(EVENTS), of(RHS), *algebra, of(JOIN)


def kinds_of(letters: str) -> tuple:
    """Numba's types of arguments; of F the functions that a step takes."""
    kinds = plain_kinds()
    return tuple(one for letter in letters for one in (function_types()[5:] if letter == "F" else (kinds[letter],)))


if COMPILING:

    def taken(which: int):
        """What makes a function of an address, as compiled code calls those of `function_types`."""

        @Intrinsic
        def function_at(typingctx, address):
            from numba.core import cgutils, types

            kind = function_types()[which]

            def generate(context, builder, signature, given):
                made = cgutils.create_struct_proxy(kind)(context, builder)
                made.c_addr = builder.inttoptr(given[0], cgutils.voidptr_t)
                made.py_addr = made.jit_addr = cgutils.voidptr_t(None)
                return made._getvalue()

            return kind(types.int64), generate

        return function_at

    attempt_at, leap_at, observe_at, record_at, events_at, rhs_at = map(taken, range(6))
    factor_at, solve_at, factor_complex_at, solve_complex_at, join_at = map(taken, range(6, 11))


def addresses(functions: tuple):
    """Functions as compiled code that Python calls takes them : int64[n], themselves where JIT is off."""
    return np.array([one.address for one in functions]) if COMPILING else functions


def no_factor(structure, jacobian, shift, factors):
    """In place of a factorisation, where nothing is solved."""
    return 0


def no_solve(structure, factors, x):
    """In place of a solution, where nothing is solved."""


@functools.cache
def no_algebra():
    """(factor, solve, factor_complex, solve_complex) for steps that solve nothing."""
    letters = (FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX)
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((no_factor, no_solve) * 2, letters, strict=True))


def alone(sums, row_blocks, handle):
    """In place of a joint, where one band is all there is."""


@functools.cache
def no_joint():
    """A joint of one band."""
    return compiled_as(njit(alone), JOIN)


def compiled_as(function, letters: str):
    """A function compiled for arguments of these kinds alone, as the loop takes it."""
    return declared(function, letters, kinds_of)


def compiled_step(attempt):
    """A step compiled for the one signature that the loop calls."""
    return compiled_as(attempt, "F" + ATTEMPT)
