"""Stability of a case with delay lines: greatest step by the linear system of steps, and by real runs.

Deviations from the initial steady state follow x' = A x + B w, s = C x + D w: x are the states outside the lines, w
the waves that arrive at the ends of lines, s the waves that nodes send into lines. An arriving wave was sent one delay
earlier and is interpolated between steps by the polynomials of the lines; friction in the middle of each stretch of a
line reflects a part of it. A step computes x by the tableau of the method, with w at its stages, and stores s.

Arguments of several functions : steps, number of steps over which growth counts; threshold, growth above which a step
fails
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from fvsolve.core.model.energy_norm import energy_form
from fvsolve.core.schemes import LIMITED
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.core.step_limits.greatest_step import (
    STEP_RATIO,
    StepLimit,
    bisect,
    greatest_step,
    limit_from,
    multiples,
)
from fvsolve.core.steppers import loop_records
from fvsolve.core.steppers.tableau import Method
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.features.delay_lines.feature import history_of, lines_of
from fvsolve.features.delay_lines.growth import REFLECTION_BOUND, lines_at, storing_nodes
from fvsolve.features.delay_lines.kernels import wave_history as at
from fvsolve.features.delay_lines.kernels.line_rates import drag_and_slope
from fvsolve.studies.operating_point import with_held_schedules
from fvsolve.studies.outcome import study_model
from fvsolve.studies.stability.growth import prediction_limit
from fvsolve.studies.stability.real_runs import SAFE_PARTS, RealRuns, fixed_step_loop, measure_limit
from fvsolve.studies.stability.stability_row import StabilityRow
from fvsolve.studies.work_limit import WorkLimit

STENCIL_MARGIN = 4  # entries before the oldest reading, for its interpolation
DERIVATIVE_STEP = 1e-6  # step of differences in units of the small deviation
BAR_PRESSURE = 1e5  # pressure of a wave of unit size [Pa]
GROWTH_ROUNDS = 2  # of all steps: first with random starts, then with their ends as starts
CALLS_TIME, WAVE_TIME = 5e-5, 1e-6  # CPU time of a stage of a step, and of a past wave [s]
REMEDY = (
    "use a part of the network, or fewer cells; rates far above those of waves, "
    "as of a small chamber, need short steps"
)
VANISHED = 1e-100  # size of a deviation that has left the model


class DelayedGrowth(NamedTuple):
    """Greatest growth `size` of a deviation, after `steps` steps.

    x, end : float64[n]  states at the start and the end
    history, end_history : float64[history_steps, 2, stretches]  past waves in the lines at the start and the end
    """

    size: float
    steps: int
    x: np.ndarray
    history: np.ndarray
    end: np.ndarray
    end_history: np.ndarray


class DelayLineSystem:
    """Linear system of a model at its start, with delay lines divided for steps of h [s], for one method.

    a, b, c, d : matrices of x' = A x + B w, s = C x + D w, with the states x outside the delay lines, the waves w that
    arrive at the ends of lines, and the waves s that nodes send into lines
    states : indices of x in the state vector
    delays : age in steps of the waves that are read from each stretch of a line: its delay, or the longest step for a
    shorter stretch; now : fraction of a wave that crosses such a shorter stretch at once, else 0
    first, last : first and last stretch of each line; history_steps : number of past steps whose waves are read
    reflection : fraction of a wave that friction in a stretch reflects
    parts, energy_rows : names and rows of an `EnergyForm`
    weight : factors on past waves, after which the sum of their squares is their energy
    """

    def __init__(self, model, method: Method, h: float) -> None:
        self.model, self.method, self.h = model, method, h
        rows, pipes = lines_of(model), model.tables.pipes
        line_of = np.repeat(np.arange(len(rows)), rows["stretches"])
        self.delays, self.now = (rows["hold"] / h)[line_of], rows["now"][line_of][:, None]
        self.last = np.cumsum(rows["stretches"]) - 1
        self.first = self.last + 1 - rows["stretches"]
        self.history_steps = int(np.ceil(self.delays.max())) + STENCIL_MARGIN
        shares = [reflected_share(pipes[row["pipe"]], row["tau"]) for row in rows]
        self.reflection = np.array(shares)[line_of][:, None]
        self.states = np.setdiff1d(np.arange(model.y_size), pipes["y"][rows["pipe"]])
        self.a, self.b, self.c, self.d = local_matrices(model, self.states)
        self.parts, self.energy_rows = (), np.zeros((0, self.states.size))
        if self.states.size:
            form = energy_form(model, model.start)
            rows_of_states = form.rows[:, self.states]
            self.parts = form.parts
            self.energy_rows = (
                rows_of_states
                if isinstance(rows_of_states, np.ndarray)
                else rows_of_states.toarray()
            )
        factor = 1.0 / (pipes["admittance"][rows["pipe"]] * model.case.properties.density)
        ages = np.arange(self.history_steps, 0, -1)
        self.weight = np.sqrt(h * factor[line_of]) * (
            ages[:, None] <= np.maximum(1.0, np.round(self.delays))
        )

    @cached_property
    def stages(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """(step matrix, matrices of arriving waves) of a step of the states x.

        There is one matrix of arriving waves for each stage. The new states are the step matrix times x, plus the sum
        over the stages of matrix times arriving waves.
        """
        method = self.method
        n = self.states.size
        s = self.method.stages
        inverse = np.zeros((0, 0))
        if n:  # in the order of `growth.step_matrix`, then with all states of a stage together
            inverse = np.linalg.inv(np.eye(s * n) - self.h * np.kron(self.a, method.a))
            inverse = inverse.reshape(n, s, n, s).transpose(1, 0, 3, 2).reshape(s * n, s * n)
        weights = self.h * np.kron(method.b, np.eye(n)) @ inverse
        step = np.eye(n) + weights @ np.kron(np.ones((s, 1)), self.a)
        return step, [weights[:, i * n : (i + 1) * n] @ self.b for i in range(s)]

    def reading_weights(self, c: float) -> tuple[np.ndarray, np.ndarray]:
        """Interpolation of the past waves that arrive c h after the start of step n: six entries and weights.

        Returns (int64[6, stretches], numbers of the entries relative to step n; float64[6, stretches], their weights).
        """
        newest = -1 if c <= 0.0 else 0
        position = c - self.delays
        low = np.floor(position + 1e-9)
        weights = np.zeros((6, position.size))
        for k, (entry, x) in enumerate(zip(low, np.maximum(0.0, position - low), strict=True)):
            if entry >= newest:
                low[k], weights[2, k] = newest, 1.0
            elif entry + 3 <= newest:
                weights[:, k] = at.lagrange_six(x)
            elif entry + 2 <= newest:
                weights[:, k] = at.lagrange_four(x)
            else:
                weights[2:4, k] = 1.0 - x, x
        return low.astype(int) + np.arange(-2, 4)[:, None], weights

    def arrivals(self, past: np.ndarray, n: int, reading: tuple[np.ndarray, np.ndarray]) -> tuple:
        """Backward and forward waves that arrive at the ends of all stretches : float64[stretches, m] each.

        m : number of deviations
        past : float64[entries, 2, stretches, m]  past waves; n : entry of the start of the step
        reading : result of `reading_weights`
        """
        entries, weights = reading
        near = past[np.clip(n + entries, 0, past.shape[0] - 1), :, np.arange(self.delays.size)]
        r, l = np.einsum("js,jswm->wsm", weights, near)  # noqa: E741
        reflected = self.reflection * (r - l)
        forward, backward = r - reflected - self.now * r, l + reflected - self.now * l
        factor = 1.0 / (1.0 - self.now**2)
        return factor * (backward - self.now * forward), factor * (forward - self.now * backward)

    def node_arrivals(self, waves: tuple) -> np.ndarray:
        """Waves (see `arrivals`) that arrive at the ends `from` and `to` of each line : float64[2 lines, m]."""
        backward, forward = waves
        return np.stack([backward[self.first], forward[self.last]], axis=1).reshape(
            2 * self.first.size, -1
        )

    def store_entry(self, past: np.ndarray, n: int, x: np.ndarray, waves: tuple) -> None:
        """Write the waves that nodes and stretches send, with states x and arriving `waves`, as entry n of `past`."""
        backward, forward = waves
        sent = (self.c @ x + self.d @ self.node_arrivals(waves)).reshape(self.first.size, 2, -1)
        past[n, 0, 1:], past[n, 1, :-1] = forward[:-1], backward[1:]  # joints
        past[n, 0, self.first], past[n, 1, self.last] = sent[:, 0], sent[:, 1]

    def size(self, x: np.ndarray, history: np.ndarray) -> np.ndarray:
        """Square root of the energy of states and waves of m deviations : float64[m].

        x : float64[n, m]  states; history : float64[history_steps, 2, stretches, m]  past waves
        """
        waves = self.weight[:, None, :, None] * history
        return np.sqrt(
            np.sum((self.energy_rows @ x) ** 2, axis=0) + np.sum(waves**2, axis=(0, 1, 2))
        )

    def propagate(
        self,
        x: np.ndarray,
        history: np.ndarray,
        steps: int,
        threshold: float,
        work: WorkLimit | None = None,
    ) -> tuple:
        """Take up to `steps` steps with m deviations; ends when the growth of a deviation exceeds the threshold.

        Returns (greatest growth of each deviation : float64[m], number of steps after which a growth last increased,
        states at the end, past waves at the end).
        x, history : states and past waves at the start, as in `size`; work : spends the estimated time
        """
        K, m = self.history_steps, x.shape[1]
        past = np.zeros((K + steps + 2, *history.shape[1:]))
        past[:K] = history
        step, inputs = self.stages
        readings = [self.reading_weights(c) for c in self.method.c]
        at_end = self.reading_weights(1.0)
        self.store_entry(past, K, x, self.arrivals(past, K - 1, at_end))
        first = self.size(x, history)
        size = np.ones(m)
        after = 0
        stretches, reach = np.arange(self.delays.size), np.count_nonzero(self.weight, axis=0)
        squares = np.sum(
            (self.weight[:, None, :, None] * history) ** 2, axis=(0, 1)
        )  # energy of the waves of a stretch
        factor = self.weight.max(axis=0)[:, None] ** 2
        if work is not None:
            work.spend(propagation_time(self.method, K, self.delays.size, 0))
        for n in range(steps):
            if work is not None:
                work.spend(propagation_time(self.method, 0, 0, 1))
            arrivals = [
                self.node_arrivals(self.arrivals(past, K + n, reading)) for reading in readings
            ]
            x = step @ x + sum(
                (matrix @ w for matrix, w in zip(inputs, arrivals, strict=True)), np.zeros_like(x)
            )
            self.store_entry(past, K + n + 1, x, self.arrivals(past, K + n, at_end))
            # the sum changes by one entry at each end
            left = past[K + n - reach, :, stretches].swapaxes(0, 1)
            squares += factor * np.sum(past[K + n] ** 2 - left**2, axis=0)
            stored = np.sum((self.energy_rows @ x) ** 2, axis=0)
            growth = np.sqrt(np.maximum(stored + squares.sum(axis=0), 0.0)) / first
            if not np.all(growth <= size):
                size, after = np.fmax(size, growth), n + 1
            if not growth.max() <= threshold:
                break
        return size, after, x, past[n + 1 : n + 1 + K]

    def starts(self) -> tuple[np.ndarray, np.ndarray]:
        """Three random deviations: states with equal waves, opposite waves alone, and states alone.

        Returns the states, float64[n, 3], and the past waves, float64[history_steps, 2, stretches, 3].
        The backward wave is the forward wave mirrored about the middle of a line, for opposite waves with the other
        sign. The direction in which a line is drawn changes at most the sign of opposite waves.
        """
        rng, rows = np.random.default_rng(7), lines_of(self.model)
        stored = rng.standard_normal((self.states.size, 1)) * self.model.scale[self.states][:, None]
        sent = rng.standard_normal((self.history_steps, self.delays.size)) * BAR_PRESSURE
        sent *= np.repeat(self.model.tables.pipes["admittance"][rows["pipe"]], rows["stretches"])
        reverse = np.concatenate(
            [np.arange(b, a - 1, -1) for a, b in zip(self.first, self.last, strict=True)]
        )
        equal, opposite = (
            np.stack([sent, sign * sent[:, reverse]], axis=1) for sign in (1.0, -1.0)
        )
        x = stored * np.array([1.0, 0.0, 1.0])
        return x, np.stack([equal, opposite, np.zeros_like(equal)], axis=-1)

    def growth(self, steps: int, threshold: float, work: WorkLimit | None = None) -> DelayedGrowth:
        """Greatest growth found within `steps` steps, a lower bound; nan for Rosenbrock methods (not modelled).

        The steps are taken twice: from the random deviations of `starts`, then from the deviations at the end of these
        steps, which are close to the deviation that grows most. The search ends if a growth exceeds the threshold.
        work : spends the estimated time; raises TooLarge above its limit
        """
        start = self.starts()
        for _ in range(GROWTH_ROUNDS):
            unit = self.size(*start)
            start = tuple(values[..., unit > VANISHED] / unit[unit > VANISHED] for values in start)
            if self.method.kind == "linear":
                return DelayedGrowth(np.nan, 0, *(values[..., 0] for values in (*start, *start)))
            size, after, *end = self.propagate(*start, steps, threshold, work)
            worst = int(np.argmax(np.nan_to_num(size, nan=np.inf)))
            growth = DelayedGrowth(
                float(size[worst]), after, *(values[..., worst] for values in (*start, *end))
            )
            if not size.max() <= threshold or not self.size(*end).min() > VANISHED:
                break
            start = end
        return growth

    def dominant_part(self, grown: DelayedGrowth) -> tuple[str, float]:
        """(name of the part with the greatest share of the energy of a grown deviation, this share)."""
        waves = np.sum((self.weight[:, None] * grown.end_history) ** 2, axis=(0, 1))
        shares = dict.fromkeys(self.parts, 0.0)
        for part, root in zip(self.parts, self.energy_rows @ grown.end, strict=True):
            shares[part] += float(root**2)
        for k, (first, last) in enumerate(zip(self.first, self.last, strict=True)):
            name = self.model.pipes[lines_of(self.model)[k]["pipe"]].name
            shares[name] = shares.get(name, 0.0) + float(waves[first : last + 1].sum())
        part, total = max(shares, key=shares.get), sum(shares.values())
        return part, shares[part] / total if total > 0.0 else np.nan


def propagation_time(method: Method, history_steps: int, stretches: int, steps: int) -> float:
    """Estimated CPU time of `DelayLineSystem.propagate` [s]."""
    return CALLS_TIME * (method.stages + 2) * steps + WAVE_TIME * history_steps * stretches


def reflected_share(pipe, tau: float) -> float:
    """Fraction of a wave that friction in a stretch of a line, of travel time tau [s], reflects at the initial flow."""
    flow, width = float(pipe["flow"]), DERIVATIVE_STEP * float(pipe["admittance"]) * BAR_PRESSURE
    slope = (drag_and_slope(pipe, flow + width)[0] - drag_and_slope(pipe, flow - width)[0]) / (
        2.0 * width
    )
    k = 0.5 * tau * float(slope)
    return k / (1.0 + k)


def local_matrices(
    model, states: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrices A, B, C, D of `DelayLineSystem` at the start, by central differences; states : indices of states x."""
    t = float(model.case.numerics.start)
    y = model.start
    rows = lines_of(model)
    ends = int(model.layout["ends"]) + 4 * rows["pipe"][:, None] + np.array([0, 3])
    first = np.cumsum(rows["stretches"]) - rows["stretches"]
    admittance = np.repeat(model.tables.pipes["admittance"][rows["pipe"]], 2)

    with model.run_data() as data:
        past, arrivals = history_of(data), at.offsets_of(history_of(data))[0]
        ends_of_lines = np.stack([first, first + rows["stretches"] - 1], axis=1)
        inputs = arrivals + at.ARRIVALS_SIZE * ends_of_lines + np.array([0, 1])

        def evaluate(y: np.ndarray, w: np.ndarray) -> np.ndarray:
            past[inputs.ravel()] = w
            past[at.COUNT] = past[at.ARRIVALS_COUNT] = at.PROFILE_ENTRIES + 1.0
            past[at.ARRIVALS_TIME] = t
            dydt, out = data.evaluate(t, y, np.inf)
            return np.append(dydt[states], out[ends.ravel()])

        rest, slopes = np.zeros(inputs.size), []
        for i in states:
            width = np.zeros(y.size)
            width[i] = DERIVATIVE_STEP * (model.scale[i] + abs(y[i]))
            slopes.append(
                (evaluate(y + width, rest) - evaluate(y - width, rest)) / (2.0 * width[i])
            )
        for i in range(rest.size):
            width = np.zeros(rest.size)
            width[i] = DERIVATIVE_STEP * admittance[i] * BAR_PRESSURE
            slopes.append((evaluate(y, width) - evaluate(y, -width)) / (2.0 * width[i]))
    matrix, n = np.array(slopes).reshape(-1, states.size + rest.size).T, states.size
    return matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]


NEAR_PREDICTION = 0.99  # lower end of the bracket over the prediction
STEP_RATIO_UP = 2.0  # ratio of consecutive steps if all are predicted safe
SMALL_WAVE = 1e-5  # deviation at the start, in units of a wave of 1 bar over one step


class DelayLineRuns(RealRuns):
    """Real runs at fixed steps, each from the deviation with the greatest growth in the linear system of the step.

    limits : a `DelayLineLimits`
    end : a step that is predicted to fail [s]; inf if no step is, nan if there is no prediction
    """

    def __init__(self, limits: DelayLineLimits, steps: int, threshold: float, end: float) -> None:
        self.failing_step, self.first, self.far, self.system = (
            end,
            limits.first,
            limits.far,
            limits.system,
        )
        self.prepare(limits.base_model.y_size, steps, threshold)

    def start_run(self, system: DelayLineSystem, x: np.ndarray, history: np.ndarray) -> RunLoop:
        """Run from the initial state plus the deviation x, with the past waves `history` in its delay lines."""
        model, t = system.model, float(system.model.case.numerics.start)
        loop = fixed_step_loop(model, lambda: model.structure, system.method.name, system.h, t)
        loop.now[:] = model.start
        loop.now[system.states] += x
        write_history(history_of(loop.run_data), lines_of(model), t, system.h, history)
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
            return limit_from(
                self.fails, self.first, self.far, STEP_RATIO if np.isnan(guess) else STEP_RATIO_UP
            )
        if any(self.fails(part * guess) for part in SAFE_PARTS) or not self.fails(
            self.failing_step
        ):
            return super().limit(guess)
        low = (SAFE_PARTS[-1] if self.fails(NEAR_PREDICTION * guess) else NEAR_PREDICTION) * guess
        return bisect(self.fails, low, self.failing_step)

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth of a deviation with steps of h [s], number of steps after which it is reached).

        The growth is infinite if a run stops. Raises TimeoutError at the time limit.
        """
        system = self.system(h)
        predicted, tables = system.growth(self.steps, self.threshold), system.model.tables
        # [kg/s]
        greatest_wave = BAR_PRESSURE * float(
            tables.pipes["admittance"][lines_of(system.model)["pipe"]].max()
        )
        small = SMALL_WAVE * float(system.weight.max()) * greatest_wave
        runs = [
            self.start_run(system, width * predicted.x, width * predicted.history)
            for width in (small, 0.0)
        ]

        def growth(k: int) -> float:
            if any(run.run(self.strides[k]) != loop_records.BUDGET_SPENT for run in runs):
                return np.inf
            moved, base = (
                (run.now[system.states], read_history(history_of(run.run_data), system))
                for run in runs
            )
            return (
                float(
                    system.size((moved[0] - base[0])[:, None], (moved[1] - base[1])[..., None])[0]
                )
                / small
            )

        return self.greatest(growth)


def write_history(
    past: np.ndarray, delays: np.ndarray, t: float, h: float, history: np.ndarray
) -> None:
    """Write past waves into the wave history `past` of delay lines, at the times t - count h, ..., t - h.

    history : float64[count, 2, stretches]  deviations of both waves in each stretch of a line, oldest first [kg/s]
    delays : delay lines in the tables
    """
    count, places = history.shape[0], at.offsets_of(past)
    numbers = at.PROFILE_ENTRIES + np.arange(count)
    past[at.COUNT] = at.PROFILE_ENTRIES + count
    past[[at.LAST_STEP, at.STEP_BEFORE]], past[[at.EQUAL_STEPS, at.EQUAL_STEPS_BEFORE]] = h, 1e18
    past[at.FIRST_TIME] = t - count * h
    at.update_tolerance(past, t, h)
    past[at.HEADER_SIZE + (numbers & (int(past[at.CAPACITY]) - 1))] = t + h * np.arange(-count, 0)
    for where, s, wave in ring_offsets(places, delays, numbers):
        past[where] = history[:, wave, s]


def read_history(past: np.ndarray, system: DelayLineSystem) -> np.ndarray:
    """Past waves of all stretches in a wave history, without the last entry : float64[history_steps, 2, stretches]."""
    values = np.zeros((system.history_steps, 2, system.delays.size))
    numbers = int(past[at.COUNT]) - 1 - system.history_steps + np.arange(system.history_steps)
    for where, s, wave in ring_offsets(at.offsets_of(past), lines_of(system.model), numbers):
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
# greatest number of lines at stores for which integer parts of the delay are checked
LINE_COUNT = 4
# ratio of consecutive steps of the search, relative width of the final bracket
RISE, FINE = 1.6, 1e-3
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
        rows = lines_of(self.base_model)
        slowest = float((rows["tau"] * rows["stretches"]).max())
        self.far, self.first = TRAVEL_FACTOR * slowest, slowest / TRAVEL_PARTS
        self.work = prediction_limit(self.base_model.y_size, steps, REMEDY)
        rates = self.system(self.first).a
        if rates.size:
            self.first = min(self.first, RATE_MARGIN / max(1e-300, float(np.linalg.norm(rates, 2))))
        for _, i, rate in storing_nodes(self.base_model, 1.0):
            travel = min(
                float(line["tau"] * line["stretches"]) for line in lines_at(self.base_model, i)
            )
            self.first = min(
                self.first, float(np.sqrt(2.0 * travel / (REFLECTION_BOUND * rate * steps)))
            )

    def model(self, h: float | None):
        """Model with schedules held at the start, and delay lines divided for steps of h [s]; None: step of the case.

        Raises CaseError if the case is refused with this step, and FvsolveError for a limited scheme in pipes with
        cells and for more than 400 states.
        """
        step = {} if h is None else {"numerics.step": h}
        model = study_model(self.case, self.set | step)
        if model.case.numerics.scheme in LIMITED and (model.tables.pipes["cells"] > 0).any():
            raise FvsolveError(
                f"numerics.scheme: {model.case.numerics.scheme} is not linear; expected a linear scheme "
                'for stability with delay lines, such as scheme = "upwind5"'
            )
        if model.y_size > MAX_STATES:
            raise FvsolveError(
                f"the case has {model.y_size} states, where each delay line counts as one; expected at most "
                f"{MAX_STATES} with delay lines: use fewer cells, or a part of the network"
            )
        return with_held_schedules(model, model.case.numerics.start)

    def system(self, h: float) -> DelayLineSystem:
        """Linear system that describes the model with steps of h [s]; raises TooLarge if it has too many past waves."""
        rows = lines_of(self.base_model)
        longest = float((rows["tau"] * rows["stretches"]).max())
        self.work.check(propagation_time(self.method, int(longest / h), len(rows), self.steps))
        return DelayLineSystem(self.model(h), self.method, h)

    def fails(self, h: float) -> bool:
        """True if the growth of a deviation exceeds the threshold, or the case is refused with steps of h [s]."""
        try:
            return (
                not self.system(h).growth(self.steps, self.threshold, self.work).size
                <= self.threshold
            )
        except CaseError as error:
            self.refused[h] = error.faults[0].message
            return True

    def predicted(self) -> StepLimit:
        """Predicted limit of the step, below which no step is found to fail; nan for Rosenbrock methods."""
        if self.method.kind == "linear":
            return StepLimit(np.nan, np.nan)
        rough = limit_from(self.fails, self.first, self.far, RISE, FINE)
        limits = [
            rough,
            *(self.limit_at_parts(d, rough.fails) for d in self.delays_at_stores(rough)),
        ]
        return min(limits, key=lambda limit: limit.fails)

    def delays_at_stores(self, rough: StepLimit) -> list[float]:
        """Delays of the lines at storing nodes [s], longest first and four at most; empty if `rough` is 0 or infinite.

        Waves grow most with steps that are the n-th part of one of these delays, with an integer n.
        rough : first estimate of the limit
        """
        at_stores = [
            line
            for _, i, _ in storing_nodes(self.base_model, 1.0)
            for line in lines_at(self.base_model, i)
        ]
        delays = (
            {float(line["tau"] * line["stretches"]) for line in at_stores}
            if 0.0 < rough.step < np.inf
            else set()
        )
        return sorted(delays, reverse=True)[:LINE_COUNT]

    def limit_at_parts(self, delay: float, fails: float) -> StepLimit:
        """Limit of the step among the steps delay / n, with integers n, with which interpolation damps no wave.

        delay : delay of a line [s]; fails : a failing step [s], below which the search starts
        The limit is inf if the greatest of these steps below `fails` does not fail.
        """
        least = int(np.ceil(delay / fails))
        if least < 1:
            return StepLimit(np.inf, np.inf)
        # The search is for the number n: steps delay / n fail for small n.
        n = greatest_step(
            lambda n: not self.fails(delay / n),
            multiples(least, 2, np.inf),
            width=0.0,
            mean=lambda low, high: (low + high) // 2,
        )
        if n.step == 0.0:
            return StepLimit(np.inf, np.inf)
        between = delay / (n.step + 0.5)
        return bisect(
            self.fails, delay / n.fails if self.fails(between) else between, delay / n.step, FINE
        )


def delayed_row(case, scheme: str, method, steps: int, threshold: float) -> StabilityRow:
    """Row of a stability study for a case with delay lines, with a scheme and a method, at the start of the case.

    It contains the limit from the linear system of a step and the limit of real runs.
    """
    limits = DelayLineLimits(case, scheme, method, steps, threshold)
    left_out = {}
    notes = []
    predicted, model = limits.predicted(), limits.base_model
    rate = float(max(model.wave_rates[model.tables.pipes["cells"] > 0], default=0.0))
    row = {
        "scheme": scheme,
        "method": method.name,
        "when": "the start, with delay lines instead of cells",
        "states": model.y_size,
        "steps": steps,
        "threshold": threshold,
        "rate": rate,
        "predicted": predicted.step,
        "lines": True,
    }
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
        row |= measure_limit(
            DelayLineRuns(limits, steps, threshold, predicted.fails), predicted.step, 0.0, left_out
        )
    return StabilityRow(**row, left_out=left_out, notes=tuple(notes))
