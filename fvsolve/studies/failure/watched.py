"""A run looked at step by step: what its probes are after each step of a window. Knows runs; judges nothing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fvsolve.steppers import slots
from fvsolve.studies.accuracy.timing import Capped
from fvsolve.studies.outcome import Outcome, outcome

WINDOW = 9  # steps looked at in a row, at least
LONGEST = 10.0  # [s] of CPU time after which a run is given up
SPARSE = 30  # windows of long runs lie a thirtieth of the steps so far apart


class Watched(Capped):
    """A run that stops after every step of a window and notes its probes; the steps are those of any run.

    bursts : lists of float64[probes] [SI], the probes after steps that follow each other
    """

    def __init__(self, *given) -> None:
        super().__init__(*given)
        self.bursts: list[list[np.ndarray]] = [[]]
        self.budget = self.left = 1.0
        self.most_seconds = LONGEST

    def pause(self) -> None:
        """Note the probes; after a window of a long run, let it run on to the next one, or give it up."""
        self.check()
        self.bursts[-1].append(self.slate.observe(self.loop.t, self.loop.now, self.loop.stepper.out))
        apart = int(self.loop.memory[slots.STEPS]) // SPARSE
        self.budget = 1.0
        if apart > WINDOW and len(self.bursts[-1]) >= WINDOW:
            self.bursts.append([])
            self.budget = float(apart)


def watched(case, set: Mapping | None = None) -> tuple[Outcome, list[np.ndarray]]:
    """(how a case with keys changed ran, its bursts : float64[steps, probes] [SI] each); see `outcome`."""
    made: list[Watched] = []

    def run(*given) -> Watched:
        made.append(Watched(*given))
        return made[-1]

    found = outcome(case, set, run=run)
    bursts = made[-1].bursts if made else []
    return found, [np.array(burst) for burst in bursts if len(burst) > 1]
