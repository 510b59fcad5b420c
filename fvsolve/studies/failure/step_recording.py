"""Run that records the values of its probes after every step, in windows of successive steps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fvsolve.studies.accuracy.timing import CappedRun
from fvsolve.studies.outcome import Outcome, outcome

WINDOW_STEPS = 9  # least number of successive steps in a window
CPU_LIMIT = 10.0  # CPU time after which a run is given up [s]
WINDOW_COUNT = 30  # in long runs the distance of windows is this fraction of the steps taken: 1 / 30


class RecordedRun(CappedRun):
    """Run that records its probes after every step; in a long run only in windows of nine or more successive steps.

    The steps are those of a run without recording.
    windows : for each window a list of float64[probes], the values of the probes after successive steps, in SI units
    """

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.windows: list[list[np.ndarray]] = [[]]
        self.budget = self.left = 1.0
        self.max_seconds = CPU_LIMIT

    def pause(self) -> None:
        """Record the probes, and in a long run skip the steps between two windows. Raises GivenUp at the CPU limit."""
        self.check()
        self.windows[-1].append(self.run_data.observe(self.loop.t, self.loop.now, self.loop.stepper.out))
        apart = int(self.loop.state["steps"]) // WINDOW_COUNT
        self.budget = 1.0
        if apart > WINDOW_STEPS and len(self.windows[-1]) >= WINDOW_STEPS:
            self.windows.append([])
            self.budget = float(apart)


def run_recorded(case, set: Mapping | None = None) -> tuple[Outcome, list[np.ndarray]]:
    """(outcome of a run with the changed keys `set`, recorded windows : list of float64[steps, probes] in SI units)."""
    runs: list[RecordedRun] = []

    def run(*arguments) -> RecordedRun:
        runs.append(RecordedRun(*arguments))
        return runs[-1]

    result = outcome(case, set, run=run)
    windows = runs[-1].windows if runs else []
    return result, [np.array(window) for window in windows if len(window) > 1]
