"""Growth of small deviations in real runs with delay lines, including the waves in the lines."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fvsolve.kernels.delay_lines import wave_history as at
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.steppers import loop_indices
from fvsolve.studies.stability.bracket import RISE, Limit, halved, limit
from fvsolve.studies.stability.delayed import BAR, Delayed
from fvsolve.studies.stability.growth import looked_at
from fvsolve.studies.stability.measured import BELOW, LONGEST, Runs

CLOSE, TWICE = 0.99, 2.0  # lower end of the bracket over the prediction; ratio of steps if all are predicted safe
SMALL = 1e-5  # deviation at the start, in units of a wave of 1 bar over one step


class DelayedRuns(Runs):
    """Real runs at fixed steps, each from the deviation with the greatest growth in the linear system of the step.

    limits : see `delay_line_row.DelayLineLimits`; failing_step : a step that is predicted to fail [s], nan for none
    """

    def __init__(self, limits, steps: int, threshold: float, end: float) -> None:
        self.end, self.first, self.far = end, limits.first, limits.far
        self.system, self.states, self.tried = limits.system, limits.own.y_size, 0.0
        self.steps, self.threshold = steps, threshold
        self.looks = looked_at(self.steps)
        self.strides = np.diff([0, *self.looks]).astype(float)
        self.latest = time.monotonic() + LONGEST

    def begun(self, system: Delayed, x: np.ndarray, history: np.ndarray) -> RunLoop:
        """Run from the start plus x, with entries `history` in its lines."""
        model, t = system.model, float(system.model.case.numerics.start)
        changes = {"method": system.method.name, "step": system.h, "courant": None, "rtol": None}
        numerics = model.case.numerics.model_copy(update=changes)
        loop = RunLoop(replace(model, case=replace(model.case, numerics=numerics)), lambda: model.structure)
        loop.now[:] = model.start
        loop.now[system.kept] += x
        loop.loop_state[loop_indices.T] = t
        remember(loop.slate.past, model.tables.delays, t, system.h, history)
        loop.begin(t + 2.0 * self.steps * system.h, NO_LIMIT)
        return loop

    def limit(self, guess: float) -> Limit:
        """Measured limit, searched close to the prediction: steps beside integer parts of delays may be safe again.

        Without a prediction all steps are searched.
        """
        if not np.isfinite(guess):
            return limit(self.fails, self.first, self.far, RISE if np.isnan(guess) else TWICE)
        if any(self.fails(part * guess) for part in BELOW) or not self.fails(self.end):
            return super().limit(guess)
        return halved(self.fails, CLOSE * guess if self.safe(CLOSE * guess) else BELOW[-1] * guess, self.end)

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth, its number of steps); infinite for a run that stops."""
        system = self.system(h)
        predicted = system.growth(self.steps, self.threshold)
        small = SMALL * float(system.weight.max()) * widest(system)
        runs = [self.begun(system, width * predicted.x, width * predicted.before) for width in (small, 0.0)]
        size, after = 1.0, 0
        for n, budget in zip(self.looks, self.strides, strict=True):
            if time.monotonic() > self.latest:
                raise TimeoutError
            if any(run.run(budget) != loop_indices.BUDGET_SPENT for run in runs):
                return np.inf, n
            moved, base = ((run.now[system.kept], entries(run.slate.past, system)) for run in runs)
            growth = float(system.size((moved[0] - base[0])[:, None], (moved[1] - base[1])[..., None])[0]) / small
            if not growth <= self.threshold:
                return growth if growth > self.threshold else np.inf, n
            if growth > size:
                size, after = growth, n
        return size, after


def widest(system: Delayed) -> float:
    """Wave of 1 bar in the line with the greatest admittance [kg/s]."""
    tables = system.model.tables
    return BAR * float(tables.pipes["admittance"][tables.delays["pipe"]].max())


def remember(past: np.ndarray, delays: np.ndarray, t: float, h: float, history: np.ndarray) -> None:
    """Write entries of lines : float64[count, 2, stretches] at t - count h, ..., t - h."""
    count, places = history.shape[0], at.offsets_of(past)
    numbers = at.PROFILE_ENTRIES + np.arange(count)
    past[at.COUNT] = at.PROFILE_ENTRIES + count
    past[[at.LAST_STEP, at.STEP_BEFORE]], past[[at.EQUAL_STEPS, at.EQUAL_STEPS_BEFORE]] = h, 1e18
    past[at.HEADER_SIZE + (numbers & (int(past[at.CAPACITY]) - 1))] = t + h * np.arange(-count, 0)
    for where, s, wave in rings(places, delays, numbers):
        past[where] = history[:, wave, s]


def entries(past: np.ndarray, system: Delayed) -> np.ndarray:
    """Entries of all stretches before the last entry : float64[history_steps, 2, stretches]."""
    values = np.zeros((system.many, 2, system.holds.size))
    numbers = int(past[at.COUNT]) - 1 - system.many + np.arange(system.many)
    for where, s, wave in rings(at.offsets_of(past), system.model.tables.delays, numbers):
        values[:, wave, s] = past[where]
    return values


def rings(places, delays: np.ndarray, numbers: np.ndarray):
    """(offsets of entries with given numbers, stretch, wave) for all stretches and waves."""
    for row in delays:
        for q in range(row["stretches"]):
            ring, mask = at.ring_of(places, row, q)
            for wave in range(2):
                yield ring + 2 * (numbers & mask) + wave, int(row["stretch"]) + q, wave
