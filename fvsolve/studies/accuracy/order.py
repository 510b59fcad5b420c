"""How fast the error of a case falls with refinement, row by row. Knows rows and errors; draws and prints nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fvsolve.doors import CALL, COUNT, NAMES, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.accuracy.afford import affordable
from fvsolve.studies.accuracy.rows import Order
from fvsolve.studies.errands import Errands
from fvsolve.studies.lines import lines, settled
from fvsolve.studies.outcome import Progress, names, without_basins
from fvsolve.studies.points import OUT, Points, kept_in

REFERENCES = ("auto", "exact", "finer", "richardson")


@door(
    set=TABLE,
    refine=TEXT,
    key=TEXT,
    levels=COUNT,
    cells=COUNT,
    schemes=NAMES,
    methods=NAMES,
    against=TEXT,
    initial=CALL,
    source=CALL,
    exact=CALL,
    out=OUT,
    progress=CALL,
    jobs=COUNT,
    dask=TEXT,
)
def order(
    case, set: Mapping | None = None, *, refine: str | None = None, key: str | None = None, levels: int | None = None,
    cells: int | None = None, schemes: str | Sequence[str] | None = None, methods: str | Sequence[str] | None = None,
    against: str = "auto", initial: Callable | None = None, source: Callable | None = None,
    exact: Callable | None = None, out: str | Path | Points | None = None, progress: Progress | None = None,
    jobs: int = 1, dask: str | None = None,
) -> Order | list[Order]:  # fmt: skip
    """Errors of a case over a refinement and the order at which they fall; a list where several are asked for.

    case, set : as `run` takes them; refine, key, levels, cells : as `studies.refine.plan` takes them
    schemes, methods : in place of the case's, names or lists of them
    against : "auto" (exact if the case names one, else finer, with basins richardson), "exact", "finer" (two levels
    finer by another scheme and method) or "richardson" (each row against the next)
    initial : initial(pipe, x) -> pressure [Pa], flow [m3/s] at the start, x float64[k] [m]
    source : source(pipe, x, t) -> mass [kg/s/m] and momentum [kg/s2] fed per length; both are averaged over cells
    exact : exact(pipe, x, t) -> pressure [Pa], flow [m3/s]; the reference, and the start where `initial` is left out
    out : folder where finished rows are kept and found again; progress(done, total, next)
    jobs, dask : who makes the runs, as in `sweep`; with functions of x and t this process alone
    Raises CaseError, FvsolveError.
    """
    if against not in REFERENCES:
        raise FvsolveError(
            f'against = "{against}" is unknown{did_you_mean(against, REFERENCES)}; wanted {", ".join(REFERENCES)}'
        )
    given = initial, source, exact
    if any(given) and (jobs != 1 or dask is not None):
        raise FvsolveError("initial, source and exact are functions of this process; wanted jobs = 1 and no dask")
    tell, found = progress or (lambda *_: None), []
    pairs = [(scheme, method) for scheme in names(schemes) or [None] for method in names(methods) or [None]]
    with kept_in(out) as points, Errands(case, jobs, dask) as errands:
        for scheme, method in pairs:
            own = {"numerics.scheme": scheme, "numerics.method": method}
            settings = {**(set or {}), **{name: value for name, value in own.items() if value is not None}}
            found.append(_order(case, settings, (refine, key, levels, cells), against, given, points, tell, errands))
    return found[0] if len(found) == 1 else found


def _order(case, settings: Mapping, rows: tuple, against, given, points, progress, errands: Errands) -> Order:
    """The study of one scheme and method; rows : refine, key, levels and cells; given : initial, source and exact
    solution, or None for each."""
    from fvsolve.case import load

    case = load(case, settings)
    if kept := settled(case):
        settings = settings | kept
        case = load(case, kept)
    made = affordable(case, *rows, against, points)
    if given == (None, None, None):
        from fvsolve.studies.accuracy.judge import Judge

        return Judge(case, made, against, errands, settings).study(points, progress)
    from fvsolve.studies.accuracy.manufactured import Manufactured

    without_basins(case, "order by functions of pipes")
    if delayed := lines(case):
        raise FvsolveError(f"functions along pipes want cells, and {listing(delayed)} would be delay lines: say "
                           'numerics.line = "cells", and line of no pipe')  # fmt: skip
    return Manufactured(case, made, against, *given).study(points, progress)
