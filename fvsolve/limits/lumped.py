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

from fvsolve.kernels import records as rec
from fvsolve.limits.cells import Modes, cell_modes, rubbed
from fvsolve.limits.drives import lumped, spreads
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

SHARE = 0.01  # of what drives the scene, over which slopes are taken
MOST = 300  # states: of more, nothing is predicted
GROWS = 10.0  # times in the run: less is not seen
HALVES, FINE = 60, 40  # of the step, until one holds, and back from there
FOLLOWED = 1.0  # of |h s|: such a mode is followed step by step, and grows as the start says


class Mode(NamedTuple):
    """What grows most in the run: its place, by how much, and up to which step it does not [s].

    own : of what no cell holds, which may leave the state of the start before it has grown, or be bounded by what
    bends; followed : whether steps follow it all the same
    """

    place: str
    grows: float
    limit: float
    own: bool
    followed: bool


def lumped_mode(model, method: str, step: float) -> Mode | None:
    """What a fixed step [s] makes grow, if anything. Raises FvsolveError for a method without a stability function."""
    numerics, r = model.case.numerics, stability_function(method_named(method))
    own = own_modes(model) if numerics.step is not None else []
    found = (
        [*own, *cell_modes(model)] if numerics.step is not None else rubbed(model)
    )  # a Courant number minds the rest
    if not found:
        return None
    span, s = numerics.end - numerics.start, np.concatenate([one for _, one in found])
    excess = beyond(r, s, step)
    worst = int(np.argmax(excess))
    grows = times(float(excess[worst]), span / step)
    if grows < GROWS:
        return None
    high = step
    for _ in range(HALVES):
        low = 0.5 * high
        if times(float(beyond(r, s, low).max()), span / low) < GROWS:
            break
        high = low
    for _ in range(FINE):
        middle = 0.5 * (low + high)
        holds = times(float(beyond(r, s, middle).max()), span / middle) < GROWS
        low, high = (middle, high) if holds else (low, middle)
    k = int(np.searchsorted(np.cumsum([one.size for _, one in found]), worst, side="right"))
    return Mode(found[k][0], grows, low, k < len(own), bool(abs(step * s[worst]) <= FOLLOWED))


def beyond(r, s: np.ndarray, h: float) -> np.ndarray:
    """By how much more a step multiplies each mode than its own growth does, less one."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.nan_to_num(np.abs(r(h * s)) / np.exp(np.maximum(h * s.real, 0.0)), nan=np.inf) - 1.0


def times(excess: float, steps: float) -> float:
    """What a factor of 1 + excess makes of one in so many steps."""
    return math.exp(min(700.0, steps * math.log1p(max(excess, 0.0))))


def own_modes(model) -> Modes:
    """Of what is no cell's, at the start, each at the state that moves most."""
    which = lumped(model)
    if not 0 < which.size <= MOST:
        return []
    t, y, width, armed = model.case.numerics.start, model.start, SHARE * spreads(model), model.tables[rec.I_ARMED]
    kept, out, j = armed.copy(), model.new_out(), np.zeros((which.size, which.size))
    model.evaluate(t, y)  # which sets what holds there

    def rates(moved: np.ndarray) -> np.ndarray:
        found = np.zeros(model.y_size)
        model.functions.rhs(float(t), moved, found, out, model.handle)
        return found[which]

    for k, i in enumerate(which):
        high, low = y.copy(), y.copy()
        high[i], low[i] = y[i] + width[i], y[i] - width[i]
        j[:, k] = (rates(high) - rates(low)) / (2.0 * SHARE)
    armed[:] = kept
    j /= spreads(model)[which][:, None]
    if not np.all(np.isfinite(j)):
        return []
    values, vectors = np.linalg.eig(j)
    most = which[np.argmax(np.abs(vectors), axis=0)]
    return [(model.state_names[i], values[k : k + 1]) for k, i in enumerate(most)]
