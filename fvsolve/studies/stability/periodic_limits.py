"""Courant limits of linear schemes on a periodic pipe: predicted for each wave, and measured by real runs.

A Courant number nu fails if the L2 norm of some initial state grows more than 1000 times within n steps. On a periodic
grid the matrix of a step is normal, so the greatest growth over all initial states is exactly the greatest |R(nu
z(theta_k))|^n over the waves k, with the phases theta_k = 2 pi k / cells, the stability function R of the method and
the symbol z of the scheme. A run measures this growth from one impulse, all of whose waves have equal size, as the
greatest |u_k(n)| / |u_k(0)| of the Fourier coefficients u_k.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.assembly.scheme_codes import scheme_settings
from fvsolve.errors import FvsolveError
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.calls import compile_as
from fvsolve.kernels.table_handle import make_handle
from fvsolve.step_limits.symbol import WEIGHTS, symbol, weights_of
from fvsolve.steppers import loop_records
from fvsolve.steppers.analysis.method_facts import analyse
from fvsolve.steppers.integrator import Integrator
from fvsolve.steppers.ode import observers
from fvsolve.steppers.structure import Structure
from fvsolve.steppers.tableau import METHODS, method_named
from fvsolve.studies.outcome import Progress, name_list
from fvsolve.studies.result_table import PlainData
from fvsolve.validation import COUNT, FUNCTION, NAMES, validated

THRESHOLD = 1e3
CELLS, STEPS = 100, 1000
SMALLEST_COURANT, LARGEST_COURANT, COURANT_RATIO = (
    0.05,
    20.0,
    1.1,
)  # first and last Courant number of the search, ratio of consecutive numbers
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
        self.tables = _tables(scheme, limiter, cells)
        self.stepper = Integrator(method_named(method), cells, 0, lambda: Structure.full(cells), np.ones(cells))
        self.handle, self.functions = make_handle(self.tables), (*observers(), _rhs())

    def run(self, start: np.ndarray, courant: float, steps: int) -> np.ndarray | None:
        """Cell values after `steps` steps at a Courant number, from the values `start`; None if not finite."""
        stepper = self.stepper
        stepper.state[:] = np.zeros(1, loop_records.STATE)
        stepper.set_control(mode=loop_records.FIXED_STEP, size=courant, step_max=FAR_TIME, stop_at=FAR_TIME)
        stepper.set_control(end=2.0 * courant * (steps + 1), budget=steps)
        stepper.restart_segment()
        stepper.y[stepper.progress[0]["now"]] = start
        code = stepper.call(*self.functions, self.handle, loop_records.PLACE + 1, stepper.no_floats)
        if code != loop_records.BUDGET_SPENT:
            return None
        return stepper.y[stepper.progress[0]["now"]].copy()


@validated(schemes=NAMES, methods=NAMES, cells=COUNT, steps=COUNT, progress=FUNCTION)
def measured_limits(
    schemes: Sequence[str] | None = None, methods: Sequence[str] | None = None, cells: int = CELLS, steps: int = STEPS,
    progress: Progress | None = None,
) -> list[MeasuredLimit]:  # fmt: skip
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
    pairs = [(scheme, tableau.name) for tableau in dict.fromkeys(chosen) if tableau.explicit for scheme in schemes]
    for scheme in schemes:
        weights_of(scheme)
    limits = []
    for scheme, method in pairs:
        report(len(limits), len(pairs), f"{scheme} with {method}")
        limits.append(measured_limit(scheme, method, cells, steps))
    return limits


def measured_limit(scheme: str, method: str, cells: int = CELLS, steps: int = STEPS) -> MeasuredLimit:
    """Least Courant number at which growth exceeds 1000 within `steps` steps, predicted and measured."""
    predicted = first_failure(lambda courant: predicted_growth(scheme, method, cells, steps, courant))
    circle = PeriodicPipe(scheme, method, cells)
    measured = first_failure(lambda courant: measured_growth(circle, cells, steps, courant))
    return MeasuredLimit(scheme, method, cells, steps, predicted, measured)


def predicted_growth(scheme: str, method: str, cells: int, steps: int, courant: float) -> float:
    """log10 of the greatest growth of a wave of the periodic grid within `steps` steps, from the stability function."""
    theta = 2 * np.pi * np.arange(cells // 2 + 1) / cells
    r = analyse(method).stability_function
    return steps * math.log10(np.abs(r(courant * symbol(weights_of(scheme), theta))).max())


def measured_growth(circle: PeriodicPipe, cells: int, steps: int, courant: float) -> float:
    """log10 of the greatest growth of a wave in a run from one impulse; inf if values do not remain finite."""
    start = np.zeros(cells)
    start[0] = 1.0
    end = circle.run(start, courant, steps)
    return math.inf if end is None else math.log10(np.abs(np.fft.rfft(end)).max())


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
    low, high = 0.0, smallest
    while growth(high) <= math.log10(THRESHOLD):
        low, high = high, high * ratio
        if high > LARGEST_COURANT:
            return None
    while high - low > width * high:
        middle = (low + high) / 2
        if growth(middle) <= math.log10(THRESHOLD):
            low = middle
        else:
            high = middle
    return high


def check_size(cells: int, steps: int) -> None:
    """Raise FvsolveError for too few cells or steps."""
    if cells < 6:
        raise FvsolveError(f"cells = {cells}: expected 6 or more, the widest scheme uses 5 cells")
    if steps < 10:
        raise FvsolveError(f"steps = {steps}: expected 10 or more, because failure is growth over many steps")


def _tables(scheme: str, limiter: str, cells: int) -> tuple:
    """Tables that the kernel of the periodic grid reads: settings of the scheme, small number of WENO, work space."""
    tables = {name: np.zeros(1, rec.RECORDS.get(name, float)) for name in (*rec.Tables._fields, *rec.RunArrays._fields)}
    tables["scratch"] = np.zeros(2 * cells + 7)
    scheme_settings(tables["settings"][0], scheme, limiter)
    tables["pipes"]["noise"] = WENO_NOISE
    return tuple(tables.values())


def _rhs():
    from fvsolve.kernels.reconstruction import rhs_periodic
    from fvsolve.steppers.run_handle import RHS

    return compile_as(rhs_periodic, RHS)
