"""What a run costs: CPU time of its steps, best of several, compiled before. Knows runs; knows no question."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from fvsolve.errors import CaseError
from fvsolve.solve.solve import Run
from fvsolve.steppers import slots
from fvsolve.studies.outcome import Outcome, outcome, prepared, refusal

MOST = 5  # runs of which the quickest counts
BUDGET = 0.4  # [s] that they may take together, the first excepted
LIMIT = 30.0  # [s] of CPU time after which a run is given up
LASTING = 120.0  # the same of one that others are measured against
TASTE = 20_000  # steps after which a run that only compiles is
GIVEN_UP = "given up after"


class Capped(Run):
    """A run that is given up, between two chunks of steps, when it has cost too much."""

    most_seconds, most_steps = np.inf, np.inf

    def pause(self) -> None:
        """As of every run, until it is given up."""
        super().pause()
        self.check()

    def check(self) -> None:
        """Give up where it has cost too much."""
        if self.processor > self.most_seconds or self.loop.memory[slots.STEPS] > self.most_steps:
            raise GivenUp

    def segments(self) -> str:
        """Why the run ended."""
        try:
            return super().segments()
        except GivenUp:
            return f"{GIVEN_UP} {self.processor:.3g} s, at t = {self.loop.t:.3g} s of {self.end:.3g} s"


class GivenUp(Exception):
    """Ends a run that costs too much."""


def capped(model, state, sink, progress) -> Run:
    """A run of LIMIT seconds at most."""
    made = Capped(model, state, sink, progress)
    made.most_seconds = LIMIT
    return made


def lasting(model, state, sink, progress) -> Run:
    """A run of LASTING seconds at most."""
    made = Capped(model, state, sink, progress)
    made.most_seconds = LASTING
    return made


def tasted(model, state, sink, progress) -> Run:
    """A run of TASTE steps or so."""
    made = Capped(model, state, sink, progress)
    made.most_steps = TASTE
    return made


def finished(model, run=None) -> Outcome:
    """One run of a model, made by `run`; KeyboardInterrupt where the user broke it off."""
    found = outcome(model, run=run)
    if found.reason.startswith("interrupted"):
        raise KeyboardInterrupt
    return found


def best(model, most: int = MOST, budget: float = BUDGET) -> Outcome:
    """The run with the least CPU time of up to `most`; a run that stops early, or is given up, is not repeated."""
    began, found = perf_counter(), finished(model, capped)
    for _ in range(most - 1 if found.ok else 0):
        if perf_counter() - began + found.seconds > budget:
            break
        found = min(found, finished(model, capped), key=lambda one: one.processor)
    return found


def quickest(case, keys) -> Outcome:
    """The best run of a case with keys changed; one that is refused is an outcome too."""
    try:
        return best(prepared(case, keys))
    except CaseError as error:
        return Outcome(refusal(error), refused=True)


def compile_seconds(model) -> float:
    """Wall time that a first run takes beyond a second one [s]: compiling, or loading what was compiled before."""
    times = []
    for _ in range(2):
        began = perf_counter()
        finished(model, tasted)
        times.append(perf_counter() - began)
    return max(0.0, times[0] - times[1])
