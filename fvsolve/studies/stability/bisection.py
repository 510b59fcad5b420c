"""Bisection for the least step that fails."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

BRACKET_WIDTH = 1e-4  # relative width of the final bracket
STEP_RATIO = 1.3  # ratio of consecutive steps of the search upwards


class StepLimit(NamedTuple):
    """Result of a search: greatest step found safe, `step` [s], and least step found to fail, `fails` [s].

    Both are inf if no failure was found, and nan if nothing was computed; `step` is 0 or nan if no safe step was found.
    """

    step: float
    fails: float


def bisect_limit(
    fails: Callable[[float], bool], first: float, far: float, rise: float = STEP_RATIO, fine: float = BRACKET_WIDTH
) -> StepLimit:
    """Find the least step h [s] at which fails(h) is true, by a search upwards and bisection.

    The search starts at `first` and multiplies the step by `rise`. Bisection ends at the relative width `fine`. If
    `first` fails, it is halved down to 1e-9 of its value; if all these steps fail, the limit `StepLimit.step` is 0. If
    no step up to `far` fails, the limit is inf.
    """
    low, high = 0.0, first
    if fails(high):
        while high > 1e-9 * first:
            low, high = 0.5 * high, high
            if not fails(low):
                break
            high = low
        else:
            return StepLimit(0.0, high)
    else:
        while not fails(rise * high):
            high *= rise
            if high > far:
                return StepLimit(np.inf, np.inf)
        low, high = high, rise * high
    return bisect(fails, low, high, fine)


def bisect(fails: Callable[[float], bool], low: float, high: float, fine: float = BRACKET_WIDTH) -> StepLimit:
    """Bisect between a safe step `low` [s] and a failing step `high` [s], to the relative width `fine`."""
    while high - low > fine * high:
        middle = 0.5 * (low + high)
        if fails(middle):
            high = middle
        else:
            low = middle
    return StepLimit(low, high)
