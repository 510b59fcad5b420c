"""Greatest step at which no wave grows between a storing node and a delay line."""

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
    """Limits of a case with changed keys, for any method; each step has a model of its own, used by all methods."""

    def __init__(self, case, set: dict, steps: list[float]) -> None:
        self.case, self.set = case, set
        self.steps = [float(h) for h in np.geomspace(min(steps) / STEP_MARGIN, STEP_MARGIN * max(steps), STEP_COUNT)]
        self.models: dict[float, object] = {}

    def model(self, h: float):
        """Model with delay lines divided for a step [s]."""
        if h not in self.models:
            self.models[h] = study_model(self.case, {**self.set, "numerics.step": h, "numerics.method": "euler"})
        return self.models[h]

    def grows(self, method: str, h: float) -> bool:
        """True if waves grow by VISIBLE_GROWTH in a run with this step [s]."""
        numerics = self.case.numerics
        return wave_growth(self.model(h), method_named(method), h, numerics.end - numerics.start)[0] >= VISIBLE_GROWTH

    def __call__(self, method: str) -> float | None:
        """Greatest step [s] below the first at which waves grow; inf if they never grow, 0 if they grow at all steps.

        None if it is not known, for Rosenbrock methods with delay lines at storing nodes.
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
