"""`fvsolve stability`: greatest stable step of a case, or Courant limits of a uniform periodic grid without a case."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument, Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import Column, ResultTable, cell_text, columns
from fvsolve.core.step_limits.advection_limit import AdvectionLimit, advection_limits
from fvsolve.core.step_limits.symbol import WEIGHTS
from fvsolve.display import save
from fvsolve.errors import FvsolveError
from fvsolve.studies.stability.periodic_limits import (
    LIMITED,
    THRESHOLD,
    LimitedLimit,
    MeasuredLimit,
    limited_limits,
    measured_limits,
)

RUNS = (
    Column("scheme"),
    Column("method"),
    Column("predicted", words=".7g"),
    Column("measured", words=".7g"),
    Column("ratio", words=".7f"),
)
# greatest number of pairs that are printed in sentences; more are printed as a table
SHOWN_ROWS = 8
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
    scheme: str | None,
    method: str | None,
    cells: int | None,
    steps: int | None,
    out: Path | None,
    courant: float | None = None,
) -> tuple[dict, Iterator]:
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
        for name, rows in (
            ("limits", [entry.plain() for entry in limits]),
            ("measured", [entry.plain() for entry in runs]),
            ("limited", [entry.flat() for entry in limited]),
        ):
            if rows:
                ResultTable([Column(key) for key in rows[0]], rows).write(out / f"{name}.csv")
    return {"limits": limits, "measured": runs, "limited": limited}, _limits_text(
        limits, runs, limited
    )


def _limits_text(
    limits: list[AdvectionLimit], runs: list[MeasuredLimit], limited: list[LimitedLimit]
) -> Iterator:
    """Courant limits in sentences or as a table, then limits measured in runs of linear and of limited schemes."""
    if len(limits) > SHOWN_ROWS:
        yield from _limit_table(limits)
    for limit in limits if len(limits) <= SHOWN_ROWS else ():
        if math.isinf(limit.limit):
            words = "stable at every Courant number"
        elif limit.limit == 0.0:
            words = f"unstable, a wave grows at every {'small ' if limit.stable else ''}step"
        else:
            words = f"stable up to Courant number {limit.limit:.10g}"
        yield f"{limit.scheme} with {limit.method}: {words}", "bold"
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
        runs = (
            measured_limits(linear, methods, **given, progress=progress)
            if given and linear != []
            else []
        )
        limits = limited_limits(limited, methods, **given, progress=progress) if limited else []
    return runs, limits


def _limited_text(limited: LimitedLimit) -> Iterator:
    """Limits of one limited scheme with one method, with frozen weights and from runs."""
    name = f"{limited.scheme} ({limited.limiter})" if limited.limiter else limited.scheme
    yield f"{name} with {limited.method}: {LIMIT_EXPLANATIONS[limited.sharp]}", "bold"
    frozen = ", ".join(
        f"{branch} {_limit(limit.limit)}" for branch, limit in limited.frozen.items()
    )
    yield f"  limits if the weights of the scheme are held constant: {frozen}"
    if limited.monotone is not None:
        yield f"  up to Courant number {limited.monotone:.6g} the total variation cannot grow"
    yield f"  least Courant number that failed on {limited.cells} cells, in runs of the limited scheme:"
    rows = [
        [f"  {n}", *(cell_text(row[i], ".3g") for row in limited.measured.values())]
        for i, n in enumerate(limited.steps)
    ]
    yield ResultTable.of("", ["  steps", *limited.measured], rows)


def _limit(x: float) -> str:
    return "every" if math.isinf(x) else f"{x:.7g}" if x else "none"


def _sentences(limit: AdvectionLimit) -> list[str]:
    sentences = []
    if limit.limit > 0.0 and limit.theta is not None:
        words = SET_BY[limit.wave].format(
            theta=limit.theta, cells=2 * math.pi / limit.theta if limit.theta else math.inf
        )
        sentences.append(f"set by {words}")
    if limit.steps is not None:
        steps = f"a thousandfold in {limit.steps:.4g} steps"
        growth = f"1 + {limit.growth:.3e}" if limit.growth < 1e-3 else f"{1 + limit.growth:.6g}"
        sentences.append(
            f"at Courant number {limit.courant:.6g} the worst wave grows by a factor of {growth} a step, {steps}"
        )
    elif limit.growth is not None:
        sentences.append(f"at Courant number {limit.courant:.6g} no wave grows")
    for low, high in limit.stable:
        if low > 0.0:
            place = (
                f"from {low:.10g} to {high:.10g}" if math.isfinite(high) else f"above {low:.10g}"
            )
            sentences.append(f"stable again {place}")
    if limit.digits:
        sentences.append(
            f"computed with the coefficients as published, which have {limit.digits} digits"
        )
    if not limit.proved:
        sentences.append("computed for sampled waves; not proved for waves between them")
    return sentences


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
    yield ResultTable.of("", ["method", *schemes], shown)
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


PICTURES = 12  # greatest number of pairs of scheme and method for which pictures are drawn
STABILITY_FILE = columns(
    scheme="scheme",
    method="method",
    steps="steps",
    threshold="threshold",
    states="states",
    predicted="predicted [s]",
    predicted_courant="predicted Courant",
    after="after steps",
    measured="measured [s]",
    measured_courant="measured Courant",
    difference="difference",
    eigenvalues="eigenvalues [s]",
    field_of_values="field of values [s]",
    von_neumann="von Neumann [s]",
    longer="measured, ten times the steps [s]",
    where="grows in",
    share="share of energy",
    notes="notes",
)


@cli.command("stability", order=300)
def stability(
    case: Annotated[
        str | None,
        Argument(
            metavar="CASE",
            help="case file or shipped case (default none: advection on a periodic grid)",
        ),
    ] = None,
    scheme: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="schemes to study (default scheme of the case, or "
            "without a case all linear schemes)",
        ),
    ] = None,
    method: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="methods to study (default method of the case, or without a case all methods)",
        ),
    ] = None,
    steps: Annotated[
        int | None,
        Option(
            help="number of steps over which growth is measured; without a case it adds "
            "measured limits of linear schemes (default 1000)"
        ),
    ] = None,
    cells: Annotated[
        int | None,
        Option(
            help="number of cells of the periodic grid on which growth is measured, only "
            "without a case (default 100)"
        ),
    ] = None,
    courant: Annotated[
        float | None,
        Option(
            help="Courant number at which growth is computed, only without a case "
            "(default 1 % above the stability limit, or 0.5 if the limit is 0)"
        ),
    ] = None,
    at: cli.AtTime = None,
    before: cli.BeforeJump = False,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="folder of tables and pictures (default "
            "runs/NAME.stability, or no files without a case)",
        ),
    ] = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Compute the greatest stable step of a case, predicted and measured, and bounds on it."""
    of_a_case = {
        "--set": set,
        "--at": at,
        "--left-limit": before,
        "--jobs": None if jobs == 1 else jobs,
    }
    of_a_case |= {"--dask": dask}
    unused = of_a_case if case is None else {"--cells": cells, "--courant": courant}
    useless = [name for name, value in unused.items() if value not in (None, False, [])]
    if useless:
        reason = (
            "needs a case: fvsolve stability CASE"
            if case is None
            else "not valid with a case, only without"
        )
        raise FvsolveError(f"{', '.join(useless)}: {reason}")
    if case is None:
        return present(as_json, *without_case(scheme, method, cells, steps, out, courant))
    from fvsolve.studies.stability.growth import STEPS
    from fvsolve.studies.stability.stability import stability as ask

    loaded = cli.load_case(case, set, scheme, method)
    folder = cli.folder_of(loaded, "stability", out)
    with progress_line() as progress:
        result = ask(
            loaded,
            cli.comma_list(scheme, "--scheme"),
            cli.method_names(method),
            cli.quantity_of(at, "time", f"--at {at}"),
            before,
            steps or STEPS,
            out=folder,
            progress=progress,
            jobs=jobs,
            dask=dask,
        )
    table = ResultTable(
        STABILITY_FILE, [row.plain() | {"notes": "; ".join(row.notes)} for row in result.rows]
    )
    files = [
        table.write(
            cli.clear_files(folder, "stability.csv", "spectrum-*.png") / "stability.csv"
        ).name
    ]
    if len(result.rows) <= PICTURES:
        files += pictures(result, folder)
    present(
        as_json,
        result.plain() | {"directory": str(folder), "files": files},
        stability_text(result, folder, files),
    )


def pictures(result, folder: Path) -> list[str]:
    """Draw a picture for each pair of a linear scheme and a method; returns the file names.

    It shows the spectrum, multiplied by a step, over the stability region. The step is the predicted limit. If this is
    not positive and finite, the step is 1 / (greatest magnitude of an eigenvalue). Pairs on a case with delay lines
    have no picture. result : as from `stability`
    """
    from fvsolve.core.steppers import analyse
    from fvsolve.report.draw.stability_pictures import spectrum_figure

    names = []
    for row in result.rows:
        if row.limited or row.lines:
            continue
        side = result.system(row.scheme)
        is_known = np.isfinite(row.predicted) and row.predicted > 0.0
        h = row.predicted if is_known else 1.0 / max(np.abs(side.spectrum.values).max(), 1e-300)
        field = None if "field_of_values" in row.left_out else h * side.field
        title = f"{result.case}, {row.scheme} with {row.method}: spectrum times h = {h:.4g} s"
        if row.rate == 0.0:
            title = f"{result.case}, {row.method}: spectrum times h = {h:.4g} s"
        figure = spectrum_figure(
            analyse(row.method).stability_function, h * side.spectrum.values, field, title
        )
        names.append(
            f"spectrum-{row.scheme}-{row.method}.png"
            if row.rate > 0.0
            else f"spectrum-{row.method}.png"
        )
        save(figure, folder / names[-1])
    return names


def stability_text(result, folder: Path, files: list[str]) -> Iterator:
    """Table of stable steps of a case, and its notes."""
    rows, first_row = result.rows, result.rows[0]
    cells = first_row.rate > 0.0
    yield (
        f"{result.case} at {first_row.when}: {first_row.states} states; a step fails if a deviation grows "
        f"{first_row.threshold:g} times (energy norm) within {first_row.steps} steps"
    )
    if cells:
        yield f"Courant number: step times {first_row.rate:.6g} 1/s; bounds as Courant numbers"
    yield ResultTable(terminal_columns(cells), [line for row in rows for line in table_lines(row)])
    for row in rows:
        for note in row.notes:
            yield f"  {row_label(row)}: {note}"
        for bound, reason in row.left_out.items():
            yield f"  {row_label(row)}: {bound.replace('_', ' ')}: {reason}"
    for text in result.notes:
        yield f"  {text}"
    yield f"{folder}: {', '.join(files)}"


def terminal_columns(cells: bool) -> list[Column]:
    """Columns of the printed table of stable steps.

    cells : True if the case has cells: steps are then also given as Courant numbers, and bounds only as Courant numbers
    """
    heads = {"scheme": "scheme", "method": "method"}
    for quantity in ("predicted", "measured"):
        heads |= {quantity: f"{quantity} [s]", f"{quantity}_courant": "Courant"}
    heads["percent"] = "difference"
    for bound in ("eigenvalues", "field_of_values", "von_neumann"):
        heads[f"{bound}_courant" if cells else bound] = bound.replace("_", " ").replace(
            "von n", "von N"
        )
    heads["part"] = "grows in"
    omitted = () if cells else ("scheme", "predicted_courant", "measured_courant", "von_neumann")
    return [Column(key, head, ".5g") for key, head in heads.items() if key not in omitted]


def table_lines(row) -> list[dict]:
    """Lines of the printed table of stable steps for one pair of scheme and method.

    A limited scheme has a further line for each of its linear schemes with frozen weights.
    """
    from fvsolve.studies.stability.stability_row import json_number

    frozen_lines = [
        {
            "scheme": f"{row.scheme}: {name}",
            "method": row.method,
            "predicted": json_number(h),
            "predicted_courant": json_number(row.courant(h)),
        }
        for name, h in row.frozen.items()
    ]
    percent = f"{100 * row.difference:+.2f} %" if np.isfinite(row.difference) else None
    part = f"{row.where} ({100 * row.share:.0f} %)" if row.where else None
    return [*frozen_lines, row.plain() | {"percent": percent, "part": part}]


def row_label(row) -> str:
    """Label of a pair of scheme and method in notes; the method alone for a case without cells."""
    return f"{row.scheme}, {row.method}" if row.rate > 0.0 else row.method
