"""`fvsolve report`, `fvsolve plot` and `fvsolve fatigue`: HTML report, pictures and pressure cycles of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json
from fvsolve.errors import FvsolveError


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="RUN_OR_STUDY", help="directory of a run or a study")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="file of the report (default RUN_OR_STUDY/report.html)")
    ] = None,
    xlsx: Annotated[
        bool, typer.Option("--xlsx", help="also write the tables as an Excel workbook in the folder of the report")
    ] = False,
) -> None:
    """Write an offline HTML page of a run or a study: verdicts, long sections, histories, model, numerics."""
    from fvsolve.report.report_files import write_report

    for path in write_report(directory, out, xlsx):
        print(path)


@app.command()
def plot(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    probes: Annotated[str, typer.Option(metavar="A,B", help="probes whose histories are drawn (default none)")] = "",
    route: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="route whose long section is drawn (default all routes, or none with --probes or --phase)",
        ),
    ] = "",
    phase: Annotated[
        list[str],
        typer.Option(
            metavar="X:Y", help="phase plane to draw, probe Y over probe X; repeat the option for more (default none)"
        ),
    ] = [],  # noqa: B006
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the pictures (default RUN)")] = None,
) -> None:
    """Draw long sections (heads, limits, devices), histories of probes and phase planes, without a browser."""
    from fvsolve.report.pictures import write_pictures

    for path in write_pictures(directory, probes, route, phase, out):
        print(path)


@app.command()
def fatigue(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    probes: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="probes of pressure or head whose cycles are counted (default all such probes)",
        ),
    ] = "",
    range: Annotated[
        float | None,
        typer.Option(
            metavar="R",
            help="range of pressure or head that causes failure after --allowable-range cycles, in the unit of the "
            "probe (default none: cycles are only counted)",
        ),
    ] = None,
    allowable_range: Annotated[
        float | None,
        typer.Option(metavar="N", help="number of cycles of the range --range until failure, required with --range"),
    ] = None,
    slope: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="exponent of the fatigue strength, required with --range: N (R/r)^M cycles of a range r cause failure",
        ),
    ] = None,
    per_day: Annotated[
        float,
        typer.Option(
            metavar="N", help="number of occurrences of the run per day, from which its fatigue life in years follows"
        ),
    ] = 1.0,
    as_json: Json = False,
) -> None:
    """Count pressure cycles of a run by rainflow counting, and estimate the fatigue life of its parts."""
    from fvsolve.cli import terminal
    from fvsolve.report import cycles as counting
    from fvsolve.run import open_run

    given = [entry for entry in (range, allowable_range, slope) if entry is not None]
    if len(given) not in (0, 3) or any(not entry > 0.0 for entry in given) or not per_day > 0.0:
        raise FvsolveError(
            "--range, --allowable-range, --slope: expected all three or none; these and --per-day must be above 0"
        )
    strength = counting.FatigueStrength(*given) if given else None
    names = [name.strip() for name in probes.split(",") if name.strip()]
    results = counting.cycles(open_run(directory), names or None, strength)
    if as_json:
        print_json({"probes": results})
        return
    console = terminal.console()
    rows = [[entry["probe"], entry["unit"], f"{size:.5g}", f"{count:g}"]
            for entry in results for size, count in entry["cycles"]]  # fmt: skip
    terminal.table(["probe", "unit", "range up to", "cycles"], rows, console)
    for entry in results if strength else ():
        years = 1.0 / (entry["share"] * per_day * 365.25) if entry["share"] > 0.0 else float("inf")
        life = "unlimited" if years == float("inf") else f"{years:.4g} years"
        terminal.line(
            console,
            f"{entry['probe']}: a run uses {entry['share']:.3g} of the fatigue life; with {per_day:g} runs a day the "
            f"life is {life}",
        )
