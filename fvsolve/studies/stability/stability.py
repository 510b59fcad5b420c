"""Greatest safe step of a case: predicted by powers of a step, measured by real runs, and bounds.

Failure: max over n <= N of ||R(h J)^n|| > 1e3 in the energy norm.
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
from fvsolve.errors import FvsolveError, RunError
from fvsolve.model.energy_norm import EnergyForm, energy_form
from fvsolve.schemes import SCHEMES, branches
from fvsolve.steppers import automatic, method_named
from fvsolve.steppers.built_in_methods import AUTO
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
from fvsolve.validation import COUNT, FLAG, FUNCTION, NAMES, NUMBER, PATH, TABLE, TEXT, validated

AUTOMATIC = (
    f"auto starts with {automatic.EXPLICIT}, for which its row holds; a run continues with {automatic.IMPLICIT} or "
    f"{automatic.TIGHT_IMPLICIT} if that is cheaper, which is not in its row"
)
VISIBLE = 1e-3  # of the small deviation: start for limited schemes, above the round-off level of WENO
LONGER = 10  # factor of the number of steps in longer runs of Euler with a limiter


@dataclass(frozen=True)
class Stability:
    """Rows of a study with notes; systems : scheme -> function that makes its linear system on first use."""

    case: str
    rows: tuple[StabilityRow, ...]
    said: tuple[str, ...]
    sides: dict[str, Callable[[str], Side]] = field(repr=False)

    def side(self, scheme: str) -> Side:
        """Linear system with one of the requested linear schemes."""
        return self.sides[scheme](scheme)

    def plain(self) -> dict:
        """Data for JSON."""
        return {"case": self.case, "rows": [row.plain() for row in self.rows], "said": self.said}


class Side:
    """Case with one linear scheme about a state: J in the energy norm, and data that do not depend on the method."""

    def __init__(self, at: Frozen) -> None:
        self.at = at
        self.linear: Linear = linearised(at)
        self.whole = energy_form(at.model, at.y)
        self.form: EnergyForm = self.whole.suited_to(self.linear.a)
        self.e = self.form.seen(self.linear.a)

    @property
    def idle(self) -> list[str]:
        """Names of states with motions that store no energy."""
        return [self.at.model.state_names[i] for i in np.flatnonzero(np.any(self.whole.idle, axis=1))]

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues of J."""
        return spectrum(self.e)

    @cached_property
    def field(self) -> np.ndarray:
        """Boundary of the field of values of J."""
        return field_of_values(self.e)

    @property
    def rate(self) -> float:
        """Greatest wave rate [1/s]; 0 without cells."""
        return self.at.model.wave_rate


@validated(
    schemes=NAMES,
    methods=NAMES,
    at=NUMBER,
    before=FLAG,
    steps=COUNT,
    threshold=NUMBER,
    set=TABLE,
    out=PATH,
    progress=FUNCTION,
    jobs=COUNT,
    dask=TEXT,
)
def stability(
    case, schemes: Sequence[str] | None = None, methods: Sequence[str] | None = None, at: float | None = None,
    before: bool = False, steps: int = STEPS, threshold: float = THRESHOLD, set=None, out: str | Path | None = None,
    progress: Progress | None = None, jobs: int = 1, dask: str | None = None,
) -> Stability:  # fmt: skip
    """Compute a row for each scheme and method (those of the case if None) about the start or the state at `at` [s].

    Finished rows are stored in `out` and reused; jobs, dask : processes, as in `sweep`. Raises CaseError, and
    FvsolveError for a state that cannot be linearised, and for too few steps or too small a threshold.
    """
    if steps < 10 or not threshold > 1.0:
        raise FvsolveError(
            f"steps = {steps}, threshold = {threshold:g}: expected at least 10 steps and a threshold above 1"
        )
    case = load(case, dict(set or {}))
    case = load(case, settled(case))
    if lines(case) and at is not None:
        raise FvsolveError("stability of delay lines is computed about the start only: later waves in lines are not "
                           'included; leave out --at, or set numerics.pipe_model = "finite-volume"')  # fmt: skip
    schemes = names(schemes) or [case.numerics.scheme]
    requested = names(methods) or [case.numerics.method]
    methods = list(dict.fromkeys(method_named(automatic.first_method(name)).name for name in requested))
    texts = (AUTOMATIC,) if AUTO in requested else ()
    requested = {"at": at, "before": before, "steps": steps, "threshold": threshold}
    work, pairs = StabilityWork(case, **requested), [*itertools.product(schemes, methods)]
    with Points(out) as points, Bench(work, jobs, dask) as pool:
        rows = kept_rows(points, case, requested, pairs, pool, progress or (lambda *_: None))
    return Stability(case.name, tuple(map(read, rows)), texts, {scheme: work.maker(scheme).side for scheme in schemes})


def kept_rows(points: Points, case, options: dict, pairs: list, pool: Bench, report: Progress) -> list[dict]:
    """Rows of pairs (scheme, method); missing rows are computed by `pool` and stored as they are finished."""
    keys = [{"study": "stability", "scheme": scheme, "method": method, **options} for scheme, method in pairs]
    rows = [points.find(case, extra) for extra in keys]
    new = [k for k, row in enumerate(rows) if row is None]

    def progress(count: int) -> None:
        known = len(pairs) - len(new)
        report(known + count, len(pairs), "".join(" with ".join(pairs[k]) for k in new[count : count + 1]))

    progress(0)
    for count, (number, row) in enumerate(pool.do([pairs[k] for k in new]), 1):
        index = new[number]
        rows[index] = points.keep(key_of(case, keys[index]), keys[index], row)
        progress(count)
    return rows


class StabilityWork:
    """Task that computes rows of a case about one state, in any process."""

    def __init__(self, case, **options) -> None:
        self.sent, self.asked = Sent(case), options
        self.makers: dict[str, Maker] = {}

    def __call__(self, pair: tuple[str, str]) -> dict:
        scheme, method = pair
        return self.maker(scheme).row(method).plain()

    def maker(self, scheme: str) -> Maker:
        """Object that computes the rows of a scheme."""
        if scheme not in self.makers:
            self.makers[scheme] = Maker(load(self.sent.source), scheme, **self.asked)
        return self.makers[scheme]

    def lost(self, pair: tuple[str, str]) -> dict:
        """Raise RunError for a row whose process has ended."""
        raise RunError(f"the process for the row of {' with '.join(pair)} has ended repeatedly; was memory "
                       "too small?")  # fmt: skip

    def __getstate__(self) -> dict:
        return {"sent": self.sent, "asked": self.asked, "makers": {}}


class Maker:
    """Rows of one scheme; shared data are computed once, on first use."""

    def __init__(self, case, scheme: str, at: float | None, before: bool, steps: int, threshold: float) -> None:
        self.case, self.scheme, self.time, self.before = case, scheme, at, before
        self.steps, self.threshold = steps, threshold
        self.states: dict[str, Frozen] = {}
        self.sides: dict[str, Side] = {}

    def at(self, scheme: str) -> Frozen:
        """Operating point with a scheme."""
        if scheme not in self.states:
            self.states[scheme] = frozen(self.case, {"numerics.scheme": scheme}, self.time, self.before)
        return self.states[scheme]

    def side(self, scheme: str) -> Side:
        """Linear system with a scheme."""
        if scheme not in self.sides:
            self.sides[scheme] = Side(self.at(scheme))
        return self.sides[scheme]

    def frozen_sides(self) -> Iterator[tuple[str, Side]]:
        """Linear systems with fixed weights of the limited scheme, for equal cells and state."""
        at = self.at(self.scheme)
        if at.model.cavitates or at.model.basins:  # their only linear scheme is upwind
            yield "upwind", Side(replace(self.at("upwind"), y=at.y))
            return
        for name, weights in branches(self.scheme, at.model.case.numerics.limiter).items():
            if name not in self.sides:
                cells = sum(weight != 0 for weight in weights)
                # degree of the polynomials at pipe ends
                degree = min(cells - 1, 4) if self.scheme == "weno5" else int(name != "upwind")
                point = replace(self.at("upwind5"), y=at.y)
                self.sides[name] = Side(reweighted(point, tuple(map(float, weights)), degree))
            yield name, self.sides[name]

    def row(self, name: str) -> StabilityRow:
        """Row of a method."""
        method = method_named(name)
        if lines(self.case):
            return delayed_row(self.case, self.scheme, method, self.steps, self.threshold)
        if has_limiter(self.at(self.scheme).model):
            return self.limited(method)
        side = self.side(self.scheme)
        growth = system(method, side.e, self.steps, self.threshold)
        limit = predicted(growth)
        greatest = growth.growth(limit.fails) if np.isfinite(limit.fails) else None
        worst = greatest and greatest.start
        runs = Runs(side.at, method.name, side.form, worst, self.steps, self.threshold, a=side.linear.a)
        row = self.bounded(side, method) | {"predicted": limit.step}
        if greatest:
            where, share = place(side.form, greatest.end)
            row |= {"growth": greatest.size, "after": greatest.steps, "where": where, "share": share}
        row |= measure(runs, limit.step, growth.size, row["left_out"])
        result = StabilityRow(**row)
        return StabilityRow(**row | {"notes": tuple(notes(result, side, growth))})

    def bounded(self, side: Side, method) -> dict:
        """Columns of a row that need no powers: names, sizes, bounds."""
        model, left_out = side.at.model, {}
        values = side.spectrum
        row = {
            "scheme": self.scheme, "method": method.name, "when": side.at.when,
            "states": model.y_size, "steps": self.steps, "threshold": self.threshold, "rate": side.rate,
            "eigenvalues": region_limit(method, values.values),
            "greatest_real": float(values.values.real.max(initial=0.0)),
        }  # fmt: skip
        if not values.complete:
            left_out["eigenvalues"] = f"the limit may be lower; it is computed from {values.said}"
        if model.y_size <= WIDE:
            row["field_of_values"] = region_limit(method, side.field)
        else:
            left_out["field_of_values"] = f"{model.y_size} states; it is computed up to {WIDE}"
        if model.cells:
            row["von_neumann"] = on_a_long_pipe(self.scheme, method) / float(model.wave_rates.max())
        if model.y_size > DENSE:
            left_out["squaring"] = f"{model.y_size} states: predicted by powers applied to {VECTORS} vectors"
        return row | {"left_out": left_out}

    def limited(self, method) -> StabilityRow:
        """Row of a limited scheme: limits with frozen weights, and the measured limit."""
        at = self.at(self.scheme)
        limits, starts, left_out, latest = {}, {}, {}, time.monotonic() + LONGEST
        try:
            for name, side in self.frozen_sides():
                growth = system(method, side.e, self.steps, self.threshold, latest)
                limit = predicted(growth)
                limits[name] = limit.step
                if 0.0 < limit.step < np.inf:
                    starts[limit.step] = growth.growth(limit.fails).start
        except TooLarge as error:
            left_out["frozen weights"] = str(error)
        guess = (
            sorted(starts)[len(starts) // 2] if starts else np.inf
        )  # the middle value, between those of small and large slopes
        if left_out and not starts:
            guess = on_a_long_pipe(SCHEMES[self.scheme].smooth.name, method) / side.rate or np.inf
        runs = Runs(at, method.name, side.form, starts.get(guess), self.steps, self.threshold, VISIBLE)
        row = {
            "scheme": self.scheme, "method": method.name, "when": at.when, "states": at.model.y_size,
            "steps": self.steps, "threshold": self.threshold, "rate": side.rate, "frozen": limits, "left_out": left_out,
        }  # fmt: skip
        row |= measure(runs, guess, growth.size, row["left_out"])
        if method.stages == 1 and method.explicit and np.isfinite(row.get("measured", np.nan)):
            longer = Runs(at, method.name, side.form, starts.get(guess), LONGER * self.steps, self.threshold, VISIBLE)
            row["longer"] = measure(longer, row["measured"], 0.0, row["left_out"], "longer").get("measured", np.nan)
        return StabilityRow(**row | {"notes": tuple(notes(StabilityRow(**row), side, None))})


def on_a_long_pipe(scheme: str, method) -> float:
    """Von Neumann's limit of the Courant number."""
    from fvsolve.step_limits.advection_limit import advection_limit

    return advection_limit(scheme, method.name).limit


def place(form: EnergyForm, end: np.ndarray) -> tuple[str, float]:
    """(part with the most energy of a unit vector, its share)."""
    shares: dict[str, float] = {}
    for part, root in zip(form.parts, form.rows @ (form.back @ end), strict=True):
        shares[part] = shares.get(part, 0.0) + float(root**2)
    part = max(shares, key=shares.get)
    return part, shares[part]
