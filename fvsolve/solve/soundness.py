"""Whether a run's numbers may be right: steps beyond a limit, growth, ledgers that do not close. Knows no files."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.limits.drives import drives
from fvsolve.limits.step import step_limits
from fvsolve.model.past import crowded
from fvsolve.solve.halves import Halves
from fvsolve.solve.unfelt import Unfelt

MOST = 1e6  # times what drives a scene: what is beyond has grown by itself
SURE = 10.0  # times the same, which waves that add up may come to: up to there a state is no sign of growth
OPEN = 1e-8  # of the largest term of a ledger: what does not close to that is wrong


class Soundness:
    """What is watched while a model runs: the pace of its basins, the size of its waves, the rise of water in modes.

    largest : float64[n]  what no state may exceed: MOST times the largest of the spread of the start, the range of what
    is given over time, and the jump that stopping the start's flows makes (Joukowsky)
    sound : time of the last state looked at that showed no growth [s]
    """

    def __init__(self, run_data) -> None:
        self.slate, self.model = run_data, run_data.model
        model = self.model
        self.moving = model.basins if model.case.numerics.step is not None else []
        self.rates: dict[str, float] = {}
        self.predicted = step_limits(model, run_data=run_data)
        self.halves = Halves(run_data)
        self.unfelt = Unfelt(model)
        self.largest = MOST * drives(model)
        self.grown: Notice | None = None
        self.sound = model.case.numerics.start

    @property
    def close(self) -> bool:
        """True if `look` has to be called every few steps: for more than growth, which the time loop looks for."""
        return bool(self.unfelt.tanks or (self.predicted and self.moving))

    @property
    def watched(self) -> np.ndarray:
        """`largest` where a limit is near, for the time loop; else nothing."""
        return np.array(np.broadcast_to(self.largest, self.model.y_size)) if self.predicted else np.zeros(0)

    def look(self, t: float, y: np.ndarray) -> str:
        """At a state: keep the pace of basins; why the run has to stop, or nothing."""
        for basin in self.moving:
            self.rates[basin.name] = max(self.rates.get(basin.name, 0.0), basin.pace(y)[0])
        if stops := self.unfelt.look(t, y):
            return stops
        ratio = np.abs(y) / self.largest
        if np.all(ratio <= SURE / MOST):
            self.sound = t
        if not np.any(ratio > 1.0):
            return ""
        worst = int(np.argmax(ratio))
        name, times = self.model.state_names[worst], MOST * float(ratio[worst])
        text = (f"{name} has grown to {times:.3g} times what drives it at t = "
                f"{self.model.case.amount(t, 'time', 6)}; the step is beyond the method's limit: halve it")  # fmt: skip
        self.grown = Notice(
            "growth", name.partition("[")[0], text, None, float(abs(y[worst])), float(self.largest[worst]), False
        )
        return f"stopped: {text}"

    def warnings(self, ledgers: dict) -> list[Notice]:
        """All notices of a run that ended."""
        notices = list(self.predicted)
        if self.model.case.numerics.step is not None and (notices or self.moving):  # now with what the run has shown
            notices = step_limits(self.model, self.rates, np.inf if self.grown else self.halves.worst()[1])
        step_error = self.halves.notice()
        notices += [] if step_error is None else [step_error]
        notices += crowded(self.slate.past)
        notices += self.unfelt.notices()
        notices += [] if self.grown is None else [self.grown]
        return notices + [notice for name, ledger in ledgers.items() for notice in unclosed(name, ledger)]


def parted(numerics, counts: dict[str, int]) -> list[Notice]:
    """A notice where steps of the length that was asked for were taken in parts."""
    if not counts.get("parted"):
        return []
    key = "step" if numerics.step is not None else "courant"
    text = (f"{counts['parted']} of {counts['steps']} steps were too long, for Newton or for a disc that shuts on a "
            "rigid column, and were taken in parts, which end where the whole would have; give a smaller "
            f"numerics.{key}, or rtol in place of it")  # fmt: skip
    return [Notice("step-limit", "numerics", text, key, float(counts["parted"]), 0.0, True)]


def unclosed(name: str, ledger: dict) -> list[Notice]:
    """A notice where a ledger's remainder is beyond round-off."""
    relative = ledger.get("relative", 0.0)
    if relative <= OPEN:  # one that is not a number is not closed
        return []
    text = (
        f"{name} ledger: {ledger['remainder']:.6g} remain, {relative:.3g} of its largest term; wanted {OPEN:g} at most"
    )
    return [Notice("ledger", name, text, "remainder", float(relative), OPEN, False)]
