"""Handle of a run: its arrays, and the compiled functions that the time loop calls.

A handle is a small array with the memory addresses of all arrays of a run (`kernels.table_handle`). So every function
of a step has few arguments, and the loop is compiled once and used for every method and every model.
A letter stands for the type of an argument or array, as in `jit.plain_kinds`: t float64, i int64, c complex128; arrays
with one and two dimensions v and w of float64, h and s of int64; z array of complex128.
"""

import functools
from collections import namedtuple

import numpy as np

from fvsolve.core.kernels.calls import RATES, READS, call_at_address, compile_as
from fvsolve.core.kernels.dtypes import RATE_UNWANTED
from fvsolve.core.kernels.table_handle import addresses_of, handle_of
from fvsolve.core.steppers import loop_records as rec
from fvsolve.jit import ARRAYS, COMPILING, Intrinsic, njit, plain_kinds

FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX = "hvtv", "hvv", "hvcz", "hzz"
# step of a method: handle of the model, handle of the run, t, h, row of y at the start, at the end
ATTEMPT = "hhttii"
FUSED_STEP = "ttVVVHV"
OBSERVE = READS
EVENTS = "tVHV"
RHS = RATES
JOIN = "vsh"
WATCH = (
    # arguments of the function that watches some accepted states: see `kernels.energy_supply.watch_state`
    "ttVVHHb"
)

# Arrays of a run, for n states, s stages and m ledger rates : record, or letter of the type.
ARRAY_KINDS = {
    "state": rec.STATE,
    "control": rec.CONTROL,
    "progress": rec.PROGRESS,
    "newton": rec.NEWTON,
    "calls": "h",  # addresses of the functions, see below
    # handle of a run with the same states and other arrays of a step, for `output_rows.separate_step`
    "spare": "h",
    "coefficients": "v",  # flat coefficients of the method, see `coefficients`
    "dense": "w",  # coefficients of its dense output
    # Jacobian (`structure.Structure.shape`), or stage sums of rhs (`kernels.stage_sums`), or empty
    "structure": "h",
    # states of this band, and partial sums of all bands, see `step_operations`
    "row_blocks": "s",
    "sums": "v",
    "y": "w",  # [4, n]  present, last and next state, and a stage
    "scale": "v",  # [n]  reference size of each state, see `step_operations.error_scale`
    "k": "w",
    "ledger_rates": "w",  # [s, n], [s, m]  rates at the stages
    "f_old": "v",  # [n]  rates at the start of the last step, or result of `start_slope_defect`
    "ledger": "v",  # [5 m]  integrals of the ledger rates, see `ledger`
    # results of rhs besides the rates, at the present state and at an output row
    "out": "v",
    "out_row": "v",
    "values": "v",  # probe values of the present state
    # event functions at the start and the end of a step, and event flags
    "g": "v",
    "g_new": "v",
    "armed": "v",
    # [2, n]  sums over the last steps, see `hidden_stiffness`; [2, 0] without this test
    "returns": "w",
    # data of the search for events within a step, see `event_search`: [events], [6, events]
    "pace": "v",
    "inner": "w",
    # states with compensated sums, and the rounding errors of these sums
    "stored": "h",
    "carry": "v",
    "times": "v",  # times of the output rows if given as a list
    "y_out": "v",
    "rows": "w",  # state of an output row; rows [capacity, 1 + probes]
    # limits of interpolated rows, see `output_rows.limit_to_bounds`
    "bounded_states": "h",
    "bounds": "w",
    "largest": "v",  # [n]  largest allowed states, checked every 16 steps, or empty
    # handle of the arrays of the function that watches some accepted states, or empty
    "watch": "h",
    # data of implicit steps: entries of the Jacobian; its product with a vector; array [q q] for q implicit stages;
    # slopes in time of the ledger rates; factors of shift I - J for real and complex shifts. Semi-implicit steps
    # store damping factors in `factors`.
    "jacobian": "v",
    "product": "v",
    "buffer": "v",
    "ledger_slopes": "v",
    "factors": "v",
    "complex_factors": "z",
    # [n]  f at the start of this step; an increment; weights of increments; a state and its rates; base of a stage;
    # fallback slope. [s, n] stages of the last step; [3 q, n] transformed increments, f and residuals of all stages
    "first": "v",
    "increment": "v",
    "weights": "v",
    "moved": "v",
    "rate": "v",
    "base": "v",
    "fallback": "v",
    "last_stages": "w",
    "transformed": "w",
}
RunArrays = namedtuple("RunArrays", ARRAY_KINDS)
# Expected dtype and number of dimensions of each array.
EXPECTED = [
    (np.dtype(ARRAYS[kind][0]), ARRAYS[kind][1]) if isinstance(kind, str) else (kind, 1)
    for kind in ARRAY_KINDS.values()
]
# Indices into `calls`.
STEP, FUSED_CALL, OBSERVER, RECORDER, EVENT_FUNCTIONS, RHS_CALL = range(6)
REAL_FACTOR, REAL_SOLVE, PAIR_FACTOR, PAIR_SOLVE, BANDS, WATCHER = range(6, 12)


@functools.cache
def run_types() -> RunArrays:
    """Numba types of the arrays of a run."""
    from numba import from_dtype, types

    def of(kind):
        return (
            plain_kinds()[kind] if isinstance(kind, str) else types.Array(from_dtype(kind), 1, "C")
        )

    return RunArrays(*map(of, ARRAY_KINDS.values()))


def handle_of_run(arrays: RunArrays):
    """Handle of the arrays of a run; raises TypeError for an array of another type than in `ARRAY_KINDS`."""
    if not COMPILING:
        return arrays
    # machine code does not check them
    for i, (array, (dtype, axes)) in enumerate(zip(arrays, EXPECTED, strict=True)):
        if array.dtype != dtype or array.ndim != axes or not array.flags.carray:
            name = RunArrays._fields[i]
            raise TypeError(
                f"{name} is not a writable C-contiguous array of {dtype} with {axes} dimension(s)"
            )
    return handle_of(addresses_of(arrays))


def boxed_run(arrays: RunArrays) -> np.ndarray:
    """Handle of the arrays of a run as an array that can itself be an array of a run."""
    handle = handle_of_run(arrays)
    if COMPILING:
        return handle
    box = np.empty(1, dtype=object)
    box[0] = handle
    return box


if COMPILING:

    @Intrinsic
    def open_run(typingctx, run):
        """Arrays behind the handle of a run; an attribute such as `r.y` loads an array."""
        from fvsolve.compile.code_generation import Tables, handle_address

        return Tables("Run", run_types)(run), handle_address
else:

    def open_run(run):
        """Arrays of a run, given as `RunArrays` or as an array that contains it."""
        return run[0] if isinstance(run, np.ndarray) else run


# Calls of the functions at addresses in `calls`.
# step of a method, arguments as `erk.attempt`
call_attempt = call_at_address("call_attempt", ATTEMPT, "t", __name__)
# see `Integrator.call`
call_fused_step = call_at_address("call_fused_step", FUSED_STEP, "", __name__)
# probes of a row or record of a state
call_observer = call_at_address("call_observer", OBSERVE, "", __name__)
# event functions, which are written to g
call_events = call_at_address("call_events", EVENTS, "", __name__)
call_rhs = call_at_address("call_rhs", RHS, "", __name__)
# factors of shift I - J, and solution with them, for a real and a complex shift, see `Structure.functions`
call_factor = call_at_address("call_factor", FACTOR, "i", __name__)
call_solve = call_at_address("call_solve", SOLVE, "", __name__)
call_factor_complex = call_at_address("call_factor_complex", FACTOR_COMPLEX, "i", __name__)
call_solve_complex = call_at_address("call_solve_complex", SOLVE_COMPLEX, "", __name__)
# returns the count of steps of its next state
call_watch = call_at_address("call_watch", WATCH, "t", __name__)
# exchange of partial sums between bands
call_join = call_at_address("call_join", JOIN, "", __name__)


def addresses(functions: tuple):
    """Addresses of functions, to pass from Python to compiled code : int64[n]; the functions themselves without JIT."""
    if COMPILING:
        return np.array([function.code.address for function in functions])
    table = np.empty(len(functions), dtype=object)
    table[:] = functions
    return table


@njit(forceinline=True)
def evaluate(handle, r, t, y, dydt):
    """Write the rates of the model at (t, y) to `dydt` and other results to `r.out`, and count the call."""
    call_rhs(r.calls[RHS_CALL], t, y, dydt, r.out, handle)
    r.state[0]["calls"] += 1.0


@njit(forceinline=True)
def stage_rates(handle, r, t, y, dydt):
    """Write the rates of the model as `evaluate`, but not the rate that limits the step: only the first stage needs it.

    Parts compute it at a cost of up to a third of the right-hand side.
    """
    r.out[rec.RATE] = RATE_UNWANTED
    evaluate(handle, r, t, y, dydt)
    r.out[rec.RATE] = 0.0


@njit(forceinline=True)
def note_stage(r):
    """Store the status of a stage with faulty rates, and its place, unless an earlier stage of the step has a fault."""
    if r.out[rec.STATUS] != 0.0 and r.progress[0]["stage_status"] == 0:
        r.progress[0]["stage_status"], r.progress[0]["stage_where"] = (
            int(r.out[rec.STATUS]),
            int(r.out[rec.PLACE]),
        )


@njit(forceinline=True)
def store_ledger_rates(r, i):
    """Store the ledger rates in `r.out` as those of stage i."""
    out = r.out
    rates = r.ledger_rates
    offset = r.control[0]["ledger_offset"]
    for m in range(rates.shape[1]):
        rates[i, m] = out[offset + m]


def no_factor(structure, jacobian, shift, factors):
    """Do nothing, in place of a factorisation, for steps that solve no equations."""
    return 0


def no_solve(structure, factors, x):
    """Do nothing, in place of a solution, for steps that solve no equations."""


@functools.cache
def no_algebra():
    """Functions factor, solve, factor_complex and solve_complex that do nothing, for explicit steps."""
    letters = (FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX)
    return tuple(
        compile_as(njit(f), kinds)
        for f, kinds in zip((no_factor, no_solve) * 2, letters, strict=True)
    )


def single_band(sums, row_blocks, handle):
    """Do nothing, in place of an exchange between bands, for a single band."""


@functools.cache
def no_exchange():
    """Compiled function that exchanges no data, for a model that is not divided into bands."""
    return compile_as(njit(single_band), JOIN)


def unwatched(t, steps, y, ledger, handle, watch, begins):
    """Do nothing, in place of a function that watches some accepted states."""
    return 0.0


@functools.cache
def no_watch():
    """Compiled function that watches no state."""
    return compile_as(njit(unwatched), WATCH)
