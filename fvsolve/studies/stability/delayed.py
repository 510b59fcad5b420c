"""Fixed steps of a model with delay lines as a linear system: stores, nodes, what is on its way. Runs no program.

x' = A x + B w, s = C x + D w about a state at rest: w what arrives at the ends of lines, s what nodes send there. What
arrives was sent a delay ago and is read between steps by the lines' own polynomials; friction in the middle of a
stretch turns a share of it back. A step takes x by the method's tableau with w at its stages, and keeps s.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from fvsolve.kernels.delay import history as at
from fvsolve.kernels.delay.lines import drag_and_slope
from fvsolve.model.energy import energy_form
from fvsolve.steppers.tableau import Method

BEYOND = 4  # entries that a reading wants behind its place
NEAR, BAR = 1e-6, 1e5  # of a small deviation, over which derivatives are taken; pressure of a wave that is one [Pa]
ROUNDS = 2  # of all steps: deviations at random, and what became of them


GONE = 1e-100  # of a deviation, that has left


class Grown(NamedTuple):
    """Greatest growth, after how many steps; x and entries of the start that grows so, and of its end."""

    size: float
    steps: int
    x: np.ndarray
    before: np.ndarray
    end: np.ndarray
    end_before: np.ndarray


class Delayed:
    """A frozen model, its lines cut for steps of h [s], under one method.

    kept : states that are no line's; holds : delays of all stretches in steps; turns : share that friction turns back
    first, last : the stretches at the ends of lines; many : steps of the past that count
    """

    def __init__(self, model, method: Method, h: float) -> None:
        self.model, self.method, self.h = model, method, h
        rows, pipes = model.tables.delays, model.tables.pipes
        each = np.repeat(np.arange(len(rows)), rows["stretches"])
        self.holds, self.now = (rows["hold"] / h)[each], rows["now"][each][:, None]
        self.last = np.cumsum(rows["stretches"]) - 1
        self.first = self.last + 1 - rows["stretches"]
        self.many = int(np.ceil(self.holds.max())) + BEYOND
        turns = [friction(pipes[row["pipe"]], row["tau"]) for row in rows]
        self.turns = np.array(turns)[each][:, None]
        self.kept = np.setdiff1d(np.arange(model.y_size), pipes["y"][rows["pipe"]])
        self.a, self.b, self.c, self.d = local(model, self.kept)
        self.parts, self.stored = (), np.zeros((0, self.kept.size))
        if self.kept.size:
            form = energy_form(model, model.start)
            self.parts, self.stored = form.parts, form.rows[:, self.kept]
            self.stored = self.stored if isinstance(self.stored, np.ndarray) else self.stored.toarray()
        per = 1.0 / (pipes["admittance"][rows["pipe"]] * model.case.properties.density)
        ages = np.arange(self.many, 0, -1)
        self.weight = np.sqrt(h * per[each]) * (ages[:, None] <= np.maximum(1.0, np.round(self.holds)))

    @cached_property
    def stages(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """What a step makes of x, and of what arrives at each stage."""
        method, n, s = self.method, self.kept.size, self.method.stages
        inside = np.linalg.inv(np.eye(s * n) - self.h * np.kron(method.a, self.a)) if n else np.zeros((0, 0))
        ends = self.h * np.kron(method.b, np.eye(n)) @ inside
        step = np.eye(n) + ends @ np.kron(np.ones((s, 1)), self.a)
        return step, [ends[:, i * n : (i + 1) * n] @ self.b for i in range(s)]

    def places(self, c: float) -> tuple[np.ndarray, np.ndarray]:
        """(entries, weights) : [6, stretches] that are read at t_n + c h, entries counted from n."""
        newest = -1 if c <= 0.0 else 0
        place = c - self.holds
        low = np.floor(place + 1e-9)
        weights = np.zeros((6, place.size))
        for k, (whole, x) in enumerate(zip(low, np.maximum(0.0, place - low), strict=True)):
            if whole >= newest:
                low[k], weights[2, k] = newest, 1.0
            elif whole + 3 <= newest:
                weights[:, k] = at.six(x)
            elif whole + 2 <= newest:
                weights[:, k] = at.four(x)
            else:
                weights[2:4, k] = 1.0 - x, x
        return low.astype(int) + np.arange(-2, 4)[:, None], weights

    def arrivals(self, past: np.ndarray, n: int, reading: tuple[np.ndarray, np.ndarray]) -> tuple:
        """Waves (backward, forward) at the ends of all stretches, read where `places` says; n : entry t_n in past."""
        entries, weights = reading
        near = past[np.clip(n + entries, 0, past.shape[0] - 1), :, np.arange(self.holds.size)]
        r, l = np.einsum("js,jswm->wsm", weights, near)  # noqa: E741
        delta = self.turns * (r - l)
        ahead, back = r - delta - self.now * r, l + delta - self.now * l
        per = 1.0 / (1.0 - self.now**2)
        return per * (back - self.now * ahead), per * (ahead - self.now * back)

    def at_ends(self, waves: tuple) -> np.ndarray:
        """What of that arrives at nodes: at `from` and `to` of each line in turn."""
        back, ahead = waves
        return np.stack([back[self.first], ahead[self.last]], axis=1).reshape(2 * self.first.size, -1)

    def enter(self, past: np.ndarray, n: int, x: np.ndarray, waves: tuple) -> None:
        """Keep what is sent at t_n as its entry."""
        back, ahead = waves
        sent = (self.c @ x + self.d @ self.at_ends(waves)).reshape(self.first.size, 2, -1)
        past[n, 0, 1:], past[n, 1, :-1] = ahead[:-1], back[1:]  # joints
        past[n, 0, self.first], past[n, 1, self.last] = sent[:, 0], sent[:, 1]

    def size(self, x: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Root of the energy of deviations : float64[m]; before : the `many` entries before t_n."""
        waves = self.weight[:, None, :, None] * before
        return np.sqrt(np.sum((self.stored @ x) ** 2, axis=0) + np.sum(waves**2, axis=(0, 1, 2)))

    def carried(self, x: np.ndarray, before: np.ndarray, steps: int, threshold: float) -> tuple:
        """(greatest growth, after how many steps, x, entries) of them after so many steps, or where one is beyond."""
        K, m = self.many, x.shape[1]
        past = np.zeros((K + steps + 2, *before.shape[1:]))
        past[:K] = before
        step, given = self.stages
        readings = [self.places(c) for c in self.method.c]
        whole = self.places(1.0)
        self.enter(past, K, x, self.arrivals(past, K - 1, whole))
        first, size, after = self.size(x, before), np.ones(m), 0
        for n in range(steps):
            come = [self.at_ends(self.arrivals(past, K + n, reading)) for reading in readings]
            x = step @ x + sum((one @ w for one, w in zip(given, come, strict=True)), np.zeros_like(x))
            self.enter(past, K + n + 1, x, self.arrivals(past, K + n, whole))
            here = self.size(x, past[n + 1 : n + 1 + K]) / first
            if not np.all(here <= size):
                size, after = np.fmax(size, here), n + 1
            if not here.max() <= threshold:
                break
        return size, after, x, past[n + 1 : n + 1 + K]

    def starts(self) -> tuple[np.ndarray, np.ndarray]:
        """Deviations at random, the same whichever way lines are drawn: waves alike, against each other, none."""
        rng, rows = np.random.default_rng(7), self.model.tables.delays
        stored = rng.standard_normal((self.kept.size, 1)) * self.model.scale[self.kept][:, None]
        sent = rng.standard_normal((self.many, self.holds.size)) * BAR
        sent *= np.repeat(self.model.tables.pipes["admittance"][rows["pipe"]], rows["stretches"])
        back = np.concatenate([np.arange(b, a - 1, -1) for a, b in zip(self.first, self.last, strict=True)])
        alike, against = (np.stack([sent, sign * sent[:, back]], axis=1) for sign in (1.0, -1.0))
        x = stored * np.array([1.0, 0.0, 1.0])
        return x, np.stack([alike, against, np.zeros_like(alike)], axis=-1)

    def growth(self, steps: int, threshold: float) -> Grown:
        """The greatest growth found in so many steps, a lower bound: of deviations at random, and of what has become of
        them, which is nearly what grows most; of Rosenbrock's methods, whose steps are not known, of none."""
        start = self.starts()
        for _ in range(ROUNDS):
            unit = self.size(*start)
            start = tuple(one[..., unit > GONE] / unit[unit > GONE] for one in start)
            if self.method.kind == "linear":
                return Grown(np.nan, 0, *(one[..., 0] for one in (*start, *start)))
            size, after, *end = self.carried(*start, steps, threshold)
            worst = int(np.argmax(np.nan_to_num(size, nan=np.inf)))
            found = Grown(float(size[worst]), after, *(one[..., worst] for one in (*start, *end)))
            if not size.max() <= threshold or not self.size(*end).min() > GONE:
                break
            start = end
        return found

    def place(self, found: Grown) -> tuple[str, float]:
        """(part with most of the energy of what has grown, its share)."""
        waves = np.sum((self.weight[:, None] * found.end_before) ** 2, axis=(0, 1))
        shares = dict.fromkeys(self.parts, 0.0)
        for part, root in zip(self.parts, self.stored @ found.end, strict=True):
            shares[part] += float(root**2)
        for k, (first, last) in enumerate(zip(self.first, self.last, strict=True)):
            name = self.model.pipes[self.model.tables.delays[k]["pipe"]].name
            shares[name] = shares.get(name, 0.0) + float(waves[first : last + 1].sum())
        part, whole = max(shares, key=shares.get), sum(shares.values())
        return part, shares[part] / whole if whole > 0.0 else np.nan


def friction(pipe, tau: float) -> float:
    """Share of a wave that friction in the middle of a stretch turns back, at the flow of the start."""
    flow, width = float(pipe["flow"]), NEAR * float(pipe["admittance"]) * BAR
    slope = (drag_and_slope(pipe, flow + width)[0] - drag_and_slope(pipe, flow - width)[0]) / (2.0 * width)
    k = 0.5 * tau * float(slope)
    return k / (1.0 + k)


def local(model, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C, D at the start, by central differences."""
    t, y, rows = float(model.case.numerics.start), model.start, model.tables.delays
    ends = int(model.layout["ends"]) + 4 * rows["pipe"][:, None] + np.array([0, 3])
    first = np.cumsum(rows["stretches"]) - rows["stretches"]
    admittance = np.repeat(model.tables.pipes["admittance"][rows["pipe"]], 2)

    with model.slate() as slate:
        past, arrive = slate.past, at.places_of(slate.past)[0]
        into = arrive + at.ARRIVALS * np.stack([first, first + rows["stretches"] - 1], axis=1) + np.array([0, 1])

        def answer(y: np.ndarray, w: np.ndarray) -> np.ndarray:
            past[into.ravel()] = w
            past[at.COUNT] = past[at.KNOWN_COUNT] = at.ZEROS + 1.0
            past[at.KNOWN_TIME] = t
            dydt, out = slate.evaluate(t, y, np.inf)
            return np.append(dydt[kept], out[ends.ravel()])

        rest, found = np.zeros(into.size), []
        for i in kept:
            width = np.zeros(y.size)
            width[i] = NEAR * (model.scale[i] + abs(y[i]))
            found.append((answer(y + width, rest) - answer(y - width, rest)) / (2.0 * width[i]))
        for i in range(rest.size):
            width = np.zeros(rest.size)
            width[i] = NEAR * admittance[i] * BAR
            found.append((answer(y, width) - answer(y, -width)) / (2.0 * width[i]))
    whole, n = np.array(found).reshape(-1, kept.size + rest.size).T, kept.size
    return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
