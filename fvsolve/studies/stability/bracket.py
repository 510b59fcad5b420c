"""Bisection for the least step that fails."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

FINE = 1e-4  # relative width of the final bracket
RISE = 1.3  # ratio of consecutive steps of the search upwards


class Limit(NamedTuple):
    """Greatest step [s] below which none fails (inf: no failure found), and the failing end of the bracket [s]."""

    step: float
    fails: float


def limit(fails: Callable[[float], bool], first: float, far: float, rise: float = RISE, fine: float = FINE) -> Limit:
    """Search upwards for the least h at which `fails` is true, by factors `rise` from `first`; then bisect to `fine`.

    If `first` fails, it is halved down to 1e-9 of its value; if all these fail, the limit is 0. Above `far` it is inf.
    """
    low, high = 0.0, first
    if fails(high):
        while high > 1e-9 * first:
            low, high = 0.5 * high, high
            if not fails(low):
                break
            high = low
        else:
            return Limit(0.0, high)
    else:
        while not fails(rise * high):
            high *= rise
            if high > far:
                return Limit(np.inf, np.inf)
        low, high = high, rise * high
    return halved(fails, low, high, fine)


def halved(fails: Callable[[float], bool], low: float, high: float, fine: float = FINE) -> Limit:
    """Bisect a bracket (`low` safe, `high` failing) to the relative width `fine`."""
    while high - low > fine * high:
        middle = 0.5 * (low + high)
        if fails(middle):
            high = middle
        else:
            low = middle
    return Limit(low, high)
