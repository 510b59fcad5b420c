"""Greatest step at which no wave grows between a storing node and a delay line."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.step_limits.delay_line_growth import storing_nodes, wave_growth
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.failure.eigen_limit import GROWTH
from fvsolve.studies.outcome import prepared

STEPS, HALVINGS = 33, 12  # number of steps tried, and of bisections between two of them
FARTHER = 4.0  # ratio of the limits of these steps to those of the map, up and down


class LinesLimit:
    """Limits of a case with changed keys, for any method; each step has a model of its own, used by all methods."""

    def __init__(self, case, set: dict, steps: list[float]) -> None:
        self.case, self.set = case, set
        self.steps = [float(h) for h in np.geomspace(min(steps) / FARTHER, FARTHER * max(steps), STEPS)]
        self.models: dict[float, object] = {}

    def model(self, h: float):
        """Model with delay lines divided for a step [s]."""
        if h not in self.models:
            self.models[h] = prepared(self.case, {**self.set, "numerics.step": h, "numerics.method": "euler"})
        return self.models[h]

    def grows(self, method: str, h: float) -> bool:
        """True if waves grow by VISIBLE_GROWTH in a run with this step [s]."""
        numerics = self.case.numerics
        return wave_growth(self.model(h), method_named(method), h, numerics.end - numerics.start)[0] >= GROWTH

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
