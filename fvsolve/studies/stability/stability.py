"""Where a case fails: the greatest safe step, predicted, measured on real runs, and beside it what bounds say.

Knows cases, matrices and runs; draws nothing. Failure: max over n <= N of ||R(h J)^n|| > 1e3 in the energy norm.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.doors import CALL, COUNT, FLAG, NAMES, NUMBER, PATH, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, RunError
from fvsolve.model.energy import EnergyForm, energy_form
from fvsolve.schemes import SCHEMES, branches
from fvsolve.steppers import automatic, method_named
from fvsolve.steppers.methods import AUTO
from fvsolve.studies.linear.frozen import Frozen, frozen, has_limiter, reweighted
from fvsolve.studies.linear.linearise import Linear, linearised
from fvsolve.studies.linear.spectrum import Spectrum, spectrum
from fvsolve.studies.lines import lines, settled
from fvsolve.studies.many import Bench
from fvsolve.studies.outcome import Progress, names
from fvsolve.studies.points import Points, key_of
from fvsolve.studies.sent import Sent
from fvsolve.studies.stability.bounds import WIDE, field_of_values, region_limit
from fvsolve.studies.stability.carried import LONGEST, VECTORS, TooLarge
from fvsolve.studies.stability.delayed_row import delayed_row
from fvsolve.studies.stability.growth import DENSE, STEPS, THRESHOLD
from fvsolve.studies.stability.measured import Runs, measure
from fvsolve.studies.stability.misled import notes
from fvsolve.studies.stability.row import StabilityRow, read
from fvsolve.studies.stability.system import predicted, system

AUTOMATIC = (
    f"auto begins with {automatic.EXPLICIT}, of which its row is; a run goes on with {automatic.IMPLICIT} or "
    f"{automatic.TIGHT} where that is cheaper, which its row does not say"
)
VISIBLE = 1e-3  # of a small deviation: what limited schemes are tried with, above what WENO takes for round-off
LONGER = 10  # times as many steps, for Euler with a limiter


@dataclass(frozen=True)
class Stability:
    """Rows of a study, what is to be said of it; sides : scheme -> what makes its linear system, on first use."""

    case: str
    rows: tuple[StabilityRow, ...]
    said: tuple[str, ...]
    sides: dict[str, Callable[[str], Side]] = field(repr=False)

    def side(self, scheme: str) -> Side:
        """The linear system with a linear scheme among those asked for."""
        return self.sides[scheme](scheme)

    def plain(self) -> dict:
        """As JSON says it."""
        return {"case": self.case, "rows": [row.plain() for row in self.rows], "said": self.said}


class Side:
    """A case with one linear scheme about its state: J in the energy norm, and what does not hang on the method."""

    def __init__(self, at: Frozen) -> None:
        self.at = at
        self.linear: Linear = linearised(at)
        self.whole = energy_form(at.model, at.y)
        self.form: EnergyForm = self.whole.fitting(self.linear.a)
        self.e = self.form.seen(self.linear.a)

    @property
    def idle(self) -> list[str]:
        """States that move without any energy."""
        return [self.at.model.state_names[i] for i in np.flatnonzero(np.any(self.whole.idle, axis=1))]

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues."""
        return spectrum(self.e)

    @cached_property
    def field(self) -> np.ndarray:
        """Boundary of the field of values."""
        return field_of_values(self.e)

    @property
    def rate(self) -> float:
        """Greatest wave rate [1/s]; 0 without cells."""
        return self.at.model.wave_rate


@door(
    schemes=NAMES,
    methods=NAMES,
    at=NUMBER,
    before=FLAG,
    steps=COUNT,
    threshold=NUMBER,
    set=TABLE,
    out=PATH,
    progress=CALL,
    jobs=COUNT,
    dask=TEXT,
)
def stability(
    case, schemes: Sequence[str] | None = None, methods: Sequence[str] | None = None, at: float | None = None,
    before: bool = False, steps: int = STEPS, threshold: float = THRESHOLD, set=None, out: str | Path | None = None,
    progress: Progress | None = None, jobs: int = 1, dask: str | None = None,
) -> Stability:  # fmt: skip
    """One row for each scheme and method, those of the case if None, about its start or the state at `at` [s].

    Finished rows are kept in `out` and reused; jobs, dask : who makes them, as in `sweep`. Raises CaseError, and
    FvsolveError for a state that cannot be linearised or counts of steps that say nothing.
    """
    if steps < 10 or not threshold > 1.0:
        raise FvsolveError(f"steps = {steps}, threshold = {threshold:g}: wanted at least 10 steps and growth above 1")
    case = load(case, dict(set or {}))
    case = load(case, settled(case))
    if lines(case) and at is not None:
        raise FvsolveError("stability of delay lines is about the start, for what is on its way later is not carried; "
                           'leave out --at, or say numerics.line = "cells"')  # fmt: skip
    schemes = names(schemes) or [case.numerics.scheme]
    asked = names(methods) or [case.numerics.method]
    methods = list(dict.fromkeys(method_named(automatic.first_method(name)).name for name in asked))
    said = (AUTOMATIC,) if AUTO in asked else ()
    asked = {"at": at, "before": before, "steps": steps, "threshold": threshold}
    work, pairs = StabilityWork(case, **asked), [*itertools.product(schemes, methods)]
    with Points(out) as points, Bench(work, jobs, dask) as bench:
        found = kept_rows(points, case, asked, pairs, bench, progress or (lambda *_: None))
    return Stability(case.name, tuple(map(read, found)), said, {one: work.maker(one).side for one in schemes})


def kept_rows(points: Points, case, asked: dict, pairs: list, bench: Bench, tell: Progress) -> list[dict]:
    """Rows of pairs of a scheme and a method, those that are not known made by `bench` and kept as they come."""
    extras = [{"study": "stability", "scheme": scheme, "method": method, **asked} for scheme, method in pairs]
    found = [points.find(case, extra) for extra in extras]
    new = [k for k, row in enumerate(found) if row is None]

    def said(count: int) -> None:
        known = len(pairs) - len(new)
        tell(known + count, len(pairs), "".join(" with ".join(pairs[k]) for k in new[count : count + 1]))

    said(0)
    for count, (number, row) in enumerate(bench.do([pairs[k] for k in new]), 1):
        at = new[number]
        found[at] = points.keep(key_of(case, extras[at]), extras[at], row)
        said(count)
    return found


class StabilityWork:
    """What makes rows of one case about one state, wherever."""

    def __init__(self, case, **asked) -> None:
        self.sent, self.asked = Sent(case), asked
        self.makers: dict[str, Maker] = {}

    def __call__(self, pair: tuple[str, str]) -> dict:
        scheme, method = pair
        return self.maker(scheme).row(method).plain()

    def maker(self, scheme: str) -> Maker:
        """What makes the rows of a scheme."""
        if scheme not in self.makers:
            self.makers[scheme] = Maker(load(self.sent.source), scheme, **self.asked)
        return self.makers[scheme]

    def lost(self, pair: tuple[str, str]) -> dict:
        """Nothing can stand for it."""
        raise RunError(f"the process that made the row of {' with '.join(pair)} has ended, again and again; was memory "
                       "too small?")  # fmt: skip

    def __getstate__(self) -> dict:
        return {"sent": self.sent, "asked": self.asked, "makers": {}}


class Maker:
    """Rows of one scheme; what they share is made once, on first use."""

    def __init__(self, case, scheme: str, at: float | None, before: bool, steps: int, threshold: float) -> None:
        self.case, self.scheme, self.time, self.before = case, scheme, at, before
        self.steps, self.threshold = steps, threshold
        self.states: dict[str, Frozen] = {}
        self.sides: dict[str, Side] = {}

    def at(self, scheme: str) -> Frozen:
        """The state with a scheme."""
        if scheme not in self.states:
            self.states[scheme] = frozen(self.case, {"numerics.scheme": scheme}, self.time, self.before)
        return self.states[scheme]

    def side(self, scheme: str) -> Side:
        """The linear system of a scheme."""
        if scheme not in self.sides:
            self.sides[scheme] = Side(self.at(scheme))
        return self.sides[scheme]

    def frozen_sides(self) -> Iterator[tuple[str, Side]]:
        """Linear systems with the weights of the limited scheme standing still; same cells, same state."""
        at = self.at(self.scheme)
        if at.model.cavitates or at.model.basins:  # which have no linear scheme but this
            yield "upwind", Side(replace(self.at("upwind"), y=at.y))
            return
        for name, weights in branches(self.scheme, at.model.case.numerics.limiter).items():
            if name not in self.sides:
                cells = sum(weight != 0 for weight in weights)
                degree = min(cells - 1, 4) if self.scheme == "weno5" else int(name != "upwind")  # of the ends
                wide = replace(self.at("upwind5"), y=at.y)
                self.sides[name] = Side(reweighted(wide, tuple(map(float, weights)), degree))
            yield name, self.sides[name]

    def row(self, name: str) -> StabilityRow:
        """The row of a method."""
        method = method_named(name)
        if lines(self.case):
            return delayed_row(self.case, self.scheme, method, self.steps, self.threshold)
        if has_limiter(self.at(self.scheme).model):
            return self.limited(method)
        side = self.side(self.scheme)
        one = system(method, side.e, self.steps, self.threshold)
        limit = predicted(one)
        grown = one.growth(limit.fails) if np.isfinite(limit.fails) else None
        worst = grown and grown.start
        runs = Runs(side.at, method.name, side.form, worst, self.steps, self.threshold, a=side.linear.a)
        row = self.bounded(side, method) | {"predicted": limit.step}
        if grown:
            where, share = place(side.form, grown.end)
            row |= {"growth": grown.size, "after": grown.steps, "where": where, "share": share}
        row |= measure(runs, limit.step, one.size, row["left_out"])
        found = StabilityRow(**row)
        return StabilityRow(**row | {"notes": tuple(notes(found, side, one))})

    def bounded(self, side: Side, method) -> dict:
        """What is known without a power: names, sizes, bounds."""
        model, left_out = side.at.model, {}
        values = side.spectrum
        row = {
            "scheme": self.scheme, "method": method.name, "when": side.at.when,
            "states": model.y_size, "steps": self.steps, "threshold": self.threshold, "rate": side.rate,
            "eigenvalues": region_limit(method, values.values),
            "greatest_real": float(values.values.real.max(initial=0.0)),
        }  # fmt: skip
        if not values.complete:
            left_out["eigenvalues"] = f"the limit may be lower, from {values.said}"
        if model.y_size <= WIDE:
            row["field_of_values"] = region_limit(method, side.field)
        else:
            left_out["field_of_values"] = f"{model.y_size} states; it is computed up to {WIDE}"
        if model.cells:
            row["von_neumann"] = on_a_long_pipe(self.scheme, method) / float(model.wave_rates.max())
        if model.y_size > DENSE:
            left_out["squaring"] = f"{model.y_size} states: predicted by {VECTORS} vectors carried along"
        return row | {"left_out": left_out}

    def limited(self, method) -> StabilityRow:
        """The row of a limited scheme: limits with its weights frozen, and the measured one."""
        at = self.at(self.scheme)
        found, starts, left_out, latest = {}, {}, {}, time.monotonic() + LONGEST
        try:
            for name, side in self.frozen_sides():
                one = system(method, side.e, self.steps, self.threshold, latest)
                limit = predicted(one)
                found[name] = limit.step
                if 0.0 < limit.step < np.inf:
                    starts[limit.step] = one.growth(limit.fails).start
        except TooLarge as error:
            left_out["frozen weights"] = str(error)
        guess = sorted(starts)[len(starts) // 2] if starts else np.inf  # between the flat and the steep ones
        if left_out and not starts:
            guess = on_a_long_pipe(SCHEMES[self.scheme].smooth.name, method) / side.rate or np.inf
        runs = Runs(at, method.name, side.form, starts.get(guess), self.steps, self.threshold, VISIBLE)
        row = {
            "scheme": self.scheme, "method": method.name, "when": at.when, "states": at.model.y_size,
            "steps": self.steps, "threshold": self.threshold, "rate": side.rate, "frozen": found, "left_out": left_out,
        }  # fmt: skip
        row |= measure(runs, guess, one.size, row["left_out"])
        if method.stages == 1 and method.explicit and np.isfinite(row.get("measured", np.nan)):
            longer = Runs(at, method.name, side.form, starts.get(guess), LONGER * self.steps, self.threshold, VISIBLE)
            row["longer"] = measure(longer, row["measured"], 0.0, row["left_out"], "longer").get("measured", np.nan)
        return StabilityRow(**row | {"notes": tuple(notes(StabilityRow(**row), side, None))})


def on_a_long_pipe(scheme: str, method) -> float:
    """Von Neumann's limit, a Courant number."""
    from fvsolve.limits.grid import advection_limit

    return advection_limit(scheme, method.name).limit


def place(form: EnergyForm, end: np.ndarray) -> tuple[str, float]:
    """(part with most of the energy of a unit vector, its share)."""
    shares: dict[str, float] = {}
    for part, root in zip(form.parts, form.rows @ (form.back @ end), strict=True):
        shares[part] = shares.get(part, 0.0) + float(root**2)
    part = max(shares, key=shares.get)
    return part, shares[part]
