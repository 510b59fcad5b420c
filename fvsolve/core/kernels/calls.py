"""Calls of compiled functions by address: each function is compiled once, and a model is a list of functions.

For each function, numba compiles again all functions that it calls; a call by address avoids this. All functions of a
job, such as the right-hand side, have the same arguments: `t, y, dydt, out, handle` for rates, `t, y, out, handle,
values` for probes, records and events, `t, y, dydt, out, handle, rows` for energies. The law of a part, such as a pump,
is a module with functions named as in `HOOKS`, each with arguments of its own. Exceptions raised in functions called by
address are lost.
"""

import functools
from collections.abc import Callable, Mapping
from inspect import Parameter, Signature
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import AMENDED, STATUS, table_types
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.errors import FvsolveError
from fvsolve.jit import COMPILING, Intrinsic, declare_function, njit, plain_kinds, specialise

# Jobs: rows of `calls`, each ended by a zero. CLOSE, the first phases of RHS, must run before event functions.
# DERIVE computes from a state the values that functions of all jobs but RHS read, where these are not the state itself
# (`basins.moving_walls`). DAMP divides the rates of a stage by 1 + h r, r their fast part (`steppers.erk`).
RHS, CLOSE, OBSERVE, RECORD, EVENTS, POWER, STORED, DERIVE, DAMP, JOBS = range(10)
RATES, READS, ENERGIES = "tVVVH", "tVVHV", "tVVVHV"  # argument types of the functions of jobs
ARGUMENTS = dict.fromkeys((RHS, CLOSE, DERIVE, DAMP), RATES)
ARGUMENTS |= dict.fromkeys((OBSERVE, RECORD, EVENTS), READS) | dict.fromkeys(
    (POWER, STORED), ENERGIES
)


class Hook(NamedTuple):
    """Function of the law of a part, with texts for messages and pages.

    letters, returned : types of arguments and results, see `argument_types`; names : of the arguments; results : their
    meanings; when : of the calls; about : what the function reads and writes
    """

    letters: str
    returned: str
    names: str = ""
    results: str = ""
    when: str = ""
    about: str = ""


# Arguments
# t : time [s]; y, dydt : states and their rates; out : network values, at the offsets in tables.layout[0] (LAYOUT)
# tables : open handle, whose attributes are the tables; device : row of the part in tables.devices
# k : row of its restriction in tables.valves; g : conductance [kg2/s2/Pa]; m, drop : flow [kg/s] and drop [Pa]
# denser, wide : see `restrictions.restriction_step`
HOOKS = {
    "set": Hook(
        "tVVTD",
        "",
        "t, y, out, tables, device",
        "",
        "first in each evaluation of the rates, before the nodes are solved",
        "From t, y and the flags of events, writes out[conductance + k] [kg2/s2/Pa] of its restriction and, if its law "
        "reads it, out[drive + k]; of a vessel out[pressure + node], a change since the start [Pa], and "
        "out[stiffness + row] [Pa/kg].",
    ),
    "move": Hook(
        "tVVVTD",
        "",
        "t, y, dydt, out, tables, device",
        "",
        "after the nodes are solved, in each evaluation that computes rates",
        "Reads the solved out: out[pressure + node] is a change since the start [Pa], out[valve + k] a mass flow "
        "[kg/s]. Writes the rates of its states to dydt[device.y + i] [unit of the state/s]; may raise out[RATE], the "
        "greatest rate that limits a step [1/s], unless it is RATE_UNWANTED.",
    ),
    "events": Hook(
        "tVVTDV",
        "",
        "t, y, out, tables, device, g",
        "",
        "after the nodes are solved, at the ends of steps and in the search for an event",
        "Writes its event functions to g[device.event + i]; a zero is an event (`self_acting_valves.event_pair`).",
    ),
    "value": Hook(
        "tVVTDi",
        "t",
        "t, y, out, tables, device, quantity",
        "value of the quantity of that number, in SI",
        "at rows of the history, and after each step for extremes",
        "Reads t, y and the solved out.",
    ),
    "outside": Hook(
        "VTD",
        "i",
        "out, tables, device",
        "1 outside the range of validity of the law, TEMPORARY if this ends by itself, else 0",
        "after each step",
        "Reads the solved out.",
    ),
    # for the heat of the fluid the dissipation is computed with `y` in place of `dydt`, unless the law has `heat`
    "power": Hook(
        "tVVVTD",
        "ttt",
        "t, y, dydt, out, tables, device",
        "power supplied, rate of stored energy, power dissipated beside drop times flow [W]",
        "at the stages of each step, if the energy is computed",
        "Reads t, y, the rates of all states in dydt, and the solved out.",
    ),
    "heat": Hook(
        "tVVTD",
        "t",
        "t, y, out, tables, device",
        "heat into the fluid beside drop times flow [W]",
        "in place of the dissipation of `power`, if friction heats the fluid",
        "Reads t, y and the solved out.",
    ),
    "stored": Hook(
        "VTD",
        "t",
        "y, tables, device",
        "stored energy minus that at the start [J]",
        "after each step, if the energy is computed",
        "Reads y.",
    ),
    "step": Hook(
        "VTittttb",
        "tt",
        "out, tables, k, g, m, drop, denser, wide",
        "a [kg/s], s [kg/s/Pa]: the next Newton step changes the flow by a + s d(drop)",
        "several times while the nodes are solved, if the conductance is above 0; also in the steady start",
        "Reads what `set` has written; pressures are not solved yet.",
    ),
    "slope": Hook(
        "VTitt",
        "t",
        "out, tables, k, g, drop",
        "d flow / d drop [kg/s/Pa]",
        "after the nodes are solved, for the rate that limits a step",
        "Reads the solved out.",
    ),
    "lift": Hook(
        "VTitttb",
        "t",
        "out, tables, k, g, drop, denser, wide",
        "d flow / d lifting pressure at constant drop [kg/s/Pa]",
        "as `step`, if a pressure lifts the restriction at once",
        "Reads what `set` has written; pressures are not solved yet.",
    ),
    "bends": Hook(
        "TitV",
        "",
        "tables, k, drop, g",
        "",
        "as `events`, for a restriction whose law has kinks",
        "Writes event functions to g[tables.valves[k].event + i], from the drop alone.",
    ),
    "lead": Hook(
        "tVTDtttb",
        "tt",
        "t, y, tables, device, before, behind, drop, ahead",
        "dx/dt of the lift x [1/s] and its slope over the drop [1/s/Pa]",
        "for a valve that is nearly shut at the end of a rigid column",
        "Reads the changes of both pressures since the start, `before` and `behind` [Pa]; the slope is for a change of "
        "the upstream (`ahead`) or of the downstream pressure.",
    ),
}


def argument_types(letters: str) -> tuple:
    """Numba types of arguments, a letter for each.

    t : number; v : vector; h : handle; V, H : vector and handle in calls by address
    T : tables; D : record of a device; i : integer; b : boolean; other letters : see `add_kind`
    """
    kinds = _kinds()
    return tuple(kinds[letter] for letter in letters)


@functools.cache
def _kinds() -> dict:
    from numba import types

    from fvsolve.compile.code_generation import Tables, Vector

    vectors = {"V": Vector(types.float64), "H": Vector(types.int64)}
    own = vectors | {"T": Tables("Tables", table_types), "D": table_types().devices.dtype}
    return plain_kinds() | own | {letter: make() for letter, make in FURTHER_KINDS.items()}


# letter of an argument type of a feature -> function that returns the type
FURTHER_KINDS: dict[str, Callable] = {}


def add_kind(letter: str, make: Callable) -> None:
    """Add a letter for the type of an argument of a feature's functions; make : function that returns the type."""
    FURTHER_KINDS[letter] = make
    _kinds.cache_clear()


def compile_as(function, letters: str):
    """Compile a function for argument types `letters` only (see `argument_types`); return it unchanged without JIT."""
    return declare_function(function, letters, argument_types)


def function_address(function, letters: str):
    """Memory address of a function compiled for the argument types `letters`; the function itself without JIT.

    The machine code stays in place as long as the function exists.
    """
    return function.address(letters, argument_types) if COMPILING else function


def hook_of(law, name: str, hooks: Mapping[str, tuple] = HOOKS):
    """Function `name` of the module `law`, which contains the law of a part; None if the module has no such function.

    name : key of `hooks`. Raises FvsolveError for a wrong number of arguments.
    """
    function, (letters, _, *names) = getattr(law, name, None), hooks[name]
    if function is None or function.__code__.co_argcount == len(letters):
        return function
    code, expected = function.__code__, names[0] if names else f"{len(letters)} arguments"
    raise FvsolveError(
        f"{law.__name__}.{name} ({code.co_filename}, line {code.co_firstlineno}) has {code.co_argcount} arguments; "
        f"expected {expected}, or another name of the function"
    )


def empty_calls(rows: int, columns: int) -> np.ndarray:
    """Table of zeros for function addresses, with a row for each job or law."""
    return np.zeros((rows, columns), dtype=np.int64 if COMPILING else object)


def call_python(function, *arguments):
    """Call a function with these arguments."""
    return function(*arguments)


def call_at_address(name: str, letters: str, returned: str = "", home: str = __name__):
    """Function (address, *arguments) of compiled code that calls the function at an address; without JIT `call_python`.

    name, home : name of the result and its module, which must assign the result to it, because code is pickled by name
    letters, returned : types of the arguments and of the results, see `argument_types`
    """
    if not COMPILING:
        return call_python

    def define(typingctx, address, *arguments):
        from fvsolve.compile.code_generation import call_by_address

        return call_by_address(argument_types(letters), argument_types(returned))

    names = ["typingctx", "address", *(f"argument_{k}" for k in range(len(letters)))]
    define.__signature__ = Signature(
        [Parameter(label, Parameter.POSITIONAL_OR_KEYWORD) for label in names]
    )
    define.__name__, define.__qualname__, define.__module__ = name, name, home
    return Intrinsic(define)


call_rates = call_at_address("call_rates", RATES)  # of the right-hand side
call_reader = call_at_address("call_reader", READS)  # reads a state and fills `values`
# fills `rows` with powers [W] or stored energies [J]
call_energies = call_at_address("call_energies", ENERGIES)
# Functions of the law of a device, or of restriction k (from `step` on).
call_set = call_at_address("call_set", *HOOKS["set"][:2])
call_move = call_at_address("call_move", *HOOKS["move"][:2])
call_events = call_at_address("call_events", *HOOKS["events"][:2])
call_value = call_at_address("call_value", *HOOKS["value"][:2])
call_outside = call_at_address("call_outside", *HOOKS["outside"][:2])
call_power = call_at_address("call_power", *HOOKS["power"][:2])
call_heat = call_at_address("call_heat", *HOOKS["heat"][:2])
call_stored = call_at_address("call_stored", *HOOKS["stored"][:2])
call_lead = call_at_address("call_lead", *HOOKS["lead"][:2])
call_step = call_at_address("call_step", *HOOKS["step"][:2])
call_slope = call_at_address("call_slope", *HOOKS["slope"][:2])
call_lift = call_at_address("call_lift", *HOOKS["lift"][:2])
call_bends = call_at_address("call_bends", *HOOKS["bends"][:2])


@njit(forceinline=True)
def derive_state(t, y, seen, out, handle):
    """Write to `seen` the values that functions read in place of the state, in models where the two differ.

    seen : array `seen` of the tables. If it is empty, only values that the right-hand side needs are computed.
    """
    tables, k = open_tables(handle), 0
    while tables.calls[DERIVE, k] != 0:
        call_rates(tables.calls[DERIVE, k], t, y, seen, out, handle)
        k += 1


@njit(forceinline=True)
def run_job(job, t, y, dydt, out, handle):
    """Call every function of a job, such as RHS, in order, with the arguments of the right-hand side."""
    calls, k = open_tables(handle).calls, 0
    while calls[job, k] != 0:
        call_rates(calls[job, k], t, y, dydt, out, handle)
        k += 1


@njit
def rhs_in_turn(t, y, dydt, out, handle):
    """Call every function of the right-hand side in order: rates go to `dydt`, network values to `out`.

    The functions read the state y itself and not the values of `derive_state`, see `basins.cell_sides`. If `dydt`
    is empty and `out` depends on rates, the rates are computed in a work array.
    """
    tables = open_tables(handle)
    derive_state(t, y, y[:0], out, handle)
    at, rates = tables.layout[0]["rates"], dydt
    if dydt.size == 0 and at >= 0:
        rates = tables.work[at : at + y.size]
    run_job(RHS, t, y, rates, out, handle)


@njit
def damp_in_turn(h, y, rates, quick, handle):
    """Divide the rates of a stage y by 1 + h r, with the step h [s] and the rate r of fast linear decay [1/s].

    quick : receives h r of the states whose rates are divided
    """
    derive_state(0.0, y, open_tables(handle).seen, quick, handle)
    run_job(DAMP, h, y, rates, quick, handle)


@njit(forceinline=True)
def run_readers(job, t, y, out, handle, values):
    """Call every function of a job, such as OBSERVE, in order, each of which reads a state and writes to `values`."""
    tables, k = open_tables(handle), 0
    derive_state(t, y, tables.seen, out, handle)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[job, k] != 0:
        call_reader(calls[job, k], t, seen, out, handle, values)
        k += 1


@njit
def observe_in_turn(t, y, out, handle, values):
    """Write all probe values to `values`."""
    run_readers(OBSERVE, t, y, out, handle, values)


@njit
def record_in_turn(t, y, out, handle, values):
    """Write probe values to `values`, then call every function that records an accepted state.

    Stops if a function has set STATUS to AMENDED, because it has corrected the state.
    """
    tables, k = open_tables(handle), 0
    observe_in_turn(t, y, out, handle, values)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[RECORD, k] != 0:
        call_reader(calls[RECORD, k], t, seen, out, handle, values)
        if out[STATUS] == AMENDED:
            return
        k += 1


@njit
def solve_nodes_in_turn(t, y, out, handle, g):
    """Solve node pressures and link flows at (t, y) into `out`, before event functions are evaluated; g is not used."""
    run_job(CLOSE, t, y, y[:0], out, handle)


@njit
def events_in_turn(t, y, handle, g):
    """Write all event functions at (t, y) to g."""
    run_readers(EVENTS, t, y, open_tables(handle).spare, handle, g)


JOB = None  # of the template: POWER or STORED


def _energies_in_turn(t, y, dydt, out, handle, rows):
    """Fill `rows` with powers [W] or stored energies [J]: call every function that computes some of its entries."""
    tables, k = open_tables(handle), 0
    derive_state(t, y, tables.seen, out, handle)
    calls, seen = tables.calls, tables.seen if tables.seen.size > 0 else y
    while calls[JOB, k] != 0:
        call_energies(calls[JOB, k], t, seen, dydt, out, handle, rows)
        k += 1


power_in_turn = specialise(_energies_in_turn, "power_in_turn", JOB=POWER)
stored_in_turn = specialise(_energies_in_turn, "stored_in_turn", JOB=STORED)


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
