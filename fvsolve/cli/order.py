"""`fvsolve order CASE`: observed order of convergence."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli import terminal
from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import Dask, Jobs, Out, clear_files, comma_list, folder_of, method_names, progress_line
from fvsolve.output.summary_file import plain
from fvsolve.studies.accuracy.order_picture import NORMS, SHOWN_VARIABLES, study_title, variable_unit
from fvsolve.studies.result_table import Column, ResultTable, columns

FILE = columns(
    scheme="scheme", method="method", reference="reference", variable="variable", unit="unit", norm="norm",
    cells="cells", size="size", step="step [s]", error="error", pairwise="order", mark="mark", order="fitted order",
    spread="spread", steps="steps", rhs="rhs", updates="cell updates", seconds="seconds",
)  # fmt: skip

TABLE = (
    Column("cells"), Column("step", "step [s]", ".4g"),
    *(column for norm in NORMS for column in (Column(norm, words=".4g"), Column(f"order {norm}", "order", ".2f"))),
    Column("rhs"), Column("seconds", words=".4g"), Column("mark"),
)  # fmt: skip


@app.command()
def order(
    case: SingleCase,
    overrides: Set = [],  # noqa: B006
    refine: Annotated[
        str | None,
        typer.Option(
            help="resolution to refine: both (cells and time steps), space or time "
            "(default both, or time for a case without pipes and basins)"
        ),
    ] = None,
    key: Annotated[
        str | None,
        typer.Option(
            metavar="KEY",
            help="single key to refine, for example links.main.cells or numerics.step (default all keys that --refine "
            "selects)",
        ),
    ] = None,
    levels: Annotated[
        int | None,
        typer.Option(help="number of refinement levels, 2 or more (default 4, or 6 if only time is refined)"),
    ] = None,
    cells: Annotated[
        int | None,
        typer.Option(
            help="number of cells, at the coarsest level, of the pipe or basin side with most cells, or of the part of "
            "--key (default as in the case, or fewer to shorten the study)"
        ),
    ] = None,
    scheme: Annotated[
        str | None, typer.Option(metavar="A,B", help="schemes to study (default scheme of the case)")
    ] = None,
    method: Annotated[
        str | None, typer.Option(metavar="A,B", help="methods to study (default method of the case)")
    ] = None,
    reference: Annotated[
        str,
        typer.Option(
            help="reference solution: exact (named in the case), finer (a run at a finer level), richardson (the next "
            "level) or auto (the first of these that suits the case)"
        ),
    ] = "auto",
    jobs: Jobs = 1,
    dask: Dask = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure the order of convergence of a case under refinement: a table, order.csv and order.png."""
    from fvsolve.studies.accuracy.order import order as study
    from fvsolve.studies.result_cache import ResultCache

    loaded = load_case(case, overrides, scheme, method)
    folder = folder_of(loaded, "order", out)
    with progress_line() as progress, ResultCache(folder) as points:
        studies = study(
            loaded,
            refine=refine,
            key=key,
            levels=levels,
            cells=cells,
            schemes=comma_list(scheme, "--scheme"),
            methods=method_names(method),
            against=reference,
            out=points,
            progress=progress,
            jobs=jobs,
            dask=dask,
        )
    studies = studies if isinstance(studies, list) else [studies]
    files = [
        ResultTable(FILE, [*file_rows(studies)]).write(
            clear_files(folder, "order.csv", "order.png", "order-*.png") / "order.csv"
        ),
        *draw(folder, studies),
    ]
    if as_json:
        print_json({"studies": [result.plain() for result in studies], "files": [str(file) for file in files],
                    "reused": points.reused})  # fmt: skip
        return
    for result in studies:
        print_study(result)
    terminal.line(terminal.console(), f"files: {', '.join(str(file) for file in files)}")


def draw(folder: Path, studies) -> list[Path]:
    """Write a picture of every order study into a folder; returns the paths."""
    files = []
    for result in studies:
        name = "order.png" if len(studies) == 1 else f"order-{result.scheme}-{result.method}.png"
        result.plot(folder / name)
        files.append(folder / name)
    return files


def file_rows(studies) -> Iterator[dict]:
    """Rows of order.csv: a row for each level of each study, variable and norm, in SI."""
    for result in studies:
        head = {"scheme": result.scheme, "method": result.method, "reference": result.kind}
        for variable, fits in result.fits.items():
            for norm in NORMS:
                labels = {"variable": variable, "unit": variable_unit(variable, result.units), "norm": norm}
                pairs = zip(result.rows, [None, *fits[norm].pairwise], fits[norm].marks, strict=True)
                for row, pairwise, mark in pairs:
                    yield head | labels | vars(fits[norm]) | vars(row) | vars(row.level) | {
                        "error": row.errors.get(variable, {}).get(norm), "pairwise": pairwise, "mark": mark,
                        "updates": row.cell_updates,
                    }  # fmt: skip


def print_study(result) -> None:
    """Print the tables, fitted orders and notes of a study."""
    console = terminal.console()
    terminal.line(console, f"{result.case}: {study_title(result)}", "bold")
    terminal.line(console, f"errors against: {result.words}")
    for variable in result.variables[:SHOWN_VARIABLES]:
        terminal.line(console, "")
        place = " at the end, all pipes" if variable in ("pressure", "flow") else ""
        terminal.line(console, f"{variable} [{result.error_unit(variable)[1]}]{place}")
        terminal.print_sheet(rows_of(result, variable), console)
    terminal.line(console, "")
    terminal.table(["fitted order of", "L1", "L2", "max"], fit_rows(result), console)
    for text in dict.fromkeys([*reason_lines(result), *result.notes]):
        terminal.line(console, text)
    terminal.line(console, "")


def rows_of(result, variable: str) -> ResultTable:
    """Table of a variable of an order study: errors and pairwise orders of all levels."""
    fits, rows, size = result.fits[variable], [], result.error_unit(variable)[0]
    for k, row in enumerate(result.rows):
        step = f"rtol {row.level.size:g}" if result.plan.measure == "rtol" else row.level.step
        cells = {"cells": row.level.cells or None, "step": step, "rhs": row.rhs, "seconds": row.seconds}
        cells |= {norm: size * error for norm, error in row.errors.get(variable, {}).items()}
        cells |= {f"order {norm}": fits[norm].pairwise[k - 1] if k else None for norm in NORMS}
        marks = {norm: fits[norm].marks[k] for norm in NORMS}
        same = len(set(marks.values())) == 1
        mark_text = marks["L1"] if same else ", ".join(f"{text} ({norm})" for norm, text in marks.items() if text)
        rows.append(plain(cells | {"mark": mark_text}))
    return ResultTable(TABLE, rows)


def fit_rows(result) -> list[list[str]]:
    """Rows of the table of fitted orders: one for each variable, with its orders in the L1, L2 and max norm."""
    return [[f"{name}", *(fit_text(fits[norm]) for norm in NORMS)] for name, fits in result.fits.items()]


def fit_text(fit) -> str:
    """Text of a fitted order with its spread; "none" without an order, "no error" if all errors are 0."""
    from fvsolve.studies.accuracy.fit import NO_ERROR

    if fit.reason:
        return "no error" if fit.reason == NO_ERROR else "none"
    return f"{fit.order:.2f} ± {fit.spread:.2f}"


def reason_lines(result):
    """Lines with reasons for missing orders and notes on orders, of the variables that are printed."""
    from fvsolve.studies.accuracy.fit import NO_ERROR

    for name in result.variables[:SHOWN_VARIABLES]:
        notes: dict[str, list[str]] = {}
        for norm, fit in result.fits[name].items():
            if (fit.reason or fit.note) and fit.reason != NO_ERROR:
                notes.setdefault(fit.reason or fit.note, []).append(norm)
        for text, norms in notes.items():
            yield f"{name} ({', '.join(norms)}): {text}"
    others = [fit.reason for name in result.variables[SHOWN_VARIABLES:] for fit in result.fits[name].values()]
    if any(reason and reason != NO_ERROR for reason in others):
        yield "of the other variables some have no order; --json gives the reasons"
