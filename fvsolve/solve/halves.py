"""A given step of a run taken again as two halves, now and then: what its errors amount to. Knows no kind of method.

A step that is too long need not grow: a valve bends what swings about its drop, so that vessels go to and fro between
two wrong pressures for ever, and implicit methods bear any step. Seen from where it was, such a step does not end where
two halves of it do, by e. What e of n steps amount to hangs on how much of an error a step leaves, r: of a vessel that
drains r is near one, and all remain; where r is small each step makes its own, e (1 - r^n) / (1 - r).
"""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels.delay.history import MENDED
from fvsolve.limits.drives import lumped, spreads
from fvsolve.limits.step import DOUBTFUL, WRONG
from fvsolve.steppers import automatic, slots
from fvsolve.steppers.stepper import Stepper
from fvsolve.steppers.tableau import method_named

LOOKS, DEAR = 32, 16  # in a run of explicit steps, of implicit ones; of explicit ones
SELDOM, FEWEST = 50.0, 8  # no look sooner than after so many, which costs a twentieth, but in short runs
LEAST = 0.1  # of what counts as small: a range that is less is none
WHOLE = 0.99  # of a step: what an event or a kink has cut says nothing
ROUNDING = 1e-10  # of ranges: an error that is less does not show what a step leaves of it


class Halves:
    """States looked at over a run of given steps: all of implicit methods, of explicit ones what no cell holds.

    Nothing where there is none or no such step. Of cells a Courant number says how long an explicit step may be.

    kept : float64[4 + 5 k]  looks, the step count from which on the next is due, that of the last, what a step leaves
    of an error; of each state the error of the last step seen, what all amount to, the sum of that over the looks,
    its least and its greatest: what a resumed run needs
    """

    def __init__(self, run_data) -> None:
        model, self.step = run_data.model, float(run_data.clock["step"])
        numerics = model.case.numerics
        method = method_named(automatic.first_method(numerics.method))
        lines = model.tables.pipes["y"][model.tables.pipes["delay"] >= 0]  # what they hold moves nothing
        states = lumped(model) if method.explicit else np.setdiff1d(np.arange(model.y_size), lines)
        self.model, self.which = model, states[: None if self.step > 0.0 else 0]
        self.kept = np.zeros(4 + 5 * self.which.size)
        self.error, self.astray, self.sums, self.least, self.greatest = self.kept[4:].reshape(5, -1)
        self.least[:] = self.greatest[:] = model.start[self.which]
        self.kept[3], self.stepper, self.dear = 1.0, None, not method.explicit
        if self.which.size:
            steps = (numerics.end - numerics.start) / self.step
            self.every = max(1.0, steps // DEAR)
            if method.explicit:
                self.every = max(1.0, steps // LOOKS, min(SELDOM, steps // FEWEST))
            self.kept[1], self.small = self.every, spreads(model, LEAST)[self.which]

    def begin(self, steps: float) -> None:
        """Look at the first step of a segment, within which a store may fill: implicit methods pass it anyway."""
        if self.which.size and self.dear:
            self.kept[1] = steps + 1.0

    def room(self, steps: float) -> float:
        """Steps that may be taken before the next look."""
        return max(1.0, self.kept[1] - steps) if self.which.size else np.inf

    def look(self, loop) -> None:
        """At an accepted state, if it is time: take the last step again."""
        memory = loop.memory
        steps, h = memory[slots.STEPS], memory[slots.LAST]
        if not self.which.size or steps < self.kept[1]:
            return
        self.kept[1] = steps + 1.0  # the next one, if this says nothing
        end = loop.orders[slots.END]
        full_step = self.step if loop.t < end else min(self.step, end - memory[slots.T_MARK])
        if h < WHOLE * full_step or mended(loop):
            return
        before, now = loop.before[self.which], loop.now[self.which]
        t = loop.t - h
        middle = self.stepped(loop, t, loop.before, 0.5 * h, fresh=True)
        half_steps = self.stepped(loop, t + 0.5 * h, middle, 0.5 * h)
        if not np.all(np.isfinite(half_steps)):  # such a step is not to be had
            return
        for state in (before, now):
            np.fmin(self.least, state, out=self.least)
            np.fmax(self.greatest, state, out=self.greatest)
        with np.errstate(over="ignore", invalid="ignore"):  # of what grows beyond all numbers
            self.gather(loop, h, steps - self.kept[2], half_steps - loop.now)
        self.kept[:3] = self.kept[0] + 1.0, steps + self.every, steps

    def gather(self, loop, h: float, steps: float, error: np.ndarray) -> None:
        """Add what so many steps have done, the last of them by `error`, those before by no more than the last seen."""
        widths, own = self.widths(), np.abs(error[self.which])
        size = float(np.linalg.norm(own / widths))
        if size > ROUNDING:
            moved = self.stepped(loop, loop.t - h, loop.before + error, h) - loop.now
            remaining = float(np.linalg.norm(moved[self.which] / widths)) / size
            self.kept[3] = remaining if remaining < 1.0 else 1.0
        remaining = self.kept[3]
        power = remaining ** (steps - 1.0)
        sum_of_powers = steps - 1.0 if remaining > 1.0 - ROUNDING else (1.0 - power) / (1.0 - remaining)
        self.astray[:] = remaining * (power * self.astray + sum_of_powers * np.fmin(own, self.error)) + own
        self.error[:] = own
        self.sums += self.astray

    def stepped(self, loop, t: float, y: np.ndarray, h: float, first=False) -> np.ndarray:
        """One step of the run's method from a state, as devices stand now; `fresh` for the first at a place."""
        if self.stepper is None:
            model = self.model
            self.stepper = Stepper(
                loop.stepper.method,
                model.y_size,
                model.ledgers,
                lambda: model.structure,
                model.scale.copy(),
                model.damped,
            )
            self.stepper.out = model.new_out()
        if first:
            self.stepper.forget()
        self.stepper.orders[:] = loop.orders
        return self.stepper.once(loop.rhs, loop.slate.handle, int(self.model.layout["supply"]), t, h, y)

    def widths(self) -> np.ndarray:
        """Ranges of the states so far."""
        return np.maximum(self.greatest - self.least, self.small)

    def worst(self) -> tuple[str, float]:
        """(place, share of its range by which it is astray on average), of the state that is most."""
        if not self.kept[0]:
            return "", 0.0
        share = self.sums / self.kept[0] / self.widths()
        share[np.isnan(share)] = np.inf
        at = int(np.argmax(share))
        return self.model.state_names[self.which[at]].partition("[")[0], float(share[at])

    def notice(self) -> Notice | None:
        """What is to be said of a run that ended."""
        place, share = self.worst()
        if not DOUBTFUL <= share < np.inf:  # what is not finite has stopped the run
            return None
        ok = share < WRONG
        verdict = "it may be wrong" if ok else "the numbers are not to be trusted"
        steps = self.model.case.step_amount(self.step)
        text = (f"{place}: steps of {steps} leave it about {100 * share:.2g} % of its range astray, on "
                f"average, by where two halves of them end; {verdict}; halve the step")  # fmt: skip
        key = "step" if self.model.case.numerics.step is not None else "courant"
        return Notice("step-error", place, text, key, share, WRONG, ok)


def mended(loop) -> bool:
    """Whether a store was given what a jump had brought within the last step, as halves of it are not."""
    past = loop.slate.past
    return past.size > 0 and past[MENDED] == loop.t
