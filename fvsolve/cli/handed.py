"""`fvsolve report` and `plot`: what is handed over. Knows what is asked; leaves the work to `report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json
from fvsolve.errors import FvsolveError


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


@app.command()
def cycles(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    probes: Annotated[str, typer.Option(metavar="A,B", help="of pressure or head; all of these by default")] = "",
    range: Annotated[
        float | None, typer.Option(metavar="R", help="that a part bears, in the unit of the probe")
    ] = None,
    bears: Annotated[float | None, typer.Option(metavar="N", help="so many cycles of it")] = None,
    slope: Annotated[float | None, typer.Option(metavar="M", help="N (R / r)^M of a range r")] = None,
    per_day: Annotated[float, typer.Option(metavar="N", help="runs a day, for how long it lasts")] = 1.0,
    as_json: Json = False,
) -> None:
    """Cycles of pressure that a run puts on its parts, by rainflow counting, and how long these bear it."""
    from fvsolve.cli import terminal
    from fvsolve.report import cycles as counting
    from fvsolve.run import open_run

    given = [one for one in (range, bears, slope) if one is not None]
    if len(given) not in (0, 3) or any(not one > 0.0 for one in given) or not per_day > 0.0:
        raise FvsolveError("what a part bears is said by --range, --bears and --slope together, each above 0")
    strength = counting.Strength(*given) if given else None
    names = [name.strip() for name in probes.split(",") if name.strip()]
    found = counting.cycles(open_run(directory), names or None, strength)
    if as_json:
        print_json({"probes": found})
        return
    console = terminal.console()
    rows = [[one["probe"], one["unit"], f"{size:.5g}", f"{count:g}"] for one in found for size, count in one["cycles"]]
    terminal.table(["probe", "unit", "range up to", "cycles"], rows, console)
    for one in found if strength else ():
        years = 1.0 / (one["share"] * per_day * 365.25) if one["share"] > 0.0 else float("inf")
        lasts = "without end" if years == float("inf") else f"{years:.4g} years"
        terminal.line(console, f"{one['probe']}: a run uses {one['share']:.3g} of it; {per_day:g} a day last {lasts}")
