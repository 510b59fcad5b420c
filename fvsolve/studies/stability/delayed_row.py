"""The row of a case with delay lines: the greatest step by the linear system of steps, and by real runs."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import CaseError, FvsolveError
from fvsolve.limits.lines import LITTLE, lines_at, stores
from fvsolve.schemes import LIMITED
from fvsolve.studies.linear.frozen import stopped
from fvsolve.studies.outcome import prepared
from fvsolve.studies.stability.bracket import Limit, halved, limit
from fvsolve.studies.stability.delayed import Delayed
from fvsolve.studies.stability.delayed_runs import DelayedRuns
from fvsolve.studies.stability.measured import too_long
from fvsolve.studies.stability.row import StabilityRow

PARTS, FAR = 32.0, 2.0  # steps that are looked at: from a part of the slowest line, or from where stores let nothing
SLOW = 0.1  # grow, nor rates of all else, to times the slowest line
LINES = 4  # at stores, whose whole parts are looked at
RISE, FINE = 1.6, 1e-3  # between them, and of the bracket around the limit
MOST = 400  # states
UNKNOWN = "stages of Rosenbrock's methods see what arrives by its slope, which is not followed"
NONE = "no step up to twice the slowest line's travel time fails"


class DelayedLimits:
    """Steps of one case and method: models cut for each, the linear systems of these, and whether they fail."""

    def __init__(self, case, scheme: str, method, steps: int, threshold: float) -> None:
        self.case, self.method, self.steps, self.threshold = case, method, steps, threshold
        self.set = {"numerics.scheme": scheme, "numerics.method": method.name}
        self.refused: dict[float, str] = {}
        self.own = self.model(None)
        rows = self.own.tables.delays
        slowest = float((rows["tau"] * rows["stretches"]).max())
        self.far, self.first = FAR * slowest, slowest / PARTS
        rates = self.system(self.first).a
        if rates.size:
            self.first = min(self.first, SLOW / max(1e-300, float(np.linalg.norm(rates, 2))))
        for _, i, rate in stores(self.own, 1.0):
            travel = min(float(line["tau"] * line["stretches"]) for line in lines_at(self.own, i))
            self.first = min(self.first, float(np.sqrt(2.0 * travel / (LITTLE * rate * steps))))

    def model(self, h: float | None):
        """The case at its start, lines cut for steps of h [s] or of its own, schedules held."""
        step = {} if h is None else {"numerics.step": h}
        model = prepared(self.case, self.set | step)
        if model.case.numerics.scheme in LIMITED and (model.tables.pipes["delay"] < 0).any():
            raise FvsolveError(f"beside delay lines stability wants a linear scheme; {model.case.numerics.scheme} "
                               "limits slopes: give scheme = \"upwind5\", say")  # fmt: skip
        if model.y_size > MOST:
            raise FvsolveError(f"{model.y_size} states, each delay line one of them; with lines stability follows "
                               f"{MOST}: take fewer cells, or a part of the network")  # fmt: skip
        return stopped(model, model.case.numerics.start)

    def system(self, h: float) -> Delayed:
        """The linear system of steps of h [s]."""
        return Delayed(self.model(h), self.method, h)

    def fails(self, h: float) -> bool:
        """Whether a deviation grows beyond the threshold, or the case is refused with such steps."""
        try:
            return not self.system(h).growth(self.steps, self.threshold).size <= self.threshold
        except CaseError as error:
            self.refused[h] = error.faults[0].message
            return True

    def predicted(self) -> Limit:
        """The greatest step [s] below which none fails; nan where steps of the method are not known."""
        if self.method.kind == "linear":
            return Limit(np.nan, np.nan)
        rough = limit(self.fails, self.first, self.far, RISE, FINE)
        least = min([rough, *(self.whole(one, rough.fails) for one in self.delays(rough))], key=lambda one: one.fails)
        return least

    def delays(self, rough: Limit) -> list[float]:
        """Delays of lines at stores [s], the longest few: steps that divide one let its waves grow most."""
        touched = [line for _, i, _ in stores(self.own, 1.0) for line in lines_at(self.own, i)]
        found = {float(line["tau"] * line["stretches"]) for line in touched} if 0.0 < rough.step < np.inf else set()
        return sorted(found, reverse=True)[:LINES]

    def whole(self, delay: float, fails: float) -> Limit:
        """The least step that fails among those near whole parts of a delay; none of these is damped by reading."""
        low = int(np.ceil(delay / fails))
        if low < 1 or not self.fails(delay / low):
            return Limit(np.inf, np.inf)
        high = 2 * low
        while self.fails(delay / high):
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.fails(delay / middle) else (low, middle)
        between = delay / (low + 0.5)
        return halved(self.fails, delay / high if self.fails(between) else between, delay / low, FINE)


def delayed_row(case, scheme: str, method, steps: int, threshold: float) -> StabilityRow:
    """Limits of a scheme and method about the start: predicted by powers of the linear step, and measured."""
    made, left_out, notes = DelayedLimits(case, scheme, method, steps, threshold), {}, []
    found, model = made.predicted(), made.own
    rate = float(max(model.wave_rates[model.tables.pipes["delay"] < 0], default=0.0))
    row = {
        "scheme": scheme, "method": method.name, "when": "the start, delay lines as they are", "states": model.y_size,
        "steps": steps, "threshold": threshold, "rate": rate, "predicted": found.step, "lines": True,
    }  # fmt: skip
    if np.isnan(found.step):
        left_out["predicted"] = UNKNOWN
    elif np.isinf(found.step):
        notes.append(NONE)
    if np.isfinite(found.fails) and found.fails not in made.refused:
        one = made.system(found.fails)
        grown = one.growth(steps, threshold)
        where, share = one.place(grown)
        row |= {"growth": grown.size, "after": grown.steps, "where": where, "share": share}
    if made.refused:
        h = min(made.refused)
        notes.append(f"steps from {h:.4g} s on are refused: {made.refused[h]}")
    if not made.refused or found.fails not in made.refused:
        row |= seen(DelayedRuns(made, steps, threshold, found.fails), found.step, left_out)
    return StabilityRow(**row, left_out=left_out, notes=tuple(notes))


def seen(runs: DelayedRuns, guess: float, left_out: dict[str, str]) -> dict:
    """The limit of real runs; where it is not found in time, why, in `left_out`."""
    try:
        found = runs.limit(guess)
    except TimeoutError:
        left_out["measured"] = too_long(runs)
        return {}
    return {"measured": found.step, "measured_up_to": found.fails if np.isfinite(found.fails) else runs.tried}
