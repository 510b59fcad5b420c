"""Study of the order of convergence of a case, and its results: rows, fitted orders and notes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.accuracy.fit import Fit
from fvsolve.studies.accuracy.order_picture import variable_unit
from fvsolve.studies.accuracy.refine import Level, Plan, affordable_plan
from fvsolve.studies.outcome import STUDY_ARGUMENTS, Progress, name_list, refuse_basins
from fvsolve.studies.parallel import RunQueue
from fvsolve.studies.resolution import delay_lines, fixed_choices
from fvsolve.studies.result_cache import OUT, ResultCache, cache_in
from fvsolve.studies.result_table import PlainData
from fvsolve.validation import COUNT, FUNCTION, NAMES, TEXT, validated


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

    picture = "fvsolve.studies.accuracy.order_picture:order_picture"
    json = "case scheme method refine=plan.way measure=plan.measure how=plan.words reference rows fits notes"

    def summary_line(self) -> str:
        return f"of {self.case!r}: {self.scheme}, {self.method}, {len(self.rows)} rows against {self.kind}"

    def table_columns(self) -> dict[str, list]:
        """Columns of the table, header -> value of each row: cells, size, step [s], errors in SI, and cost."""
        columns: dict[str, list] = {"cells": [row.level.cells for row in self.rows]}
        columns |= {"size": [row.level.size for row in self.rows], "step": [row.level.step for row in self.rows]}
        for name, norms in self.fits.items():
            for norm in norms:
                key = f"{name} {norm}"
                columns[key] = [row.errors.get(name, {}).get(norm, math.nan) for row in self.rows]
        return columns | {"rhs": [row.rhs for row in self.rows], "seconds": [row.seconds for row in self.rows]}

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


REFERENCE_KINDS = ("auto", "exact", "finer", "richardson")


@validated(
    refine=TEXT,
    key=TEXT,
    levels=COUNT,
    cells=COUNT,
    schemes=NAMES,
    methods=NAMES,
    against=TEXT,
    initial=FUNCTION,
    source=FUNCTION,
    exact=FUNCTION,
    out=OUT,
    **STUDY_ARGUMENTS,
)
def order(
    case, set: Mapping | None = None, *, refine: str | None = None, key: str | None = None, levels: int | None = None,
    cells: int | None = None, schemes: str | Sequence[str] | None = None, methods: str | Sequence[str] | None = None,
    against: str = "auto", initial: Callable | None = None, source: Callable | None = None,
    exact: Callable | None = None, out: str | Path | ResultCache | None = None, progress: Progress | None = None,
    jobs: int = 1, dask: str | None = None,
) -> Order | list[Order]:  # fmt: skip
    """Run a case over a refinement; returns errors and the order with which they decrease.

    With several schemes or methods, the result is a list with an `Order` for each pair of scheme and method.
    case, set : as in `run`; refine, key, levels, cells : as in `studies.accuracy.refine.refinement_plan`
    schemes, methods : name or list of names that replace the scheme and method of the case
    against : reference, "auto", "exact", "finer" (two levels finer, by another scheme and method) or "richardson" (each
    row against the next). "auto" is "exact" if the case names an exact solution, otherwise "richardson" with basins and
    "finer" without; if a finer run fails or is too inaccurate, it is "richardson".
    initial : initial(pipe, x) -> pressure [Pa], flow [m3/s] at the start, x float64[k] [m]
    source : source(pipe, x, t) -> mass [kg/s/m] and momentum [kg/s2] fed per length and time
    exact : exact(pipe, x, t) -> pressure [Pa], flow [m3/s]; the reference, and the start if `initial` is left out
    Fields of these functions are averaged over cells.
    out : folder in which finished rows are stored and found again; progress : progress(done, total, next)
    jobs, dask : processes that make the runs, as in `sweep`; functions of x and t need this process alone
    Raises CaseError, FvsolveError.
    """
    if against not in REFERENCE_KINDS:
        hint = did_you_mean(against, REFERENCE_KINDS) or f". Expected {', '.join(REFERENCE_KINDS)}"
        raise FvsolveError(f'against = "{against}" is unknown{hint}')
    given = initial, source, exact
    if any(given) and (jobs != 1 or dask is not None):
        raise FvsolveError("initial, source and exact are functions of this process. Expected jobs = 1 and no dask")
    report, studies = progress or (lambda *_: None), []
    pairs = [(scheme, method) for scheme in name_list(schemes) or [None] for method in name_list(methods) or [None]]
    with cache_in(out) as points, RunQueue(case, jobs, dask) as queue:
        for scheme, method in pairs:
            pair_settings = {"numerics.scheme": scheme, "numerics.method": method}
            settings = {**(set or {}), **{name: value for name, value in pair_settings.items() if value is not None}}
            rows = refine, key, levels, cells
            studies.append(_order_of_pair(case, settings, rows, against, given, points, report, queue))
    return studies[0] if len(studies) == 1 else studies


def _order_of_pair(case, settings: Mapping, rows: tuple, against, given, points, progress, queue: RunQueue) -> Order:
    """Order study of one scheme and method; against and progress are as for `order`.

    settings : overrides of the case; rows : (refine, key, levels, cells) as for `order`; given : (initial, source,
    exact) as for `order`; points : cache of earlier rows; queue : makes the runs
    """
    from fvsolve.case import load

    case = load(case, settings)
    if fixed := fixed_choices(case):
        settings = settings | fixed
        case = load(case, fixed)
    refinement = affordable_plan(case, *rows, against, points)
    if given == (None, None, None):
        from fvsolve.studies.accuracy.order_study import OrderStudy

        return OrderStudy(case, refinement, against, queue, settings).study(points, progress)
    from fvsolve.studies.accuracy.manufactured import ManufacturedStudy

    refuse_basins(case, "order by functions of pipes")
    if delayed := delay_lines(case):
        raise FvsolveError(f"functions along pipes need cells, but {listing(delayed)} would be delay lines. Set "
                           'numerics.pipe_model = "finite-volume", and remove `pipe_model` from all pipes')  # fmt: skip
    return ManufacturedStudy(case, refinement, against, *given).study(points, progress)
