"""Calls of compiled functions by their addresses, so that each is compiled once and a scene is a list of them.

Numba compiles whatever a function calls into it again; an address ends that. All pieces of a job take the same
arguments: `t, y, dydt, out, handle` and, where they read a state, the vector that they fill. The law of a part is
functions named as `HOOKS`, each taking its own. What they raise is lost.
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.jit import COMPILING, Intrinsic, declared, njit, plain_kinds
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import AMENDED, STATUS, table_types

# Jobs: rows of `calls`, each ended by a zero. CLOSE, the first phases of RHS, is what event functions want to have run.
# SEE makes of a state what the pieces of all but RHS see of it, where that is something else (`basins.walls`). DAMP
# divides rates of a stage by what is quick in them (`steppers.semi_implicit`).
RHS, CLOSE, OBSERVE, RECORD, EVENTS, POWER, STORED, SEE, DAMP, JOBS = range(10)
RATES, READS, ENERGIES = "tVVVH", "tVVHV", "tVVVHV"  # arguments of pieces
ARGUMENTS = dict.fromkeys((RHS, CLOSE, SEE, DAMP), RATES)
ARGUMENTS |= dict.fromkeys((OBSERVE, RECORD, EVENTS), READS) | dict.fromkeys((POWER, STORED), ENERGIES)
HOOKS = {  # of the law of a part: arguments, and what it returns
    "set": (
        "tVVTD",
        "",
    ),  # t, y, out, tables, device: conductances, speeds, pressures of vessels, by (t, y) and flags
    "move": ("tVVVTD", ""),  # t, y, dydt, out, tables, device: rates of what it holds where dydt.size > 0; out[RATE]
    "events": ("tVVTDV", ""),  # t, y, out, tables, device, g: its event functions, from closed nodes
    "value": ("tVVTDi", "t"),  # t, y, out, tables, device, which: its quantity of that number
    "outside": ("VTD", "i"),  # out, tables, device: 1 where its law is not to be trusted, or PASSING
    "power": ("tVVVTD", "ttt"),  # t, y, dydt, out, tables, device: supplied, rate of what it stores, dissipated [W]
    "stored": ("VTD", "t"),  # y, tables, device: what it stores, since the profile [J]
    "step": ("VTittttb", "tt"),  # out, tables, k, g, m, drop, denser, wide: Newton's, see `kernels.restrictions`
    "slope": ("VTitt", "t"),  # out, tables, k, g, drop: d flow / d drop [kg/s/Pa]
    "lift": ("VTitttb", "t"),  # out, tables, k, g, drop, denser, wide: d flow / d pressure before it, beside the drop's
    "bends": ("TitV", ""),  # tables, k, drop, g: event functions of a restriction, by the drop alone
    "lead": ("tVTDtttb", "tt"),  # t, y, tables, device, p' before, p' behind, drop, ahead: as `kernels.led` asks
}


def argument_types(letters: str) -> tuple:
    """Numba's types of times (t), rows of numbers (v) and handles (h); of V and H as calls by address pass these."""
    kinds = _kinds()
    return tuple(kinds[letter] for letter in letters)


@functools.cache
def _kinds() -> dict:
    from numba import types

    from fvsolve.kernels.opened import Tables
    from fvsolve.kernels.vectors import Vector

    own = {"V": Vector(types.float64), "H": Vector(types.int64), "T": Tables(), "D": table_types().devices.dtype}
    return plain_kinds() | own


def compile_as(function, letters: str):
    """The function compiled for arguments of these kinds and no others, itself where JIT is off."""
    return declared(function, letters, argument_types)


def addressed(function, letters: str):
    """A function, compiled, as tables hold it: its address, or itself where JIT is off.

    Its machine code stays there as long as the function does.
    """
    return function.address(letters, argument_types) if COMPILING else function


def hook_of(law, name: str):
    """The function of a law at a hook, None where it has none; FvsolveError where it takes other arguments."""
    function, wanted = getattr(law, name, None), len(HOOKS[name][0])
    if function is None or function.__code__.co_argcount == wanted:
        return function
    said = f"{law.__name__}.{name} takes {function.__code__.co_argcount} arguments"
    raise FvsolveError(f"{said}; wanted {wanted}, as kernels.calls.HOOKS says, or another name")


def empty_calls(rows: int, columns: int) -> np.ndarray:
    """Room for addresses."""
    return np.zeros((rows, columns), dtype=np.int64 if COMPILING else object)


if COMPILING:

    def call(letters: str, returned: str = ""):
        """(signature, generator) of a call whose first argument is the address."""
        from numba.core import types

        kinds = argument_types(letters)
        found = argument_types(returned)
        result = types.none if not found else found[0] if len(found) == 1 else types.Tuple(found)

        def generate(context, builder, kind, args):
            shape = context.call_conv.get_function_type(result, kinds)
            pointer = builder.inttoptr(args[0], shape.as_pointer())
            _, value = context.call_conv.call_function(builder, pointer, result, kinds, args[1:])
            return value if found else context.get_dummy_value()

        return result(types.int64, *kinds), generate

    @Intrinsic
    def call_rates(typingctx, address, t, y, dydt, out, handle):
        """Call the function at an address."""
        return call(RATES)

    @Intrinsic
    def call_reader(typingctx, address, t, y, out, handle, values):
        """Call the function at an address."""
        return call(READS)

    @Intrinsic
    def call_energies(typingctx, address, t, y, dydt, out, handle, rows):
        """Call the function at an address."""
        return call(ENERGIES)

    @Intrinsic
    def call_set(typingctx, address, t, y, out, tables, device):
        """Call the hook at an address."""
        return call(*HOOKS["set"])

    @Intrinsic
    def call_move(typingctx, address, t, y, dydt, out, tables, device):
        """Call the hook at an address."""
        return call(*HOOKS["move"])

    @Intrinsic
    def call_events(typingctx, address, t, y, out, tables, device, g):
        """Call the hook at an address."""
        return call(*HOOKS["events"])

    @Intrinsic
    def call_value(typingctx, address, t, y, out, tables, device, which):
        """Call the hook at an address."""
        return call(*HOOKS["value"])

    @Intrinsic
    def call_outside(typingctx, address, out, tables, device):
        """Call the hook at an address."""
        return call(*HOOKS["outside"])

    @Intrinsic
    def call_power(typingctx, address, t, y, dydt, out, tables, device):
        """Call the hook at an address."""
        return call(*HOOKS["power"])

    @Intrinsic
    def call_stored(typingctx, address, y, tables, device):
        """Call the hook at an address."""
        return call(*HOOKS["stored"])

    @Intrinsic
    def call_step(typingctx, address, out, tables, k, g, m, drop, denser, wide):
        """Call the hook at an address."""
        return call(*HOOKS["step"])

    @Intrinsic
    def call_slope(typingctx, address, out, tables, k, g, drop):
        """Call the hook at an address."""
        return call(*HOOKS["slope"])

    @Intrinsic
    def call_lift(typingctx, address, out, tables, k, g, drop, denser, wide):
        """Call the hook at an address."""
        return call(*HOOKS["lift"])

    @Intrinsic
    def call_bends(typingctx, address, tables, k, drop, g):
        """Call the hook at an address."""
        return call(*HOOKS["bends"])

    @Intrinsic
    def call_lead(typingctx, address, t, y, tables, device, before, behind, drop, ahead):
        """Call the hook at an address."""
        return call(*HOOKS["lead"])
else:

    def call_rates(function, *arguments):
        """Call a function."""
        return function(*arguments)

    call_reader = call_energies = call_rates
    call_set = call_move = call_events = call_value = call_outside = call_power = call_stored = call_lead = call_rates
    call_step = call_slope = call_lift = call_bends = call_rates


@njit(forceinline=True)
def see(t, y, seen, out, handle):
    """Let `seen` be what the pieces see of a state, in scenes where that is something else.

    seen : that of the tables, or none of it where rates come next, whose kernels need less
    """
    tables, k = open_tables(handle), 0
    while tables.calls[SEE, k] != 0:
        call_rates(tables.calls[SEE, k], t, y, seen, out, handle)
        k += 1


@njit(forceinline=True)
def run(job, t, y, dydt, out, handle):
    """Every piece of a job that takes part in the right-hand side."""
    calls, k = open_tables(handle).calls, 0
    while calls[job, k] != 0:
        call_rates(calls[job, k], t, y, dydt, out, handle)
        k += 1


@njit
def rhs_in_turn(t, y, dydt, out, handle):
    """Every piece of the right-hand side; they see states as these are, see `basins.stretch`.

    Rates are found, asked for or not, where `out` hangs on them.
    """
    tables = open_tables(handle)
    see(t, y, y[:0], out, handle)
    at, rates = tables.layout[0]["rates"], dydt
    if dydt.size == 0 and at >= 0:
        rates = tables.work[at : at + y.size]
    run(RHS, t, y, rates, out, handle)


@njit
def damp_in_turn(h, y, rates, quick, handle):
    """Every piece that divides rates of a stage y by 1 + h r; quick : h r of the states that it divides."""
    see(0.0, y, open_tables(handle).seen, quick, handle)
    run(DAMP, h, y, rates, quick, handle)


@njit
def observe_in_turn(t, y, out, handle, values):
    """Every piece that reads probes."""
    tables, k = open_tables(handle), 0
    see(t, y, tables.seen, out, handle)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[OBSERVE, k] != 0:
        call_reader(calls[OBSERVE, k], t, seen, out, handle, values)
        k += 1


@njit
def record_in_turn(t, y, out, handle, values):
    """Every piece that notes an accepted state, after the probes are read."""
    tables, k = open_tables(handle), 0
    observe_in_turn(t, y, out, handle, values)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[RECORD, k] != 0:
        call_reader(calls[RECORD, k], t, seen, out, handle, values)
        if out[STATUS] == AMENDED:
            return
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
    see(t, y, tables.seen, out, handle)
    seen = tables.seen if tables.seen.size > 0 else y
    while calls[EVENTS, k] != 0:
        call_reader(calls[EVENTS, k], t, seen, out, handle, g)
        k += 1


@njit
def power_in_turn(t, y, dydt, out, handle, power):
    """Every piece that fills `power`."""
    tables, k = open_tables(handle), 0
    see(t, y, tables.seen, out, handle)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[POWER, k] != 0:
        call_energies(calls[POWER, k], t, seen, dydt, out, handle, power)
        k += 1


@njit
def stored_in_turn(t, y, dydt, out, handle, stored):
    """Every piece that fills `stored`."""
    tables, k = open_tables(handle), 0
    see(t, y, tables.seen, out, handle)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[STORED, k] != 0:
        call_energies(calls[STORED, k], t, seen, dydt, out, handle, stored)
        k += 1
