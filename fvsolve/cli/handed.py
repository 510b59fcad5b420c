"""`fvsolve report`: what is handed over. Knows what is asked; leaves the work to `report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import app


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="default RUN/report.html")] = None,
    xlsx: Annotated[bool, typer.Option("--xlsx", help="the tables too, as a workbook beside it")] = False,
) -> None:
    """One offline HTML page of a run: verdicts, long sections, histories, model, numerics."""
    from fvsolve.report.report import write_report

    for path in write_report(directory, out, xlsx):
        print(path)
