"""`fvsolve report` and `plot`: what is handed over. Knows what is asked; leaves the work to `report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import app


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="RUN_OR_STUDY", help="directory of a run or a study")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="default report.html there")] = None,
    xlsx: Annotated[bool, typer.Option("--xlsx", help="the tables too, as a workbook beside it")] = False,
) -> None:
    """One offline HTML page of a run or a study: verdicts, long sections, histories, model, numerics."""
    from fvsolve.report.report import write_report

    for path in write_report(directory, out, xlsx):
        print(path)


@app.command()
def plot(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    probes: Annotated[str, typer.Option(metavar="A,B", help="histories of these")] = "",
    route: Annotated[str, typer.Option(metavar="NAME", help="one long section; all where nothing is asked")] = "",
    phase: Annotated[list[str], typer.Option(metavar="X:Y", help="one probe over another")] = [],  # noqa: B006
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="default RUN")] = None,
) -> None:
    """Pictures without a browser: long sections with what was met along them, histories by choice, phase planes."""
    from fvsolve.report.pictures import write_pictures

    for path in write_pictures(directory, probes, route, phase, out):
        print(path)
