"""Step doubling: occasional repetition of a given step as two half steps, to estimate the error of the run.

A step that is too long need not be unstable: the nonlinear law of a valve bounds the growth, so that vessels oscillate
between two wrong pressures, and implicit methods are stable at any step. Let e be the difference between the state
after a step and the state after two half steps, and r the fraction of an error that remains after one more step. The
errors of n steps add up to e (1 - r^n) / (1 - r). For a draining vessel r is near 1 and all errors remain; with a small
r only the last errors remain.
"""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels.delay_lines.wave_history import CORRECTED_TIME
from fvsolve.step_limits.forcing_ranges import state_ranges, states_outside_cells
from fvsolve.step_limits.step_notices import DOUBTFUL, WRONG
from fvsolve.steppers import automatic
from fvsolve.steppers.integrator import Integrator
from fvsolve.steppers.tableau import method_named

EXPLICIT_CHECKS, IMPLICIT_CHECKS = 32, 16  # number of checks in a run of explicit steps, of implicit steps
# Least number of explicit steps between two checks, which costs a twentieth; least number of checks in short runs.
STEPS_BETWEEN_CHECKS, FEWEST_CHECKS = 50.0, 8
LEAST_RANGE = 0.1  # least range of a state, in units of its small deviation
FULL_STEP = 0.99  # fraction of a full step: steps that an event or a kink has shortened are not checked
ROUNDING = 1e-10  # relative to ranges: a smaller error is too small to measure r


class StepDoubling:
    """Estimate of the error of a run with steps of given length.

    It checks states outside cells under an explicit method, where the Courant limit bounds the errors of cells, and all
    states under an implicit method; states of delay lines are left out. Without such states or without a given step
    there is no check.

    restart_data : float64[4 + 5 k]  number of checks, step count of the next check, step count of the last check,
    fraction r of an error that a step leaves; then five arrays over the k checked states: error of the last checked
    step, accumulated error, sum of the accumulated errors over the checks, least value, greatest value
    """

    def __init__(self, run_data) -> None:
        model, self.step = run_data.model, float(run_data.clock["step"])
        numerics = model.case.numerics
        method = method_named(automatic.first_method(numerics.method))
        lines = model.tables.pipes["y"][model.tables.pipes["delay"] >= 0]  # their states do not affect other states
        states = states_outside_cells(model) if method.explicit else np.setdiff1d(np.arange(model.y_size), lines)
        self.model, self.states = model, states[: None if self.step > 0.0 else 0]
        self.restart_data = np.zeros(4 + 5 * self.states.size)
        self.error, self.accumulated_error, self.sums, self.least, self.greatest = self.restart_data[4:].reshape(5, -1)
        self.least[:] = self.greatest[:] = model.start[self.states]
        self.restart_data[3], self.stepper, self.implicit = 1.0, None, not method.explicit
        if self.states.size:
            steps = (numerics.end - numerics.start) / self.step
            self.interval = max(1.0, steps // IMPLICIT_CHECKS)
            if method.explicit:
                self.interval = max(1.0, steps // EXPLICIT_CHECKS, min(STEPS_BETWEEN_CHECKS, steps // FEWEST_CHECKS))
            self.restart_data[1], self.small = self.interval, state_ranges(model, LEAST_RANGE)[self.states]

    def begin(self, steps: float) -> None:
        """Order a check of the first step of a segment if the method is implicit.

        An implicit method stays stable there, however great the change at the start of the segment.
        steps : number of steps at the start of the segment
        """
        if self.states.size and self.implicit:
            self.restart_data[1] = steps + 1.0

    def steps_left(self, steps: float) -> float:
        """Number of steps until the next check; steps : number of steps taken so far."""
        return max(1.0, self.restart_data[1] - steps) if self.states.size else np.inf

    def check(self, loop) -> None:
        """Repeat the last step as two half steps if a check is due; `loop` is a `RunLoop` at an accepted state."""
        memory = loop.state
        steps, h = memory["steps"], memory["last"]
        if not self.states.size or steps < self.restart_data[1]:
            return
        self.restart_data[1] = steps + 1.0  # check the next step if this step cannot be checked
        end = loop.control["end"]
        full_step = self.step if loop.t < end else min(self.step, end - memory["t_mark"])
        if h < FULL_STEP * full_step or corrected_store(loop):
            return
        before, now = loop.before[self.states], loop.now[self.states]
        t = loop.t - h
        middle = self.single_step(loop, t, loop.before, 0.5 * h, first=True)
        half_steps = self.single_step(loop, t + 0.5 * h, middle, 0.5 * h)
        if not np.all(np.isfinite(half_steps)):  # the half steps cannot be computed
            return
        for state in (before, now):
            np.fmin(self.least, state, out=self.least)
            np.fmax(self.greatest, state, out=self.greatest)
        with np.errstate(over="ignore", invalid="ignore"):  # states that grow may overflow
            self.accumulate(loop, h, steps - self.restart_data[2], half_steps - loop.now)
        self.restart_data[:3] = self.restart_data[0] + 1.0, steps + self.interval, steps

    def accumulate(self, loop, h: float, steps: float, error: np.ndarray) -> None:
        """Add the errors of the steps since the last check to the accumulated errors.

        loop : the `RunLoop`; h : length of the last step [s]; steps : number of steps since the last check
        error : float64[n]  error of the last step
        For each step between the two checks, the lesser of the errors at this check and at the last check is added.
        """
        widths, own = self.widths(), np.abs(error[self.states])
        size = float(np.linalg.norm(own / widths))
        if size > ROUNDING:
            moved = self.single_step(loop, loop.t - h, loop.before + error, h) - loop.now
            remaining = float(np.linalg.norm(moved[self.states] / widths)) / size
            self.restart_data[3] = remaining if remaining < 1.0 else 1.0
        remaining = self.restart_data[3]
        power = remaining ** (steps - 1.0)
        sum_of_powers = steps - 1.0 if remaining > 1.0 - ROUNDING else (1.0 - power) / (1.0 - remaining)
        self.accumulated_error[:] = (
            remaining * (power * self.accumulated_error + sum_of_powers * np.fmin(own, self.error)) + own
        )
        self.error[:] = own
        self.sums += self.accumulated_error

    def single_step(self, loop, t: float, y: np.ndarray, h: float, first=False) -> np.ndarray:
        """State after one step of length h [s] from state y at time t [s], with the method of the run.

        loop : the `RunLoop`; first : True to discard the stored Jacobian, for the first step from a new state
        """
        if self.stepper is None:
            model = self.model
            self.stepper = Integrator(
                loop.stepper.method,
                model.y_size,
                model.ledgers,
                lambda: model.structure,
                model.scale.copy(),
                model.damped,
            )
            self.stepper.out = model.new_out()
        if first:
            self.stepper.discard_history()
        self.stepper.control[0] = loop.control
        return self.stepper.single_step(loop.rhs, loop.run_data.handle, int(self.model.layout["supply"]), t, h, y)

    def widths(self) -> np.ndarray:
        """Greatest minus least value so far of each checked state, at least its `state_ranges` with the share 0.1."""
        return np.maximum(self.greatest - self.least, self.small)

    def worst(self) -> tuple[str, float]:
        """Name of the state with the greatest error, without its cell, and its mean error over the range of the state.

        The result is ("", 0) before the first check.
        """
        if not self.restart_data[0]:
            return "", 0.0
        share = self.sums / self.restart_data[0] / self.widths()
        share[np.isnan(share)] = np.inf
        at = int(np.argmax(share))
        return self.model.state_names[self.states[at]].partition("[")[0], float(share[at])

    def notice(self) -> Notice | None:
        """Notice at the end of a run if the mean error is 0.5 % or more of the range of a state, otherwise None."""
        place, share = self.worst()
        if not DOUBTFUL <= share < np.inf:  # a state that is not finite has stopped the run
            return None
        ok = share < WRONG
        verdict = "the results may be wrong" if ok else "the numbers are not to be trusted"
        steps = self.model.case.step_amount(self.step)
        text = (f"{place}: steps of {steps} give a mean error of about {100 * share:.2g} % of its range, by "
                f"comparison with two half steps; {verdict}; halve the step")  # fmt: skip
        key = "step" if self.model.case.numerics.step is not None else "courant"
        return Notice("step-error", place, text, key, share, WRONG, ok)


def corrected_store(loop) -> bool:
    """True if the present state of the loop is marked as corrected for a jump in a delay line within the last step.

    A correction changes masses of storing nodes and flows of rigid columns. Half steps have no such correction, so such
    a step is not checked. The mark is removed when the corrected state is recorded again.
    """
    past = loop.run_data.past
    return past.size > 0 and past[CORRECTED_TIME] == loop.t
