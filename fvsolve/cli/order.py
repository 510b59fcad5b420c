"""`fvsolve order CASE`: how fast the error falls. Knows words, tables and files; leaves the study to `studies`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli import terminal
from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Dask, Jobs, Out, cleared, folder_of, listed, methods_of, told
from fvsolve.output.summary import plain
from fvsolve.studies.accuracy.picture import NORMS, SHOWN, title, unit
from fvsolve.studies.sheet import Column, Sheet, columns

FILE = columns(
    scheme="scheme", method="method", reference="reference", variable="variable", unit="unit", norm="norm",
    cells="cells", size="size", step="step [s]", error="error", pairwise="order", mark="mark", order="fitted order",
    spread="spread", steps="steps", rhs="rhs", updates="cell updates", seconds="seconds",
)  # fmt: skip

TABLE = (
    Column("cells"), Column("step", "step [s]", ".4g"),
    *(one for norm in NORMS for one in (Column(norm, words=".4g"), Column(f"order {norm}", "order", ".2f"))),
    Column("rhs"), Column("seconds", words=".4g"), Column("mark"),
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
    jobs: Jobs = 1,
    dask: Dask = None,
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
                      methods=methods_of(method), against=against, out=points, progress=progress,
                      jobs=jobs, dask=dask)  # fmt: skip
    found = found if isinstance(found, list) else [found]
    files = [
        Sheet(FILE, [*lines(found)]).write(cleared(folder, "order.csv", "order.png", "order-*.png") / "order.csv"),
        *draw(folder, found),
    ]
    if as_json:
        print_json({"studies": [one.plain() for one in found], "files": [str(file) for file in files],
                    "reused": points.reused})  # fmt: skip
        return
    for one in found:
        say(one)
    terminal.line(terminal.console(), f"files: {', '.join(str(file) for file in files)}")


def draw(folder: Path, found) -> list[Path]:
    """A picture of every study."""
    files = []
    for one in found:
        name = "order.png" if len(found) == 1 else f"order-{one.scheme}-{one.method}.png"
        one.plot(folder / name)
        files.append(folder / name)
    return files


def lines(found) -> Iterator[dict]:
    """A line of order.csv for each row of each study, variable and norm, SI."""
    for one in found:
        known = {"scheme": one.scheme, "method": one.method, "reference": one.kind}
        for variable, fits in one.fits.items():
            for norm in NORMS:
                what = {"variable": variable, "unit": unit(variable, one.units), "norm": norm}
                pairs = zip(one.rows, [None, *fits[norm].pairwise], fits[norm].marks, strict=True)
                for row, pairwise, mark in pairs:
                    yield known | what | vars(fits[norm]) | vars(row) | vars(row.level) | {
                        "error": row.errors.get(variable, {}).get(norm), "pairwise": pairwise, "mark": mark,
                        "updates": row.cell_updates,
                    }  # fmt: skip


def say(one) -> None:
    """What a person reads."""
    console = terminal.console()
    terminal.line(console, f"{one.case}: {title(one)}", "bold")
    terminal.line(console, f"errors against: {one.words}")
    for variable in one.variables[:SHOWN]:
        terminal.line(console, "")
        where = " at the end, all pipes" if variable in ("pressure", "flow") else ""
        terminal.line(console, f"{variable} [{one.told(variable)[1]}]{where}")
        terminal.sheet(rows_of(one, variable), console)
    terminal.line(console, "")
    terminal.table(["fitted order of", "L1", "L2", "max"], fitted(one), console)
    for text in dict.fromkeys([*reasons(one), *one.notes]):
        terminal.line(console, text)
    terminal.line(console, "")


def rows_of(one, variable: str) -> Sheet:
    """A variable's table."""
    fits, found, size = one.fits[variable], [], one.told(variable)[0]
    for k, row in enumerate(one.rows):
        step = f"rtol {row.level.size:g}" if one.plan.measure == "rtol" else row.level.step
        cells = {"cells": row.level.cells or None, "step": step, "rhs": row.rhs, "seconds": row.seconds}
        cells |= {norm: size * error for norm, error in row.errors.get(variable, {}).items()}
        cells |= {f"order {norm}": fits[norm].pairwise[k - 1] if k else None for norm in NORMS}
        marks = {norm: fits[norm].marks[k] for norm in NORMS}
        same = len(set(marks.values())) == 1
        told = marks["L1"] if same else ", ".join(f"{mark} ({norm})" for norm, mark in marks.items() if mark)
        found.append(plain(cells | {"mark": told}))
    return Sheet(TABLE, found)


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
