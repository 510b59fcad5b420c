"""Checks of a run: steps beyond their limit, growth of states, mass balances that do not close."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.model.delay_history import jump_overflow_notices
from fvsolve.solve.sloshing_validity import SloshingCheck
from fvsolve.solve.step_doubling import StepDoubling
from fvsolve.step_limits.forcing_ranges import forcing_sizes
from fvsolve.step_limits.step_notices import step_limits

GROWTH_LIMIT = 1e6  # largest state, in units of its forcing range: beyond it the state has grown by instability
NO_GROWTH = 10.0  # in the same units: waves that add up may reach it, so a smaller state is no sign of growth
LEDGER_TOLERANCE = 1e-8  # greatest remainder of a ledger, relative to its largest term


class RunChecks:
    """Checks during a run: wave rates of basins, size of the states, height of sloshing modes.

    largest : float64[n]  allowed size of each state: 1e6 times its `forcing_sizes`. In cells these are the largest of
    the range of initial values, the range of the schedules, and the Joukowsky jump if the initial flows stop
    sound : time of the last checked state without growth [s]
    """

    def __init__(self, run_data) -> None:
        self.run_data, self.model = run_data, run_data.model
        model = self.model
        self.moving = model.basins if model.case.numerics.step is not None else []
        self.rates: dict[str, float] = {}
        self.predicted = step_limits(model, run_data=run_data)
        self.step_doubling = StepDoubling(run_data)
        self.sloshing = SloshingCheck(model)
        self.largest = GROWTH_LIMIT * forcing_sizes(model)
        self.grown: Notice | None = None
        self.sound = model.case.numerics.start

    @property
    def needs_frequent_checks(self) -> bool:
        """True if `check` must be called every few steps, for checks that the time loop does not make itself."""
        return bool(self.sloshing.tanks or (self.predicted and self.moving))

    @property
    def largest_if_needed(self) -> np.ndarray:
        """Array `largest` if the step exceeds a predicted limit, so that the time loop checks growth; else empty."""
        return np.array(np.broadcast_to(self.largest, self.model.y_size)) if self.predicted else np.zeros(0)

    def check(self, t: float, y: np.ndarray) -> str:
        """Check state y at time t [s], and update the wave rates of basins; returns the reason to stop, or ""."""
        for basin in self.moving:
            self.rates[basin.name] = max(self.rates.get(basin.name, 0.0), basin.max_rate(y)[0])
        if stops := self.sloshing.check(t, y):
            return stops
        ratio = np.abs(y) / self.largest
        if np.all(ratio <= NO_GROWTH / GROWTH_LIMIT):
            self.sound = t
        if not np.any(ratio > 1.0):
            return ""
        worst = int(np.argmax(ratio))
        name, times = self.model.state_names[worst], GROWTH_LIMIT * float(ratio[worst])
        text = (f"{name} has grown to {times:.3g} times the range of its forcing at t = "
                f"{self.model.case.amount(t, 'time', 6)}; the step is beyond the limit of the method: "
                "halve the step")  # fmt: skip
        self.grown = Notice(
            "growth", name.partition("[")[0], text, None, float(abs(y[worst])), float(self.largest[worst]), False
        )
        return f"stopped: {text}"

    def warnings(self, ledgers: dict) -> list[Notice]:
        """Notices of all checks at the end of a run; ledgers : balances of mass and scalars by name."""
        notices = list(self.predicted)
        # repeat the prediction with the wave rates and step errors of the run
        if self.model.case.numerics.step is not None and (notices or self.moving):
            notices = step_limits(self.model, self.rates, np.inf if self.grown else self.step_doubling.worst()[1])
        step_error = self.step_doubling.notice()
        notices += [] if step_error is None else [step_error]
        notices += jump_overflow_notices(self.run_data.past)
        notices += self.sloshing.notices()
        notices += [] if self.grown is None else [self.grown]
        return notices + [notice for name, ledger in ledgers.items() for notice in ledger_notices(name, ledger)]


def split_step_notices(numerics, counts: dict[str, int]) -> list[Notice]:
    """Notice if steps of given length were taken in parts; an empty list if not.

    counts : counts of the run, with the number of such steps under "parted"
    """
    if not counts.get("parted"):
        return []
    key = "step" if numerics.step is not None else "courant"
    text = (f"{counts['parted']} of {counts['steps']} steps were too long for Newton's method, or for a disc that "
            "shuts on a rigid column, and were taken in parts that end where the full step would have ended; give a "
            f"smaller numerics.{key}, or rtol instead")  # fmt: skip
    return [Notice("step-limit", "numerics", text, key, float(counts["parted"]), 0.0, True)]


def ledger_notices(name: str, ledger: dict) -> list[Notice]:
    """Notice if the remainder of the balance `name` is larger than rounding; an empty list if not."""
    relative = ledger.get("relative", 0.0)
    if relative <= LEDGER_TOLERANCE:  # False for NaN: such a ledger does not close
        return []
    text = (
        f"{name} ledger: the remainder, 0 in an exact balance, is {ledger['remainder']:.6g}, {relative:.3g} of the "
        f"largest term; expected at most {LEDGER_TOLERANCE:g} of the largest term"
    )
    return [Notice("ledger", name, text, "remainder", float(relative), LEDGER_TOLERANCE, False)]
