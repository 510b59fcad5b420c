"""The least step that fails, bracketed and halved. Knows a question with yes and no; asks nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

FINE = 1e-4  # relative width of the bracket around a limit
RISE = 1.3  # between steps that are tried on the way up


class Limit(NamedTuple):
    """The greatest step [s] up to which none fails (inf: none found that does), and the bracket's failing end."""

    step: float
    fails: float


def limit(fails: Callable[[float], bool], first: float, far: float, rise: float = RISE, fine: float = FINE) -> Limit:
    """The least h at which `fails` turns true, from below: `first` times `rise` each, then halved to `fine`.

    Where `first` fails, smaller ones are tried, halved, down to 1e-9 of it: then the limit is 0.
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
    """A bracket (safe, failing) halved until its relative width is `fine`."""
    while high - low > fine * high:
        middle = 0.5 * (low + high)
        if fails(middle):
            high = middle
        else:
            low = middle
    return Limit(low, high)
