"""Growth of small deviations in real runs with delay lines, including the waves in the lines."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fvsolve.kernels.delay_lines import wave_history as at
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.steppers import loop_records
from fvsolve.studies.stability.bisection import STEP_RATIO, StepLimit, bisect, bisect_limit
from fvsolve.studies.stability.delay_line_system import BAR_PRESSURE, DelayLineSystem
from fvsolve.studies.stability.power_growth import checked_powers
from fvsolve.studies.stability.real_runs import SAFE_PARTS, TIME_LIMIT, RealRuns

NEAR_PREDICTION, STEP_RATIO_UP = (
    0.99,
    2.0,
)  # lower end of the bracket over the prediction; ratio of steps if all are predicted safe
SMALL_WAVE = 1e-5  # deviation at the start, in units of a wave of 1 bar over one step


class DelayLineRuns(RealRuns):
    """Real runs at fixed steps, each from the deviation with the greatest growth in the linear system of the step.

    limits : a `delay_line_row.DelayLineLimits`; steps : number of steps of a run; threshold : growth at which it fails
    end : a step that is predicted to fail [s]; inf if no step is, nan if there is no prediction
    """

    def __init__(self, limits, steps: int, threshold: float, end: float) -> None:
        self.failing_step, self.first, self.far = end, limits.first, limits.far
        self.system, self.states, self.longest_tried = limits.system, limits.base_model.y_size, 0.0
        self.steps, self.threshold = steps, threshold
        self.check_steps = checked_powers(self.steps)
        self.strides = np.diff([0, *self.check_steps]).astype(float)
        self.latest = time.monotonic() + TIME_LIMIT

    def start_run(self, system: DelayLineSystem, x: np.ndarray, history: np.ndarray) -> RunLoop:
        """Run from the initial state plus the deviation x, with the past waves `history` in its delay lines."""
        model, t = system.model, float(system.model.case.numerics.start)
        changes = {"method": system.method.name, "step": system.h, "courant": None, "rtol": None}
        numerics = model.case.numerics.model_copy(update=changes)
        loop = RunLoop(replace(model, case=replace(model.case, numerics=numerics)), lambda: model.structure)
        loop.now[:] = model.start
        loop.now[system.states] += x
        loop.state["t"] = t
        write_history(loop.run_data.past, model.tables.delays, t, system.h, history)
        loop.begin(t + 2.0 * self.steps * system.h, NO_LIMIT)
        return loop

    def limit(self, guess: float) -> StepLimit:
        """Limit of real runs, searched close to the predicted limit `guess` [s].

        If `guess` is inf or nan, steps up to twice the longest travel time are searched. Otherwise the search stays
        close because steps that do not divide the delay of a line may be safe above the limit.
        """
        if not np.isfinite(guess):
            return bisect_limit(self.fails, self.first, self.far, STEP_RATIO if np.isnan(guess) else STEP_RATIO_UP)
        if any(self.fails(part * guess) for part in SAFE_PARTS) or not self.fails(self.failing_step):
            return super().limit(guess)
        return bisect(
            self.fails,
            NEAR_PREDICTION * guess if self.safe(NEAR_PREDICTION * guess) else SAFE_PARTS[-1] * guess,
            self.failing_step,
        )

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth of a deviation with steps of h [s], number of steps after which it is reached).

        The growth is infinite if a run stops. Raises TimeoutError at the time limit.
        """
        system = self.system(h)
        predicted = system.growth(self.steps, self.threshold)
        small = SMALL_WAVE * float(system.weight.max()) * greatest_wave(system)
        runs = [self.start_run(system, width * predicted.x, width * predicted.history) for width in (small, 0.0)]
        size, after = 1.0, 0
        for n, budget in zip(self.check_steps, self.strides, strict=True):
            if time.monotonic() > self.latest:
                raise TimeoutError
            if any(run.run(budget) != loop_records.BUDGET_SPENT for run in runs):
                return np.inf, n
            moved, base = ((run.now[system.states], read_history(run.run_data.past, system)) for run in runs)
            growth = float(system.size((moved[0] - base[0])[:, None], (moved[1] - base[1])[..., None])[0]) / small
            if not growth <= self.threshold:
                return growth if growth > self.threshold else np.inf, n
            if growth > size:
                size, after = growth, n
        return size, after


def greatest_wave(system: DelayLineSystem) -> float:
    """Mass flow [kg/s] of a wave of 1 bar in the delay line with the greatest admittance."""
    tables = system.model.tables
    return BAR_PRESSURE * float(tables.pipes["admittance"][tables.delays["pipe"]].max())


def write_history(past: np.ndarray, delays: np.ndarray, t: float, h: float, history: np.ndarray) -> None:
    """Write past waves into the wave history `past` of delay lines, at the times t - count h, ..., t - h.

    history : float64[count, 2, stretches]  deviations of both waves in each stretch of a line, oldest first [kg/s]
    delays : delay lines in the tables
    """
    count, places = history.shape[0], at.offsets_of(past)
    numbers = at.PROFILE_ENTRIES + np.arange(count)
    past[at.COUNT] = at.PROFILE_ENTRIES + count
    past[[at.LAST_STEP, at.STEP_BEFORE]], past[[at.EQUAL_STEPS, at.EQUAL_STEPS_BEFORE]] = h, 1e18
    past[at.HEADER_SIZE + (numbers & (int(past[at.CAPACITY]) - 1))] = t + h * np.arange(-count, 0)
    for where, s, wave in ring_offsets(places, delays, numbers):
        past[where] = history[:, wave, s]


def read_history(past: np.ndarray, system: DelayLineSystem) -> np.ndarray:
    """Past waves of all stretches of delay lines, without the last entry : float64[history_steps, 2, stretches].

    past : wave history of a run
    """
    values = np.zeros((system.history_steps, 2, system.delays.size))
    numbers = int(past[at.COUNT]) - 1 - system.history_steps + np.arange(system.history_steps)
    for where, s, wave in ring_offsets(at.offsets_of(past), system.model.tables.delays, numbers):
        values[:, wave, s] = past[where]
    return values


def ring_offsets(places, delays: np.ndarray, numbers: np.ndarray):
    """Yield (offsets in the wave history, number of the stretch, wave) for each stretch and wave of all delay lines.

    The offsets are those of the entries with the given `numbers`; wave is 0 for the forward and 1 for the backward
    wave.
    places : result of `wave_history.offsets_of`; delays : delay lines in the tables
    """
    for row in delays:
        for q in range(row["stretches"]):
            ring, mask = at.ring_of(places, row, q)
            for wave in range(2):
                yield ring + 2 * (numbers & mask) + wave, int(row["stretch"]) + q, wave
