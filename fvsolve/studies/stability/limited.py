"""Courant limits of limited schemes on a periodic grid: frozen weights, bounds, real runs. Knows no exact limit.

A limited scheme has no derivative at a constant state: its weights go with the solution. What can be said: the exact
limits of the linear schemes that it is where its switches stand still; for slopes, up to which Courant number total
variation cannot grow, r / (1 + phi / 2) with phi the greatest slope in differences (1 for minmod, 2 for the others)
and r the method's SSP radius (Harten 1983); and where real runs grow, from three starts, in more and more steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.doors import CALL, COUNT, NAMES, door
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.limits.grid import AdvectionLimit, limit_of
from fvsolve.schemes import LIMITED, LIMITERS, branches
from fvsolve.steppers.analysis.facts import analyse
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.outcome import Progress, names
from fvsolve.studies.sheet import Plain
from fvsolve.studies.stability.periodic import THRESHOLD, Circle, check_size, first_failure

CELLS, STEPS, TIMES = 50, 500, (1, 10, 100)
CLOSE = 1e-3  # of a measured limit: it does not hang on the Courant number smoothly
SMALLEST = 0.3  # Courant number that is tried, where no bound says that less cannot fail
RATIO = 1.02  # of the next: what fails may pass again at a greater one
METHODS = ("euler", "ssp-rk2", "ssp-rk3", "rk4")  # by default
LOOKS = 25  # at the norm during a run
FALLS = 0.05  # of the limit between the fewest and the most steps, more than an exponential explains: not sharp
SEED = 1


@dataclass(frozen=True)
class LimitedLimit(Plain):
    """What is known of a limited scheme with a method.

    frozen : limits of the linear schemes by name; monotone : up to which Courant number total variation cannot grow,
    None where nothing is known; measured : by start, the least Courant number found to fail in steps[i] steps (None:
    none up to 20); least : over the starts; sharp : False where it falls by more than 5 % from the fewest to the most
    steps, None where nothing failed.
    """

    scheme: str
    limiter: str | None
    method: str
    frozen: dict[str, AdvectionLimit]
    monotone: float | None
    cells: int
    steps: tuple[int, ...]
    measured: dict[str, tuple[float | None, ...]]

    also = ("least", "sharp")

    @property
    def least(self) -> tuple[float | None, ...]:
        """Over the starts, for each count of steps."""
        columns = zip(*self.measured.values(), strict=True)
        return tuple(min((x for x in column if x is not None), default=None) for column in columns)

    @property
    def sharp(self) -> bool | None:
        first, last = self.least[0], self.least[-1]
        return None if first is None or last is None else last >= (1 - FALLS) * first

    def flat(self) -> dict:
        """As one row of a table."""
        found = {"scheme": self.scheme, "limiter": self.limiter, "method": self.method, "monotone": self.monotone}
        found |= {"cells": self.cells, "sharp": self.sharp}
        for start, row in self.measured.items():
            found |= {f"{start}, {n} steps": x for n, x in zip(self.steps, row, strict=True)}
        return found


@door(schemes=NAMES, methods=NAMES, cells=COUNT, steps=COUNT, progress=CALL)
def limited_limits(
    schemes: Sequence[str] = tuple(LIMITED), methods: Sequence[str] | None = None, cells: int = CELLS,
    steps: int = STEPS, progress: Progress | None = None,
) -> list[LimitedLimit]:  # fmt: skip
    """Limited schemes, muscl with each limiter, and explicit methods; runs of `steps`, 10 and 100 times as many.

    Raises FvsolveError for names that are none, implicit methods, and a circle or a run that is too short.
    """
    check_size(cells, steps)
    tell = progress or (lambda *_: None)
    schemes, named = names(schemes) or tuple(LIMITED), [method_named(name) for name in names(methods) or METHODS]
    implicit = [one.name for one in named if not one.explicit]
    if implicit:
        raise FvsolveError(f"{implicit[0]} is implicit: limited schemes are measured with explicit methods")
    for name in schemes:
        if name not in LIMITED:
            wanted = did_you_mean(name, LIMITED) or f"; limited schemes are {', '.join(LIMITED)}"
            raise FvsolveError(f'no limited scheme named "{name}"{wanted}')
    kinds = [(name, limiter) for name in schemes for limiter in (LIMITERS if name == "muscl" else (None,))]
    pairs = [(*kind, one.name) for one in dict.fromkeys(named) for kind in kinds]
    found = []
    for scheme, limiter, method in pairs:
        tell(len(found), len(pairs), f"{scheme} {limiter or ''} with {method}")
        found.append(limited_limit(scheme, limiter, method, cells, steps))
    return found


def limited_limit(
    scheme: str, limiter: str | None, method: str, cells: int = CELLS, steps: int = STEPS
) -> LimitedLimit:
    """One limited scheme and method."""
    name = limiter or scheme
    counts = tuple(n * steps for n in TIMES)
    return LimitedLimit(
        scheme, limiter, method_named(method).name,
        {branch: limit_of(weights, branch, method) for branch, weights in branches(scheme, limiter).items()},
        monotone_limit(name, method), cells, counts,
        {start: tuple(measured(scheme, limiter, method, u, n) for n in counts) for start, u in starts(cells).items()},
    )  # fmt: skip


def monotone_limit(limiter: str, method: str) -> float | None:
    """The Courant number up to which total variation cannot grow; None where nothing is known."""
    radius = analyse(method).ssp_radius
    return radius / (1 + LIMITERS[limiter].steepest / 2) if limiter in LIMITERS and radius > 0 else None


def starts(cells: int) -> dict[str, np.ndarray]:
    """Fields of mean zero: one wave, a front up and down, noise."""
    j = np.arange(cells)
    noise = np.random.default_rng(SEED).standard_normal(cells)
    found = {"wave": np.sin(2 * np.pi * j / cells), "front": np.where(j < cells // 2, 1.0, -1.0), "noise": noise}
    return {name: u - u.mean() for name, u in found.items()}


def measured(scheme: str, limiter: str | None, method: str, start: np.ndarray, steps: int) -> float | None:
    """The least Courant number found at which the L2 norm of a real run grows past the threshold within the steps."""
    circle = Circle(scheme, method, start.size, limiter or "minmod")
    smallest = monotone_limit(limiter or scheme, method) or SMALLEST
    return first_failure(lambda courant: _growth(circle, start, courant, steps), CLOSE, smallest, RATIO)


def _growth(circle: Circle, start: np.ndarray, courant: float, steps: int) -> float:
    """log10 of the greatest norm seen in a run over that of its start; inf once past the threshold."""
    u, most, done = start, 0.0, 0
    for k in range(1, LOOKS + 1):
        count, done = steps * k // LOOKS - done, steps * k // LOOKS
        u = circle.run(u, courant, count) if count else u
        if u is None:
            return math.inf
        most = max(most, float(np.linalg.norm(u) / np.linalg.norm(start)))
        if most > THRESHOLD:
            return math.inf
    return math.log10(most) if most > 0 else -math.inf
