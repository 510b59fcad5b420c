"""What `fvsolve stability` says without a case: Courant limits of a uniform periodic grid. Knows words and tables."""

from __future__ import annotations

import math
from pathlib import Path

from fvsolve.cli import terminal
from fvsolve.cli.app import print_json
from fvsolve.cli.studying import listed, methods_of, told, writable
from fvsolve.limits.grid import AdvectionLimit, advection_limits
from fvsolve.limits.symbol import WEIGHTS
from fvsolve.studies.sheet import Column, Sheet, text
from fvsolve.studies.stability.limited import LIMITED, LimitedLimit, limited_limits
from fvsolve.studies.stability.periodic import THRESHOLD, Measured, measured_limits

RUNS = (Column("scheme"), Column("method"), Column("predicted", words=".7g"), Column("measured", words=".7g"),
        Column("ratio", words=".7f"))  # fmt: skip
FEW = 8  # pairs that get a line each
SET_BY = {
    "longest": "the longest waves (theta -> 0)",
    "shortest": "the shortest wave (two cells)",
    "all": "every wave at once",
    "between": "a wave of {cells:.4g} cells (theta = {theta:.6g})",
}
SHARP = {
    None: "no run failed",
    True: "the measured limit holds as runs get longer",
    False: "no sharp limit, it falls as runs get longer",
}
LEGEND = "set by l: the longest waves, s: the shortest, of two cells, b: a wave between, a: every wave at once"


def without_case(
    scheme: str | None, method: str | None, cells: int | None, steps: int | None, as_json: bool, out: Path | None,
    courant: float | None = None,
) -> None:  # fmt: skip
    """Limits of the named schemes and methods, comma separated; all linear schemes and all methods by default.

    With `cells` or `steps` explicit methods are measured on a periodic pipe too, limited schemes always; growth is
    quoted at `courant`; CSV files go to `out`, where given. Raises FvsolveError for names that are none.
    """
    named, methods = listed(scheme, "--scheme") or None, methods_of(method) or None
    linear = None if named is None else [name for name in named if name not in LIMITED]
    runs, limited = _measured(named, linear, methods, cells, steps)
    limits = advection_limits(linear, methods, courant) if linear is None or linear else []
    if out is not None:
        writable(out)
        for name, rows in (("limits", [one.plain() for one in limits]), ("measured", [one.plain() for one in runs]),
                           ("limited", [one.flat() for one in limited])):  # fmt: skip
            if rows:
                Sheet([Column(key) for key in rows[0]], rows).write(out / f"{name}.csv")
    if as_json:
        print_json({"limits": limits, "measured": runs, "limited": limited})
        return
    if len(limits) <= FEW:
        for one in limits:
            _show(one)
    else:
        _table(limits)
    if runs:
        _table_of_runs(runs)
    for one in limited:
        _show_limited(one)


def _measured(named, linear, methods, cells: int | None, steps: int | None) -> tuple[list, list]:
    """What is run for real: (linear schemes where asked, limited ones)."""
    limited = [name for name in named or () if name in LIMITED]
    asked = {name: n for name, n in (("cells", cells), ("steps", steps)) if n is not None}
    with told() as progress:
        runs = measured_limits(linear, methods, **asked, progress=progress) if asked and linear != [] else []
        found = limited_limits(limited, methods, **asked, progress=progress) if limited else []
    return runs, found


def _table_of_runs(runs: list[Measured]) -> None:
    console, first = terminal.console(), runs[0]
    terminal.line(console, "")
    head = f"Least Courant number that fails on a circle of {first.cells} cells: a wave grows {THRESHOLD:g}-fold"
    terminal.line(console, f"{head} in {first.steps} steps", "bold")
    terminal.sheet(Sheet(RUNS, [one.plain() for one in runs]), console)


def _show_limited(one: LimitedLimit) -> None:
    """One limited scheme and method, in sentences and a table."""
    console, name = terminal.console(), f"{one.scheme} ({one.limiter})" if one.limiter else one.scheme
    terminal.line(console, f"{name} with {one.method}: {SHARP[one.sharp]}", "bold")
    frozen = ", ".join(f"{branch} {_limit(limit.limit)}" for branch, limit in one.frozen.items())
    terminal.line(console, f"  limits with frozen weights: {frozen}")
    if one.monotone is not None:
        terminal.line(console, f"  total variation cannot grow up to {one.monotone:.6g}")
    terminal.line(
        console, f"  least Courant number found to fail on {one.cells} cells, real runs of the limited scheme:"
    )
    rows = [[f"  {n}", *(text(row[i], ".3g") for row in one.measured.values())] for i, n in enumerate(one.steps)]
    terminal.table(["  steps", *one.measured], rows, console)


def _show(one: AdvectionLimit) -> None:
    """One pair in sentences."""
    console = terminal.console()
    terminal.line(console, f"{one.scheme} with {one.method}: {_limit_in_words(one)}", "bold")
    for words in _sentences(one):
        terminal.line(console, f"  {words}")


def _limit(x: float) -> str:
    return "every" if math.isinf(x) else f"{x:.7g}" if x else "none"


def _limit_in_words(one: AdvectionLimit) -> str:
    if math.isinf(one.limit):
        return "stable at every Courant number"
    if one.limit == 0.0:
        return f"no limit, some wave grows at every {'small ' if one.stable else ''}step"
    return f"stable up to Courant number {one.limit:.10g}"


def _sentences(one: AdvectionLimit) -> list[str]:
    found = []
    if one.limit > 0.0 and one.theta is not None:
        words = SET_BY[one.wave].format(theta=one.theta, cells=2 * math.pi / one.theta if one.theta else math.inf)
        found.append(f"set by {words}")
    if one.steps is not None:
        steps = f"a thousandfold in {one.steps:.4g} steps"
        found.append(f"at {one.courant:.6g} the worst wave grows by {_growth(one.growth)} a step, {steps}")
    elif one.growth is not None:
        found.append(f"at {one.courant:.6g} no wave grows")
    for low, high in one.stable:
        if low > 0.0:
            place = f"from {low:.10g} to {high:.10g}" if math.isfinite(high) else f"above {low:.10g}"
            found.append(f"stable again {place}")
    if one.digits:
        found.append(f"with the coefficients as published, to {one.digits} digits")
    if not one.proved:
        found.append("found on sampled waves; not proved between them")
    return found


def _growth(growth: float) -> str:
    return f"1 + {growth:.3e}" if growth < 1e-3 else f"{1 + growth:.6g}"


def _table(found: list[AdvectionLimit]) -> None:
    """Methods down, schemes across; methods that all schemes are stable with in one line."""
    console, rows, free = terminal.console(), {}, []
    for one in found:
        rows.setdefault(one.method, {})[one.scheme] = one
    schemes = [name for name in WEIGHTS if any(name in row for row in rows.values())]
    shown = []
    for name, row in rows.items():
        if all(math.isinf(one.limit) for one in row.values()):
            free.append(name)
        else:
            shown.append([name, *(_cell(row[scheme]) for scheme in schemes)])
    terminal.line(console, "Courant limits of linear advection on a uniform periodic grid (von Neumann)", "bold")
    terminal.table(["method", *schemes], shown, console)
    terminal.line(console, LEGEND)
    terminal.line(
        console, "none: grows at every step, however small; every: stable at every step; +: stable again beyond"
    )
    if free:
        terminal.line(console, f"every Courant number, all these schemes: {', '.join(free)}")
    open_ones = [f"{one.scheme} with {one.method}" for one in found if not one.proved]
    if open_ones:
        terminal.line(console, f"not proved between sampled waves: {', '.join(open_ones)}")


def _cell(one: AdvectionLimit) -> str:
    again = " +" if any(low > 0 for low, _ in one.stable) else ""
    if math.isinf(one.limit):
        return "every"
    return (f"{one.limit:.7f} {one.wave[0]}" if one.limit > 0.0 else "none") + again
