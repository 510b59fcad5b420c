"""Greatest safe step of a case: predicted from the linearised case, measured by real runs, and bounds.

A step h fails if a deviation grows more than 1000 times in the energy norm within n <= N steps. For the linearised case
this growth is the greatest norm of the powers R(h J)^n, with the Jacobian J and the stability function R of the method.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from fvsolve.argument_checks import COUNT, FLAG, NAMES, NUMBER, PATH, validated
from fvsolve.case import load
from fvsolve.core.model.energy_norm import EnergyForm, energy_form
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.schemes import SCHEMES, branches
from fvsolve.core.steppers import automatic, method_named
from fvsolve.core.steppers.tableau import AUTO
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError
from fvsolve.studies.linearise import Linear, Spectrum, find_eigenvalues, linearise_at
from fvsolve.studies.operating_point import (
    OperatingPoint,
    has_limiter,
    operating_point,
    with_weights,
)
from fvsolve.studies.outcome import STUDY_ARGUMENTS, Progress, name_list
from fvsolve.studies.parallel import PickledCase, TaskPool, Work
from fvsolve.studies.resolution import delay_lines, fixed_choices
from fvsolve.studies.result_cache import ResultCache, case_key
from fvsolve.studies.stability.delay_line_limits import delayed_row
from fvsolve.studies.stability.growth import (
    DENSE,
    STEPS,
    THRESHOLD,
    VECTORS,
    growth_method,
    predicted_limit,
    prediction_limit,
)
from fvsolve.studies.stability.real_runs import RealRuns, measure_limit
from fvsolve.studies.stability.stability_row import (
    MAX_STATES,
    StabilityRow,
    bound_notes,
    field_of_values,
    region_limit,
    row_from_json,
)
from fvsolve.studies.work_limit import TooLarge

AUTO_NOTE = (
    f"auto starts with {automatic.EXPLICIT}, and its row is that of {automatic.EXPLICIT}; a run continues with "
    f"{automatic.IMPLICIT} or {automatic.TIGHT_IMPLICIT} if that is cheaper, but the row does not include these methods"
)
# of the small deviation: start for limited schemes, above the round-off level of WENO
LIMITED_DEVIATION = 1e-3
LONGER_FACTOR = 10  # factor of the number of steps in longer runs of Euler with a limiter


@dataclass(frozen=True)
class Stability(PlainData):
    """Result of a stability study: a row for each scheme and method, and notes.

    systems : {scheme: function of the scheme that returns its `LinearSystem`, computed on first use}
    """

    case: str
    rows: tuple[StabilityRow, ...]
    notes: tuple[str, ...]
    systems: dict[str, Callable[[str], LinearSystem]] = field(repr=False)

    json = "case rows said=notes"

    def system(self, scheme: str) -> LinearSystem:
        """Linear system with one of the requested schemes; raises FvsolveError for a limited scheme."""
        return self.systems[scheme](scheme)


class LinearSystem:
    """Case linearised with one linear scheme about a state, and data that do not depend on the time method.

    linear : state-space form; full_form : energy form of the model
    form : energy norm in use, `full_form` suited to the Jacobian; e : Jacobian in the coordinates of this norm [1/s]
    """

    def __init__(self, at: OperatingPoint) -> None:
        self.at = at
        self.linear: Linear = linearise_at(at, hold_delays=True)
        self.full_form = energy_form(at.model, at.y)
        self.form: EnergyForm = self.full_form.suited_to(self.linear.a)
        self.e = self.form.seen(self.linear.a)

    @property
    def idle(self) -> list[str]:
        """Names of states with motions that store no energy."""
        return [
            self.at.model.state_names[i]
            for i in np.flatnonzero(np.any(self.full_form.idle, axis=1))
        ]

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues of the Jacobian [1/s]."""
        return find_eigenvalues(self.e)

    @cached_property
    def field(self) -> np.ndarray:
        """Boundary of the field of values (numerical range) of the Jacobian : complex[m] [1/s]."""
        return field_of_values(self.e)

    @property
    def rate(self) -> float:
        """Greatest wave rate of pipes and basins [1/s]; 0 without cells."""
        return self.at.model.wave_rate


@declared("study")
@validated(
    schemes=NAMES,
    methods=NAMES,
    at=NUMBER,
    before=FLAG,
    steps=COUNT,
    threshold=NUMBER,
    out=PATH,
    **STUDY_ARGUMENTS,
)
def stability(
    case,
    schemes: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    at: float | None = None,
    before: bool = False,
    steps: int = STEPS,
    threshold: float = THRESHOLD,
    set=None,
    out: str | Path | None = None,
    progress: Progress | None = None,
    jobs: int = 1,
    dask: str | None = None,
) -> Stability:
    """Compute the greatest stable steps of a case for each scheme and time method: a row for each pair.

    schemes, methods : names; default: scheme and method of the case; `auto` counts as its first method
    at : time of the state about which deviations grow [s]; default: the start
    before : True to take schedules just before a jump or kink at this time
    steps : number of steps over which growth counts; threshold : growth above which a step fails
    set : changed keys of the case; out : folder in which finished rows are stored and found again
    progress : function of (rows done, rows in total, next row); jobs, dask : processes, as in `sweep`
    Raises CaseError, and FvsolveError for a state that cannot be linearised, for `at` with delay lines, for a
    prediction that takes too long, and for too few steps or too small a threshold.
    """
    if steps < 10 or not threshold > 1.0:
        given = f"steps = {steps}, threshold = {threshold:g}"
        raise FvsolveError(f"{given}: expected at least 10 steps and a threshold above 1")
    case = load(case, dict(set or {}))
    case = load(case, fixed_choices(case))
    if delay_lines(case) and at is not None:
        raise FvsolveError(
            "stability of delay lines is computed about the start only: later waves in lines are not "
            'included; leave out --at, or set numerics.pipe_model = "finite-volume"'
        )
    schemes = name_list(schemes) or [case.numerics.scheme]
    requested = name_list(methods) or [case.numerics.method]
    methods = list(
        dict.fromkeys(method_named(automatic.first_method(name)).name for name in requested)
    )
    texts = (AUTO_NOTE,) if AUTO in requested else ()
    requested = {"at": at, "before": before, "steps": steps, "threshold": threshold}
    work, pairs = RowTask(case, **requested), [*itertools.product(schemes, methods)]
    with ResultCache(out) as points, TaskPool(work, jobs, dask) as pool:
        rows = cached_rows(points, case, requested, pairs, pool, progress or (lambda *_: None))
    systems = {scheme: work.maker(scheme).system for scheme in schemes}
    return Stability(case.name, tuple(map(row_from_json, rows)), texts, systems)


def cached_rows(
    points: ResultCache, case, options: dict, pairs: list, pool: TaskPool, report: Progress
) -> list[dict]:
    """Rows of all pairs (scheme, method); rows that are not in the cache are computed by `pool` and stored.

    points : cache of rows; report : progress function; options : settings that are part of the key of a row
    """
    keys = [
        {"study": "stability", "scheme": scheme, "method": method, **options}
        for scheme, method in pairs
    ]
    rows = [points.find(case, extra) for extra in keys]
    new = [k for k, row in enumerate(rows) if row is None]

    def progress(count: int) -> None:
        known = len(pairs) - len(new)
        report(
            known + count,
            len(pairs),
            "".join(" with ".join(pairs[k]) for k in new[count : count + 1]),
        )

    progress(0)
    for count, (number, row) in enumerate(pool.run([pairs[k] for k in new]), 1):
        index = new[number]
        rows[index] = points.store(case_key(case, keys[index]), keys[index], row)
        progress(count)
    return rows


class RowTask(Work):
    """Task that computes rows of a stability study of a case, in this or another process."""

    unsent = ("makers",)

    def __init__(self, case, **options) -> None:
        self.pickled_case, self.options = PickledCase(case), options
        self.makers: dict[str, SchemeRows] = {}

    def __call__(self, pair: tuple[str, str]) -> dict:
        scheme, method = pair
        return self.maker(scheme).row(method).plain()

    def maker(self, scheme: str) -> SchemeRows:
        """Object that computes the rows of a scheme for all methods."""
        if scheme not in self.makers:
            self.makers[scheme] = SchemeRows(load(self.pickled_case.source), scheme, **self.options)
        return self.makers[scheme]

    def process_text(self, pair: tuple[str, str]) -> str:
        return f"for the row of {' with '.join(pair)}"


class SchemeRows:
    """Computation of the rows of one scheme; data that methods share are computed once, on first use."""

    def __init__(
        self, case, scheme: str, at: float | None, before: bool, steps: int, threshold: float
    ) -> None:
        self.case, self.scheme, self.time, self.before = case, scheme, at, before
        self.steps, self.threshold = steps, threshold
        self.states: dict[str, OperatingPoint] = {}
        self.systems: dict[str, LinearSystem] = {}

    def at(self, scheme: str) -> OperatingPoint:
        """Operating point of the case with a scheme, computed on first use."""
        if scheme not in self.states:
            self.states[scheme] = operating_point(
                self.case, {"numerics.scheme": scheme}, self.time, self.before
            )
        return self.states[scheme]

    def system(self, scheme: str) -> LinearSystem:
        """Linear system of the case with a linear scheme, computed on first use."""
        if scheme not in self.systems:
            self.systems[scheme] = LinearSystem(self.at(scheme))
        return self.systems[scheme]

    def frozen_systems(self) -> Iterator[tuple[str, LinearSystem]]:
        """Yield (name, linear system) for each linear scheme that the limited scheme becomes with constant weights.

        All systems are linearised at the state of the limited scheme. In a case with basins or cavities the only system
        is that of `upwind`.
        """
        at = self.at(self.scheme)
        if at.model.cavitates or at.model.meshed:  # their only linear scheme is upwind
            yield "upwind", LinearSystem(replace(self.at("upwind"), y=at.y))
            return
        for name, weights in branches(self.scheme, at.model.case.numerics.limiter).items():
            if name not in self.systems:
                # which set the degree of the polynomials at pipe ends
                cells = sum(weight != 0 for weight in weights)
                degree = min(cells - 1, 4) if self.scheme == "weno5" else int(name != "upwind")
                point = replace(self.at("upwind5"), y=at.y)
                self.systems[name] = LinearSystem(
                    with_weights(point, tuple(map(float, weights)), degree)
                )
            yield name, self.systems[name]

    def row(self, name: str) -> StabilityRow:
        """Row of the stability study for the scheme and a method; name : name of the method."""
        method = method_named(name)
        if delay_lines(self.case):
            return delayed_row(self.case, self.scheme, method, self.steps, self.threshold)
        if has_limiter(self.at(self.scheme).model):
            return self.limited_row(method)
        side = self.system(self.scheme)
        growth = growth_method(method, side.e, self.steps, self.threshold)
        limit = predicted_limit(growth)
        greatest = growth.growth(limit.fails) if np.isfinite(limit.fails) else None
        worst = greatest and greatest.start
        runs = RealRuns(
            side.at, method.name, side.form, worst, self.steps, self.threshold, a=side.linear.a
        )
        row = self.bound_columns(side, method) | {"predicted": limit.step}
        if greatest:
            shares: dict[str, float] = {}  # of the energy of the deviation, by part
            for part, root in zip(
                side.form.parts, side.form.rows @ (side.form.back @ greatest.end), strict=True
            ):
                shares[part] = shares.get(part, 0.0) + float(root**2)
            where = max(shares, key=shares.get)
            row |= {
                "growth": greatest.size,
                "after": greatest.steps,
                "where": where,
                "share": shares[where],
            }
        row |= measure_limit(runs, limit.step, growth.size, row["left_out"])
        result = StabilityRow(**row)
        notes = bound_notes(result, side, growth)
        if result.states > DENSE:
            notes.append(
                f"{result.states} states are more than {DENSE}, so the limit is predicted from powers of the "
                f"step matrix applied to {VECTORS} start vectors"
            )
        return StabilityRow(**row | {"notes": tuple(notes)})

    def first_columns(self, at: OperatingPoint, method) -> dict:
        """Columns that name the pair and the operating point."""
        return {
            "scheme": self.scheme,
            "method": method.name,
            "when": at.when,
            "states": at.model.y_size,
            "steps": self.steps,
            "threshold": self.threshold,
        }

    def bound_columns(self, side: LinearSystem, method) -> dict:
        """Columns that need no powers of the step matrix: names, sizes, bounds; side : linear system of the scheme."""
        model, left_out = side.at.model, {}
        values = side.spectrum
        row = self.first_columns(side.at, method) | {
            "rate": side.rate,
            "eigenvalues": region_limit(method, values.values),
            "greatest_real": float(values.values.real.max(initial=0.0)),
        }
        if not values.complete:
            some = f"it is computed from some eigenvalues, {values.description}"
            left_out["eigenvalues"] = f"the limit may be lower; {some}"
        if model.y_size <= MAX_STATES:
            row["field_of_values"] = region_limit(method, side.field)
        else:
            left_out["field_of_values"] = (
                f"not computed, because {model.y_size} states are more than {MAX_STATES}"
            )
        if model.cells:
            row["von_neumann"] = von_neumann_limit(self.scheme, method) / float(
                model.wave_rates.max()
            )
        return row | {"left_out": left_out}

    def limited_row(self, method) -> StabilityRow:
        """Row of a limited scheme: predicted limits with its weights held constant, and the limit of real runs.

        For Euler it has also the limit of runs of ten times as many steps.
        """
        at = self.at(self.scheme)
        limits = {}
        starts = {}
        left_out = {}
        work = prediction_limit(at.model.y_size, self.steps)  # of all these predictions together
        try:
            for name, side in self.frozen_systems():
                growth = growth_method(method, side.e, self.steps, self.threshold, work)
                limit = predicted_limit(growth)
                limits[name] = limit.step
                if 0.0 < limit.step < np.inf:
                    starts[limit.step] = growth.growth(limit.fails).start
        except TooLarge as error:
            left_out["frozen weights"] = str(error)
        # the middle value, between those of small and large slopes
        guess = sorted(starts)[len(starts) // 2] if starts else np.inf
        if left_out and not starts:
            guess = (
                von_neumann_limit(SCHEMES[self.scheme].smooth.name, method) / side.rate or np.inf
            )

        def runs(steps: int) -> RealRuns:
            return RealRuns(
                at,
                method.name,
                side.form,
                starts.get(guess),
                steps,
                self.threshold,
                LIMITED_DEVIATION,
            )

        row = self.first_columns(at, method) | {
            "rate": side.rate,
            "frozen": limits,
            "left_out": left_out,
        }
        row |= measure_limit(runs(self.steps), guess, growth.size, left_out)
        if method.stages == 1 and method.explicit and np.isfinite(row.get("measured", np.nan)):
            longer = measure_limit(
                runs(LONGER_FACTOR * self.steps), row["measured"], 0.0, left_out, "longer"
            )
            row["longer"] = longer.get("measured", np.nan)
        return StabilityRow(**row | {"notes": tuple(bound_notes(StabilityRow(**row), side, None))})


def von_neumann_limit(scheme: str, method) -> float:
    """Von Neumann's limit of the Courant number, for a linear scheme on a uniform grid."""
    from fvsolve.core.step_limits.advection_limit import advection_limit

    return advection_limit(scheme, method.name).limit
