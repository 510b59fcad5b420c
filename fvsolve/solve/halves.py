"""A fixed step of a run taken again as two halves, now and then: by how much it goes astray. Knows explicit methods.

Beyond its limit a step need not grow: a valve bends what swings about its drop, so that vessels go to and fro between
two wrong pressures for ever, as large as the step is long. Seen from where it was, such a step ends nowhere near where
two halves of it do.
"""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.limits.drives import lumped, spreads
from fvsolve.limits.step import DOUBTFUL, WRONG
from fvsolve.steppers import automatic
from fvsolve.steppers import orders as told
from fvsolve.steppers.tableau import method_named

LOOKS = 32  # in a run
LEAST = 0.1  # of what counts as small: a range that is less is none
WHOLE = 0.99  # of a step: what an event or a kink has cut says nothing


class Halves:
    """What no cell holds, looked at over a run of fixed explicit steps; nothing where there is none or no such step.

    kept : float64[2 + 3 k]  looks, the step count from which on the next is due; sums of what was astray, least and
    greatest of each state: what a resumed run needs
    """

    def __init__(self, model) -> None:
        numerics = model.case.numerics
        method = method_named(automatic.first_method(numerics.method))
        fixed = numerics.step is not None and method.explicit
        self.model, self.which = model, lumped(model) if fixed else np.zeros(0, dtype=np.int64)
        self.kept = np.zeros(2 + 3 * self.which.size)
        self.astray, self.least, self.greatest = self.kept[2:].reshape(3, -1)
        self.least[:] = self.greatest[:] = model.start[self.which]
        if self.which.size:
            self.a, self.b = method.a.astype(float), method.b.astype(float)
            self.step, self.out = numerics.step, model.new_out()
            self.every = max(1.0, (numerics.end - numerics.start) / numerics.step // LOOKS)
            self.kept[1] = self.every

    def room(self, steps: float) -> float:
        """Steps that may be taken before the next look."""
        return max(1.0, self.kept[1] - steps) if self.which.size else np.inf

    def look(self, loop) -> None:
        """At an accepted state, if it is time: take the last step again."""
        steps, h = loop.memory[told.STEPS], loop.memory[told.LAST]
        if not self.which.size or steps < self.kept[1]:
            return
        if h < WHOLE * self.step:  # the next one then
            self.kept[1] = steps + 1.0
            return
        before, now = loop.before, loop.now[self.which]
        y = before
        for part in range(2):
            y = self.stepped(loop.t - h + part * 0.5 * h, y, 0.5 * h)
        for end in (before[self.which], now):
            np.fmin(self.least, end, out=self.least)
            np.fmax(self.greatest, end, out=self.greatest)
        self.astray += np.abs(y[self.which] - now)
        self.kept[:2] = self.kept[0] + 1.0, steps + self.every

    def stepped(self, t: float, y: np.ndarray, h: float) -> np.ndarray:
        """One step of the method by the compiled rates, as devices stand now."""
        k = np.zeros((self.b.size, y.size))
        for i, row in enumerate(self.a):
            self.model.functions.rhs(t + h * row.sum(), y + h * (row @ k), k[i], self.out, self.model.handle)
        return y + h * (self.b @ k)

    def worst(self) -> tuple[str, float]:
        """(state, share of its range by which it went astray on average), of the one that did most."""
        if not self.kept[0]:
            return "", 0.0
        widths = np.maximum(self.greatest - self.least, spreads(self.model, LEAST)[self.which])
        share = self.astray / self.kept[0] / widths
        share[np.isnan(share)] = np.inf
        at = int(np.argmax(share))
        return self.model.state_names[self.which[at]], float(share[at])

    def notice(self) -> Notice | None:
        """What is to be said of a run that ended."""
        place, share = self.worst()
        if not DOUBTFUL <= share < np.inf:  # what is not finite has stopped the run
            return None
        ok = share < WRONG
        said = "it may be wrong" if ok else "the numbers are not to be trusted"
        text = (f"{place}: steps of {self.step:.6g} s end {100 * share:.2g} % of its range from where two halves "
                f"do, on average; {said}; halve the step")  # fmt: skip
        return Notice("step-error", place, text, "step", share, WRONG, ok)
