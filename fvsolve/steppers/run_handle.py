"""Handle of a run: its arrays, and the compiled functions that the time loop calls.

A handle is a small array with the memory addresses of all arrays of a run (`kernels.table_handle`). So every function
of a step has few arguments, and the loop is compiled once and used for every method and every model.
A letter stands for the type of an argument or array, as in `jit.plain_kinds`: t float64, i int64, c complex128; arrays
with one and two dimensions v and w of float64, h and s of int64; z array of complex128.
"""

import functools
from collections import namedtuple

import numpy as np

from fvsolve.jit import ARRAYS, COMPILING, Intrinsic, declare_function, njit, plain_kinds
from fvsolve.kernels.table_handle import addresses_of, handle_of
from fvsolve.steppers import loop_records as rec

FACTOR, SOLVE, FACTOR_COMPLEX, SOLVE_COMPLEX = "hvtv", "hvv", "hvcz", "hzz"
ATTEMPT = "hhttii"  # step of a method: handle of the model, handle of the run, t, h, row of y at the start, at the end
FUSED_STEP, OBSERVE, EVENTS, RHS, JOIN = "ttvvvhv", "tvvhv", "tvhv", "tvvvh", "vsh"

# Arrays of a run, for n states, s stages and m ledger rates : record, or letter of the type.
ARRAY_KINDS = {
    "state": rec.STATE, "control": rec.CONTROL, "progress": rec.PROGRESS, "newton": rec.NEWTON,
    "calls": "h",  # addresses of the functions, in the order of `function_types`
    "spare": "h",  # handle of a run with the same states and other arrays of a step, for `output_rows.separate_step`
    "coefficients": "v",  # flat coefficients of the method, see `coefficients`
    "dense": "w",  # coefficients of its dense output
    "structure": "h",  # Jacobian (`structure.Structure.shape`), or stage sums of rhs (`kernels.stage_sums`), or empty
    "row_blocks": "s", "sums": "v",  # states of this band, and partial sums of all bands, see `step_operations`
    "y": "w",  # [4, n]  present, last and next state, and a stage
    "scale": "v",  # [n]  reference size of each state, see `step_operations.error_scale`
    "k": "w", "ledger_rates": "w",  # [s, n], [s, m]  rates at the stages
    "f_old": "v",  # [n]  rates at the start of the last step, or result of `start_slope_defect`
    "ledger": "v",  # [5 m]  integrals of the ledger rates, see `ledger`
    "out": "v", "out_row": "v",  # results of rhs besides the rates, at the present state and at an output row
    "values": "v",  # probe values of the present state
    "g": "v", "g_new": "v", "armed": "v",  # event functions at the start and the end of a step, and event flags
    "stored": "h", "carry": "v",  # states with compensated sums, and the rounding errors of these sums
    "times": "v",  # times of the output rows if given as a list
    "y_out": "v", "rows": "w",  # state of an output row; rows [capacity, 1 + probes]
    "bounded_states": "h", "bounds": "w",  # limits of interpolated rows, see `output_rows.limit_to_bounds`
    "largest": "v",  # [n]  largest allowed states, checked every 16 steps, or empty
    # data of implicit steps: entries of the Jacobian; its product with a vector; array [q q] for q implicit stages;
    # slopes in time of the ledger rates; factors of shift I - J for real and complex shifts. Semi-implicit steps
    # store damping factors in `factors`.
    "jacobian": "v", "product": "v", "buffer": "v", "ledger_slopes": "v", "factors": "v", "complex_factors": "z",
    # [n]  f at the start of this step; an increment; weights of increments; a state and its rates; base of a stage;
    # fallback slope. [s, n] stages of the last step; [3 q, n] transformed increments, f and residuals of all stages
    "first": "v", "increment": "v", "weights": "v", "moved": "v", "rate": "v", "base": "v", "fallback": "v",
    "last_stages": "w", "transformed": "w",
}  # fmt: skip
RunArrays = namedtuple("RunArrays", ARRAY_KINDS)
# Indices into `calls`.
(
    STEP,
    FUSED_CALL,
    OBSERVER,
    RECORDER,
    EVENT_FUNCTIONS,
    RATES,
    REAL_FACTOR,
    REAL_SOLVE,
    PAIR_FACTOR,
    PAIR_SOLVE,
    BANDS,
) = range(11)


@functools.cache
def run_types() -> RunArrays:
    """Numba types of the arrays of a run."""
    from numba import from_dtype, types

    def of(kind):
        return plain_kinds()[kind] if isinstance(kind, str) else types.Array(from_dtype(kind), 1, "C")

    return RunArrays(*map(of, ARRAY_KINDS.values()))


def run_handle(arrays: RunArrays):
    """Handle of the arrays of a run; raises TypeError for an array of another type than in `ARRAY_KINDS`."""
    if not COMPILING:
        return arrays
    for name, array in arrays._asdict().items():  # machine code does not check them
        kind = ARRAY_KINDS[name]
        dtype, axes = ARRAYS[kind] if isinstance(kind, str) else (kind, 1)
        if array.dtype != dtype or array.ndim != axes or not array.flags.carray:
            raise TypeError(f"{name} is not a writable C-contiguous array of {dtype} with {axes} dimension(s)")
    return handle_of(addresses_of(arrays))


def empty_run():
    """Empty array for the handle `spare`."""
    return np.zeros(0, dtype=np.int64 if COMPILING else object)


def boxed_run(arrays: RunArrays) -> np.ndarray:
    """Handle of the arrays of a run as an array that can itself be an array of a run."""
    handle = run_handle(arrays)
    if COMPILING:
        return handle
    box = np.empty(1, dtype=object)
    box[0] = handle
    return box


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
    attempt = of(ATTEMPT, types.float64)
    return attempt, of(FUSED_STEP), of(OBSERVE), of(OBSERVE), of(EVENTS), of(RHS), *algebra, of(JOIN)


def argument_types(letters: str) -> tuple:
    """Numba types of arguments given as letters of `jit.plain_kinds`."""
    kinds = plain_kinds()
    return tuple(kinds[letter] for letter in letters)


if COMPILING:

    @Intrinsic
    def open_run(typingctx, run):
        """Arrays behind the handle of a run; an attribute such as `r.y` loads an array."""
        from fvsolve.kernels.table_attributes import Tables, handle_address

        return Tables("Run", run_types)(run), handle_address

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
else:

    def open_run(run):
        """Arrays of a run, given as `RunArrays` or as an array that contains it."""
        return run[0] if isinstance(run, np.ndarray) else run

    def attempt_at(function):
        """Function itself, in place of its address."""
        return function

    fused_step_at = observe_at = record_at = events_at = rhs_at = join_at = attempt_at
    factor_at = solve_at = factor_complex_at = solve_complex_at = attempt_at


def addresses(functions: tuple):
    """Addresses of functions, to pass from Python to compiled code : int64[n]; the functions themselves without JIT."""
    if COMPILING:
        return np.array([function.address for function in functions])
    table = np.empty(len(functions), dtype=object)
    table[:] = functions
    return table


@njit(forceinline=True)
def evaluate(handle, r, t, y, dydt):
    """Write the rates of the model at (t, y) to `dydt` and other results to `r.out`, and count the call."""
    rhs_at(r.calls[RATES])(t, y, dydt, r.out, handle)
    r.state[0]["calls"] += 1.0


@njit(forceinline=True)
def store_ledger_rates(r, i):
    """Store the ledger rates in `r.out` as those of stage i."""
    out, rates, offset = r.out, r.ledger_rates, r.control[0]["ledger_offset"]
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
