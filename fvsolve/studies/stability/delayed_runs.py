"""Growth of a small deviation in real runs with delay lines, what is on its way in them included. Knows runs."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fvsolve.kernels.delay import history as at
from fvsolve.solve.loop import NO_LIMIT, Loop
from fvsolve.steppers import slots
from fvsolve.studies.stability.bracket import RISE, Limit, halved, limit
from fvsolve.studies.stability.delayed import BAR, Delayed
from fvsolve.studies.stability.growth import looked_at
from fvsolve.studies.stability.measured import BELOW, LONGEST, Runs

CLOSE, TWICE = 0.99, 2.0  # of the prediction; between steps where there is none
SMALL = 1e-5  # of a wave of a bar in one step: the deviation at the start


class DelayedRuns(Runs):
    """Real runs at fixed steps, each from what the linear system of that step says to grow most.

    limits : see `delayed_row.DelayedLimits`; end : a step that is predicted to fail [s], nan for none
    """

    def __init__(self, limits, steps: int, threshold: float, end: float) -> None:
        self.end, self.first, self.far = end, limits.first, limits.far
        self.system, self.states, self.tried = limits.system, limits.own.y_size, 0.0
        self.steps, self.threshold = steps, threshold
        self.looks = looked_at(self.steps)
        self.strides = np.diff([0, *self.looks]).astype(float)
        self.latest = time.monotonic() + LONGEST

    def begun(self, one: Delayed, x: np.ndarray, before: np.ndarray) -> Loop:
        """A run whose lines remember these entries."""
        model, t = one.model, float(one.model.case.numerics.start)
        changes = {"method": one.method.name, "step": one.h, "courant": None, "rtol": None}
        numerics = model.case.numerics.model_copy(update=changes)
        made = Loop(replace(model, case=replace(model.case, numerics=numerics)), lambda: model.structure)
        made.now[:] = model.start
        made.now[one.kept] += x
        made.memory[slots.T] = t
        remember(made.slate.past, model.tables.delays, t, one.h, before)
        made.begin(t + 2.0 * self.steps * one.h, NO_LIMIT)
        return made

    def limit(self, guess: float) -> Limit:
        """As of all runs, but close about the prediction: beside whole parts of delays steps hold again.

        Where none is predicted they are looked for among all.
        """
        if not np.isfinite(guess):
            return limit(self.fails, self.first, self.far, RISE if np.isnan(guess) else TWICE)
        if any(self.fails(part * guess) for part in BELOW) or not self.fails(self.end):
            return super().limit(guess)
        return halved(self.fails, CLOSE * guess if self.safe(CLOSE * guess) else BELOW[-1] * guess, self.end)

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth, after how many steps); a run that breaks off: infinite."""
        one = self.system(h)
        found = one.growth(self.steps, self.threshold)
        small = SMALL * float(one.weight.max()) * widest(one)
        runs = [self.begun(one, width * found.x, width * found.before) for width in (small, 0.0)]
        size, after = 1.0, 0
        for n, more in zip(self.looks, self.strides, strict=True):
            if time.monotonic() > self.latest:
                raise TimeoutError
            if any(run.run(more) != slots.CHUNK for run in runs):
                return np.inf, n
            moved, still = ((run.now[one.kept], entries(run.slate.past, one)) for run in runs)
            here = float(one.size((moved[0] - still[0])[:, None], (moved[1] - still[1])[..., None])[0]) / small
            if not here <= self.threshold:
                return here if here > self.threshold else np.inf, n
            if here > size:
                size, after = here, n
        return size, after


def widest(one: Delayed) -> float:
    """Wave of a bar in the widest line [kg/s]."""
    tables = one.model.tables
    return BAR * float(tables.pipes["admittance"][tables.delays["pipe"]].max())


def remember(past: np.ndarray, delays: np.ndarray, t: float, h: float, before: np.ndarray) -> None:
    """Have lines remember entries : float64[many, 2, stretches] at t - many h, ..., t - h."""
    many, places = before.shape[0], at.places_of(past)
    numbers = at.ZEROS + np.arange(many)
    past[at.COUNT] = at.ZEROS + many
    past[[at.STEP, at.STEP_BEFORE]], past[[at.EVEN, at.EVEN_BEFORE]] = h, 1e18
    past[at.HEAD + (numbers & (int(past[at.CAPACITY]) - 1))] = t + h * np.arange(-many, 0)
    for where, s, wave in rings(places, delays, numbers):
        past[where] = before[:, wave, s]


def entries(past: np.ndarray, one: Delayed) -> np.ndarray:
    """The last entries but one, of all stretches : float64[many, 2, stretches]."""
    found = np.zeros((one.many, 2, one.holds.size))
    numbers = int(past[at.COUNT]) - 1 - one.many + np.arange(one.many)
    for where, s, wave in rings(at.places_of(past), one.model.tables.delays, numbers):
        found[:, wave, s] = past[where]
    return found


def rings(places, delays: np.ndarray, numbers: np.ndarray):
    """(places of entries of these numbers, stretch, wave) of all stretches and waves."""
    for row in delays:
        for q in range(row["stretches"]):
            ring, mask = at.ring_of(places, row, q)
            for wave in range(2):
                yield ring + 2 * (numbers & mask) + wave, int(row["stretch"]) + q, wave
