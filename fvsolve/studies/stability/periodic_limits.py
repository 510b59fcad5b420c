"""Courant limits on a periodic pipe, predicted for each wave and measured by real runs.

A Courant number nu fails if the L2 norm of some initial state grows more than 1000 times within n steps. On a periodic
grid the matrix of a step of a linear scheme is normal, so the greatest growth over all initial states is exactly the
greatest |R(nu z(theta_k))|^n over the waves k, with the phases theta_k = 2 pi k / cells, the stability function R of
the method and the symbol z of the scheme. A run measures this growth from one impulse, all of whose waves have equal
size, as the greatest |u_k(n)| / |u_k(0)| of the Fourier coefficients u_k.

A limited scheme has no derivative at a constant state, since its weights depend on the solution, and no exact limit.
Three kinds of limits are computed. The linear schemes that result from constant weights have exact limits. For slope
limiters total variation cannot grow up to the Courant number r / (1 + phi / 2), with the greatest slope phi over the
difference of neighbours (1 for minmod, 2 for other limiters) and the SSP radius r of the method (Harten 1983). Real
runs from three initial states (`start_fields`) give measured limits for increasing numbers of steps.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import COUNT, FUNCTION, NAMES, validated
from fvsolve.core.assembly.scheme_codes import scheme_settings
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.table_handle import make_handle
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.schemes import LIMITED, LIMITERS, branches
from fvsolve.core.step_limits.advection_limit import AdvectionLimit, limit_of
from fvsolve.core.step_limits.greatest_step import greatest_step, multiples
from fvsolve.core.step_limits.symbol import WEIGHTS, symbol, weights_of
from fvsolve.core.steppers import loop_records
from fvsolve.core.steppers.analysis.stability_properties import analyse
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.ode import observers
from fvsolve.core.steppers.structure import Structure
from fvsolve.core.steppers.tableau import METHODS, method_named
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.studies.outcome import Progress, name_list

THRESHOLD = 1e3
CELLS, STEPS = 100, 1000
SMALLEST_COURANT, LARGEST_COURANT = 0.05, 20.0  # first and last Courant number of the search
COURANT_RATIO = 1.1  # ratio of consecutive Courant numbers
LIMIT_TOLERANCE = 1e-8  # relative width of the bracket of a limit
FAR_TIME = 1e300
WENO_NOISE = 1e-18  # small number of WENO, for values of size 1


@dataclass(frozen=True)
class MeasuredLimit(PlainData):
    """Least Courant number that fails on a periodic grid, predicted and measured; None if none fails."""

    scheme: str
    method: str
    cells: int
    steps: int
    predicted: float | None
    measured: float | None

    also = ("ratio",)

    @property
    def ratio(self) -> float | None:
        """Predicted limit divided by measured limit; None if a limit is missing."""
        return self.predicted / self.measured if self.predicted and self.measured else None


class PeriodicPipe:
    """Linear advection on a periodic grid by one scheme and one method; a run is one call of compiled code."""

    def __init__(self, scheme: str, method: str, cells: int, limiter: str = "minmod") -> None:
        from fvsolve.core.kernels.calls import compile_as
        from fvsolve.core.kernels.reconstruction import rhs_periodic
        from fvsolve.core.steppers.run_handle import RHS

        names = (*rec.Tables._fields, *rec.RunArrays._fields)
        tables = {name: np.zeros(1, rec.RECORDS.get(name, float)) for name in names}
        tables["scratch"] = np.zeros(2 * cells + 7)
        scheme_settings(tables["settings"][0], scheme, limiter)
        tables["pipes"]["noise"] = WENO_NOISE
        self.tables = tuple(tables.values())
        self.stepper = Integrator(
            method_named(method), cells, 0, lambda: Structure.full(cells), np.ones(cells)
        )
        self.handle, self.functions = (
            make_handle(self.tables),
            (*observers(), compile_as(rhs_periodic, RHS)),
        )

    def run(self, start: np.ndarray, courant: float, steps: int) -> np.ndarray | None:
        """Cell values after `steps` steps at a Courant number, from the values `start`; None if not finite."""
        stepper = self.stepper
        stepper.state[:] = np.zeros(1, loop_records.STATE)
        stepper.set_control(
            mode=loop_records.FIXED_STEP, size=courant, step_max=FAR_TIME, stop_at=FAR_TIME
        )
        stepper.set_control(end=2.0 * courant * (steps + 1), budget=steps)
        stepper.restart_segment()
        stepper.y[stepper.progress[0]["now"]] = start
        code = stepper.call(*self.functions, self.handle, loop_records.PLACE + 1, stepper.no_floats)
        if code != loop_records.BUDGET_SPENT:
            return None
        return stepper.y[stepper.progress[0]["now"]].copy()


@declared("study")
@validated(schemes=NAMES, methods=NAMES, cells=COUNT, steps=COUNT, progress=FUNCTION)
def measured_limits(
    schemes: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    cells: int = CELLS,
    steps: int = STEPS,
    progress: Progress | None = None,
) -> list[MeasuredLimit]:
    """Predicted and measured Courant limits of linear schemes with explicit methods on a periodic grid.

    schemes, methods : names; default: all linear schemes, all explicit methods; implicit methods are left out
    cells : cells of the grid; steps : number of steps of a run
    progress : function of (limits done, limits in total, next pair)
    Raises FvsolveError for unknown names, and for too few cells or steps.
    """
    check_size(cells, steps)
    report = progress or (lambda *_: None)
    schemes = name_list(schemes) or list(WEIGHTS)
    chosen = [method_named(name) for name in name_list(methods) or ()] or list(METHODS.values())
    pairs = [
        (scheme, tableau.name)
        for tableau in dict.fromkeys(chosen)
        if tableau.explicit
        for scheme in schemes
    ]
    for scheme in schemes:
        weights_of(scheme)
    limits = []
    for scheme, method in pairs:
        report(len(limits), len(pairs), f"{scheme} with {method}")
        limits.append(measured_limit(scheme, method, cells, steps))
    return limits


def measured_limit(
    scheme: str, method: str, cells: int = CELLS, steps: int = STEPS
) -> MeasuredLimit:
    """Least Courant number at which growth exceeds 1000 within `steps` steps, predicted and measured.

    The growth is that of the wave that grows most: from the stability function, and in a run from one impulse.
    """
    theta = 2 * np.pi * np.arange(cells // 2 + 1) / cells
    circle = PeriodicPipe(scheme, method, cells)
    r, impulse = analyse(method).stability_function, np.zeros(cells)
    impulse[0] = 1.0

    def predicted_growth(courant: float) -> float:
        return steps * math.log10(np.abs(r(courant * symbol(weights_of(scheme), theta))).max())

    def measured_growth(courant: float) -> float:
        end = circle.run(impulse, courant, steps)
        return math.inf if end is None else math.log10(np.abs(np.fft.rfft(end)).max())

    return MeasuredLimit(
        scheme,
        method,
        cells,
        steps,
        first_failure(predicted_growth),
        first_failure(measured_growth),
    )


def first_failure(
    growth: Callable[[float], float],
    width: float = LIMIT_TOLERANCE,
    smallest: float = SMALLEST_COURANT,
    ratio: float = COURANT_RATIO,
) -> float | None:
    """Least Courant number whose growth exceeds 1000; None if there is none up to 20.

    growth : function of the Courant number, log10 of the growth
    The search goes upwards from `smallest` by factors `ratio`; bisection ends at the relative width `width`.
    """

    def fails(courant: float) -> bool:
        return not growth(courant) <= math.log10(THRESHOLD)

    rising = multiples(smallest, ratio, LARGEST_COURANT / ratio)
    limit = greatest_step(fails, rising, multiples(0.5 * smallest, 0.5, 0.0), width=width)
    return limit.fails if limit.fails < math.inf else None


def check_size(cells: int, steps: int) -> None:
    """Raise FvsolveError for too few cells or steps."""
    if cells < 6:
        raise FvsolveError(f"cells = {cells}: expected 6 or more, the widest scheme uses 5 cells")
    if steps < 10:
        raise FvsolveError(
            f"steps = {steps}: expected 10 or more, because failure is growth over many steps"
        )


# limited schemes --------------------------------------------------------------------------------------------------

LIMITED_CELLS = 50
LIMITED_STEPS = 500
STEP_FACTORS = (1, 10, 100)
# relative width of a measured limit; growth is not a smooth function of the Courant number
LIMITED_TOLERANCE = 1e-3
# least Courant number that is run, unless a bound excludes failure up to a greater one
SMALLEST = 0.3
RATIO = 1.02  # of consecutive Courant numbers; above a failure, a greater one may be stable again
LIMITED_METHODS = ("euler", "ssp-rk2", "ssp-rk3", "rk4")  # by default
NORM_CHECKS = 25  # number of checks of the norm during a run
# relative fall of the limit from the fewest to the most steps above which it is not sharp
SHARPNESS = 0.05
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
        cells = {
            "scheme": self.scheme,
            "limiter": self.limiter,
            "method": self.method,
            "monotone": self.monotone,
        }
        cells |= {"cells": self.cells, "sharp": self.sharp}
        for start, row in self.measured.items():
            cells |= {f"{start}, {n} steps": x for n, x in zip(self.steps, row, strict=True)}
        return cells


@declared("study")
@validated(schemes=NAMES, methods=NAMES, cells=COUNT, steps=COUNT, progress=FUNCTION)
def limited_limits(
    schemes: Sequence[str] = tuple(LIMITED),
    methods: Sequence[str] | None = None,
    cells: int = LIMITED_CELLS,
    steps: int = LIMITED_STEPS,
    progress: Progress | None = None,
) -> list[LimitedLimit]:
    """Courant limits of limited schemes (muscl with each limiter) with explicit methods on a periodic grid.

    cells : cells of the grid; steps : real runs have 1, 10 and 100 times this number of steps
    progress : function of (limits done, limits in total, next pair)
    Raises FvsolveError for unknown names, implicit methods, and for too few cells or steps.
    """
    check_size(cells, steps)
    report = progress or (lambda *_: None)
    schemes = name_list(schemes) or tuple(LIMITED)
    chosen = [method_named(name) for name in name_list(methods) or LIMITED_METHODS]
    implicit = [tableau.name for tableau in chosen if not tableau.explicit]
    if implicit:
        raise FvsolveError(
            f"{implicit[0]} is implicit; expected explicit methods for runs with limited schemes"
        )
    for name in schemes:
        if name not in LIMITED:
            hint = did_you_mean(name, LIMITED) or f"; limited schemes are {', '.join(LIMITED)}"
            raise FvsolveError(f'no limited scheme named "{name}"{hint}')
    kinds = [
        (name, limiter)
        for name in schemes
        for limiter in (LIMITERS if name == "muscl" else (None,))
    ]
    pairs = [(*kind, tableau.name) for tableau in dict.fromkeys(chosen) for kind in kinds]
    limits = []
    for scheme, limiter, method in pairs:
        report(len(limits), len(pairs), f"{scheme} {limiter or ''} with {method}")
        limits.append(limited_limit(scheme, limiter, method, cells, steps))
    return limits


def limited_limit(
    scheme: str,
    limiter: str | None,
    method: str,
    cells: int = LIMITED_CELLS,
    steps: int = LIMITED_STEPS,
) -> LimitedLimit:
    """Courant limits of a limited scheme (and the limiter of muscl) with a method, on a grid of `cells` cells."""
    counts, name = tuple(n * steps for n in STEP_FACTORS), method_named(method).name
    frozen = {
        branch: limit_of(weights, branch, method)
        for branch, weights in branches(scheme, limiter).items()
    }
    measured = {
        start: tuple(measured_courant(scheme, limiter, method, u, n) for n in counts)
        for start, u in start_fields(cells).items()
    }
    monotone = monotone_limit(limiter or scheme, method)
    return LimitedLimit(scheme, limiter, name, frozen, monotone, cells, counts, measured)


def monotone_limit(limiter: str, method: str) -> float | None:
    """Courant number up to which total variation cannot grow with a slope limiter and a method; None if unknown."""
    radius, own = analyse(method).ssp_radius, LIMITERS.get(limiter)
    return radius / (1 + own.steepest / 2) if own and own.monotone and radius > 0 else None


def start_fields(cells: int) -> dict[str, np.ndarray]:
    """Initial cell values with mean zero, by name: a sine wave, a square wave ("front") and random noise."""
    j = np.arange(cells)
    noise = np.random.default_rng(SEED).standard_normal(cells)
    fields = {
        "wave": np.sin(2 * np.pi * j / cells),
        "front": np.where(j < cells // 2, 1.0, -1.0),
        "noise": noise,
    }
    return {name: u - u.mean() for name, u in fields.items()}


def measured_courant(
    scheme: str, limiter: str | None, method: str, start: np.ndarray, steps: int
) -> float | None:
    """Least Courant number up to 20 at which the norm of a run from `start` is found to grow 1000 times, or None."""
    circle = PeriodicPipe(scheme, method, start.size, limiter or "minmod")
    smallest = monotone_limit(limiter or scheme, method) or SMALLEST
    return first_failure(
        lambda courant: _growth(circle, start, courant, steps), LIMITED_TOLERANCE, smallest, RATIO
    )


def _growth(circle: PeriodicPipe, start: np.ndarray, courant: float, steps: int) -> float:
    """log10 of the growth of the norm in a run; inf above a growth of 1000, and if values are not finite."""
    u = start
    greatest = 0.0
    done = 0
    for k in range(1, NORM_CHECKS + 1):
        count, done = steps * k // NORM_CHECKS - done, steps * k // NORM_CHECKS
        u = circle.run(u, courant, count) if count else u
        if u is None:
            return math.inf
        greatest = max(greatest, float(np.linalg.norm(u) / np.linalg.norm(start)))
        if greatest > THRESHOLD:
            return math.inf
    return math.log10(greatest) if greatest > 0 else -math.inf
