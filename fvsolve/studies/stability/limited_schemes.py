"""Courant limits of limited schemes on a periodic grid: frozen weights, bounds and real runs.

A limited scheme has no derivative at a constant state, since its weights depend on the solution, and no exact limit.
Three kinds of limits are computed. The linear schemes that result from constant weights have exact limits. For slope
limiters total variation cannot grow up to the Courant number r / (1 + phi / 2), with the greatest slope phi over the
difference of neighbours (1 for minmod, 2 for other limiters) and the SSP radius r of the method (Harten 1983). Real
runs from three initial states (`start_fields`) give measured limits for increasing numbers of steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.schemes import LIMITED, LIMITERS, branches
from fvsolve.step_limits.advection_limit import AdvectionLimit, limit_of
from fvsolve.steppers.analysis.method_facts import analyse
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.outcome import Progress, name_list
from fvsolve.studies.result_table import PlainData
from fvsolve.studies.stability.periodic_limits import THRESHOLD, PeriodicPipe, check_size, first_failure
from fvsolve.validation import COUNT, FUNCTION, NAMES, validated

CELLS, STEPS, STEP_FACTORS = 50, 500, (1, 10, 100)
LIMIT_TOLERANCE = 1e-3  # relative width of a measured limit; growth is not a smooth function of the Courant number
SMALLEST = 0.3  # least Courant number that is run, unless a bound excludes failure up to a greater one
RATIO = 1.02  # of consecutive Courant numbers; above a failure, a greater one may be stable again
METHODS = ("euler", "ssp-rk2", "ssp-rk3", "rk4")  # by default
NORM_CHECKS = 25  # number of checks of the norm during a run
SHARPNESS = 0.05  # relative fall of the limit from the fewest to the most steps above which it is not sharp
SEED = 1


@dataclass(frozen=True)
class LimitedLimit(PlainData):
    """Courant limits of a limited scheme with a method.

    frozen : exact limits with constant weights, by name of the resulting linear scheme
    monotone : Courant number up to which total variation cannot grow; None if unknown
    steps : numbers of steps of the runs
    measured : name of the initial values (see `start_fields`) -> for each number of steps, the least Courant number
    found to fail within these steps; None if none fails up to 20
    least : least measured limit over the initial values, for each number of steps
    sharp : False if `least` falls by more than 5 % from the fewest to the most steps (exponential growth alone would
    change it less), None unless runs of both the fewest and the most steps fail
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
        """Least measured limit over the initial values, for each number of steps; None if no run failed."""
        columns = zip(*self.measured.values(), strict=True)
        return tuple(min((x for x in column if x is not None), default=None) for column in columns)

    @property
    def sharp(self) -> bool | None:
        first, last = self.least[0], self.least[-1]
        return None if first is None or last is None else last >= (1 - SHARPNESS) * first

    def flat(self) -> dict:
        """Values as a single row of a table, without the exact limits: name of the column -> value."""
        cells = {"scheme": self.scheme, "limiter": self.limiter, "method": self.method, "monotone": self.monotone}
        cells |= {"cells": self.cells, "sharp": self.sharp}
        for start, row in self.measured.items():
            cells |= {f"{start}, {n} steps": x for n, x in zip(self.steps, row, strict=True)}
        return cells


@validated(schemes=NAMES, methods=NAMES, cells=COUNT, steps=COUNT, progress=FUNCTION)
def limited_limits(
    schemes: Sequence[str] = tuple(LIMITED), methods: Sequence[str] | None = None, cells: int = CELLS,
    steps: int = STEPS, progress: Progress | None = None,
) -> list[LimitedLimit]:  # fmt: skip
    """Courant limits of limited schemes (muscl with each limiter) with explicit methods on a periodic grid.

    cells : cells of the grid; steps : real runs have 1, 10 and 100 times this number of steps
    progress : function of (limits done, limits in total, next pair)
    Raises FvsolveError for unknown names, implicit methods, and for too few cells or steps.
    """
    check_size(cells, steps)
    report = progress or (lambda *_: None)
    schemes, chosen = (
        name_list(schemes) or tuple(LIMITED),
        [method_named(name) for name in name_list(methods) or METHODS],
    )
    implicit = [tableau.name for tableau in chosen if not tableau.explicit]
    if implicit:
        raise FvsolveError(f"{implicit[0]} is implicit. Expected explicit methods for runs with limited schemes")
    for name in schemes:
        if name not in LIMITED:
            hint = did_you_mean(name, LIMITED) or f"; limited schemes are {', '.join(LIMITED)}"
            raise FvsolveError(f'no limited scheme named "{name}"{hint}')
    kinds = [(name, limiter) for name in schemes for limiter in (LIMITERS if name == "muscl" else (None,))]
    pairs = [(*kind, tableau.name) for tableau in dict.fromkeys(chosen) for kind in kinds]
    limits = []
    for scheme, limiter, method in pairs:
        report(len(limits), len(pairs), f"{scheme} {limiter or ''} with {method}")
        limits.append(limited_limit(scheme, limiter, method, cells, steps))
    return limits


def limited_limit(
    scheme: str, limiter: str | None, method: str, cells: int = CELLS, steps: int = STEPS
) -> LimitedLimit:
    """Courant limits of a limited scheme (and the limiter of muscl) with a method, on a grid of `cells` cells."""
    name = limiter or scheme
    counts = tuple(n * steps for n in STEP_FACTORS)
    return LimitedLimit(
        scheme,
        limiter,
        method_named(method).name,
        {branch: limit_of(weights, branch, method) for branch, weights in branches(scheme, limiter).items()},
        monotone_limit(name, method),
        cells,
        counts,
        {
            start: tuple(measured_courant(scheme, limiter, method, u, n) for n in counts)
            for start, u in start_fields(cells).items()
        },
    )


def monotone_limit(limiter: str, method: str) -> float | None:
    """Courant number up to which total variation cannot grow with a slope limiter and a method; None if unknown."""
    radius = analyse(method).ssp_radius
    return radius / (1 + LIMITERS[limiter].steepest / 2) if limiter in LIMITERS and radius > 0 else None


def start_fields(cells: int) -> dict[str, np.ndarray]:
    """Initial cell values with mean zero, by name: a sine wave, a square wave ("front") and random noise."""
    j = np.arange(cells)
    noise = np.random.default_rng(SEED).standard_normal(cells)
    fields = {"wave": np.sin(2 * np.pi * j / cells), "front": np.where(j < cells // 2, 1.0, -1.0), "noise": noise}
    return {name: u - u.mean() for name, u in fields.items()}


def measured_courant(scheme: str, limiter: str | None, method: str, start: np.ndarray, steps: int) -> float | None:
    """Least Courant number found at which the L2 norm of a real run grows 1000 times within `steps` steps.

    start : initial cell values. The result is None if no Courant number up to 20 is found to fail.
    """
    circle = PeriodicPipe(scheme, method, start.size, limiter or "minmod")
    smallest = monotone_limit(limiter or scheme, method) or SMALLEST
    return first_failure(lambda courant: _growth(circle, start, courant, steps), LIMIT_TOLERANCE, smallest, RATIO)


def _growth(circle: PeriodicPipe, start: np.ndarray, courant: float, steps: int) -> float:
    """log10 of the growth in a run, the greatest norm over the norm at the start.

    The result is inf for a growth above 1000, and if values are not finite.
    """
    u, greatest, done = start, 0.0, 0
    for k in range(1, NORM_CHECKS + 1):
        count, done = steps * k // NORM_CHECKS - done, steps * k // NORM_CHECKS
        u = circle.run(u, courant, count) if count else u
        if u is None:
            return math.inf
        greatest = max(greatest, float(np.linalg.norm(u) / np.linalg.norm(start)))
        if greatest > THRESHOLD:
            return math.inf
    return math.log10(greatest) if greatest > 0 else -math.inf
