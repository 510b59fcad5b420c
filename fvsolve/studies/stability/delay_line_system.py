"""Fixed steps of a model with delay lines as a linear system of states and of waves in the lines.

Deviations from the initial steady state follow x' = A x + B w, s = C x + D w: x are the states outside the lines, w
the waves that arrive at the ends of lines, s the waves that nodes send into lines. An arriving wave was sent one delay
earlier and is interpolated between steps by the polynomials of the lines; friction in the middle of each stretch of a
line reflects a part of it. A step computes x by the tableau of the method, with w at its stages, and stores s.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from fvsolve.kernels.delay_lines import wave_history as at
from fvsolve.kernels.delay_lines.line_rates import drag_and_slope
from fvsolve.model.energy_norm import energy_form
from fvsolve.steppers.tableau import Method

STENCIL_MARGIN = 4  # entries before the oldest reading, for its interpolation
DERIVATIVE_STEP = 1e-6  # step of differences in units of the small deviation
BAR_PRESSURE = 1e5  # pressure of a wave of unit size [Pa]
GROWTH_ROUNDS = 2  # of all steps: first with random starts, then with their ends as starts
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
        rows, pipes = model.tables.delays, model.tables.pipes
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
            self.energy_rows = rows_of_states if isinstance(rows_of_states, np.ndarray) else rows_of_states.toarray()
        factor = 1.0 / (pipes["admittance"][rows["pipe"]] * model.case.properties.density)
        ages = np.arange(self.history_steps, 0, -1)
        self.weight = np.sqrt(h * factor[line_of]) * (ages[:, None] <= np.maximum(1.0, np.round(self.delays)))

    @cached_property
    def stages(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """(step matrix, matrices of arriving waves) of a step of the states x.

        There is one matrix of arriving waves for each stage. The new states are the step matrix times x, plus the sum
        over the stages of matrix times arriving waves.
        """
        method, n, s = self.method, self.states.size, self.method.stages
        inverse = np.linalg.inv(np.eye(s * n) - self.h * np.kron(method.a, self.a)) if n else np.zeros((0, 0))
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
        """Waves that arrive at nodes, at the ends `from` and `to` of each line in turn : float64[2 lines, m].

        m : number of deviations; waves : result of `arrivals`
        """
        backward, forward = waves
        return np.stack([backward[self.first], forward[self.last]], axis=1).reshape(2 * self.first.size, -1)

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
        return np.sqrt(np.sum((self.energy_rows @ x) ** 2, axis=0) + np.sum(waves**2, axis=(0, 1, 2)))

    def propagate(self, x: np.ndarray, history: np.ndarray, steps: int, threshold: float) -> tuple:
        """Take up to `steps` steps with m deviations; ends when the growth of a deviation exceeds the threshold.

        Returns (greatest growth of each deviation : float64[m], number of steps after which a growth last increased,
        states at the end, past waves at the end).
        x, history : states and past waves at the start, as in `size`
        """
        K, m = self.history_steps, x.shape[1]
        past = np.zeros((K + steps + 2, *history.shape[1:]))
        past[:K] = history
        step, inputs = self.stages
        readings = [self.reading_weights(c) for c in self.method.c]
        at_end = self.reading_weights(1.0)
        self.store_entry(past, K, x, self.arrivals(past, K - 1, at_end))
        first, size, after = self.size(x, history), np.ones(m), 0
        for n in range(steps):
            arrivals = [self.node_arrivals(self.arrivals(past, K + n, reading)) for reading in readings]
            x = step @ x + sum((matrix @ w for matrix, w in zip(inputs, arrivals, strict=True)), np.zeros_like(x))
            self.store_entry(past, K + n + 1, x, self.arrivals(past, K + n, at_end))
            growth = self.size(x, past[n + 1 : n + 1 + K]) / first
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
        rng, rows = np.random.default_rng(7), self.model.tables.delays
        stored = rng.standard_normal((self.states.size, 1)) * self.model.scale[self.states][:, None]
        sent = rng.standard_normal((self.history_steps, self.delays.size)) * BAR_PRESSURE
        sent *= np.repeat(self.model.tables.pipes["admittance"][rows["pipe"]], rows["stretches"])
        reverse = np.concatenate([np.arange(b, a - 1, -1) for a, b in zip(self.first, self.last, strict=True)])
        equal, opposite = (np.stack([sent, sign * sent[:, reverse]], axis=1) for sign in (1.0, -1.0))
        x = stored * np.array([1.0, 0.0, 1.0])
        return x, np.stack([equal, opposite, np.zeros_like(equal)], axis=-1)

    def growth(self, steps: int, threshold: float) -> DelayedGrowth:
        """Greatest growth found within `steps` steps, a lower bound; nan for Rosenbrock methods (not modelled).

        The steps are taken twice: from the random deviations of `starts`, then from the deviations at the end of these
        steps, which are close to the deviation that grows most. The search ends if a growth exceeds the threshold.
        """
        start = self.starts()
        for _ in range(GROWTH_ROUNDS):
            unit = self.size(*start)
            start = tuple(values[..., unit > VANISHED] / unit[unit > VANISHED] for values in start)
            if self.method.kind == "linear":
                return DelayedGrowth(np.nan, 0, *(values[..., 0] for values in (*start, *start)))
            size, after, *end = self.propagate(*start, steps, threshold)
            worst = int(np.argmax(np.nan_to_num(size, nan=np.inf)))
            growth = DelayedGrowth(float(size[worst]), after, *(values[..., worst] for values in (*start, *end)))
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
            name = self.model.pipes[self.model.tables.delays[k]["pipe"]].name
            shares[name] = shares.get(name, 0.0) + float(waves[first : last + 1].sum())
        part, total = max(shares, key=shares.get), sum(shares.values())
        return part, shares[part] / total if total > 0.0 else np.nan


def reflected_share(pipe, tau: float) -> float:
    """Fraction of a wave that friction in the middle of a stretch of a delay line reflects, at the initial flow.

    tau : travel time of the stretch [s]
    """
    flow, width = float(pipe["flow"]), DERIVATIVE_STEP * float(pipe["admittance"]) * BAR_PRESSURE
    slope = (drag_and_slope(pipe, flow + width)[0] - drag_and_slope(pipe, flow - width)[0]) / (2.0 * width)
    k = 0.5 * tau * float(slope)
    return k / (1.0 + k)


def local_matrices(model, states: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrices A, B, C, D of `DelayLineSystem` at the start, by central differences; states : indices of states x."""
    t, y, rows = float(model.case.numerics.start), model.start, model.tables.delays
    ends = int(model.layout["ends"]) + 4 * rows["pipe"][:, None] + np.array([0, 3])
    first = np.cumsum(rows["stretches"]) - rows["stretches"]
    admittance = np.repeat(model.tables.pipes["admittance"][rows["pipe"]], 2)

    with model.run_data() as data:
        past, arrivals = data.past, at.offsets_of(data.past)[0]
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
            slopes.append((evaluate(y + width, rest) - evaluate(y - width, rest)) / (2.0 * width[i]))
        for i in range(rest.size):
            width = np.zeros(rest.size)
            width[i] = DERIVATIVE_STEP * admittance[i] * BAR_PRESSURE
            slopes.append((evaluate(y, width) - evaluate(y, -width)) / (2.0 * width[i]))
    matrix, n = np.array(slopes).reshape(-1, states.size + rest.size).T, states.size
    return matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]
