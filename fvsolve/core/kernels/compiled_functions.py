"""Compiled functions of a model for the stepper, compiled at first use."""

import functools

from fvsolve.core.kernels import calls
from fvsolve.core.kernels.rhs_assembly import CLOSING, PHASES, ModelFeatures
from fvsolve.jit import compile_in_parallel, compile_once, njit

READER_IMPORTS = (
    "from fvsolve.core.kernels.rhs_assembly import ModelFeatures, RhsTerms; "
    "from fvsolve.core.kernels.compiled_functions import compile_readers; "
)
HOOK = {hook: k for k, hook in enumerate(calls.HOOKS)}
RHS_HOOKS = ("set", "move", "step", "slope", "lift")
READER_HOOKS = ("value", "outside", "events", "bends")
ENERGY_HOOKS = ("power", "stored")
COMPILE_TIME_LOOP = "from fvsolve.core.steppers.time_loop import compiled; compiled()"


class Functions:
    """Compiled functions of a model: `rhs`, `observe`, `record`, `events`, and `energies` (compiled at first use).

    cast : features of the model, which decide on its functions
    calls : int64[jobs, n]  addresses of functions, a row for each job
    hooks : int64[laws, hooks]  addresses of the functions of parts' laws; the handle of a model contains both arrays
    """

    def __init__(self, cast: ModelFeatures) -> None:
        self.cast, rates = cast, cast.functions(*PHASES)
        # a row for each job, ended by a zero
        most = max(
            len(rates),
            *map(cast.count, ("observe", "record", "events", "stored", "derive_state", "damp")),
        )
        most = max(most, cast.count("network_power") + cast.count("power"))
        self.calls = calls.empty_calls(calls.JOBS, most + 1)
        self.hooks = calls.empty_calls(len(cast.laws), len(calls.HOOKS))
        others = (
            ""
            if all(name.startswith("fvsolve.") for name in cast.packages())
            else "import fvsolve.parts; "
        )
        code = f"{others}{READER_IMPORTS}compile_readers({cast!r}); {COMPILE_TIME_LOOP}"
        # A second process compiles the readers and the time loop at the same time.
        with compile_in_parallel(code, "run_steps"):
            self.rhs = self.compile_job(calls.RHS, rates, calls.rhs_in_turn)
            self.store_hooks(*RHS_HOOKS, *["lead"] * cast.columns, *cast.device_hooks)
        self.store_addresses(calls.CLOSE, cast.functions(*CLOSING))
        self.store_addresses(calls.DERIVE, cast.functions("derive_state"))
        self.store_addresses(calls.DAMP, cast.functions("damp"))
        self.observe = self.compile_job(
            calls.OBSERVE, cast.functions("observe"), calls.observe_in_turn
        )
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
        power, stored = self.cast.functions("network_power", "power"), self.cast.functions("stored")
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
    step_function = unused_step
    if needed:
        from fvsolve.core.kernels.fused_step import fused_step_linear as step_function
    return calls.compile_as(step_function, "ttVVVHV")


@njit
def unused_step(t, h, y, y_new, out, handle, values):
    """Placeholder with the arguments of `fused_step_linear`; it is never called."""
