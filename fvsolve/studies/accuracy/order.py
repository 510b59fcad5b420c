"""Study of the order of convergence of a case."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.accuracy.order_result import Order
from fvsolve.studies.accuracy.time_budget import affordable_plan
from fvsolve.studies.delay_line_keys import delay_lines, fixed_choices
from fvsolve.studies.outcome import Progress, name_list, refuse_basins
from fvsolve.studies.result_cache import OUT, ResultCache, cache_in
from fvsolve.studies.run_queue import RunQueue
from fvsolve.validation import COUNT, FUNCTION, NAMES, TABLE, TEXT, validated

REFERENCE_KINDS = ("auto", "exact", "finer", "richardson")


@validated(
    set=TABLE,
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
    progress=FUNCTION,
    jobs=COUNT,
    dask=TEXT,
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
            studies.append(
                _order_of_pair(case, settings, (refine, key, levels, cells), against, given, points, report, queue)
            )
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
