"""Growth of small deviations in real runs of the compiled program, and the measured limit of the step."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fvsolve.model.energy_norm import EnergyForm
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.steppers import loop_indices
from fvsolve.studies.linear.frozen import Frozen
from fvsolve.studies.stability.bracket import RISE, Limit, halved
from fvsolve.studies.stability.growth import STEPS, THRESHOLD, looked_at

SMALL = 10.0 ** -np.arange(6.0, 16.0)  # greatest deviation at the start, in units of the small deviation of states
CERTAIN = 1e-6  # a deviation of this size at the start is above round-off and Newton residuals
WIDER, ALIKE = 10.0, 0.02  # ratio of a larger start; relative difference of growth up to which both starts agree
SAME_END = 2.0  # greatest number of steps between the ends of two runs that stop for the same reason
STAGES = 10.0  # greatest deviation of stages of a step over that of states
RANDOM = 2  # random starts, besides the start with the greatest predicted growth
BELOW = (0.3, 0.6, 0.85)  # of the predicted limit: steps that are checked to be safe
LONGEST = 20.0  # time limit of a measured limit [s]
NEVER = (10.0, 100.0)  # steps over 1 / ||J|| that are run if no step is predicted to fail
WIDEN, DEEPEN = 12, 40  # greatest number of factors 1.3 upwards and downwards in the search for a bracket


class Runs:
    """Real runs about an operating point by one method with fixed steps; growth of the difference of two runs.

    form : energy norm; worst : float64[r]  a start in its coordinates, used besides two random starts
    small : greatest deviation at the start, in units of the small deviation of states; if None, the size for which
    rates are most nearly `a` (their derivative) times the deviation, at the start and after growth to the threshold
    """

    def __init__(self, at: Frozen, method: str, form: EnergyForm, worst=None, steps: int = STEPS,
                 threshold: float = THRESHOLD, small: float | None = None, a=None) -> None:  # fmt: skip
        self.at, self.method, self.form, self.tried = at, method, form, 0.0
        self.states = at.model.y_size
        self.steps, self.threshold = steps, threshold
        rng = np.random.default_rng(7)
        starts = [*([] if worst is None else [worst]), *rng.standard_normal((RANDOM, form.size))]
        deviations = [self.shaped(start) for start in starts]
        self.starts = [(y, small or self.linear_width(y, a)) for y in deviations]
        self.looks = looked_at(self.steps)
        self.strides = np.diff([0, *self.looks]).astype(float)
        self.still = not np.any(at.rate)
        self.structure = at.model.structure
        self.latest = time.monotonic() + LONGEST

    def shaped(self, start: np.ndarray) -> np.ndarray:
        """Start in coordinates of the energy norm as a deviation of states; the greatest equals its small deviation."""
        y = self.form.back @ start
        return y / np.max(np.abs(y) / self.at.model.scale)

    def linear_width(self, y: np.ndarray, a) -> float:
        """Size of the start deviation for which growth remains linear up to the threshold and is above round-off.

        After growth the deviation may have any shape, with all its energy in one state; stages of a step exceed it.
        """
        base, rng = self.at.rate, np.random.default_rng(11)
        grown = self.at.model.scale * rng.choice([-1.0, 1.0], y.size)
        reach = STAGES * self.threshold * np.sqrt(y.size)

        def nonlinearity(z: np.ndarray, width: float) -> float:
            change = self.at.model.rhs(self.at.t, self.at.y + width * z) - base
            slope = a @ z
            return float(np.max(np.abs(change / width - slope))) / (np.max(np.abs(slope)) or 1.0)

        return float(min(SMALL, key=lambda width: max(nonlinearity(y, width), nonlinearity(grown, reach * width))))

    def loop(self, y: np.ndarray, h: float) -> RunLoop:
        """Run from the state y with fixed steps of h [s]."""
        model = self.at.model
        changes = {"method": self.method, "step": h, "courant": None, "rtol": None}
        numerics = model.case.numerics.model_copy(update=changes)
        loop = RunLoop(replace(model, case=replace(model.case, numerics=numerics)), lambda: self.structure)
        loop.now[:], loop.armed[:] = y, self.at.armed
        loop.loop_state[loop_indices.T] = self.at.t
        loop.begin(self.at.t + 2.0 * self.steps * h, NO_LIMIT)
        return loop

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth over all starts, its number of steps); infinite for a run that stops.

        If growth exceeds the threshold, a larger start is run. If its growth agrees, the start has grown, and not
        round-off or Newton residuals, whose size does not depend on the start. Otherwise the larger start counts, and
        the check is repeated.
        """
        size, after, base_at = 1.0, 0, self.standing(h)
        for start, width in self.starts:
            growth, n = self.grown(width * start, h, base_at)
            while growth > self.threshold and width < CERTAIN:
                width, smaller, smaller_after = WIDER * width, growth, n
                growth, n = self.grown(width * start, h, base_at)
                if n == smaller_after and (growth == smaller or abs(growth - smaller) <= ALIKE * smaller):
                    break
            if growth > size:
                size, after = growth, n
            if size > self.threshold:
                break
        return size, after

    def standing(self, h: float) -> Callable[[int], np.ndarray | None]:
        """Function k -> state relative to which deviations are measured at check k; None if a run from it stops."""
        run, states = None if self.still else self.loop(self.at.y, h), []

        def state(k: int) -> np.ndarray | None:
            while run and len(states) <= k:
                states.append(
                    run.now.copy() if run.run(self.strides[len(states)]) == loop_indices.BUDGET_SPENT else None
                )
            return states[k] if run else self.at.y

        return state

    def grown(self, start: np.ndarray, h: float, base_at: Callable) -> tuple[float, int]:
        """(greatest growth of one start, its number of steps); stops above the threshold."""
        size, after, run = 1.0, 0, self.loop(self.at.y + start, h)
        first = np.linalg.norm(self.form.forward @ start)
        for k, n in enumerate(self.looks):
            if time.monotonic() > self.latest:
                raise TimeoutError
            base = base_at(k)
            if base is None or run.run(self.strides[k]) != loop_indices.BUDGET_SPENT:
                return (size, after) if self.end_of_state(h) <= n * h else (np.inf, n)
            growth = float(np.linalg.norm(self.form.forward @ (run.now - base))) / first
            if not growth <= self.threshold:
                return growth if growth > self.threshold else np.inf, n
            if growth > size:
                size, after = growth, n
        return size, after

    def end_of_state(self, h: float) -> float:
        """Time [s] after which a run from the state itself stops, equal for this step and for half of it; else inf.

        Then the model ends there (a piston at the end of its cylinder), and no step has failed.
        """
        ends = [self.broken_off(self.loop(self.at.y, step), self.steps * h / step) for step in (h, 0.5 * h)]
        return min(ends) if abs(ends[0] - ends[1]) <= SAME_END * h else np.inf

    def broken_off(self, run: RunLoop, steps: float) -> float:
        """Time [s] after which a run stops within a number of steps; inf if it does not."""
        return np.inf if run.run(steps) in (loop_indices.BUDGET_SPENT, loop_indices.DONE) else run.t - self.at.t

    def fails(self, h: float) -> bool:
        """True if the growth of a run exceeds the threshold."""
        self.tried = max(self.tried, h)
        return self.growth(h)[0] > self.threshold

    def limit(self, guess: float) -> Limit:
        """Greatest safe step by bisection around a guess, after a check that smaller steps are safe."""
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
        """True if no run fails."""
        return not self.fails(h)

    def below(self, high: float) -> Limit:
        """Limit below a step that fails; nan if none is found."""
        for _ in range(DEEPEN):
            if self.safe(high / RISE):
                return halved(self.fails, high / RISE, high)
            high /= RISE
        return Limit(np.nan, high)


def measure(runs: Runs, guess: float, size: float, left_out: dict[str, str], quantity: str = "measured") -> dict:
    """Measured limit around a guess; if it is not found in time, `left_out` gets the reason."""
    try:
        return measured(runs, guess, size)
    except TimeoutError:
        left_out[quantity] = too_long(runs)
        return {}


def too_long(runs: Runs) -> str:
    """Reason for a missing measured limit: real runs take too long."""
    return f"real runs of {runs.states} states take longer than {LONGEST:g} s"


def measured(runs: Runs, guess: float, size: float) -> dict:
    """Measured limit around a guess; if no step is predicted to fail, two long steps are run."""
    if np.isfinite(guess) and guess > 0.0:
        limit = runs.limit(guess)
        return {"measured": limit.step, "measured_up_to": limit.fails if np.isfinite(limit.fails) else runs.tried}
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
