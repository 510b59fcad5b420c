"""Calls of compiled functions by their addresses, so that each is compiled once and a scene is a list of them.

Numba compiles whatever a function calls into it again; an address ends that. All pieces of a job take the same
arguments: `t, y, dydt, out, handle` and, where they read a state, the vector that they fill. What they raise is lost.
"""

from __future__ import annotations

import os

import numpy as np

from fvsolve.jit import njit, once
from fvsolve.kernels.handle import open_tables

# Jobs: rows of `calls`, each ended by a zero. CLOSE, the first phases of RHS, is what event functions want to have run.
RHS, CLOSE, OBSERVE, RECORD, EVENTS, POWER, STORED, JOBS = range(8)
RATES, READS, ENERGIES = "tVVVH", "tVVHV", "tVVVHV"  # arguments of pieces
ARGUMENTS = dict.fromkeys((RHS, CLOSE), RATES)
ARGUMENTS |= dict.fromkeys((OBSERVE, RECORD, EVENTS), READS) | dict.fromkeys((POWER, STORED), ENERGIES)
COMPILING = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


def argument_types(letters: str) -> tuple:
    """Numba's types of times (t), rows of numbers (v) and handles (h); of V and H as calls by address pass these."""
    from numba import types

    from fvsolve.kernels.vectors import Vector

    kinds = {"t": types.float64, "v": types.float64[::1], "h": types.int64[::1]}
    kinds |= {"V": Vector(types.float64), "H": Vector(types.int64)}
    return tuple(kinds[letter] for letter in letters)


@once
def compile_as(function, letters: str) -> None:
    """Compile for arguments of these kinds, and for no others."""
    if hasattr(function, "compile") and not function.overloads:
        function.compile(argument_types(letters))
        function.disable_compile()


def listed(functions: list, letters: str) -> list:
    """The functions, compiled, as a row of `calls` holds them: addresses, or themselves where JIT is off."""
    for function in functions:
        compile_as(function, letters)
    return [address_of(function) if COMPILING else function for function in functions]


def address_of(function) -> int:
    """Where the machine code of a function of one signature lies; it stays there as long as the function does."""
    (compiled,) = function.overloads.values()
    return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)


def empty_calls(longest: int) -> np.ndarray:
    """Room for rows of so many functions."""
    return np.zeros((JOBS, longest + 1), dtype=np.int64 if COMPILING else object)


if COMPILING:
    from numba.core import types
    from numba.extending import intrinsic

    def called(context, builder, kind, args):
        """Machine code of a call whose first argument is the address."""
        shape = context.call_conv.get_function_type(types.none, kind.args[1:])
        pointer = builder.inttoptr(args[0], shape.as_pointer())
        context.call_conv.call_function(builder, pointer, types.none, kind.args[1:], args[1:])
        return context.get_dummy_value()

    @intrinsic
    def call_rates(typingctx, address, t, y, dydt, out, handle):
        """Call the function at an address."""
        return types.none(types.int64, *argument_types(RATES)), called

    @intrinsic
    def call_reader(typingctx, address, t, y, out, handle, values):
        """Call the function at an address."""
        return types.none(types.int64, *argument_types(READS)), called

    @intrinsic
    def call_energies(typingctx, address, t, y, dydt, out, handle, rows):
        """Call the function at an address."""
        return types.none(types.int64, *argument_types(ENERGIES)), called
else:

    def call_rates(function, *arguments):
        """Call a function."""
        function(*arguments)

    call_reader = call_energies = call_rates


@njit(forceinline=True)
def run(job, t, y, dydt, out, handle):
    """Every piece of a job that takes part in the right-hand side."""
    calls, k = open_tables(handle).calls, 0
    while calls[job, k] != 0:
        call_rates(calls[job, k], t, y, dydt, out, handle)
        k += 1


@njit
def rhs_in_turn(t, y, dydt, out, handle):
    """Every piece of the right-hand side."""
    run(RHS, t, y, dydt, out, handle)


@njit
def observe_in_turn(t, y, out, handle, values):
    """Every piece that reads probes."""
    calls, k = open_tables(handle).calls, 0
    while calls[OBSERVE, k] != 0:
        call_reader(calls[OBSERVE, k], t, y, out, handle, values)
        k += 1


@njit
def record_in_turn(t, y, out, handle, values):
    """Every piece that notes an accepted state, after the probes are read."""
    calls, k = open_tables(handle).calls, 0
    observe_in_turn(t, y, out, handle, values)
    while calls[RECORD, k] != 0:
        call_reader(calls[RECORD, k], t, y, out, handle, values)
        k += 1


@njit
def close_in_turn(t, y, out, handle, g):
    """Close the nodes for the event functions that follow."""
    run(CLOSE, t, y, y[:0], out, handle)


@njit
def events_in_turn(t, y, handle, g):
    """Every piece of the event functions."""
    tables, k = open_tables(handle), 0
    calls, out = tables.calls, tables.spare
    while calls[EVENTS, k] != 0:
        call_reader(calls[EVENTS, k], t, y, out, handle, g)
        k += 1


@njit
def power_in_turn(t, y, dydt, out, handle, power):
    """Every piece that fills `power`."""
    calls, k = open_tables(handle).calls, 0
    while calls[POWER, k] != 0:
        call_energies(calls[POWER, k], t, y, dydt, out, handle, power)
        k += 1


@njit
def stored_in_turn(t, y, dydt, out, handle, stored):
    """Every piece that fills `stored`."""
    calls, k = open_tables(handle).calls, 0
    while calls[STORED, k] != 0:
        call_energies(calls[STORED, k], t, y, dydt, out, handle, stored)
        k += 1
