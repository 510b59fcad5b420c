"""Compiled functions of a model for the stepper, compiled at first use, and the fused step of upwind scheme and Euler.

The fused step is that of the upwind scheme and the Euler method under the linear density law. The loop of
`steppers.time_loop` passes over all cells separately for rates, sums, envelope and the search for NaN. Here a block of
cells is advanced and compared with the envelope while it lies in the cache. The operations and their order are equal,
so the results agree to the bit.
"""

import functools

from fvsolve.jit import compile_in_parallel, compile_once, njit
from fvsolve.kernels import calls
from fvsolve.kernels.calls import RHS, run_job
from fvsolve.kernels.dtypes import NOT_FINITE, STATUS
from fvsolve.kernels.observation import observe_linear, record_nodes, update_envelope
from fvsolve.kernels.rhs_assembly import CLOSING, PHASES, ModelFeatures
from fvsolve.kernels.table_handle import open_tables

BLOCK = 512


@njit
def fused_cells(h, k, flow, half, base, r, l, r_new, l_new, least, greatest):
    """Advance a block of n pipe cells by the step h [s]; return the numbers of cells below and above their envelope.

    k : wave speed over cell length [1/s]
    flow : initial steady mass flow [kg/s]
    half : half of the friction coefficient of |M| M [1/kg]; base : half of the initial steady drag [kg/s2]
    r, l : float64[n + 1]  waves [kg/s]; r starts with the cell before the block, l ends with the cell behind it
    r_new, l_new : float64[n]  receive the new waves [kg/s]
    least, greatest : float64[n]  envelope of r + l [kg/s]
    NaN counts as below and above, so the search for it costs nothing.
    """
    here, beyond, low, high = r[1:], l[1:], 0, 0
    for i in range(r_new.size):
        m = flow + (here[i] - l[i])
        s = half * (abs(m) * m) - base
        a = here[i] + h * (-k * (here[i] - r[i]) - s)
        b = l[i] + h * (k * (beyond[i] - l[i]) + s)
        r_new[i], l_new[i] = a, b
        low += not a + b >= least[i]
        high += not a + b <= greatest[i]
    return low, high


@njit
def fused_block(t, h, pipe, index, at, r, l, r_new, l_new, tables):
    """Advance cells of pipe number `index` from cell `at` on and update their envelope; return 0 if all are finite.

    t : time after the step [s]; h : step [s]
    r, l, r_new, l_new : waves before and after the step, see `fused_cells`
    """
    e, a, b = tables.envelope, pipe["cell"] + at, pipe["cell"] + at + r_new.size
    k, half, base = pipe["speed"] / pipe["dx"], 0.5 * pipe["loss"], 0.5 * pipe["drag"]
    low, high = fused_cells(h, k, pipe["flow"], half, base, r, l, r_new, l_new, e[0, a:b], e[2, a:b])
    return update_envelope(t, r_new, l_new, a, low, high, index, tables) if low + high > 0 else 0


@njit
def fused_step_linear(t, h, y, y_new, out, handle, values):
    """Advance y by the step h to y_new at time t, by the upwind scheme and Euler; update `out`, probes and records.

    On entry `out` holds the solved nodes of y. The function is valid for models whose states are only those of pipes,
    without friction or with a given friction factor. `values` receives the values of probes. STATUS is set to
    NOT_FINITE if a value is not finite.
    """
    tables = open_tables(handle)
    pipes, pad, bad = tables.pipes, tables.scratch[:4], 0
    for index in range(pipes.size):
        pipe = pipes[index]
        n, o, ends = pipe["cells"], pipe["y"], tables.layout[0]["ends"] + 4 * index
        r, l, r_new, l_new = y[o : o + n], y[o + n : o + 2 * n], y_new[o : o + n], y_new[o + n : o + 2 * n]
        for side in range(2):  # the cells at the ends, whose neighbours are nodes
            i = side * (n - 1)
            pad[0], pad[1] = out[ends] if i == 0 else r[i - 1], r[i]
            pad[2], pad[3] = l[i], out[ends + 3] if i == n - 1 else l[i + 1]
            bad += fused_block(t, h, pipe, index, i, pad[:2], pad[2:], r_new[i : i + 1], l_new[i : i + 1], tables)
        for i in range(1, n - 1, BLOCK):
            j = min(i + BLOCK, n - 1)
            bad += fused_block(t, h, pipe, index, i, r[i - 1 : j], l[i : j + 1], r_new[i:j], l_new[i:j], tables)
    run_job(RHS, t, y_new, y_new[:0], out, handle)
    observe_linear(t, y_new, out, handle, values)
    record_nodes(t, y_new, out, handle, values)
    if bad > 0:
        out[STATUS] = NOT_FINITE


READER_IMPORTS = (
    "from fvsolve.kernels.rhs_assembly import ModelFeatures, RhsTerms; "
    "from fvsolve.kernels.compiled_functions import compile_readers; "
)
HOOK = {hook: k for k, hook in enumerate(calls.HOOKS)}
RHS_HOOKS, READER_HOOKS = ("set", "move", "step", "slope", "lift"), ("value", "outside", "events", "bends")
ENERGY_HOOKS = ("power", "stored")
COMPILE_TIME_LOOP = "from fvsolve.steppers.time_loop import compiled; compiled()"


class Functions:
    """Compiled functions of a model: `rhs`, `observe`, `record`, `events`, and `energies` (compiled at first use).

    cast : features of the model, which decide on its functions
    calls : int64[jobs, n]  addresses of functions, a row for each job
    hooks : int64[laws, hooks]  addresses of the functions of parts' laws; the handle of a model contains both arrays
    """

    def __init__(self, cast: ModelFeatures) -> None:
        self.cast, rates = cast, cast.functions(*PHASES)
        self.calls = calls.empty_calls(calls.JOBS, len(rates) + 3)
        self.hooks = calls.empty_calls(len(cast.laws), len(calls.HOOKS))
        others = "" if all(name.startswith("fvsolve.") for name in cast.packages()) else "import fvsolve.parts; "
        code = f"{others}{READER_IMPORTS}compile_readers({cast!r}); {COMPILE_TIME_LOOP}"
        with compile_in_parallel(code, "run_steps"):
            self.rhs = self.compile_job(calls.RHS, rates, calls.rhs_in_turn)
            self.store_hooks(*RHS_HOOKS, *["lead"] * cast.columns)
        self.store_addresses(calls.CLOSE, cast.functions(*CLOSING))
        self.store_addresses(calls.DERIVE, cast.functions("derive_state"))
        self.store_addresses(calls.DAMP, cast.functions("damp"))
        self.observe = self.compile_job(calls.OBSERVE, cast.functions("observe"), calls.observe_in_turn)
        self.store_addresses(calls.RECORD, cast.functions("record"))
        self.store_addresses(calls.EVENTS, cast.functions("events"))
        self.store_hooks(*READER_HOOKS)
        self.record, self.events = compile_readers(cast)

    def store_addresses(self, job: int, functions: list) -> None:
        """Write the addresses of the functions of a job to `calls`."""
        self.calls[job, : len(functions)] = [
            calls.function_address(function, calls.ARGUMENTS[job]) for function in functions
        ]

    def store_hooks(self, *hooks: str) -> None:
        """Write the addresses of functions of the laws of all parts to the attribute `hooks`.

        hooks : names of these functions, keys of `calls.HOOKS`
        """
        for row, law in zip(self.hooks, self.cast.modules(), strict=True):
            for hook in hooks:
                if (function := calls.hook_of(law, hook)) is not None:
                    row[HOOK[hook]] = calls.function_address(function, calls.HOOKS[hook][0])

    def compile_job(self, job: int, functions: list, in_turn):
        """Store the addresses of all functions of a job; return the compiled `in_turn`, which calls them in order."""
        self.store_addresses(job, functions)
        return calls.compile_as(in_turn, calls.ARGUMENTS[job])

    @functools.cached_property
    def energies(self) -> tuple:
        """Compiled functions (power, stored), which fill an array with powers [W] or stored energies [J].

        Their arguments are (t, y, dydt, out, handle, rows).
        """
        self.store_hooks(*ENERGY_HOOKS)
        power, stored = self.cast.functions("power"), self.cast.functions("stored")
        return self.compile_job(calls.POWER, power, calls.power_in_turn), self.compile_job(
            calls.STORED, stored, calls.stored_in_turn
        )


functions = compile_once(Functions)


def compile_readers(cast: ModelFeatures) -> tuple:
    """Compiled functions (record, events) of a model; all functions that they call are compiled too."""
    for function in cast.functions("observe", "record", "events"):
        calls.function_address(function, calls.READS)
    for law in cast.modules():
        for hook in READER_HOOKS:
            if (function := calls.hook_of(law, hook)) is not None:
                calls.function_address(function, calls.HOOKS[hook][0])
    record = calls.compile_as(calls.record_in_turn, calls.READS)
    return record, calls.compile_as(calls.events_in_turn, "tVHV")


@compile_once
def fused_step_function(needed: bool):
    """Compiled combined step of upwind scheme and Euler method if `needed`, else a placeholder with equal arguments."""
    return calls.compile_as(fused_step_linear if needed else unused_step, "ttVVVHV")


@njit
def unused_step(t, h, y, y_new, out, handle, values):
    """Placeholder with the arguments of `fused_step_linear`; it is never called."""
