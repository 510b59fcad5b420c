"""Calls of compiled functions by address: each function is compiled once, and a model is a list of functions.

For each function, numba compiles again all functions that it calls; a call by address avoids this. All functions of a
job, such as the right-hand side, have the same arguments: `t, y, dydt, out, handle` for rates, `t, y, out, handle,
values` for probes, records and events, `t, y, dydt, out, handle, rows` for energies. The law of a part, such as a pump,
is a module with functions named as in `HOOKS`, each with arguments of its own. Exceptions raised in functions called by
address are lost.
"""

import functools
from collections.abc import Callable
from inspect import Parameter, Signature

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
HOOKS = {  # functions of the law of a part: types of arguments and of the result
    # out : network values (node pressures as changes since the start [Pa], mass flows [kg/s], ...), read and written at
    # the offsets in tables.layout[0] (LAYOUT of `kernels.dtypes`); tables : open handle, its attributes are the tables
    # device : row of the part in tables.devices; t, y, dydt : time [s], states and their rates (empty if not requested)
    # t, y, out, tables, device: writes conductances, speeds, pressures of vessels, from (t, y) and flags
    "set": ("tVVTD", ""),
    # t, y, dydt, out, tables, device: rates of its states if dydt.size > 0; out[RATE]
    "move": ("tVVVTD", ""),
    # t, y, out, tables, device, g: its event functions, from solved nodes
    "events": ("tVVTDV", ""),
    # t, y, out, tables, device, quantity: value of its quantity of that number
    "value": ("tVVTDi", "t"),
    # out, tables, device: 1 outside the range of validity of its law, TEMPORARY if this ends by itself, otherwise 0
    "outside": ("VTD", "i"),
    # t, y, dydt, out, tables, device: power supplied, rate of stored energy, dissipation [W]
    # for the heat of the fluid the dissipation is computed with `y` in place of `dydt`, unless the law has `heat`
    "power": ("tVVVTD", "ttt"),
    # t, y, out, tables, device: heat into the fluid beside drop times flow [W]
    "heat": ("tVVTD", "t"),
    "stored": ("VTD", "t"),  # y, tables, device: stored energy, change since the profile [J]
    # Restriction k, conductance g [kg2/s2/Pa], drop [Pa]; denser, wide : see `restrictions.restriction_step`
    "step": (
        "VTittttb",
        "tt",
    ),  # out, tables, k, g, m, drop, denser, wide: Newton step, see `kernels.restrictions`
    "slope": ("VTitt", "t"),  # out, tables, k, g, drop: d flow / d drop [kg/s/Pa]
    # out, tables, k, g, drop, denser, wide: d flow / d lifting pressure at constant drop
    "lift": ("VTitttb", "t"),
    # tables, k, drop, g: event functions of a restriction, from the drop alone
    "bends": ("TitV", ""),
    # t, y, tables, device, p' upstream, p' downstream (changes since the start [Pa]), drop, ahead: dx/dt of the lift x
    # and its slope over the drop [1/s/Pa], for a change of the upstream (`ahead`) or of the downstream pressure
    "lead": ("tVTDtttb", "tt"),
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


def hook_of(law, name: str, hooks: dict[str, tuple[str, str]] = HOOKS):
    """Function `name` of the module `law`, which contains the law of a part; None if the module has no such function.

    name : key of `hooks`. Raises FvsolveError for a wrong number of arguments.
    """
    function, expected = getattr(law, name, None), len(hooks[name][0])
    if function is None or function.__code__.co_argcount == expected:
        return function
    error = f"{law.__name__}.{name} has {function.__code__.co_argcount} arguments"
    raise FvsolveError(
        f"{error}; expected the {expected} arguments listed in kernels.calls.HOOKS, or another name of the function"
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
call_set = call_at_address("call_set", *HOOKS["set"])
call_move = call_at_address("call_move", *HOOKS["move"])
call_events = call_at_address("call_events", *HOOKS["events"])
call_value = call_at_address("call_value", *HOOKS["value"])
call_outside = call_at_address("call_outside", *HOOKS["outside"])
call_power = call_at_address("call_power", *HOOKS["power"])
call_heat = call_at_address("call_heat", *HOOKS["heat"])
call_stored = call_at_address("call_stored", *HOOKS["stored"])
call_lead = call_at_address("call_lead", *HOOKS["lead"])
call_step = call_at_address("call_step", *HOOKS["step"])
call_slope = call_at_address("call_slope", *HOOKS["slope"])
call_lift = call_at_address("call_lift", *HOOKS["lift"])
call_bends = call_at_address("call_bends", *HOOKS["bends"])


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
