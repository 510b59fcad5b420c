"""Order study of one scheme and method: runs of all rows, errors against a reference, fitted orders, and their picture.

Arguments of several functions : rows, each an `OrderRow`; fits, variable -> norm -> `Fit`; points, result cache;
progress, called as progress(done, total, next)
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fvsolve.core.assembly.scheme_codes import limiter_notices
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError
from fvsolve.parts.nodes_and_links import NETWORK_DOMAINS
from fvsolve.studies.accuracy.fit import FAILED, FLOOR, LEAST_ROWS, NO_ERROR, Fit, fit
from fvsolve.studies.accuracy.refine import Level, Plan
from fvsolve.studies.distance import NORMS, error_norms, recording_keys, variable_size
from fvsolve.studies.outcome import (
    REFERENCE_CPU_LIMIT,
    Outcome,
    Progress,
    capped,
    outcome,
    study_model,
)
from fvsolve.studies.parallel import RunQueue, RunRequest
from fvsolve.studies.reference import ROUNDING, Reference, find_reference, reference_of_run
from fvsolve.studies.resolution import (
    EXACT_NOTE,
    EXPECTED_ORDER,
    READING_ORDER,
    basins,
    cell_counts,
    cells_for_lines,
    delay_lines,
    greatest_wave_rate,
    has_initial_jump,
    order_varies,
    scheme_order,
    unit_of,
)
from fvsolve.studies.result_cache import ResultCache


@dataclass(frozen=True)
class OrderRow(PlainData):
    """Row of an order study: a refinement level with its errors and cost.

    errors : variable -> {"L1" | "L2" | "max": error [SI]}; seconds : time of the run [s]
    rhs : number of evaluations of the rates; reason : reason of a failed run, else empty
    """

    level: Level
    errors: dict[str, dict[str, float]]
    seconds: float
    rhs: int
    cell_updates: int
    steps: int
    reason: str = ""

    json = """cells=level.cells size=level.size step=level.step set=level.set
              seconds rhs cell_updates steps reason errors"""


@dataclass(frozen=True, repr=False)
class Order(Displayable, PlainData):
    """Order study of one scheme and method.

    rows : refinement levels with errors, from coarse to fine; fits : variable -> {"L1" | "L2" | "max": Fit}
    kind : kind of the reference, "exact" | "finer" | "richardson" | "function"; words : description of the reference
    own_error : variable -> {"L1" | "L2" | "max": error of the reference itself [SI]}; notes : remarks on the numbers
    units : SI units of the variables of basins
    shown : variable -> (factor from SI, unit) of its printed errors, and "length" -> that of printed cell sizes; errors
    of variables without an entry are printed in SI
    """

    case: str
    scheme: str
    method: str
    plan: Plan
    kind: str
    words: str
    rows: tuple[OrderRow, ...]
    fits: dict[str, dict[str, Fit]]
    own_error: dict[str, dict[str, float]]
    notes: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    shown: dict[str, tuple[float, str]] = field(default_factory=dict)

    picture = "fvsolve.studies.accuracy.order_study:order_picture"
    json = "case scheme method refine=plan.way measure=plan.measure how=plan.words reference rows fits notes"

    def summary_line(self) -> str:
        return f"of {self.case!r}: {self.scheme}, {self.method}, {len(self.rows)} rows against {self.kind}"

    def table_columns(self) -> dict[str, list]:
        """Columns of the table, header -> value of each row: cells, size, step [s], errors in SI, and cost."""
        columns: dict[str, list] = {"cells": [row.level.cells for row in self.rows]}
        columns |= {
            "size": [row.level.size for row in self.rows],
            "step": [row.level.step for row in self.rows],
        }
        for name, norms in self.fits.items():
            for norm in norms:
                key = f"{name} {norm}"
                columns[key] = [row.errors.get(name, {}).get(norm, math.nan) for row in self.rows]
        return columns | {
            "rhs": [row.rhs for row in self.rows],
            "seconds": [row.seconds for row in self.rows],
        }

    def error_unit(self, variable: str) -> tuple[float, str]:
        """(factor from SI, unit) of the printed errors of a variable."""
        return self.shown.get(variable) or (1.0, variable_unit(variable, self.units))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the compared variables."""
        return tuple(self.fits)

    @property
    def reference(self) -> dict:
        """Kind, description and error of the reference."""
        return {"kind": self.kind, "words": self.words, "own_error": self.own_error}


SHOWN_VARIABLES = 3  # variables with a table on the terminal; order.csv contains all
# measure that is printed in the units of the case; steps and tolerances are SI
CELLS = "cell size [m]"


def order_picture(study):
    """matplotlib Figure of an `Order`: errors over size, a panel for each first variable, a line for each norm."""
    from fvsolve.report.draw.accuracy_pictures import order_figure

    length_factor, length = (
        study.shown.get("length", (1.0, "m")) if study.plan.measure == CELLS else (1.0, "")
    )
    measure = CELLS.replace("[m]", f"[{length}]") if length else study.plan.measure
    curves = {}
    for variable, fits in list(study.fits.items())[: 2 * SHOWN_VARIABLES]:
        size, error_unit = study.error_unit(variable)
        curves[f"{variable} [{error_unit}]"] = {
            norm: (
                [size * row.errors.get(variable, {}).get(norm, math.nan) for row in study.rows],
                replace(fit, constant=size * fit.constant / length_factor**fit.order),
            )
            for norm, fit in fits.items()
        }
    sizes = [length_factor * row.level.size for row in study.rows]
    return order_figure(
        sizes, curves, measure, f"{study.case}: {study_title(study)}; {study.words}"
    )


def study_title(study) -> str:
    """Title of an `Order` study: scheme, method and description of the refinement."""
    scheme = f"{study.scheme}, " if study.rows[0].level.cells else ""
    return f"{scheme}{study.method}, {study.plan.words}"


def variable_unit(variable: str, known: Mapping[str, str] = {}) -> str:  # noqa: B006
    """SI unit of a variable of an order study: from `known` (variable -> unit), otherwise from its dimension."""
    from fvsolve.units import DIMENSIONS

    return known[variable] if variable in known else DIMENSIONS[variable_dimension(variable)].si


def variable_dimension(variable: str, case=None) -> str:
    """Dimension of a variable of pipes, nodes or links, such as "pressure"; "number" for other variables.

    case : case whose part is named before the quantity; None for the first type of part that has the quantity
    """
    from fvsolve.parts import KINDS

    quantity = variable.split("@")[0].rsplit(".", 1)[-1].rsplit(" ", 1)[-1]
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    kinds.sort(key=lambda kind: getattr(kind, "domain", "") in NETWORK_DOMAINS)
    if case is not None:
        name = variable.split("@")[0].rsplit(".", 1)[0].rsplit(" ", 1)[-1]
        kinds = [*(parts[name] for parts in (case.nodes, case.links) if name in parts), *kinds]
    return next(
        (
            quantities[quantity]
            for kind in kinds
            for quantities in (kind.quantities, getattr(kind, "along", {}))
            if quantity in quantities
        ),
        "number",
    )


def error_scale(case, variable: str) -> tuple[float, str]:
    """(factor from SI, unit) of errors of a variable in the units of `[output]`, or of lengths for "length"."""
    from fvsolve.core.output.unit_columns import column

    result = column(
        "", variable if variable == "length" else variable_dimension(variable, case), case
    )
    return result.span_from_si(1.0), result.span_unit


# timed runs of a row; time of the first run above which it is not repeated [s]
BEST_OF, BRIEF_RUN = 2, 1.0
# greatest excess of a fitted order over that of scheme and method; it occurs at single points
EXCESS_ORDER = 1.5
REFERENCE_MARGIN = 10.0  # errors below this multiple of the error of the reference are not used
UNCERTAIN = "reference"  # mark of rows with errors too close to that of the reference
FINEST_ROW = "finest"  # mark of a row that ran, but has no finer row for comparison
# greatest relative error of the factor 1 / (1 - ratio^-p) of an extrapolation
EXTRAPOLATION_ERROR = 0.25
# relative to the size of a variable: smaller errors do not come from steps or stretches
EXACT_ERROR = 1e-12
# a, b: greatest distance a + b order of an order of three differences from theory
ORDER_TOLERANCE = 0.06, 0.04


def timed_run(case, keys: Mapping) -> Outcome:
    """Outcome of a case with changed keys: of the faster of two runs, or of a single run if it takes long."""
    return outcome(case, keys, best_of=BEST_OF, run=capped(REFERENCE_CPU_LIMIT), budget=BRIEF_RUN)


class OrderStudy:
    """Order study of one scheme and method: runs the rows of a refinement, compares them with a reference, fits orders.

    plan : refinement; against : kind of the reference as in `order`
    queue : `RunQueue` that makes the runs; settings : overrides that turn the case of the queue into `case`
    """

    def __init__(self, case, plan: Plan, against: str, queue: RunQueue, settings: Mapping) -> None:
        self.case, self.plan, self.against = case, plan, against
        self.queue, self.stages = queue, (dict(settings),)
        self.probe_names = tuple(probe.text for probe in case.probes)
        if against == "exact" and case.exact is None:
            raise FvsolveError(
                'reference = "exact": the case names no solution under [exact]; expected "finer"'
            )
        # 4 times the cells along both axes take too long
        if against == "auto" and case.exact is None and basins(case):
            self.against = "richardson"

    @cached_property
    def breaks(self) -> list[tuple[float, bool]]:
        """Kinks and jumps that travel through cells: (time [s], True for a jump), also those of the initial state."""
        breaks = list(study_model(self.case).breaks)
        first, second = (level.set for level in self.plan.levels[:2])
        if self.plan.way != "time" and has_initial_jump(self.case, first, second):
            breaks.append((self.case.numerics.start, True))
        return breaks

    def study(self, points: ResultCache | None, progress: Progress) -> Order:
        """Run and fit all rows, coarsest first; rows against a reference are stored in the cache `points` and reused.

        With the reference "auto", each row is compared with the next if a finer run fails, or is not more accurate than
        the rows. Raises FvsolveError if no row runs, or if the reference of the caller or [exact] cannot be used.
        """
        if self.against == "richardson":
            return self.richardson(progress)
        try:
            return self.against_reference(points, progress)
        except FvsolveError as error:
            if self.against != "auto" or self.case.exact is not None:
                raise
            result = self.richardson(progress)
            return replace(
                result, notes=(f"no other reference can be used: {error}", *result.notes)
            )

    def against_reference(self, points: ResultCache | None, progress: Progress) -> Order:
        """Study against an exact solution or a finer run."""
        rows, levels = [], self.plan.levels
        total = len(levels) + 1

        def cached(name, make):
            return make() if points is None else points.get(self.case, self.cache_key(name), make)

        reference_data = cached("reference", lambda: self.reference_data(progress, total))
        if points is not None and not self.queue.in_process:
            new = [
                k for k in range(len(levels)) if points.find(self.case, self.cache_key(k)) is None
            ]
            # before other runs start, else they would wait for each other
            reference = self.reference if new else None
            for count, at in enumerate(
                self.queue.run_ahead([self.request(levels[k]) for k in new]), 1
            ):
                cached(new[at], lambda level=levels[new[at]]: self.row(level).plain())
                progress(total - len(new) + count - 1, total, reference.words)
        for k, level in enumerate(levels):
            progress(k + 1, total, level_text(self.plan, level))
            data = cached(k, lambda level=level: self.row(level).plain())
            seconds = np.nan if data["seconds"] is None else data["seconds"]
            work = data["rhs"], data["cell_updates"], data["steps"]
            rows.append(
                OrderRow(level, error_numbers(data["errors"]), seconds, *work, data["reason"])
            )
        own, sizes = error_numbers(reference_data["own"]), reference_data["sizes"]
        return self.fitted_order(rows, reference_data["kind"], reference_data["words"], own, sizes)

    def cache_key(self, name) -> dict:
        """Values that identify a cached result of the case; name : "reference" or the number of a row."""
        return {
            "study": "order",
            "against": self.against,
            "way": self.plan.way,
            "what": name,
            "levels": [level.set for level in self.plan.levels],
        }

    def reference_data(self, progress: Progress, total: int) -> dict:
        """Plain data: kind, words and error of the reference, greatest values of variables; total : for `progress`."""
        progress(0, total, "reference")
        reference = self.reference
        return {
            "kind": reference.kind,
            "words": reference.words,
            "own": reference.own_error,
            "sizes": self.sizes(),
        }

    @cached_property
    def reference(self) -> Reference:
        """Reference of all rows."""
        way = "both" if self.against == "exact" else self.plan.way
        return self.find_reference(way, self.against != "finer", queue=self.queue)

    def find_reference(self, way: str, exact: bool, **options) -> Reference:
        """Find a reference for the finest row by `reference.find_reference`, from one kind of reference runs.

        Runs with another scheme and method than the rows are preferred.
        way : "time" for a reference with the cells and scheme of the case; exact : True to use the exact solution of
        the case if it applies; options : further arguments of `reference.find_reference`
        """
        method, last = METHODS.get(self.case.numerics.method), self.plan.levels[-1]
        delayed = way != "time" and delay_lines(self.case)
        keys = last.set | (cells_for_lines(self.case, last.step) if delayed else {})
        return find_reference(
            self.case,
            recording_keys(self.case, keys),
            opinions=1,
            exclude_own=True,
            way=way,
            lines=bool(delayed),
            stiff=method is None or not method.explicit,
            exact=exact,
            stages=self.stages,
            **options,
        )

    def request(self, level: Level) -> RunRequest:
        """`RunRequest` for the run of a refinement level."""
        return RunRequest(timed_run, recording_keys(self.case, level.set), self.stages)

    def run(self, level: Level) -> Outcome:
        """Outcome of the run of a refinement level."""
        return self.queue(self.case, self.request(level))

    def sizes(self) -> dict[str, float]:
        """Greatest value of each variable in the coarsest row that runs [SI]; raises FvsolveError if no row runs."""
        for level in self.plan.levels:
            run = self.run(level)
            if run.ok:
                return {
                    name: variable_size(run, name)
                    for name in error_norms(run, self.reference, self.probe_names)
                }
        raise FvsolveError(f"no row could be run: {run.reason}")

    def row(self, level: Level) -> OrderRow:
        """Make the run of a refinement level; returns its `OrderRow` with errors."""
        run = self.run(level)
        errors = error_norms(run, self.reference, self.probe_names) if run.ok else {}
        return row_of_run(level, run, errors)

    def fitted_order(self, rows, kind: str, words: str, own: dict, sizes: dict) -> Order:
        """Fit an order for every variable and norm, and add notes. Raises the FvsolveError of `refuse_reference`.

        kind, words : kind and description of the reference
        own : variable -> norm -> error of the reference [SI]; sizes : variable -> greatest absolute value [SI]
        """
        fits = {}
        doubtful = []
        smooth_order = self.smooth_order()
        for name in sizes:
            fits[name] = {}
            for norm in NORMS:
                errors = [row.errors.get(name, {}).get(norm, np.nan) for row in rows]
                floor, rounding = own.get(name, {}).get(norm, 0.0), ROUNDING * sizes[name]
                fitted = check_order(
                    fit([row.level.size for row in rows], errors, max(floor, rounding)),
                    smooth_order,
                )
                uncertain = [e < REFERENCE_MARGIN * floor and floor > rounding for e in errors]
                pairs = zip(uncertain, fitted.marks, strict=True)
                marks = [UNCERTAIN if bad and mark == FLOOR else mark for bad, mark in pairs]
                fits[name][norm] = replace(fitted, marks=tuple(marks))
                doubtful += [name] if any(mark == UNCERTAIN for mark in marks) else []
        self.refuse_reference(rows, fits, words)
        left_out = self.case.exact is None and "exact" in self.case.raw
        notes = ["[exact] does not hold with these settings and is not used"] if left_out else []
        largest = [
            max(norms.values()) / sizes[name]
            for row in rows
            for name, norms in row.errors.items()
            if name not in ("pressure", "flow") and sizes[name] > 0.0
        ]
        exact = bool(delay_lines(self.case)) and max(largest, default=1.0) <= EXACT_ERROR
        notes += row_notes(rows, [] if exact else doubtful)
        numerics = self.case.numerics
        notes += [*self.order_notes(exact), *self.step_error_note(fits)]
        notes += [notice.text for notice in limiter_notices(numerics.scheme, numerics.limiter)]
        units = {name: unit for name in fits if (unit := unit_of(self.case, name)) is not None}
        scales = {
            name: error_scale(self.case, name) for name in [*fits, "length"] if name not in units
        }
        return Order(
            self.case.name,
            numerics.scheme,
            numerics.method,
            self.plan,
            kind,
            words,
            tuple(rows),
            fits,
            own,
            tuple(notes),
            units,
            scales,
        )

    def refuse_reference(self, rows, fits, words: str) -> None:
        """Raise FvsolveError if all errors of all variables are too close to that of the reference, named `words`."""
        uncertain = [
            mark == UNCERTAIN
            for name, norms in fits.items()
            for norm, fitted in norms.items()
            for row, mark in zip(rows, fitted.marks, strict=True)
            if row.errors.get(name, {}).get(norm, 0.0) > 0.0
        ]
        if uncertain and all(uncertain):
            raise FvsolveError(
                f"the reference is not more accurate than the rows ({words}); name an exact solution under [exact], "
                'or try against = "richardson", or coarser rows'
            )

    def smooth_order(self) -> float:
        """Order of scheme and method together for smooth solutions; NaN if tolerances are refined.

        With delay lines it is the order of the interpolation in their history, for any method.
        """
        if delay_lines(self.case) and self.plan.measure != "rtol":
            return READING_ORDER
        numerics, space = self.case.numerics, scheme_order(self.case)
        if self.plan.way == "space" or (self.plan.way == "both" and numerics.rtol is not None):
            return space
        if self.plan.measure == "rtol":
            return np.nan
        method = METHODS[numerics.method].order
        return method if self.plan.way == "time" else min(space, method)

    def theory(self) -> dict[str, float]:
        """Expected order for each norm, NaN if it is not known.

        Jumps (s = 0) and kinks (s = 1) reduce the order p of smooth solutions to (s + 1) p / (p + 1) in L1,
        (s + 1/2) p / (p + 1) in L2 and s p / (p + 1) in max. Bores, the jumps of a free surface, reduce it to 1 in L1,
        1/2 in L2 and 0 in max.
        """
        p, breaks = self.smooth_order(), self.breaks
        if delay_lines(self.case):
            return dict.fromkeys(NORMS, np.nan)
        if self.plan.way == "time" or not breaks:
            return dict.fromkeys(
                NORMS, np.nan if self.plan.way != "time" and order_varies(self.case) else p
            )
        s = 0.0 if any(jumps for _, jumps in breaks) else 1.0
        if s == 0.0 and any(basin.physics_type.has_shocks for basin in basins(self.case).values()):
            return {"L1": 1.0, "L2": 0.5, "max": 0.0}  # bores remain steep
        return {"L1": (s + 1) * p / (p + 1), "L2": (s + 0.5) * p / (p + 1), "max": s * p / (p + 1)}

    def order_notes(self, exact: bool) -> list[str]:
        """Notes on the expected order with jumps, kinks or delay lines; exact : True if their errors are rounding."""
        breaks = self.breaks
        if delay_lines(self.case):
            return [EXACT_NOTE if exact else EXPECTED_ORDER]
        if self.plan.way == "time" or not breaks:
            return []
        jump, orders = any(jumps for _, jumps in breaks), self.theory()
        effect = "jumps, so that fronts travel" if jump else "has kinks, which travel"
        source = "a schedule" if study_model(self.case).breaks else "the start"
        max_order = "none in max" if jump else f"{orders['max']:.2g} in max"
        parts = (
            ", as do those of parts that open or shut during the run"
            if study_model(self.case).events
            else ""
        )
        return [
            f"{source} {effect} through the cells{parts}: order {self.smooth_order()} in space and time is expected "
            f"to show as about {orders['L1']:.2g} in L1, {orders['L2']:.2g} in L2 and {max_order}"
        ]

    def step_error_note(self, fits) -> list[str]:
        """List with a remark on a smaller step or tolerance if the time error may hide the order in space, or []."""
        with_errors = [norms["L1"] for norms in fits.values() if norms["L1"].reason != NO_ERROR]
        hidden = any(FLOOR in fitted.marks or fitted.reason for fitted in with_errors)
        if self.plan.way != "space" or not hidden or len(self.plan.levels) < LEAST_ROWS:
            return []
        numerics, step = self.case.numerics, self.plan.levels[-1].step
        if numerics.rtol is not None:
            key = f"rtol={max(1e-13, 1e-3 * numerics.rtol):.2g}"
        elif numerics.step is not None:
            key = f"step={0.25 * step:.2g}"
        else:
            last = self.plan.levels[-1].set
            cells = {
                name: tuple(np.atleast_1d(last[name]).tolist()) for name in cell_counts(self.case)
            }
            key = f"courant={0.25 * step * greatest_wave_rate(self.case, cells):.2g}"
        return [
            f"the time error is the same in all rows. If it hides the order in space, try --set numerics.{key}"
        ]

    # Richardson ------------------------------------------------------------------------------------------------

    def richardson(self, progress: Progress) -> Order:
        """Study without a reference: differences between each row and the next, extrapolated to errors."""
        runs, levels = [], self.plan.levels
        for count, at in enumerate(
            self.queue.run_ahead([self.request(level) for level in levels]), 1
        ):
            progress(count, len(levels), level_text(self.plan, levels[at]))
        for k, level in enumerate(levels):
            progress(k, len(levels), level_text(self.plan, level))
            runs.append(self.run(level))
        rows = []
        for level, run, after in zip(self.plan.levels, runs, [*runs[1:], None], strict=True):
            both = run.ok and after is not None and after.ok
            errors = error_norms(run, reference_of_run(after), self.probe_names) if both else {}
            rows.append(row_of_run(level, run, errors))
        names = next((row.errors for row in rows if row.errors), {})
        good = next((run for run in runs if run.ok), None)
        if good is None:
            raise FvsolveError(f"no row could be run: {runs[0].reason}")
        sizes = {name: variable_size(good, name) for name in names}
        result, theory = self.fitted_order(rows, "richardson", RICHARDSON, {}, sizes), self.theory()
        fits = {
            name: {
                norm: mark_finest(check_three_differences(fitted, theory[norm]), rows)
                for norm, fitted in norms.items()
            }
            for name, norms in result.fits.items()
        }
        notes = *result.notes, *difference_notes(rows, fits)
        return replace(result, rows=extrapolate(rows, fits), fits=fits, notes=notes)


def check_order(fitted: Fit, smooth_order: float) -> Fit:
    """Return a fit, with a note if its order is far above `smooth_order`, the order of scheme and method together."""
    if fitted.reason or not fitted.order > smooth_order + EXCESS_ORDER:
        return fitted
    return replace(
        fitted,
        note=f"errors fall faster than the order {smooth_order:g} of scheme and method allows: the "
        "motion decays, or errors change sign, so this is not the order of the method",
    )


RICHARDSON = "Richardson: each row against the next, extrapolated"


def check_three_differences(fitted: Fit, theory: float) -> Fit:
    """Return a fit of differences; an order of only three rows is removed if it differs from the order `theory`."""
    tolerance = max(fitted.spread, ORDER_TOLERANCE[0] + ORDER_TOLERANCE[1] * theory)
    if (
        fitted.reason
        or fitted.marks.count("") > LEAST_ROWS
        or not abs(fitted.order - theory) > tolerance
    ):
        return fitted
    reason = (
        f"no order: three differences show {fitted.order:.2f}, but {theory:.2g} is expected; they are too few to "
        "decide if rows are still too coarse; try more levels, or finer rows"
    )
    return replace(fitted, order=np.nan, spread=np.nan, constant=np.nan, reason=reason, note="")


def mark_finest(fitted: Fit, rows) -> Fit:
    """Return a fit in which rows that ran but have no finer row have the mark "finest" instead of "failed"."""
    pairs = zip(fitted.marks, rows, strict=True)
    marks = tuple(FINEST_ROW if mark == FAILED and not row.reason else mark for mark, row in pairs)
    return replace(fitted, marks=marks)


def is_certain(fitted: Fit, ratio: float) -> bool:
    """True if 1 / (1 - ratio^-p), with the fitted order p and the ratio of sizes of rows, is certain to a quarter."""
    return fitted.order > 0.0 and np.log(ratio) * fitted.spread <= EXTRAPOLATION_ERROR * (
        ratio**fitted.order - 1.0
    )


def extrapolate(rows, fits) -> tuple[OrderRow, ...]:
    """Rows with errors instead of differences to the next row, where the fitted order p is certain (see `is_certain`).

    The error of a row is its difference d plus the error of the next row. After the last difference, the error of the
    next row is d / (ratio^p - 1), with the ratio of the sizes of both rows.
    """
    results: list[OrderRow] = []
    for k in range(len(rows) - 1, -1, -1):
        errors, after = {}, results[-1].errors if results else {}
        for name, norms in rows[k].errors.items():
            ratio, errors[name] = rows[k].level.size / rows[k + 1].level.size, {}
            for norm, d in norms.items():
                fitted = fits[name][norm]
                rest = after[name][norm] if name in after else d / (ratio**fitted.order - 1.0)
                errors[name][norm] = d + rest if is_certain(fitted, ratio) else d
        results.append(replace(rows[k], errors=errors))
    return tuple(reversed(results))


def difference_notes(rows, fits) -> list[str]:
    """List with a note on variables whose order is uncertain (see `is_certain`), at most three, or an empty list."""
    ratio = rows[0].level.size / rows[1].level.size
    names = [
        f"{name} ({', '.join(uncertain)})"
        for name, norms in fits.items()
        if (uncertain := [norm for norm, fitted in norms.items() if not is_certain(fitted, ratio)])
    ]
    if not names:
        return []
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return [
        f"where the order is uncertain, nothing is extrapolated: for {', '.join(names[:3])}{more} the table "
        "shows differences to the next row, and errors are larger"
    ]


def row_of_run(level: Level, run: Outcome, errors: dict) -> OrderRow:
    """`OrderRow` of a refinement level, from its run and errors."""
    counts = run.counts
    updates = run.cell_updates if run.model is not None else 0
    return OrderRow(
        level,
        errors,
        run.seconds,
        counts.get("rhs", 0),
        updates,
        counts.get("steps", 0),
        "" if run.ok else run.reason,
    )


def error_numbers(errors: Mapping) -> dict:
    """Errors from plain data : variable -> {norm: error}, with NaN instead of None."""
    return {
        name: {norm: np.nan if e is None else e for norm, e in norms.items()}
        for name, norms in errors.items()
    }


def level_text(plan: Plan, level: Level) -> str:
    """Text of the resolution of a refinement level, such as "200 cells" or "step 0.001"."""
    if plan.way != "time" and level.cells:
        return f"{level.cells} cells"
    return f"{plan.measure.split(' ')[0]} {level.size:.4g}"


def row_notes(rows, doubtful: list[str]) -> list[str]:
    """Notes on failed rows, and on the variables `doubtful`, whose errors are too close to that of the reference."""
    notes = []
    failed = [row for row in rows if row.reason]
    if failed:
        notes.append(
            f"{len(failed)} of {len(rows)} rows failed; reason of the first: {failed[0].reason}"
        )
    if doubtful:
        names = ", ".join(dict.fromkeys(doubtful))
        notes.append(
            f'errors of rows marked "{UNCERTAIN}" are less than {REFERENCE_MARGIN:g} times the error of the reference '
            f"({names}), so they are not reliable; name an exact solution under [exact], or try fewer levels"
        )
    return notes
