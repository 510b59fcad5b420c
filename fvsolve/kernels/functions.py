"""Compiled functions of a model for the stepper, compiled at first use."""

import functools

from fvsolve.jit import beside, njit, once
from fvsolve.kernels import calls
from fvsolve.kernels.phases import CLOSING, PHASES, Cast

READERS = "from fvsolve.kernels.phases import Cast, Pieces; from fvsolve.kernels.functions import compile_readers; "
HOOK = {hook: k for k, hook in enumerate(calls.HOOKS)}
MOVING, READING = ("set", "move", "step", "slope", "lift"), ("value", "outside", "events", "bends")
ENERGIES = ("power", "stored")
MARCH = "from fvsolve.steppers.march import compiled; compiled()"


class Functions:
    """Compiled functions of a model: `rhs`, `observe`, `record`, `events`, and `energies` when they are first used.

    calls : int64[jobs, n]  addresses of functions, a row for each job
    hooks : int64[laws, hooks]  addresses of the functions of parts' laws; both stand behind the handle of a model
    """

    def __init__(self, cast: Cast) -> None:
        self.cast, rates = cast, cast.functions(*PHASES)
        self.calls = calls.empty_calls(calls.JOBS, len(rates) + 3)
        self.hooks = calls.empty_calls(len(cast.laws), len(calls.HOOKS))
        others = "" if all(name.startswith("fvsolve.") for name in cast.homes()) else "import fvsolve.parts; "
        with beside(f"{others}{READERS}compile_readers({cast!r}); {MARCH}", "march_at"):
            self.rhs = self.all(calls.RHS, rates, calls.rhs_in_turn)
            self.hang(*MOVING, *["lead"] * cast.columns)
        self.enter(calls.CLOSE, cast.functions(*CLOSING))
        self.enter(calls.SEE, cast.functions("see"))
        self.enter(calls.DAMP, cast.functions("damp"))
        self.observe = self.all(calls.OBSERVE, cast.functions("observe"), calls.observe_in_turn)
        self.enter(calls.RECORD, cast.functions("record"))
        self.enter(calls.EVENTS, cast.functions("events"))
        self.hang(*READING)
        self.record, self.events = compile_readers(cast)

    def enter(self, job: int, functions: list) -> None:
        """Write the addresses of the functions of a job to `calls`."""
        self.calls[job, : len(functions)] = [calls.addressed(function, calls.ARGUMENTS[job]) for function in functions]

    def hang(self, *hooks: str) -> None:
        """Write the addresses of these hooks of all laws to `hooks`."""
        for row, law in zip(self.hooks, self.cast.modules(), strict=True):
            for hook in hooks:
                if (function := calls.hook_of(law, hook)) is not None:
                    row[HOOK[hook]] = calls.addressed(function, calls.HOOKS[hook][0])

    def all(self, job: int, functions: list, in_turn):
        """Store all functions of a job; return the compiled function that calls them in turn."""
        self.enter(job, functions)
        return calls.compile_as(in_turn, calls.ARGUMENTS[job].lower())

    @functools.cached_property
    def energies(self) -> tuple:
        """(power, stored), functions of (t, y, dydt, out, handle, rows)."""
        self.hang(*ENERGIES)
        power, stored = self.cast.functions("power"), self.cast.functions("stored")
        return self.all(calls.POWER, power, calls.power_in_turn), self.all(calls.STORED, stored, calls.stored_in_turn)


functions = once(Functions)


def compile_readers(cast: Cast) -> tuple:
    """(record, events) of a model, compiled together with all functions that they call."""
    for function in cast.functions("observe", "record", "events"):
        calls.addressed(function, calls.READS)
    for law in cast.modules():
        for hook in READING:
            if (function := calls.hook_of(law, hook)) is not None:
                calls.addressed(function, calls.HOOKS[hook][0])
    record = calls.compile_as(calls.record_in_turn, calls.READS.lower())
    return record, calls.compile_as(calls.events_in_turn, "tvhv")


@once
def leap_function(needed: bool):
    """Fused step of upwind and Euler under the linear law if `needed`, else an unused function of that type."""
    found = stay
    if needed:
        from fvsolve.kernels.leap import leap_linear as found
    return calls.compile_as(found, "ttvvvhv")


@njit
def stay(t, h, y, y_new, out, handle, values):
    """Placeholder; it is never called."""
