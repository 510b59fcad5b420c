"""Growth of small deviations in real runs of the compiled program, and the measured limit of the step."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from fvsolve.core.model.energy_norm import EnergyForm
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.core.step_limits.greatest_step import STEP_RATIO, StepLimit, bisect, step_below
from fvsolve.core.steppers import loop_records
from fvsolve.studies.operating_point import OperatingPoint
from fvsolve.studies.stability.growth import STEPS, THRESHOLD, checked_powers

# greatest at the start, in units of the small deviation of states
SMALL_DEVIATIONS = 10.0 ** -np.arange(6.0, 16.0)
# a deviation of this size at the start is above round-off and Newton residuals
CLEAR_DEVIATION = 1e-6
DEVIATION_RATIO = 10.0  # ratio of a larger start to a smaller one
GROWTH_AGREEMENT = 0.02  # relative difference of growth up to which both starts agree
# greatest number of steps between the ends of two runs that stop for the same reason
END_TOLERANCE = 2.0
STAGE_REACH = 10.0  # greatest deviation of stages of a step over that of states
RANDOM_STARTS = 2  # random starts, besides the start with the greatest predicted growth
SAFE_PARTS = (0.3, 0.6, 0.85)  # of the predicted limit: steps that are checked to be safe
TIME_LIMIT = 20.0  # time limit of a measured limit [s]
UNLIMITED_STEPS = (10.0, 100.0)  # steps over 1 / ||J|| that are run if no step is predicted to fail
# greatest number of factors 1.3 up and down in the search for a bracket
MAX_WIDENINGS, MAX_REDUCTIONS = 12, 40


class RealRuns:
    """Pairs of real runs about an operating point with fixed steps, to measure how the difference of the runs grows.

    at : operating point; steps : number of steps of a run; threshold : growth above which a step fails
    form : energy norm; worst : float64[r]  start deviation in coordinates of the norm, in addition to two random starts
    small : greatest deviation at the start, in units of the small deviation of states; default: the size at which the
    rates are closest to linear, both at the start and after growth to the threshold
    a : float64[n, n]  Jacobian of the rates, for this default
    """

    def __init__(
        self,
        at: OperatingPoint,
        method: str,
        form: EnergyForm,
        worst=None,
        steps: int = STEPS,
        threshold: float = THRESHOLD,
        small: float | None = None,
        a=None,
    ) -> None:
        self.at, self.method, self.form = at, method, form
        self.prepare(at.model.y_size, steps, threshold)
        rng = np.random.default_rng(7)
        starts = [
            *([] if worst is None else [worst]),
            *rng.standard_normal((RANDOM_STARTS, form.size)),
        ]
        deviations = [form.back @ start for start in starts]
        # the greatest entry of each equals the small deviation of that state
        deviations = [y / np.max(np.abs(y) / at.model.scale) for y in deviations]
        self.starts = [(y, small or self.linear_width(y, a)) for y in deviations]
        self.at_rest = not np.any(at.rate)
        self.structure = at.model.structure

    def prepare(self, states: int, steps: int, threshold: float) -> None:
        """Set the fields that all kinds of runs have; states : number of states, for messages."""
        self.states, self.steps, self.threshold, self.longest_tried = states, steps, threshold, 0.0
        self.check_steps = checked_powers(steps)
        self.strides = np.diff([0, *self.check_steps]).astype(float)
        self.latest = time.monotonic() + TIME_LIMIT

    def linear_width(self, y: np.ndarray, a) -> float:
        """Factor on the start deviation y for which growth remains linear up to the threshold and is above round-off.

        a : float64[n, n]  Jacobian. A grown deviation may have all its energy in one state, and the stages of a step
        may exceed it; the factor allows for both.
        """
        base, rng = self.at.rate, np.random.default_rng(11)
        grown = self.at.model.scale * rng.choice([-1.0, 1.0], y.size)
        reach = STAGE_REACH * self.threshold * np.sqrt(y.size)

        def nonlinearity(z: np.ndarray, width: float) -> float:
            change = self.at.model.evaluate(self.at.t, self.at.y + width * z)[0] - base
            slope = a @ z
            return float(np.max(np.abs(change / width - slope))) / (np.max(np.abs(slope)) or 1.0)

        return float(
            min(
                SMALL_DEVIATIONS,
                key=lambda width: max(nonlinearity(y, width), nonlinearity(grown, reach * width)),
            )
        )

    def loop(self, y: np.ndarray, h: float) -> RunLoop:
        """Run loop that starts from the state y with fixed steps of h [s]."""
        loop = fixed_step_loop(self.at.model, lambda: self.structure, self.method, h, self.at.t)
        loop.now[:], loop.armed[:] = (
            y,
            self.at.model.flags if self.at.armed is None else self.at.armed,
        )
        loop.begin(self.at.t + 2.0 * self.steps * h, NO_LIMIT)
        return loop

    def growth(self, h: float) -> tuple[float, int]:
        """(greatest growth of a deviation with steps of h [s], number of steps after which it is reached).

        The growth is infinite if a run stops because of the step. If the growth exceeds the threshold, the run is
        repeated with a larger deviation at the start, unless this is 1e-6 of a small deviation or more. If both growths
        agree, the deviation itself has grown. Otherwise round-off or Newton residuals have grown, whose size does not
        depend on the start; then the larger deviation is used, and the check is repeated. Raises TimeoutError at the
        time limit.
        """
        size = 1.0
        after = 0
        base_at = self.base_states(h)
        for start, width in self.starts:
            growth, n = self.growth_of_start(width * start, h, base_at)
            while growth > self.threshold and width < CLEAR_DEVIATION:
                width = DEVIATION_RATIO * width
                smaller = growth
                smaller_after = n
                growth, n = self.growth_of_start(width * start, h, base_at)
                if n == smaller_after and (
                    growth == smaller or abs(growth - smaller) <= GROWTH_AGREEMENT * smaller
                ):
                    break
            if growth > size:
                size, after = growth, n
            if size > self.threshold:
                break
        return size, after

    def base_states(self, h: float) -> Callable[[int], np.ndarray | None]:
        """Function of k that returns the state from which deviations are measured at check number k.

        It is the state of a run from the operating point with steps of h [s], or None if this run has stopped. At a
        steady state it is the operating point itself.
        """
        run, states = None if self.at_rest else self.loop(self.at.y, h), []

        def state(k: int) -> np.ndarray | None:
            while run and len(states) <= k:
                continues = run.run(self.strides[len(states)]) == loop_records.BUDGET_SPENT
                states.append(run.now.copy() if continues else None)
            return states[k] if run else self.at.y

        return state

    def growth_of_start(self, start: np.ndarray, h: float, base_at: Callable) -> tuple[float, int]:
        """(greatest growth of the deviation `start` with steps of h [s], number of steps after which it is reached).

        The run ends when the growth exceeds the threshold. The growth is infinite if a run stops because of the step.
        base_at : result of `base_states`. Raises TimeoutError at the time limit.
        """
        run, first = self.loop(self.at.y + start, h), np.linalg.norm(self.form.forward @ start)

        def growth(k: int) -> float:
            base = base_at(k)
            if base is None or run.run(self.strides[k]) != loop_records.BUDGET_SPENT:
                return -1.0 if self.state_end_time(h) <= self.check_steps[k] * h else np.inf
            return float(np.linalg.norm(self.form.forward @ (run.now - base))) / first

        return self.greatest(growth)

    def greatest(self, growth: Callable[[int], float]) -> tuple[float, int]:
        """(greatest growth at all checks, number of steps after which it is reached).

        growth : growth at check number k; inf if a run stops because of the step, -1 if the model ends there
        The checks end when the growth exceeds the threshold, or is not a number, which counts as infinite, and at the
        end of the model. Raises TimeoutError at the time limit.
        """
        size, after = 1.0, 0
        for k, n in enumerate(self.check_steps):
            if time.monotonic() > self.latest:
                raise TimeoutError
            now = growth(k)
            if not now <= self.threshold:
                return now if now > self.threshold else np.inf, n
            if now < 0.0:
                break
            if now > size:
                size, after = now, n
        return size, after

    def state_end_time(self, h: float) -> float:
        """Time [s] after which a run from the operating point itself stops; inf if that time depends on the step.

        If runs with the steps h and h / 2 stop at the same time, the model ends there (such as a piston at the end of
        its cylinder), and the step h has not failed.
        """
        ends = []
        for step in (h, 0.5 * h):
            run = self.loop(self.at.y, step)
            reached = run.run(self.steps * h / step) in (
                loop_records.BUDGET_SPENT,
                loop_records.DONE,
            )
            ends.append(np.inf if reached else run.t - self.at.t)
        return min(ends) if abs(ends[0] - ends[1]) <= END_TOLERANCE * h else np.inf

    def fails(self, h: float) -> bool:
        """True if the growth of a deviation with steps of h [s] exceeds the threshold."""
        self.longest_tried = max(self.longest_tried, h)
        return self.growth(h)[0] > self.threshold

    def limit(self, guess: float) -> StepLimit:
        """Greatest safe step by bisection around the step `guess` [s], after a check that smaller steps are safe.

        It is inf if no step fails up to about 20 times `guess`, and nan if no safe step is found.
        """
        for part in SAFE_PARTS:
            if self.fails(part * guess):
                return self.limit_below(part * guess)
        high = guess
        for _ in range(MAX_WIDENINGS):
            if self.fails(high * 1.03):
                low = SAFE_PARTS[-1] * guess if self.fails(high / STEP_RATIO) else high / STEP_RATIO
                return bisect(self.fails, low, high * 1.03)
            high *= STEP_RATIO
        return StepLimit(np.inf, np.inf)

    def limit_below(self, high: float) -> StepLimit:
        """Limit of the step below a step `high` [s] that fails; nan if no safe step is found."""
        found = step_below(self.fails, high, shorter_steps(high))
        return found if found.step else StepLimit(np.nan, found.fails)

    def columns(self, guess: float, size: float) -> dict[str, float]:
        """Columns of a stability row: limit of real runs, `measured` [s], and a step above it, `measured_up_to` [s].

        `measured_up_to` is a step with which runs fail, or the longest tested step if none fails.
        guess : predicted limit [s]; if it is infinite, runs with two long steps are made
        size : norm of the Jacobian [1/s]. The result is empty if `guess` is 0, or if `guess` is infinite and `size` is
        0. Raises TimeoutError at the time limit.
        """
        if np.isfinite(guess) and guess > 0.0:
            return self.limit_columns(guess)
        if guess == 0.0 or size == 0.0:
            return {}
        passed = 0.0
        try:
            for factor in UNLIMITED_STEPS:
                if self.fails(factor / size):
                    return {
                        "measured": self.limit_below(factor / size).step,
                        "measured_up_to": factor / size,
                    }
                passed = factor / size
        except TimeoutError:
            if passed == 0.0:
                raise
        return {"measured": np.inf, "measured_up_to": passed}

    def limit_columns(self, guess: float) -> dict[str, float]:
        """Columns of `columns` with the limit that is found around a step `guess` [s]."""
        limit = self.limit(guess)
        fails = limit.fails if np.isfinite(limit.fails) else self.longest_tried
        return {"measured": limit.step, "measured_up_to": fails}


def shorter_steps(h: float) -> Iterator[float]:
    """Yield 40 steps below a step h [s], each shorter than the one before by the factor 1.3."""
    for _ in range(MAX_REDUCTIONS):
        h /= STEP_RATIO
        yield h


def measure_limit(
    runs: RealRuns, guess: float, size: float, left_out: dict[str, str], quantity: str = "measured"
) -> dict:
    """Columns of a stability row with the limit of real runs, see `RealRuns.columns`; empty if not found in time.

    quantity : name under which `left_out` then receives the reason
    """
    try:
        return runs.columns(guess, size)
    except TimeoutError:
        left_out[quantity] = f"real runs of {runs.states} states take longer than {TIME_LIMIT:g} s"
        return {}


def fixed_step_loop(model, structure: Callable, method: str, h: float, t: float) -> RunLoop:
    """Run loop with fixed steps of h [s] from the time t [s]; structure : function that returns the `Structure`.

    No step is divided, because the runs show at which step a method fails.
    """
    changes = {"method": method, "step": h, "courant": None, "rtol": None}
    numerics = model.case.numerics.model_copy(update=changes)
    loop = RunLoop(replace(model, case=replace(model.case, numerics=numerics)), structure)
    loop.state["t"], loop.control["dividing_rate"] = t, 0.0
    return loop
