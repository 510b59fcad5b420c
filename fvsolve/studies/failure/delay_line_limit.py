"""Greatest time step at which no wave grows between a node with storage (tank, chamber) and a delay line."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.step_limits.delay_line_growth import storing_nodes, wave_growth
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.failure.eigenvalue_limit import VISIBLE_GROWTH
from fvsolve.studies.outcome import study_model

STEP_COUNT, HALVINGS = 33, 12  # number of steps tried, and of bisections between two of them
STEP_MARGIN = 4.0  # ratio of the limits of these steps to those of the map, up and down


class WaveGrowthLimit:
    """Callable that returns, for a method, the greatest step at which waves in delay lines do not grow visibly.

    The waves are those between a storing node and the far end of a delay line, see `wave_growth`. Growth is visible if
    it is 1000 times or more in the run.
    case, set : the case and its changed keys; steps : steps of the failure map [s], around which limits are searched
    The model depends on the step but not on the method, so that all methods use the stored model of a step.
    """

    def __init__(self, case, set: dict, steps: list[float]) -> None:
        self.case, self.set = case, set
        self.steps = [float(h) for h in np.geomspace(min(steps) / STEP_MARGIN, STEP_MARGIN * max(steps), STEP_COUNT)]
        self.models: dict[float, object] = {}

    def model(self, h: float):
        """Model with delay lines divided into stretches for steps of h [s]."""
        if h not in self.models:
            self.models[h] = study_model(self.case, {**self.set, "numerics.step": h, "numerics.method": "euler"})
        return self.models[h]

    def grows(self, method: str, h: float) -> bool:
        """True if waves between a storing node and a delay line grow 1000 times or more in a run of steps h [s]."""
        numerics = self.case.numerics
        return wave_growth(self.model(h), method_named(method), h, numerics.end - numerics.start)[0] >= VISIBLE_GROWTH

    def __call__(self, method: str) -> float | None:
        """Greatest step [s] up to which waves grow less than 1000 times in the run with a method.

        It is inf if they do so at all steps tried, and 0 if they grow more at the shortest of these steps. The result
        is None for Rosenbrock methods if delay lines end at storing nodes, as their growth is not known.
        """
        if method_named(method).kind == "linear" and any(storing_nodes(self.model(self.steps[0]), 1.0)):
            return None
        last = 0.0
        for h in self.steps:
            if self.grows(method, h):
                break
            last = h
        else:
            return math.inf
        high = h
        for _ in range(HALVINGS if last > 0.0 else 0):
            middle = math.sqrt(last * high)
            last, high = (last, middle) if self.grows(method, middle) else (middle, high)
        return last
