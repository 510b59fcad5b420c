"""Courant limits of a uniform periodic grid: output of `fvsolve stability` without a case."""

import math
from collections.abc import Iterator
from pathlib import Path

from fvsolve.cli import app as cli
from fvsolve.cli.progress import progress_line
from fvsolve.cli.terminal import TextTable
from fvsolve.step_limits.advection_limit import AdvectionLimit, advection_limits
from fvsolve.step_limits.symbol import WEIGHTS
from fvsolve.studies.result_table import Column, ResultTable, cell_text
from fvsolve.studies.stability.periodic_limits import (
    LIMITED,
    THRESHOLD,
    LimitedLimit,
    MeasuredLimit,
    limited_limits,
    measured_limits,
)

RUNS = (Column("scheme"), Column("method"), Column("predicted", words=".7g"), Column("measured", words=".7g"),
        Column("ratio", words=".7f"))  # fmt: skip
SHOWN_ROWS = 8  # greatest number of pairs that are printed in sentences; more are printed as a table
SET_BY = {
    "longest": "the longest waves (theta -> 0)",
    "shortest": "the shortest wave (two cells)",
    "all": "all waves together",
    "between": "a wave of {cells:.4g} cells (theta = {theta:.6g})",
}
LIMIT_EXPLANATIONS = {
    None: "no run failed",
    True: "the measured limit does not depend on the length of the run",
    False: "no sharp limit: it falls as runs get longer",
}
LEGEND = "l: the longest waves set the limit, s: the shortest (two cells), b: a wave between, a: all waves together"


def without_case(
    scheme: str | None, method: str | None, cells: int | None, steps: int | None, out: Path | None,
    courant: float | None = None,
) -> tuple[dict, Iterator]:  # fmt: skip
    """Courant limits of schemes and methods on a periodic grid : (values for JSON, text).

    scheme, method : names separated by commas, or None for all linear schemes and all methods
    cells, steps : cells of the grid and steps of a run. If one of them is given, limits of explicit methods are also
        measured by runs. Limits of limited schemes are always measured.
    courant : Courant number at which the growth of waves is printed; out : folder for CSV files, or None
    Raises FvsolveError for unknown names.
    """
    named, methods = cli.comma_list(scheme, "--scheme") or None, cli.method_names(method) or None
    linear = None if named is None else [name for name in named if name not in LIMITED]
    runs, limited = _measure(named, linear, methods, cells, steps)
    limits = advection_limits(linear, methods, courant) if linear is None or linear else []
    if out is not None:
        cli.writable_folder(out)
        for name, rows in (("limits", [entry.plain() for entry in limits]),
                           ("measured", [entry.plain() for entry in runs]),
                           ("limited", [entry.flat() for entry in limited])):  # fmt: skip
            if rows:
                ResultTable([Column(key) for key in rows[0]], rows).write(out / f"{name}.csv")
    return {"limits": limits, "measured": runs, "limited": limited}, _limits_text(limits, runs, limited)


def _limits_text(limits: list[AdvectionLimit], runs: list[MeasuredLimit], limited: list[LimitedLimit]) -> Iterator:
    """Courant limits in sentences or as a table, then limits measured in runs of linear and of limited schemes."""
    if len(limits) > SHOWN_ROWS:
        yield from _limit_table(limits)
    for limit in limits if len(limits) <= SHOWN_ROWS else ():
        yield f"{limit.scheme} with {limit.method}: {_limit_in_words(limit)}", "bold"
        yield from (f"  {words}" for words in _sentences(limit))
    if runs:
        first = runs[0]
        yield ""
        head = f"Least Courant number that fails on a periodic grid of {first.cells} cells"
        yield f"{head}: a wave grows {THRESHOLD:g}-fold in {first.steps} steps", "bold"
        yield ResultTable(RUNS, [run.plain() for run in runs])
    for entry in limited:
        yield from _limited_text(entry)


def _measure(named, linear, methods, cells: int | None, steps: int | None) -> tuple[list, list]:
    """Limits measured by runs : (list for linear schemes, list for limited schemes).

    named : names of all given schemes, or None; linear : the linear schemes among them, or None for all linear schemes
    methods : names of methods, or None for all; cells, steps : as for `without_case`
    Linear schemes are measured only if `cells` or `steps` is given.
    """
    limited = [name for name in named or () if name in LIMITED]
    given = {name: n for name, n in (("cells", cells), ("steps", steps)) if n is not None}
    with progress_line() as progress:
        runs = measured_limits(linear, methods, **given, progress=progress) if given and linear != [] else []
        limits = limited_limits(limited, methods, **given, progress=progress) if limited else []
    return runs, limits


def _limited_text(limited: LimitedLimit) -> Iterator:
    """Limits of one limited scheme with one method, with frozen weights and from runs."""
    name = f"{limited.scheme} ({limited.limiter})" if limited.limiter else limited.scheme
    yield f"{name} with {limited.method}: {LIMIT_EXPLANATIONS[limited.sharp]}", "bold"
    frozen = ", ".join(f"{branch} {_limit(limit.limit)}" for branch, limit in limited.frozen.items())
    yield f"  limits if the weights of the scheme are held constant: {frozen}"
    if limited.monotone is not None:
        yield f"  up to Courant number {limited.monotone:.6g} the total variation cannot grow"
    yield f"  least Courant number that failed on {limited.cells} cells, in runs of the limited scheme:"
    rows = [
        [f"  {n}", *(cell_text(row[i], ".3g") for row in limited.measured.values())]
        for i, n in enumerate(limited.steps)
    ]
    yield TextTable(["  steps", *limited.measured], rows)


def _limit(x: float) -> str:
    return "every" if math.isinf(x) else f"{x:.7g}" if x else "none"


def _limit_in_words(limit: AdvectionLimit) -> str:
    if math.isinf(limit.limit):
        return "stable at every Courant number"
    if limit.limit == 0.0:
        return f"unstable, a wave grows at every {'small ' if limit.stable else ''}step"
    return f"stable up to Courant number {limit.limit:.10g}"


def _sentences(limit: AdvectionLimit) -> list[str]:
    sentences = []
    if limit.limit > 0.0 and limit.theta is not None:
        words = SET_BY[limit.wave].format(
            theta=limit.theta, cells=2 * math.pi / limit.theta if limit.theta else math.inf
        )
        sentences.append(f"set by {words}")
    if limit.steps is not None:
        steps = f"a thousandfold in {limit.steps:.4g} steps"
        sentences.append(
            f"at Courant number {limit.courant:.6g} the worst wave grows by a factor of "
            f"{_growth(limit.growth)} a step, {steps}"
        )
    elif limit.growth is not None:
        sentences.append(f"at Courant number {limit.courant:.6g} no wave grows")
    for low, high in limit.stable:
        if low > 0.0:
            place = f"from {low:.10g} to {high:.10g}" if math.isfinite(high) else f"above {low:.10g}"
            sentences.append(f"stable again {place}")
    if limit.digits:
        sentences.append(f"computed with the coefficients as published, which have {limit.digits} digits")
    if not limit.proved:
        sentences.append("computed for sampled waves; not proved for waves between them")
    return sentences


def _growth(growth: float) -> str:
    return f"1 + {growth:.3e}" if growth < 1e-3 else f"{1 + growth:.6g}"


def _limit_table(limits: list[AdvectionLimit]) -> Iterator:
    """Table of Courant limits with a row for each method and a column for each scheme.

    Methods that are stable at every Courant number with all schemes share one line below the table.
    """
    rows, free = {}, []
    for limit in limits:
        rows.setdefault(limit.method, {})[limit.scheme] = limit
    schemes = [name for name in WEIGHTS if any(name in row for row in rows.values())]
    shown = []
    for name, row in rows.items():
        if all(math.isinf(limit.limit) for limit in row.values()):
            free.append(name)
        else:
            shown.append([name, *(_cell(row[scheme]) for scheme in schemes)])
    yield "Courant limits of linear advection on a uniform periodic grid (von Neumann)", "bold"
    yield TextTable(["method", *schemes], shown)
    yield LEGEND
    small = "none: a wave grows at every step, however small"
    yield f"{small}; every: stable at every step; +: stable again at larger steps"
    if free:
        yield f"stable at every Courant number with all these schemes: {', '.join(free)}"
    unproved = [f"{limit.scheme} with {limit.method}" for limit in limits if not limit.proved]
    if unproved:
        yield f"not proved between sampled waves: {', '.join(unproved)}"


def _cell(limit: AdvectionLimit) -> str:
    again = " +" if any(low > 0 for low, _ in limit.stable) else ""
    if math.isinf(limit.limit):
        return "every"
    return (f"{limit.limit:.7f} {limit.wave[0]}" if limit.limit > 0.0 else "none") + again
