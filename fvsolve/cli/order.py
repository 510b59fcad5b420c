"""`fvsolve order CASE`: how fast the error falls. Knows words, tables and files; leaves the study to `studies`."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli import terminal
from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Out, folder_of, listed, methods_of, told
from fvsolve.studies.accuracy.picture import NORMS, SHOWN, title, unit

COLUMNS = (
    "scheme", "method", "reference", "variable", "unit", "norm", "cells", "size", "step [s]", "error", "order", "mark",
    "fitted order", "spread", "steps", "rhs", "cell updates", "seconds",
)  # fmt: skip


@app.command()
def order(
    case: One,
    overrides: Set = [],  # noqa: B006
    refine: Annotated[str | None, typer.Option(help="both (cells and steps), space or time")] = None,
    key: Annotated[str | None, typer.Option(metavar="KEY", help="one resolution alone: links.main.cells")] = None,
    levels: Annotated[int | None, typer.Option(help="rows")] = None,
    cells: Annotated[int | None, typer.Option(help="of the coarsest row")] = None,
    scheme: Annotated[str | None, typer.Option(metavar="A,B", help="schemes, in place of the case's")] = None,
    method: Annotated[str | None, typer.Option(metavar="A,B", help="methods, in place of the case's")] = None,
    against: Annotated[str, typer.Option(help="auto, exact, finer or richardson")] = "auto",
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure how fast the error of a case falls with refinement: a table, order.csv and order.png."""
    from fvsolve.studies.accuracy.order import order as study
    from fvsolve.studies.points import Points

    scene = load_case(case, overrides, scheme, method)
    folder = folder_of(scene, "order", out)
    with told() as progress, Points(folder) as points:
        found = study(scene, refine=refine, key=key, levels=levels, cells=cells, schemes=listed(scheme, "--scheme"),
                      methods=methods_of(method), against=against, out=points, progress=progress)  # fmt: skip
    found = found if isinstance(found, list) else [found]
    files = [write_table(folder / "order.csv", found), *draw(folder, found)]
    if as_json:
        print_json({"studies": [one.plain() for one in found], "files": [str(file) for file in files],
                    "reused": points.reused})  # fmt: skip
        return
    for one in found:
        show(one)
    terminal.line(terminal.console(), f"files: {', '.join(str(file) for file in files)}")


def draw(folder: Path, found) -> list[Path]:
    """A picture of every study."""
    files = []
    for one in found:
        name = "order.png" if len(found) == 1 else f"order-{one.scheme}-{one.method}.png"
        one.plot(folder / name)
        files.append(folder / name)
    return files


def write_table(path: Path, found) -> Path:
    """All rows of all studies, variables and norms, SI."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        sheet = csv.writer(file)
        sheet.writerow(COLUMNS)
        for one in found:
            for variable, fits in one.fits.items():
                for norm in NORMS:
                    sheet.writerows(lines(one, variable, norm, fits[norm]))
    return path


def lines(one, variable: str, norm: str, fit):
    """The rows of one norm."""
    for k, row in enumerate(one.rows):
        yield [
            one.scheme, one.method, one.kind, variable, unit(variable, one.units), norm, row.level.cells,
            repr(row.level.size), number(row.level.step), number(row.errors.get(variable, {}).get(norm, math.nan)),
            number(fit.pairwise[k - 1]) if k else "", fit.marks[k], number(fit.order), number(fit.spread), row.steps,
            row.rhs, row.cell_updates, number(row.seconds),
        ]  # fmt: skip


def number(x: float) -> str:
    """A number in full, nothing for NaN."""
    return "" if math.isnan(x) else repr(float(x))


def show(one) -> None:
    """What a person reads."""
    console = terminal.console()
    terminal.line(console, f"{one.case}: {title(one)}", "bold")
    terminal.line(console, f"errors against: {one.words}")
    for variable in one.variables[:SHOWN]:
        terminal.line(console, "")
        where = " at the end, all pipes" if variable in ("pressure", "flow") else ""
        terminal.line(console, f"{variable} [{unit(variable, one.units)}]{where}")
        terminal.table(["cells", "step [s]", "L1", "order", "L2", "order", "max", "order", "rhs", "seconds", "mark"],
                       rows_of(one, variable), console)  # fmt: skip
    terminal.line(console, "")
    terminal.table(["fitted order of", "L1", "L2", "max"], fitted(one), console)
    for text in dict.fromkeys([*reasons(one), *one.notes]):
        terminal.line(console, text)
    terminal.line(console, "")


def rows_of(one, variable: str) -> list[list[str]]:
    """Rows of a variable's table."""
    fits, found = one.fits[variable], []
    for k, row in enumerate(one.rows):
        cells = [str(row.level.cells or "-"), brief(row.level.step)]
        if one.plan.measure == "rtol":
            cells[1] = f"rtol {row.level.size:g}"
        for norm in NORMS:
            cells += [
                brief(row.errors.get(variable, {}).get(norm, math.nan)),
                f"{fits[norm].pairwise[k - 1]:.2f}" if k and not math.isnan(fits[norm].pairwise[k - 1]) else "-",
            ]
        marks = {norm: fits[norm].marks[k] for norm in NORMS}
        same = len(set(marks.values())) == 1
        told = marks["L1"] if same else ", ".join(f"{mark} ({norm})" for norm, mark in marks.items() if mark)
        found.append([*cells, str(row.rhs), brief(row.seconds), told])
    return found


def brief(x: float) -> str:
    """Four digits."""
    return "-" if math.isnan(x) else f"{x:.4g}"


def fitted(one) -> list[list[str]]:
    """The fitted orders of all variables."""
    return [[f"{name}", *(slope(fits[norm]) for norm in NORMS)] for name, fits in one.fits.items()]


def slope(fit) -> str:
    """An order with its spread, or that there is none."""
    from fvsolve.studies.accuracy.fit import NO_ERROR

    if fit.reason:
        return "no error" if fit.reason == NO_ERROR else "none"
    return f"{fit.order:.2f} ± {fit.spread:.2f}"


def reasons(one):
    """Why shown variables have no number, what is beside it, and how many others have none."""
    from fvsolve.studies.accuracy.fit import NO_ERROR

    for name in one.variables[:SHOWN]:
        told: dict[str, list[str]] = {}
        for norm, fit in one.fits[name].items():
            if (fit.reason or fit.note) and fit.reason != NO_ERROR:
                told.setdefault(fit.reason or fit.note, []).append(norm)
        for text, norms in told.items():
            yield f"{name} ({', '.join(norms)}): {text}"
    others = [fit.reason for name in one.variables[SHOWN:] for fit in one.fits[name].values()]
    if any(reason and reason != NO_ERROR for reason in others):
        yield "other variables without an order: --json says why"
