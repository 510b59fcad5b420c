"""CPU time of runs: the least of several runs, with code that is already compiled."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from fvsolve.errors import CaseError
from fvsolve.solve.solve import Run
from fvsolve.studies.outcome import Outcome, outcome, refusal_text, study_model

MAX_RUNS = 5  # greatest number of runs, of which the fastest counts
REPEAT_TIME = 0.4  # wall time of all runs together, including the first, above which no run is repeated [s]
CPU_LIMIT = 30.0  # CPU time after which a run is stopped [s]
REFERENCE_CPU_LIMIT = 120.0  # CPU time after which a reference run, or a row of an order study, is stopped [s]
PROBE_STEPS = 20_000  # steps after which a run that only compiles is stopped
GIVEN_UP = "given up after"


class CappedRun(Run):
    """Run that stops between two chunks of steps as soon as its cost exceeds a limit."""

    max_seconds, max_steps = np.inf, np.inf

    def pause(self) -> None:
        """Do what a run does between two chunks of steps, then check the cost."""
        super().pause()
        self.check()

    def check(self) -> None:
        """Raise GivenUp if CPU time or number of steps exceeds its limit."""
        if self.processor > self.max_seconds or self.loop.state["steps"] > self.max_steps:
            raise GivenUp

    def segments(self) -> str:
        """Run to the end; returns the reason for the end, such as "finished", or "given up after ..." at the limit."""
        try:
            return super().segments()
        except GivenUp:
            return f"{GIVEN_UP} {self.processor:.3g} s, at t = {self.loop.t:.3g} s of {self.end:.3g} s"


class GivenUp(Exception):
    """Raised to end a run that costs too much."""


def capped_run(model, state, sink, progress) -> Run:
    """Run of a model that is stopped after CPU_LIMIT seconds of CPU time; arguments as for `solve.Run`."""
    run = CappedRun(model, state, sink, progress)
    run.max_seconds = CPU_LIMIT
    return run


def long_capped_run(model, state, sink, progress) -> Run:
    """Run of a model that is stopped after REFERENCE_CPU_LIMIT seconds of CPU time; arguments as for `solve.Run`."""
    run = CappedRun(model, state, sink, progress)
    run.max_seconds = REFERENCE_CPU_LIMIT
    return run


def probe_run(model, state, sink, progress) -> Run:
    """New `Run` of a model, not yet started, that stops after about PROBE_STEPS steps; arguments as for `solve.Run`."""
    run = CappedRun(model, state, sink, progress)
    run.max_steps = PROBE_STEPS
    return run


def finished_run(model, run=None) -> Outcome:
    """Outcome of one run of a model. Raises KeyboardInterrupt if the user interrupted the run.

    run : function(model, state, sink, progress) that returns the `Run`, such as `capped_run` (default `solve.Run`
    itself)
    """
    result = outcome(model, run=run)
    if result.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    return result


def best_run(model, most: int = MAX_RUNS, budget: float = REPEAT_TIME) -> Outcome:
    """Outcome with the least CPU time among up to `most` runs of a model.

    A run that stops early, or exceeds its limit, is not repeated.
    budget : wall time of all runs together, including the first [s]; a run that would probably exceed it is not begun
    """
    began, fastest = perf_counter(), finished_run(model, capped_run)
    for _ in range(most - 1 if fastest.ok else 0):
        if perf_counter() - began + fastest.seconds > budget:
            break
        fastest = min(fastest, finished_run(model, capped_run), key=lambda run: run.processor)
    return fastest


def best_run_of(case, keys) -> Outcome:
    """Outcome of `best_run` for a case with changed keys; a refused case gives an outcome with its reason."""
    try:
        return best_run(study_model(case, keys))
    except CaseError as error:
        return Outcome(refusal_text(error), refused=True)


def compile_seconds(model) -> float:
    """Wall time of a first run minus that of a second run [s].

    The difference is the time of compilation, or of loading compiled code.
    """
    times = []
    for _ in range(2):
        began = perf_counter()
        finished_run(model, probe_run)
        times.append(perf_counter() - began)
    return max(0.0, times[0] - times[1])
