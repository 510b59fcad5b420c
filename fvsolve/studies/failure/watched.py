"""Run that records its probes after every step of some windows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fvsolve.steppers import loop_indices
from fvsolve.studies.accuracy.timing import Capped
from fvsolve.studies.outcome import Outcome, outcome

WINDOW = 9  # least number of successive steps in a window
LONGEST = 10.0  # CPU time after which a run is given up [s]
SPARSE = 30  # in long runs the distance of windows is this fraction of the steps taken: 1 / 30


class Watched(Capped):
    """Run that pauses after every step of a window and records its probes; its steps are those of a usual run.

    windows : lists of float64[probes] [SI], the probes after successive steps
    """

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.bursts: list[list[np.ndarray]] = [[]]
        self.budget = self.left = 1.0
        self.most_seconds = LONGEST

    def pause(self) -> None:
        """Record the probes, and in a long run skip the steps between two windows. Raises GivenUp at the CPU limit."""
        self.check()
        self.bursts[-1].append(self.slate.observe(self.loop.t, self.loop.now, self.loop.stepper.out))
        apart = int(self.loop.loop_state[loop_indices.STEPS]) // SPARSE
        self.budget = 1.0
        if apart > WINDOW and len(self.bursts[-1]) >= WINDOW:
            self.bursts.append([])
            self.budget = float(apart)


def watched(case, set: Mapping | None = None) -> tuple[Outcome, list[np.ndarray]]:
    """(outcome of a run with changed keys, its windows : float64[steps, probes] [SI] each)."""
    runs: list[Watched] = []

    def run(*arguments) -> Watched:
        runs.append(Watched(*arguments))
        return runs[-1]

    result = outcome(case, set, run=run)
    windows = runs[-1].bursts if runs else []
    return result, [np.array(window) for window in windows if len(window) > 1]
