"""How long a fixed step may be for what is no wave alone: vessels, columns, bodies, devices, what rubs and is carried.

An estimate of the start: eigenvalues of the rates of all states but those of cells, which stand still meanwhile, and
the modes of cells (`limits.cells`). A deviation that is multiplied by |R(h s)| a step, and by
|exp(h s)| in truth, has grown by the quotient. Slopes are those over a hundredth of what drives the scene: that of a
valve at a drop of zero has no end, and a swing about it that is smaller is none that counts. Knows no run.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.limits.cells import Modes, cell_modes, rubbed
from fvsolve.limits.drives import lumped, spreads
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

SHARE = 0.01  # of what drives the scene, over which slopes are taken
MOST = 300  # states: of more, nothing is predicted
GROWS = 10.0  # times that a mode or a wave grows in a run: less is not seen, where no step is without growth
LEAST, FINE = 1e-15, 40  # of the step, where one that holds is looked for; halvings back from there
FOLLOWED = 1.0  # of |h s|: such a mode is followed step by step, and grows as the start says


class Mode(NamedTuple):
    """What grows most in the run: its place, by how much, and up to which step it does not [s].

    own : of what no cell holds, which may leave the state of the start before it has grown, or be bounded by what
    bends; followed : whether steps follow it all the same; frequency : at which it swings [Hz]
    """

    place: str
    grows: float
    limit: float
    own: bool
    followed: bool
    frequency: float


def lumped_modes(model, method: str, step: float) -> list[Mode]:
    """What a fixed step [s] makes grow: of what no cell holds, and of cells.

    Raises FvsolveError for a method without a stability function.
    """
    r, numerics = stability_function(method_named(method)), model.case.numerics
    span, fixed = numerics.end - numerics.start, numerics.step is not None
    own = own_modes(model) if fixed else []
    cells = cell_modes(model) if fixed else rubbed(model)  # a Courant number minds the rest
    candidates = [quickest(r, modes, step, span, modes is own) for modes in (own, cells)]
    return [mode for mode in candidates if mode is not None]


def quickest(r, modes: Modes, step: float, span: float, own: bool, enough: float = GROWS) -> Mode | None:
    """What grows most of some modes, if any grows `enough` times within the span [s]."""
    if not modes:
        return None
    s = np.concatenate([values for _, values in modes])

    def grown(h: float) -> float:
        return times(float(beyond(r, s, h).max()), span / h)

    if grown(step) < enough:
        return None
    high, low = step, 0.5 * step
    while grown(low) >= enough and low > LEAST * step:
        high, low = low, 0.5 * low
    for _ in range(FINE):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if grown(middle) < enough else (low, middle)
    worst = int(np.argmax(beyond(r, s, step)))
    at = int(np.searchsorted(np.cumsum([values.size for _, values in modes]), worst, side="right"))
    frequency = abs(float(s[worst].imag)) / (2.0 * math.pi)
    return Mode(modes[at][0], grown(step), low, own, bool(abs(step * s[worst]) <= FOLLOWED), frequency)


def beyond(r, s: np.ndarray, h: float) -> np.ndarray:
    """By how much more a step multiplies each mode than its own growth does, less one."""
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.abs(r(h * s)) / np.exp(np.maximum(h * s.real, 0.0))
        return (ratio if np.isfinite(ratio).all() else np.nan_to_num(ratio, nan=np.inf)) - 1.0


def times(excess: float, steps: float) -> float:
    """What a factor of 1 + excess makes of one in so many steps."""
    return math.exp(min(700.0, steps * math.log1p(max(excess, 0.0))))


def own_modes(model) -> Modes:
    """Of what is no cell's, at the start, each at the state that moves most."""
    states = lumped(model)
    if not 0 < states.size <= MOST:
        return []
    t, y, width = float(model.case.numerics.start), model.start, SHARE * spreads(model)
    out, j = model.new_out(), np.zeros((states.size, states.size))

    def rates(moved: np.ndarray) -> np.ndarray:
        result = np.zeros(model.y_size)
        model.functions.rhs(t, moved, result, out, run_data.handle)
        return result[states]

    with model.slate() as run_data:
        run_data.evaluate(t, y, np.inf)  # which sets what holds there
        for k, i in enumerate(states):
            high, low = y.copy(), y.copy()
            high[i], low[i] = y[i] + width[i], y[i] - width[i]
            j[:, k] = (rates(high) - rates(low)) / (2.0 * SHARE)
    j /= spreads(model)[states][:, None]
    if not np.all(np.isfinite(j)):
        return []
    values, vectors = np.linalg.eig(j)
    most = states[np.argmax(np.abs(vectors), axis=0)]
    return [(model.state_names[i], values[k : k + 1]) for k, i in enumerate(most)]
