"""Greatest fixed step for modes other than plain waves: vessels, columns, bodies, devices, friction, scalars.

It is estimated at the start, from the eigenvalues s of the rates of all states outside cells, with the cells held
constant, and from the modes of cells (`step_limits.cell_modes`). In a step h the method multiplies a deviation by
|R(h s)|, with its stability function R, and the exact solution by |exp(h s)|; the quotient is the growth by the method.
Slopes are differences over a hundredth of the forcing range: the slope of a valve at zero pressure drop is infinite,
and smaller oscillations about it are not relevant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.step_limits.cell_modes import Modes, cell_modes, friction_modes
from fvsolve.step_limits.forcing_ranges import state_ranges, states_outside_cells
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

SHARE = 0.01  # fraction of the forcing range over which slopes are taken
MOST = 300  # number of states above which no prediction is made
LEAST_GROWTH = (
    10.0  # growth factor of a mode or a wave in a run below which no notice is given: some growth is unavoidable
)
LEAST, FINE = 1e-15, 40  # least step in the search for the limit, relative to the given step; number of bisections
RESOLVED = 1.0  # |h s| up to which a mode is resolved by the steps, and grows as predicted at the start


class Mode(NamedTuple):
    """Fastest growing of several modes of a model, in a run with a given step; see `fastest_growing`.

    place : name of the part or state; growth : growth factor in the run, over the exact growth factor
    limit : step [s] up to which the growth is below the factor `enough` of `fastest_growing`
    outside_cells : True for states outside cells, whose growth may end because the state changes or a law bounds it
    resolved : True if the steps resolve the mode; frequency : frequency of its oscillation [Hz]
    """

    place: str
    growth: float
    limit: float
    outside_cells: bool
    resolved: bool
    frequency: float


def lumped_modes(model, method: str, step: float) -> list[Mode]:
    """Fastest growing mode of the states outside cells, and that of the cells, with steps of `step` [s], as a list.

    Modes that grow less than 10 times in the run are left out. Under a given Courant number only modes of waves with
    friction are computed. Raises FvsolveError for a method without a stability function.
    """
    r, numerics = stability_function(method_named(method)), model.case.numerics
    span, fixed = numerics.end - numerics.start, numerics.step is not None
    own = modes_outside_cells(model) if fixed else []
    cells = cell_modes(model) if fixed else friction_modes(model)  # a Courant number limits the other modes
    candidates = [fastest_growing(r, modes, step, span, modes is own) for modes in (own, cells)]
    return [mode for mode in candidates if mode is not None]


def fastest_growing(r, modes: Modes, step: float, span: float, own: bool, enough: float = LEAST_GROWTH) -> Mode | None:
    """Mode with the greatest growth, if it grows by the factor `enough` in a run of `span` [s]; otherwise None.

    r : stability function of the method; modes : pairs of a name and eigenvalues [1/s]; step : time step [s]
    own : True if the modes are of states outside cells
    """
    if not modes:
        return None
    s = np.concatenate([values for _, values in modes])

    def grown(h: float) -> float:
        return growth_factor(float(excess_growth(r, s, h).max()), span / h)

    if grown(step) < enough:
        return None
    high, low = step, 0.5 * step
    while grown(low) >= enough and low > LEAST * step:
        high, low = low, 0.5 * low
    for _ in range(FINE):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if grown(middle) < enough else (low, middle)
    worst = int(np.argmax(excess_growth(r, s, step)))
    at = int(np.searchsorted(np.cumsum([values.size for _, values in modes]), worst, side="right"))
    frequency = abs(float(s[worst].imag)) / (2.0 * math.pi)
    return Mode(modes[at][0], grown(step), low, own, bool(abs(step * s[worst]) <= RESOLVED), frequency)


def excess_growth(r, s: np.ndarray, h: float) -> np.ndarray:
    """Growth factor of each mode in a step, divided by the exact growth factor (at least 1), minus 1.

    r : stability function of the method; s : eigenvalues of the modes [1/s]; h : time step [s]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.abs(r(h * s)) / np.exp(np.maximum(h * s.real, 0.0))
        return (ratio if np.isfinite(ratio).all() else np.nan_to_num(ratio, nan=np.inf)) - 1.0


def growth_factor(excess: float, steps: float) -> float:
    """Growth factor (1 + excess)^steps over a number of steps, at most exp(700); 1 for a negative excess."""
    return math.exp(min(700.0, steps * math.log1p(max(excess, 0.0))))


def modes_outside_cells(model) -> Modes:
    """Eigenvalues [1/s] of the states outside cells at the start, each with the name of the state that moves most.

    The list is empty for more than 300 such states, and for slopes that are not finite.
    """
    states = states_outside_cells(model)
    if not 0 < states.size <= MOST:
        return []
    t, y, width = float(model.case.numerics.start), model.start, SHARE * state_ranges(model)
    out, j = model.new_out(), np.zeros((states.size, states.size))

    def rates(moved: np.ndarray) -> np.ndarray:
        result = np.zeros(model.y_size)
        model.functions.rhs(t, moved, result, out, run_data.handle)
        return result[states]

    with model.run_data() as run_data:
        run_data.evaluate(t, y, np.inf)  # sets the device states there
        for k, i in enumerate(states):
            high, low = y.copy(), y.copy()
            high[i], low[i] = y[i] + width[i], y[i] - width[i]
            j[:, k] = (rates(high) - rates(low)) / (2.0 * SHARE)
    j /= state_ranges(model)[states][:, None]
    if not np.all(np.isfinite(j)):
        return []
    values, vectors = np.linalg.eig(j)
    most = states[np.argmax(np.abs(vectors), axis=0)]
    return [(model.state_names[i], values[k : k + 1]) for k, i in enumerate(most)]
