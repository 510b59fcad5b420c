"""Stability of a case with delay lines: greatest step by the linear system of steps, and by real runs.

Arguments of several functions : steps, number of steps over which growth counts; threshold, growth above which a step
fails
"""

from __future__ import annotations

import numpy as np

from fvsolve.errors import CaseError, FvsolveError
from fvsolve.kernels.delay_lines import wave_history as at
from fvsolve.schemes import LIMITED
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.step_limits.delay_line_growth import REFLECTION_BOUND, lines_at, storing_nodes
from fvsolve.steppers import loop_records
from fvsolve.studies.linear.operating_point import with_held_schedules
from fvsolve.studies.outcome import study_model
from fvsolve.studies.stability.delay_line_system import BAR_PRESSURE, DelayLineSystem
from fvsolve.studies.stability.growth import STEP_RATIO, StepLimit, bisect, bisect_limit
from fvsolve.studies.stability.real_runs import SAFE_PARTS, RealRuns, fixed_step_loop, measure_limit
from fvsolve.studies.stability.stability_row import StabilityRow

NEAR_PREDICTION = 0.99  # lower end of the bracket over the prediction
STEP_RATIO_UP = 2.0  # ratio of consecutive steps if all are predicted safe
SMALL_WAVE = 1e-5  # deviation at the start, in units of a wave of 1 bar over one step


class DelayLineRuns(RealRuns):
    """Real runs at fixed steps, each from the deviation with the greatest growth in the linear system of the step.

    limits : a `DelayLineLimits`
    end : a step that is predicted to fail [s]; inf if no step is, nan if there is no prediction
    """

    def __init__(self, limits: DelayLineLimits, steps: int, threshold: float, end: float) -> None:
        self.failing_step, self.first, self.far, self.system = end, limits.first, limits.far, limits.system
        self.prepare(limits.base_model.y_size, steps, threshold)

    def start_run(self, system: DelayLineSystem, x: np.ndarray, history: np.ndarray) -> RunLoop:
        """Run from the initial state plus the deviation x, with the past waves `history` in its delay lines."""
        model, t = system.model, float(system.model.case.numerics.start)
        loop = fixed_step_loop(model, lambda: model.structure, system.method.name, system.h, t)
        loop.now[:] = model.start
        loop.now[system.states] += x
        write_history(loop.run_data.past, model.tables.delays, t, system.h, history)
        loop.begin(t + 2.0 * self.steps * system.h, NO_LIMIT)
        return loop

    def columns(self, guess: float, size: float) -> dict[str, float]:
        return self.limit_columns(guess)

    def limit(self, guess: float) -> StepLimit:
        """Limit of real runs, searched close to the predicted limit `guess` [s].

        If `guess` is inf or nan, steps up to twice the longest travel time are searched. Otherwise the search stays
        close because steps that do not divide the delay of a line may be safe above the limit.
        """
        if not np.isfinite(guess):
            return bisect_limit(self.fails, self.first, self.far, STEP_RATIO if np.isnan(guess) else STEP_RATIO_UP)
        if any(self.fails(part * guess) for part in SAFE_PARTS) or not self.fails(self.failing_step):
            return super().limit(guess)
        low = (SAFE_PARTS[-1] if self.fails(NEAR_PREDICTION * guess) else NEAR_PREDICTION) * guess
        return bisect(self.fails, low, self.failing_step)

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth of a deviation with steps of h [s], number of steps after which it is reached).

        The growth is infinite if a run stops. Raises TimeoutError at the time limit.
        """
        system = self.system(h)
        predicted, tables = system.growth(self.steps, self.threshold), system.model.tables
        greatest_wave = BAR_PRESSURE * float(tables.pipes["admittance"][tables.delays["pipe"]].max())  # [kg/s]
        small = SMALL_WAVE * float(system.weight.max()) * greatest_wave
        runs = [self.start_run(system, width * predicted.x, width * predicted.history) for width in (small, 0.0)]

        def growth(k: int) -> float:
            if any(run.run(self.strides[k]) != loop_records.BUDGET_SPENT for run in runs):
                return np.inf
            moved, base = ((run.now[system.states], read_history(run.run_data.past, system)) for run in runs)
            return float(system.size((moved[0] - base[0])[:, None], (moved[1] - base[1])[..., None])[0]) / small

        return self.greatest(growth)


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


TRAVEL_PARTS = 32.0  # first step: at most the longest travel time over this
TRAVEL_FACTOR = 2.0  # last step: the longest travel time times this
RATE_MARGIN = 0.1  # greatest product of the first step and the rates of other states
LINE_COUNT = 4  # greatest number of lines at stores for which integer parts of the delay are checked
RISE, FINE = 1.6, 1e-3  # ratio of consecutive steps of the search, relative width of the final bracket
MAX_STATES = 400  # greatest number of states
UNKNOWN_REASON = "stages of Rosenbrock methods use the slope of arriving waves, which the linear system does not model"
NO_LIMIT_NOTE = "no step up to twice the slowest line's travel time fails"


class DelayLineLimits:
    """Step limit of a case with delay lines for one scheme and method, predicted by a linear system for each step.

    The delay lines are divided into stretches for each step.
    """

    def __init__(self, case, scheme: str, method, steps: int, threshold: float) -> None:
        self.case, self.method, self.steps, self.threshold = case, method, steps, threshold
        self.set = {"numerics.scheme": scheme, "numerics.method": method.name}
        self.refused: dict[float, str] = {}
        self.base_model = self.model(None)
        rows = self.base_model.tables.delays
        slowest = float((rows["tau"] * rows["stretches"]).max())
        self.far, self.first = TRAVEL_FACTOR * slowest, slowest / TRAVEL_PARTS
        rates = self.system(self.first).a
        if rates.size:
            self.first = min(self.first, RATE_MARGIN / max(1e-300, float(np.linalg.norm(rates, 2))))
        for _, i, rate in storing_nodes(self.base_model, 1.0):
            travel = min(float(line["tau"] * line["stretches"]) for line in lines_at(self.base_model, i))
            self.first = min(self.first, float(np.sqrt(2.0 * travel / (REFLECTION_BOUND * rate * steps))))

    def model(self, h: float | None):
        """Model with schedules held at the start, and delay lines divided for steps of h [s]; None: step of the case.

        Raises CaseError if the case is refused with this step, and FvsolveError for a limited scheme in pipes with
        cells and for more than 400 states.
        """
        step = {} if h is None else {"numerics.step": h}
        model = study_model(self.case, self.set | step)
        if model.case.numerics.scheme in LIMITED and (model.tables.pipes["delay"] < 0).any():
            raise FvsolveError(f"numerics.scheme: {model.case.numerics.scheme} is not linear. Expected a linear scheme "
                               "for stability with delay lines, such as scheme = \"upwind5\"")  # fmt: skip
        if model.y_size > MAX_STATES:
            raise FvsolveError(
                f"the case has {model.y_size} states, where each delay line counts as one. Expected at most "
                f"{MAX_STATES} with delay lines: use fewer cells, or a part of the network"
            )
        return with_held_schedules(model, model.case.numerics.start)

    def system(self, h: float) -> DelayLineSystem:
        """Linear system that describes the model with steps of h [s]."""
        return DelayLineSystem(self.model(h), self.method, h)

    def fails(self, h: float) -> bool:
        """True if the growth of a deviation exceeds the threshold, or the case is refused with steps of h [s]."""
        try:
            return not self.system(h).growth(self.steps, self.threshold).size <= self.threshold
        except CaseError as error:
            self.refused[h] = error.faults[0].message
            return True

    def predicted(self) -> StepLimit:
        """Predicted limit of the step, below which no step is found to fail; nan for Rosenbrock methods."""
        if self.method.kind == "linear":
            return StepLimit(np.nan, np.nan)
        rough = bisect_limit(self.fails, self.first, self.far, RISE, FINE)
        limits = [rough, *(self.limit_at_parts(d, rough.fails) for d in self.delays_at_stores(rough))]
        return min(limits, key=lambda limit: limit.fails)

    def delays_at_stores(self, rough: StepLimit) -> list[float]:
        """Delays of the lines at storing nodes [s], longest first and four at most; empty if `rough` is 0 or infinite.

        Waves grow most with steps that are the n-th part of one of these delays, with an integer n.
        rough : first estimate of the limit
        """
        at_stores = [line for _, i, _ in storing_nodes(self.base_model, 1.0) for line in lines_at(self.base_model, i)]
        delays = {float(line["tau"] * line["stretches"]) for line in at_stores} if 0.0 < rough.step < np.inf else set()
        return sorted(delays, reverse=True)[:LINE_COUNT]

    def limit_at_parts(self, delay: float, fails: float) -> StepLimit:
        """Limit of the step among the steps delay / n, with integers n, with which interpolation damps no wave.

        delay : delay of a line [s]; fails : a failing step [s], below which the search starts
        The limit is inf if the greatest of these steps below `fails` does not fail.
        """
        low = int(np.ceil(delay / fails))
        if low < 1 or not self.fails(delay / low):
            return StepLimit(np.inf, np.inf)
        high = 2 * low
        while self.fails(delay / high):
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.fails(delay / middle) else (low, middle)
        between = delay / (low + 0.5)
        return bisect(self.fails, delay / high if self.fails(between) else between, delay / low, FINE)


def delayed_row(case, scheme: str, method, steps: int, threshold: float) -> StabilityRow:
    """Row of a stability study for a case with delay lines, with a scheme and a method, at the start of the case.

    It contains the limit from the linear system of a step and the limit of real runs.
    """
    limits, left_out, notes = DelayLineLimits(case, scheme, method, steps, threshold), {}, []
    predicted, model = limits.predicted(), limits.base_model
    rate = float(max(model.wave_rates[model.tables.pipes["delay"] < 0], default=0.0))
    row = {
        "scheme": scheme, "method": method.name, "when": "the start, with delay lines instead of cells",
        "states": model.y_size, "steps": steps, "threshold": threshold, "rate": rate, "predicted": predicted.step,
        "lines": True,
    }  # fmt: skip
    if np.isnan(predicted.step):
        left_out["predicted"] = UNKNOWN_REASON
    elif np.isinf(predicted.step):
        notes.append(NO_LIMIT_NOTE)
    if np.isfinite(predicted.fails) and predicted.fails not in limits.refused:
        linear = limits.system(predicted.fails)
        growth = linear.growth(steps, threshold)
        where, share = linear.dominant_part(growth)
        row |= {"growth": growth.size, "after": growth.steps, "where": where, "share": share}
    if limits.refused:
        h = min(limits.refused)
        notes.append(f"steps of {h:.4g} s or more are refused: {limits.refused[h]}")
    if not limits.refused or predicted.fails not in limits.refused:
        row |= measure_limit(DelayLineRuns(limits, steps, threshold, predicted.fails), predicted.step, 0.0, left_out)
    return StabilityRow(**row, left_out=left_out, notes=tuple(notes))
