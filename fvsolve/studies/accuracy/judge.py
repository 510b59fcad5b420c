"""The rows of one order study: run, measured against a reference, fitted. Knows runs and errors; knows no words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.steppers.methods import METHODS
from fvsolve.studies.accuracy.cells import basins, counts, greatest_rate, order_varies, space_order, starts_with_jump
from fvsolve.studies.accuracy.fit import FAILED, FLOOR, LEAST_ROWS, NO_ERROR, Fit, fit
from fvsolve.studies.accuracy.picture import differences_in
from fvsolve.studies.accuracy.plane import unit_of
from fvsolve.studies.accuracy.refine import Level, Plan
from fvsolve.studies.accuracy.rows import Order, OrderRow
from fvsolve.studies.accuracy.timing import lasting
from fvsolve.studies.distance import NORMS, differences, recorded, size_of
from fvsolve.studies.errands import Errand, Errands
from fvsolve.studies.lines import EXACT, EXPECTED, READING, cells_for_lines, lines
from fvsolve.studies.outcome import Outcome, Progress, outcome, prepared
from fvsolve.studies.points import Points
from fvsolve.studies.truth import ROUNDING, Truth, of_run, truth

BEST_OF, BRIEF = 2, 1.0  # timings of a row; [s] that the first may take for there to be a second
BEYOND = 1.5  # by which a fitted order may exceed that of scheme and method, as some do at a point
WORTH = 10.0  # times the truth's own error that an error must be to mean anything
UNSURE = "reference"  # the mark of rows that the reference cannot judge
FINEST = "finest"  # the mark of a row that ran, with no finer one to judge it
SURE_FACTOR = 0.25  # error that an extrapolated error may have
RIGHT = 1e-12  # of the size of a variable: errors that steps and stretches have no part in
ASTRAY = 0.06, 0.04  # how far from theory an order of three differences may lie: a + b order


def timed(case, keys: Mapping) -> Outcome:
    """The run of a row."""
    return outcome(case, keys, best_of=BEST_OF, run=lasting, budget=BRIEF)


class Judge:
    """The rows of one study and what they are measured against.

    errands : who makes its runs; settings : what was set on their case to make this one
    """

    def __init__(self, case, made: Plan, against: str, errands: Errands, settings: Mapping) -> None:
        self.case, self.plan, self.against = case, made, against
        self.errands, self.stages = errands, (dict(settings),)
        self.own = tuple(probe.text for probe in case.probes)
        if against == "exact" and case.exact is None:
            raise FvsolveError('against = "exact": the case names no solution under [exact]; wanted "finer"')
        if against == "auto" and case.exact is None and basins(case):  # runs four times finer both ways are too dear
            self.against = "richardson"

    @cached_property
    def breaks(self) -> list[tuple[float, bool]]:
        """Kinks and jumps that run through cells: (time [s], whether a value jumps), the start's among them."""
        found = list(prepared(self.case).breaks)
        first, second = (level.set for level in self.plan.levels[:2])
        if self.plan.way != "time" and starts_with_jump(self.case, first, second):
            found.append((self.case.numerics.start, True))
        return found

    def study(self, points: Points | None, progress: Progress) -> Order:
        """Run all rows, coarsest first, and fit; those that `points` has are reused.

        Under "auto", where a finer run fails or is no better than what it would judge, each row judges the one before.
        """
        if self.against == "richardson":
            return self.richardson(progress)
        try:
            return self.judged(points, progress)
        except FvsolveError as error:
            if self.against != "auto" or self.case.exact is not None:
                raise
            found = self.richardson(progress)
            return replace(found, notes=(f"no other reference would do: {error}", *found.notes))

    def judged(self, points: Points | None, progress: Progress) -> Order:
        """The study against an exact solution or a finer run."""
        rows, levels = [], self.plan.levels
        total = len(levels) + 1

        def kept(what, make):
            return make() if points is None else points.get(self.case, self.extra(what), make)

        known = kept("reference", lambda: self.about(progress, total))
        if points is not None and not self.errands.alone:
            new = [k for k in range(len(levels)) if points.find(self.case, self.extra(k)) is None]
            truth = self.truth if new else None  # before others begin, or they would wait for each other
            for count, at in enumerate(self.errands.ahead([self.errand(levels[k]) for k in new]), 1):
                kept(new[at], lambda level=levels[new[at]]: self.row(level).plain())
                progress(total - len(new) + count - 1, total, truth.words)
        for k, level in enumerate(levels):
            progress(k + 1, total, words_of(self.plan, level))
            found = kept(k, lambda level=level: self.row(level).plain())
            rows.append(row_of(level, found))
        own, sizes = plain_numbers(known["own"]), known["sizes"]
        return self.made(rows, known["kind"], known["words"], own, sizes)

    def extra(self, what) -> dict:
        """What names a point beside the case."""
        return {"study": "order", "against": self.against, "way": self.plan.way, "what": what,
                "levels": [level.set for level in self.plan.levels]}  # fmt: skip

    def about(self, progress: Progress, total: int) -> dict:
        """The reference in words and numbers."""
        progress(0, total, "reference")
        found = self.truth
        return {"kind": found.kind, "words": found.words, "own": found.own, "sizes": self.sizes()}

    @cached_property
    def truth(self) -> Truth:
        """What rows are measured against."""
        way = "both" if self.against == "exact" else self.plan.way
        return self.finer(way, self.against != "finer", errands=self.errands)

    def finer(self, way: str, exact: bool, **others) -> Truth:
        """The truth for the finest row by one kind of runs, made otherwise than it; in time by the same cells."""
        method, last = METHODS.get(self.case.numerics.method), self.plan.levels[-1]
        delayed = way != "time" and lines(self.case)
        keys = last.set | (cells_for_lines(self.case, last.step) if delayed else {})
        return truth(
            self.case, recorded(self.case, keys), opinions=1, judged=True, way=way, lines=bool(delayed),
            stiff=method is None or not method.explicit, exact=exact, stages=self.stages, **others,
        )  # fmt: skip

    def errand(self, level: Level) -> Errand:
        """What the run of a row is."""
        return Errand(timed, recorded(self.case, level.set), self.stages)

    def run(self, level: Level) -> Outcome:
        """The run of a row."""
        return self.errands(self.case, self.errand(level))

    def sizes(self) -> dict[str, float]:
        """How large each variable is, by the first row that runs: rounding is measured against it."""
        for level in self.plan.levels:
            run = self.run(level)
            if run.ok:
                return {name: size_of(run, name) for name in differences(run, self.truth, self.own)}
        raise FvsolveError(f"no row could be run: {run.reason}")

    def row(self, level: Level) -> OrderRow:
        """A run with its errors."""
        run = self.run(level)
        errors = differences(run, self.truth, self.own) if run.ok else {}
        return measured(level, run, errors)

    def made(self, rows, kind: str, words: str, own: dict, sizes: dict) -> Order:
        """Fits of all variables and norms, and what is to be said of them."""
        fits, doubtful, most = {}, [], self.smooth_order()
        for name in sizes:
            fits[name] = {}
            for norm in NORMS:
                errors = [row.errors.get(name, {}).get(norm, np.nan) for row in rows]
                floor, rounding = own.get(name, {}).get(norm, 0.0), ROUNDING * sizes[name]
                found = plausible(fit([row.level.size for row in rows], errors, max(floor, rounding)), most)
                unsure = [e < WORTH * floor and floor > rounding for e in errors]
                pairs = zip(unsure, found.marks, strict=True)
                marks = [UNSURE if bad and mark == FLOOR else mark for bad, mark in pairs]
                fits[name][norm] = replace(found, marks=tuple(marks))
                doubtful += [name] if any(mark == UNSURE for mark in marks) else []
        self.refuse(rows, fits, words)
        left_out = self.case.exact is None and "exact" in self.case.raw
        notes = ["[exact] does not hold with these settings and is left out"] if left_out else []
        largest = [max(norms.values()) / sizes[name] for row in rows for name, norms in row.errors.items()
                   if name not in ("pressure", "flow") and sizes[name] > 0.0]  # fmt: skip
        exact = bool(lines(self.case)) and max(largest, default=1.0) <= RIGHT
        notes += notes_of(rows, [] if exact else doubtful)
        notes += [*self.expected(exact), *self.way_out(fits)]
        numerics = self.case.numerics
        known = {name: unit for name in fits if (unit := unit_of(self.case, name)) is not None}
        shown = {name: differences_in(self.case, name) for name in [*fits, "length"] if name not in known}
        return Order(self.case.name, numerics.scheme, numerics.method, self.plan, kind, words, tuple(rows), fits, own,
                     tuple(notes), known, shown)  # fmt: skip

    def refuse(self, rows, fits, words: str) -> None:
        """FvsolveError where the reference can judge no row in any variable."""
        told = [
            mark == UNSURE
            for name, norms in fits.items() for norm, one in norms.items()
            for row, mark in zip(rows, one.marks, strict=True) if row.errors.get(name, {}).get(norm, 0.0) > 0.0
        ]  # fmt: skip
        if told and all(told):
            raise FvsolveError(
                f"the reference is no better than the runs it judges ({words}); name an exact solution under [exact], "
                'take against = "richardson", or coarser rows'
            )

    def smooth_order(self) -> float:
        """Order that scheme and method have together where all is smooth; NaN where rows are tolerances.

        Delay lines may show that by which they read what was sent, whatever the method.
        """
        if lines(self.case) and self.plan.measure != "rtol":
            return READING
        numerics, space = self.case.numerics, space_order(self.case)
        if self.plan.way == "space" or (self.plan.way == "both" and numerics.rtol is not None):
            return space
        if self.plan.measure == "rtol":
            return np.nan
        method = METHODS[numerics.method].order
        return method if self.plan.way == "time" else min(space, method)

    def theory(self) -> dict[str, float]:
        """Norm -> order expected, NaN: none; jumps (s = 0) and kinks (s = 1) leave (s + 1) p / (p + 1) of p in L1."""
        p, breaks = self.smooth_order(), self.breaks
        if lines(self.case):
            return dict.fromkeys(NORMS, np.nan)
        if self.plan.way == "time" or not breaks:
            return dict.fromkeys(NORMS, np.nan if self.plan.way != "time" and order_varies(self.case) else p)
        s = 0.0 if any(jumps for _, jumps in breaks) else 1.0
        if s == 0.0 and any(basin.own.steep for basin in basins(self.case).values()):
            return {"L1": 1.0, "L2": 0.5, "max": 0.0}  # bores keep steep
        return {"L1": (s + 1) * p / (p + 1), "L2": (s + 0.5) * p / (p + 1), "max": s * p / (p + 1)}

    def expected(self, exact: bool) -> list[str]:
        """What is to be said where jumps or kinks of schedules run through pipes; exact : no row shows an error."""
        breaks = self.breaks
        if lines(self.case):
            return [EXACT if exact else EXPECTED]
        if self.plan.way == "time" or not breaks:
            return []
        jump, told = any(jumps for _, jumps in breaks), self.theory()
        what = "jumps, so fronts run" if jump else "has kinks, and these run"
        where = "a schedule" if prepared(self.case).breaks else "the start"
        most = "none in max" if jump else f"{told['max']:.2g} in max"
        more = "; so does what opens or shuts on the way" if prepared(self.case).events else ""
        return [
            f"{where} {what} through the cells{more}: order {self.smooth_order()} in space and time is expected to "
            f"show about {told['L1']:.2g} in L1, {told['L2']:.2g} in L2 and {most}"
        ]

    def way_out(self, fits) -> list[str]:
        """How to lower what steps do wrong, where it hides the order of the cells."""
        seen = [norms["L1"] for norms in fits.values() if norms["L1"].reason != NO_ERROR]
        hidden = any(FLOOR in one.marks or one.reason for one in seen)
        if self.plan.way != "space" or not hidden or len(self.plan.levels) < LEAST_ROWS:
            return []
        numerics, step = self.case.numerics, self.plan.levels[-1].step
        if numerics.rtol is not None:
            key = f"rtol={max(1e-13, 1e-3 * numerics.rtol):.2g}"
        elif numerics.step is not None:
            key = f"step={0.25 * step:.2g}"
        else:
            last = self.plan.levels[-1].set
            cells = {name: tuple(np.atleast_1d(last[name]).tolist()) for name in counts(self.case)}
            key = f"courant={0.25 * step * greatest_rate(self.case, cells):.2g}"
        return [f"what steps do wrong is the same in all rows; where that hides the order: --set numerics.{key}"]

    # Richardson ------------------------------------------------------------------------------------------------

    def richardson(self, progress: Progress) -> Order:
        """Errors of each row but the last: the sum of the differences to the next from there on, and what is left."""
        runs, levels = [], self.plan.levels
        for count, at in enumerate(self.errands.ahead([self.errand(level) for level in levels]), 1):
            progress(count, len(levels), words_of(self.plan, levels[at]))
        for k, level in enumerate(levels):
            progress(k, len(levels), words_of(self.plan, level))
            runs.append(self.run(level))
        rows = []
        for level, run, after in zip(self.plan.levels, runs, [*runs[1:], None], strict=True):
            both = run.ok and after is not None and after.ok
            rows.append(measured(level, run, differences(run, of_run(after), self.own) if both else {}))
        names = next((row.errors for row in rows if row.errors), {})
        good = next((run for run in runs if run.ok), None)
        if good is None:
            raise FvsolveError(f"no row could be run: {runs[0].reason}")
        sizes = {name: size_of(good, name) for name in names}
        made, theory = self.made(rows, "richardson", RICHARDSON, {}, sizes), self.theory()
        fits = {name: {norm: alone(trusted(one, theory[norm]), rows) for norm, one in found.items()}
                for name, found in made.fits.items()}  # fmt: skip
        return replace(
            made, rows=extrapolated(rows, fits), fits=fits, notes=(*made.notes, *differences_only(rows, fits))
        )


def plausible(found: Fit, most: float) -> Fit:
    """A fit, with a word where errors fall far quicker than scheme and method together can make them."""
    if found.reason or not found.order > most + BEYOND:
        return found
    return replace(found, note=f"errors fall quicker than order {most:g} of scheme and method: they are what is left "
                   "of a motion that dies away, or have changed sign, and show no order of these")  # fmt: skip


RICHARDSON = "Richardson: each row against the next, extrapolated"


def trusted(found: Fit, theory: float) -> Fit:
    """A fit of differences, none where there are just three of them and they show another order than theory."""
    within = max(found.spread, ASTRAY[0] + ASTRAY[1] * theory)
    if found.reason or found.marks.count("") > LEAST_ROWS or not abs(found.order - theory) > within:
        return found
    reason = (f"no order: three differences show {found.order:.2f} where {theory:.2g} is expected; too few to tell "
              "whether rows are still too coarse: more levels, or finer ones")  # fmt: skip
    return replace(found, order=np.nan, spread=np.nan, constant=np.nan, reason=reason, note="")


def alone(found: Fit, rows) -> Fit:
    """A fit whose rows that ran, and only lack a finer one, are not called failed."""
    pairs = zip(found.marks, rows, strict=True)
    return replace(found, marks=tuple(FINEST if mark == FAILED and not row.reason else mark for mark, row in pairs))


def sure(found: Fit, ratio: float) -> bool:
    """Whether an order p is known so well that 1 / (1 - ratio^-p) is, to a quarter."""
    return found.order > 0.0 and np.log(ratio) * found.spread <= SURE_FACTOR * (ratio**found.order - 1.0)


def extrapolated(rows, fits) -> tuple[OrderRow, ...]:
    """Rows whose differences d to the next are errors where an order p is sure: d and the error of the next.

    The last difference leaves d / (ratio^p - 1).
    """
    found: list[OrderRow] = []
    for k in range(len(rows) - 1, -1, -1):
        errors, after = {}, found[-1].errors if found else {}
        for name, norms in rows[k].errors.items():
            ratio, errors[name] = rows[k].level.size / rows[k + 1].level.size, {}
            for norm, d in norms.items():
                one = fits[name][norm]
                rest = after[name][norm] if name in after else d / (ratio**one.order - 1.0)
                errors[name][norm] = d + rest if sure(one, ratio) else d
        found.append(replace(rows[k], errors=errors))
    return tuple(reversed(found))


def differences_only(rows, fits) -> list[str]:
    """Where differences between rows stand in place of errors."""
    ratio = rows[0].level.size / rows[1].level.size
    lost = [f"{name} ({', '.join(none)})" for name, norms in fits.items()
            if (none := [norm for norm, one in norms.items() if not sure(one, ratio)])]  # fmt: skip
    if not lost:
        return []
    more = f" and {len(lost) - 3} more" if len(lost) > 3 else ""
    return [f"without a sure order nothing is extrapolated: of {', '.join(lost[:3])}{more} the table shows differences "
            "to the next row; errors are larger"]  # fmt: skip


def measured(level: Level, run: Outcome, errors: dict) -> OrderRow:
    """A row of the table from its run."""
    counts = run.counts
    updates = run.cell_updates if run.model is not None else 0
    return OrderRow(level, errors, run.seconds, counts.get("rhs", 0), updates, counts.get("steps", 0),
               "" if run.ok else run.reason)  # fmt: skip


def row_of(level: Level, found: Mapping) -> OrderRow:
    """A row from plain data."""
    seconds = np.nan if found["seconds"] is None else found["seconds"]
    return OrderRow(level, plain_numbers(found["errors"]), seconds, found["rhs"], found["cell_updates"], found["steps"],
               found["reason"])  # fmt: skip


def plain_numbers(found: Mapping) -> dict:
    """Variable -> norm -> number, NaN where there is None."""
    return {name: {norm: np.nan if e is None else e for norm, e in norms.items()} for name, norms in found.items()}


def words_of(made: Plan, level: Level) -> str:
    """A row in words."""
    if made.way != "time" and level.cells:
        return f"{level.cells} cells"
    return f"{made.measure.split(' ')[0]} {level.size:.4g}"


def notes_of(rows, doubtful: list[str]) -> list[str]:
    """What must be said of the numbers."""
    notes = []
    failed = [row for row in rows if row.reason]
    if failed:
        notes.append(f"{len(failed)} of {len(rows)} rows failed; the first: {failed[0].reason}")
    if doubtful:
        names = ", ".join(dict.fromkeys(doubtful))
        notes.append(
            f'rows marked "{UNSURE}" are less than {WORTH:g} times as far off as the reference itself is ({names}): '
            "it is no judge of them; name an exact solution under [exact], or take fewer levels"
        )
    return notes
