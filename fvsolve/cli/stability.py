"""`fvsolve stability`. Knows what is asked and how it is shown; leaves the numbers to `studies`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fvsolve.cli.app import Json, Set, app, load_case, print_json
from fvsolve.cli.linearise import At, Before, time_of
from fvsolve.cli.studying import Dask, Jobs, Out, cleared, folder_of, listed, methods_of, told
from fvsolve.studies.sheet import Column, Sheet, columns

PICTURES = 12  # pairs beyond which no picture is drawn
FILE = columns(
    scheme="scheme", method="method", steps="steps", threshold="threshold", states="states",
    predicted="predicted [s]", predicted_courant="predicted Courant", after="after steps",
    measured="measured [s]", measured_courant="measured Courant", difference="difference",
    eigenvalues="eigenvalues [s]", field_of_values="field of values [s]", von_neumann="von Neumann [s]",
    longer="measured, ten times the steps [s]", where="grows in", share="share of energy", notes="notes",
)  # fmt: skip


@app.command()
def stability(
    case: Annotated[str | None, typer.Argument(metavar="[CASE]", help="a case; without one, a periodic grid")] = None,
    scheme: Annotated[str | None, typer.Option(metavar="A,B", help="schemes; default that of the case")] = None,
    method: Annotated[str | None, typer.Option(metavar="A,B", help="methods; default that of the case")] = None,
    steps: Annotated[int | None, typer.Option(help="within which growth counts, default 1000")] = None,
    cells: Annotated[int | None, typer.Option(help="without a case: measure on so many cells")] = None,
    courant: Annotated[float | None, typer.Option(help="without a case: growth at this Courant number")] = None,
    at: At = None,
    before: Before = False,
    jobs: Jobs = 1,
    dask: Dask = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """The greatest safe step of a case, predicted and measured, and what bounds say of it."""
    of_a_case = {"--set": set, "--at": at, "--before": before, "--jobs": jobs if jobs != 1 else None, "--dask": dask}
    refuse(case, of_a_case, {"--cells": cells, "--courant": courant})
    if case is None:
        from fvsolve.cli.grid import without_case

        without_case(scheme, method, cells, steps, as_json, out, courant)
        return
    from fvsolve.studies.stability.growth import STEPS
    from fvsolve.studies.stability.stability import stability as ask

    read = load_case(case, set, scheme, method)
    folder = folder_of(read, "stability", out)
    with told() as progress:
        found = ask(
            read,
            listed(scheme, "--scheme"),
            methods_of(method),
            time_of(at),
            before,
            steps or STEPS,
            out=folder,
            progress=progress,
            jobs=jobs,
            dask=dask,
        )
    table = Sheet(FILE, [row.plain() | {"notes": "; ".join(row.notes)} for row in found.rows])
    files = [table.write(cleared(folder, "stability.csv", "spectrum-*.png") / "stability.csv").name]
    if len(found.rows) <= PICTURES:
        files += pictures(found, folder)
    if as_json:
        print_json(found.plain() | {"directory": str(folder), "files": files})
    else:
        say(found, folder, files)


def refuse(case: str | None, of_a_case: dict, of_a_grid: dict) -> None:
    """Raise FvsolveError for options that say nothing here."""
    from fvsolve.errors import FvsolveError

    idle = [name for name, value in (of_a_grid if case else of_a_case).items() if value not in (None, False, [])]
    if idle:
        where = "with a case: only a periodic grid has them" if case else "without a case: fvsolve stability CASE"
        raise FvsolveError(f"{', '.join(idle)}: nothing to say {where}")


def pictures(found, folder: Path) -> list[str]:
    """One picture for each row of a linear scheme: the spectrum over the method's region; returns their names."""
    from fvsolve.draw.spectrum import spectrum_figure
    from fvsolve.steppers import analyse

    names = []
    for row in found.rows:
        if row.limited or row.lines:
            continue
        side = found.side(row.scheme)
        known = np.isfinite(row.predicted) and row.predicted > 0.0
        h = row.predicted if known else 1.0 / max(np.abs(side.spectrum.values).max(), 1e-300)
        field = None if "field_of_values" in row.left_out else h * side.field
        title = f"{found.case}, {row.scheme} with {row.method}: spectrum times h = {h:.4g} s"
        if row.rate == 0.0:
            title = f"{found.case}, {row.method}: spectrum times h = {h:.4g} s"
        figure = spectrum_figure(analyse(row.method).stability_function, h * side.spectrum.values, field, title)
        names.append(f"spectrum-{row.scheme}-{row.method}.png" if row.rate > 0.0 else f"spectrum-{row.method}.png")
        figure.savefig(folder / names[-1])
    return names


def say(found, folder: Path, files: list[str]) -> None:
    """The table, and below it where a bound misleads."""
    from fvsolve.cli import terminal

    rows = found.rows
    where, first = terminal.console(), rows[0]
    cells = first.rate > 0.0
    terminal.line(where, f"{found.case} at {first.when}: {first.states} states; a step fails where a deviation grows "
                         f"by {first.threshold:g} (energy norm) within {first.steps} steps")  # fmt: skip
    if cells:
        terminal.line(where, f"Courant number: step times {first.rate:.6g} 1/s; bounds as Courant numbers")
    terminal.sheet(Sheet(shown(cells), [line for row in rows for line in lines(row)]), where)
    for row in rows:
        for note in row.notes:
            terminal.line(where, f"  {label(row)}: {note}")
        for what, why in row.left_out.items():
            terminal.line(where, f"  {label(row)}: {what.replace('_', ' ')}: {why}")
    for text in found.said:
        terminal.line(where, f"  {text}")
    terminal.line(where, f"{folder}: {', '.join(files)}")


def shown(cells: bool) -> list[Column]:
    """Columns on the terminal; with cells steps stand as Courant numbers too, and bounds as these alone."""
    heads = {"scheme": "scheme", "method": "method"}
    for what in ("predicted", "measured"):
        heads |= {what: f"{what} [s]", f"{what}_courant": "Courant"}
    heads["percent"] = "difference"
    for bound in ("eigenvalues", "field_of_values", "von_neumann"):
        heads[f"{bound}_courant" if cells else bound] = bound.replace("_", " ").replace("von n", "von N")
    heads["part"] = "grows in"
    idle = () if cells else ("scheme", "predicted_courant", "measured_courant", "von_neumann")
    return [Column(key, head, ".5g") for key, head in heads.items() if key not in idle]


def lines(row) -> list[dict]:
    """Lines of the table that one row takes: a limited scheme has one for each frozen one."""
    from fvsolve.studies.stability.row import said

    found = [{"scheme": f"{row.scheme}: {name}", "method": row.method, "predicted": said(h),
              "predicted_courant": said(row.courant(h))} for name, h in row.frozen.items()]  # fmt: skip
    percent = f"{100 * row.difference:+.2f} %" if np.isfinite(row.difference) else None
    part = f"{row.where} ({100 * row.share:.0f} %)" if row.where else None
    return [*found, row.plain() | {"percent": percent, "part": part}]


def label(row) -> str:
    """What a line below the table is about."""
    return f"{row.scheme}, {row.method}" if row.rate > 0.0 else row.method
