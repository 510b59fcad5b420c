"""Growth of a small deviation in real runs of the compiled program, against the same threshold. Knows runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fvsolve.model.energy import EnergyForm
from fvsolve.solve.loop import NO_LIMIT, Loop
from fvsolve.steppers import slots
from fvsolve.studies.linear.frozen import Frozen
from fvsolve.studies.stability.bracket import RISE, Limit, halved
from fvsolve.studies.stability.growth import STEPS, THRESHOLD, looked_at

SMALL = 10.0 ** -np.arange(6.0, 16.0)  # greatest deviation at the start, in units of what counts as a small one
CERTAIN = 1e-6  # a start as large as this is not hidden by rounding and what Newton's iteration leaves
WIDER, ALIKE = 10.0, 0.02  # times a smaller one, whose growth it has but for this share, if a start is what grew
SAME_END = 2.0  # steps between the ends of two runs that break off for the same reason
STAGES = 10.0  # times as far as states, at most, the stages of a step reach
RANDOM = 2  # starts at random, beside the one that is predicted to grow most
BELOW = (0.3, 0.6, 0.85)  # of the predicted limit: steps that are to be safe, tried too
LONGEST = 20.0  # that measuring may take [s]
NEVER = (10.0, 100.0)  # steps over 1 / ||J|| that are run where none is predicted to fail
WIDEN, DEEPEN = 12, 40  # times 1.3 up and down, to find both ends of a bracket


class Runs:
    """Real runs of a frozen model by one method at fixed steps; growth of the difference of two runs.

    form : the energy norm; worst : float64[r]  a start in its coordinates, tried beside two at random
    small : greatest deviation at the start, in units of what counts as a small one; if None, and `a` is the derivative
    of the rates, the one whose rates are nearest to a times it at the start and when it has grown to the threshold
    """

    def __init__(self, at: Frozen, method: str, form: EnergyForm, worst=None, steps: int = STEPS,
                 threshold: float = THRESHOLD, small: float | None = None, a=None) -> None:  # fmt: skip
        self.at, self.method, self.form, self.tried = at, method, form, 0.0
        self.states = at.model.y_size
        self.steps, self.threshold = steps, threshold
        rng = np.random.default_rng(7)
        starts = [*([] if worst is None else [worst]), *rng.standard_normal((RANDOM, form.size))]
        shapes = [self.shaped(start) for start in starts]
        self.starts = [(y, small or self.linear_width(y, a)) for y in shapes]
        self.looks = looked_at(self.steps)
        self.strides = np.diff([0, *self.looks]).astype(float)
        self.still = not np.any(at.rate)
        self.structure = at.model.structure
        self.latest = time.monotonic() + LONGEST

    def shaped(self, start: np.ndarray) -> np.ndarray:
        """A start in the energy norm as a deviation of the states, the greatest of which counts as just small."""
        y = self.form.back @ start
        return y / np.max(np.abs(y) / self.at.model.scale)

    def linear_width(self, y: np.ndarray, a) -> float:
        """How large the deviation may be, to stay linear until it has grown, and to stand out from round-off.

        Grown, it may have any shape, and all its energy in one state; stages of a step reach further still.
        """
        base, rng = self.at.rate, np.random.default_rng(11)
        grown = self.at.model.scale * rng.choice([-1.0, 1.0], y.size)
        reach = STAGES * self.threshold * np.sqrt(y.size)

        def apart(z: np.ndarray, width: float) -> float:
            change = self.at.model.rhs(self.at.t, self.at.y + width * z) - base
            slope = a @ z
            return float(np.max(np.abs(change / width - slope))) / (np.max(np.abs(slope)) or 1.0)

        return float(min(SMALL, key=lambda width: max(apart(y, width), apart(grown, reach * width))))

    def loop(self, y: np.ndarray, h: float) -> Loop:
        """A run from a state, at a fixed step."""
        model = self.at.model
        changes = {"method": self.method, "step": h, "courant": None, "rtol": None}
        numerics = model.case.numerics.model_copy(update=changes)
        made = Loop(replace(model, case=replace(model.case, numerics=numerics)), lambda: self.structure)
        made.now[:], made.armed[:] = y, self.at.armed
        made.memory[slots.T] = self.at.t
        made.begin(self.at.t + 2.0 * self.steps * h, NO_LIMIT)
        return made

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth over all starts, after how many steps); a run that breaks off: infinite.

        A wider start that grows alike says that the start grew, and not the rounding of the runs or what Newton's
        iteration leaves, which are as large as before: else the wider one counts, and so on.
        """
        size, at, still = 1.0, 0, self.standing(h)
        for start, width in self.starts:
            here, n = self.grown(width * start, h, still)
            while here > self.threshold and width < CERTAIN:
                width, before, after = WIDER * width, here, n
                here, n = self.grown(width * start, h, still)
                if n == after and (here == before or abs(here - before) <= ALIKE * before):
                    break
            if here > size:
                size, at = here, n
            if size > self.threshold:
                break
        return size, at

    def standing(self, h: float) -> Callable[[int], np.ndarray | None]:
        """k -> the state from which deviations are counted at the k-th look; None where a run from it breaks off."""
        run, known = None if self.still else self.loop(self.at.y, h), []

        def state(k: int) -> np.ndarray | None:
            while run and len(known) <= k:
                known.append(run.now.copy() if run.run(self.strides[len(known)]) == slots.CHUNK else None)
            return known[k] if run else self.at.y

        return state

    def grown(self, start: np.ndarray, h: float, still: Callable) -> tuple[float, int]:
        """(greatest growth of one start, after how many steps), as soon as it passes the threshold."""
        size, at, run = 1.0, 0, self.loop(self.at.y + start, h)
        first = np.linalg.norm(self.form.forth @ start)
        for k, n in enumerate(self.looks):
            if time.monotonic() > self.latest:
                raise TimeoutError
            base = still(k)
            if base is None or run.run(self.strides[k]) != slots.CHUNK:
                return (size, at) if self.end_of_state(h) <= n * h else (np.inf, n)
            here = float(np.linalg.norm(self.form.forth @ (run.now - base))) / first
            if not here <= self.threshold:
                return here if here > self.threshold else np.inf, n
            if here > size:
                size, at = here, n
        return size, at

    def end_of_state(self, h: float) -> float:
        """Time [s] after which a run from the state itself breaks off, with this step as with half of it; else inf.

        It is the scene that ends there, a piston at the end of its cylinder, and no step that fails.
        """
        ends = [self.broken_off(self.loop(self.at.y, step), self.steps * h / step) for step in (h, 0.5 * h)]
        return min(ends) if abs(ends[0] - ends[1]) <= SAME_END * h else np.inf

    def broken_off(self, run: Loop, steps: float) -> float:
        """Time [s] after which a run breaks off within so many steps; inf where it does not."""
        return np.inf if run.run(steps) in (slots.CHUNK, slots.DONE) else run.t - self.at.t

    def fails(self, h: float) -> bool:
        """Whether some run grows beyond the threshold."""
        self.tried = max(self.tried, h)
        return self.growth(h)[0] > self.threshold

    def limit(self, guess: float) -> Limit:
        """The greatest safe step by bisection around a guess, once smaller ones are known to be safe."""
        for part in BELOW:
            if self.fails(part * guess):
                return self.below(part * guess)
        high = guess
        for _ in range(WIDEN):
            if self.fails(high * 1.03):
                return halved(self.fails, high / RISE if self.safe(high / RISE) else BELOW[-1] * guess, high * 1.03)
            high *= RISE
        return Limit(np.inf, np.inf)

    def safe(self, h: float) -> bool:
        """Whether no run fails."""
        return not self.fails(h)

    def below(self, high: float) -> Limit:
        """The limit below a step that fails; nan where none is found."""
        for _ in range(DEEPEN):
            if self.safe(high / RISE):
                return halved(self.fails, high / RISE, high)
            high /= RISE
        return Limit(np.nan, high)


def measure(runs: Runs, guess: float, size: float, left_out: dict[str, str], what: str = "measured") -> dict:
    """The measured limit around a guess; where it is not found in time, why, in `left_out`."""
    try:
        return measured(runs, guess, size)
    except TimeoutError:
        left_out[what] = too_long(runs)
        return {}


def too_long(runs: Runs) -> str:
    """Why there is no limit of these runs."""
    return f"real runs of {runs.states} states take longer than {LONGEST:g} s"


def measured(runs: Runs, guess: float, size: float) -> dict:
    """The measured limit around a guess; where none is predicted, two long steps that are to be safe."""
    if np.isfinite(guess) and guess > 0.0:
        found = runs.limit(guess)
        return {"measured": found.step, "measured_up_to": found.fails if np.isfinite(found.fails) else runs.tried}
    if guess == 0.0 or size == 0.0:
        return {}
    passed = 0.0
    try:
        for factor in NEVER:
            if runs.fails(factor / size):
                return {"measured": runs.below(factor / size).step, "measured_up_to": factor / size}
            passed = factor / size
    except TimeoutError:
        if passed == 0.0:
            raise
    return {"measured": np.inf, "measured_up_to": passed}
