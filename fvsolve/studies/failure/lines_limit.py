"""The greatest step at which no wave grows between a store and a delay line. Knows models; runs nothing."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.limits.lines import stores, wave_growth
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.failure.eigen_limit import GROWTH
from fvsolve.studies.outcome import prepared

STEPS, HALVINGS = 33, 12  # looked at, and of the bracket that is found
FARTHER = 4.0  # than the steps that are run, up and down


class LinesLimit:
    """Limits of one case with keys set; a model is cut for each step that is looked at, once for all methods."""

    def __init__(self, case, set: dict, steps: list[float]) -> None:
        self.case, self.set = case, set
        self.steps = [float(h) for h in np.geomspace(min(steps) / FARTHER, FARTHER * max(steps), STEPS)]
        self.models: dict[float, object] = {}

    def model(self, h: float):
        """The model whose lines are cut for a step [s]."""
        if h not in self.models:
            self.models[h] = prepared(self.case, {**self.set, "numerics.step": h, "numerics.method": "euler"})
        return self.models[h]

    def grows(self, method: str, h: float) -> bool:
        """Whether waves grow by GROWTH in a run with this step [s]."""
        numerics = self.case.numerics
        return wave_growth(self.model(h), method_named(method), h, numerics.end - numerics.start)[0] >= GROWTH

    def __call__(self, method: str) -> float | None:
        """The greatest step [s] before the first at which they do; inf where there is none, 0 where each does.

        None where it is not known: of Rosenbrock's methods where lines touch a store.
        """
        if method_named(method).kind == "linear" and any(stores(self.model(self.steps[0]), 1.0)):
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
