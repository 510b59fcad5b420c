"""How long a fixed step may be for what is no wave: vessels, columns, bodies, devices, and what pipes carry.

An estimate of the start: eigenvalues of the rates of all states but those of cells, which stand still meanwhile, and
the worst wave of what is carried, fades and spreads in pipes. A deviation that is multiplied by |R(h s)| a step, and by
|exp(h s)| in truth, has grown by the quotient. Slopes are those over a hundredth of what drives the scene: that of a
valve at a drop of zero has no end, and a swing about it that is smaller is none that counts. Knows no run.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.limits.drives import lumped, spreads
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

SHARE = 0.01  # of what drives the scene, over which slopes are taken
MOST = 300  # states: of more, nothing is predicted
GROWS = 10.0  # times in the run: less is not seen
HALVES, FINE = 60, 40  # of the step, until one holds, and back from there
FOLLOWED = 1.0  # of |h s|: such a mode is followed step by step, and grows as the start says
PHASES = 65  # of what is carried, from 0 to pi


class Mode(NamedTuple):
    """What grows most in the run: its place, by how much, and up to which step it does not [s].

    sure : whether it does so once it is moved: what pipes carry, and what is followed step by step; other modes leave
    the state of the start before that, or are bounded by what bends
    """

    place: str
    grows: float
    limit: float
    sure: bool


def lumped_mode(model, method: str) -> Mode | None:
    """What the fixed step of a model makes grow, if anything; nothing under a method that has no stability function."""
    numerics, r = model.case.numerics, stability_function(method_named(method))
    own = own_modes(model)
    found = [*own, *carried_modes(model)]
    if not found:
        return None
    places, s = [place for place, _ in found], np.array([one for _, one in found])
    span, step = numerics.end - numerics.start, numerics.step
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
    return Mode(places[worst], grows, low, bool(worst >= len(own) or abs(step * s[worst]) <= FOLLOWED))


def beyond(r, s: np.ndarray, h: float) -> np.ndarray:
    """By how much more a step multiplies each mode than its own growth does, less one."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.nan_to_num(np.abs(r(h * s)) / np.exp(np.maximum(h * s.real, 0.0)), nan=np.inf) - 1.0


def times(excess: float, steps: float) -> float:
    """What a factor of 1 + excess makes of one in so many steps."""
    return math.exp(min(700.0, steps * math.log1p(max(excess, 0.0))))


def own_modes(model) -> list[tuple[str, complex]]:
    """(state that moves most, eigenvalue [1/s]) of what is no cell's, at the start."""
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
    return [(model.state_names[i], complex(one)) for i, one in zip(most, values, strict=True)]


def carried_modes(model) -> list[tuple[str, complex]]:
    """The same of every scalar in every pipe: waves that are carried on, spread and fade."""
    pipes, wave = model.tables[rec.I_PIPES], 1.0 - np.exp(-1j * np.linspace(0.0, np.pi, PHASES))
    rho, found = model.case.properties.density, []
    for name, scalar in model.case.scalars.items():
        for mesh, row in zip(model.pipes, pipes, strict=True):
            carried = abs(float(row["flow"])) / (rho * row["area"] * row["dx"])
            s = -carried * wave - 2.0 * scalar.diffusivity / row["dx"] ** 2 * wave.real - scalar.decay
            found += [(f"{mesh.name}.{name}", complex(one)) for one in s]
    return found
