"""`fvsolve study`: runs of a study file, all events with all protections."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json
from fvsolve.cli.study_options import Dask, Jobs, progress_line


@app.command()
def study(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file of a study: case, events, protections")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="folder of the run directories and tables (default runs/NAME, the name of FILE without .toml)",
        ),
    ] = None,
    jobs: Jobs = 1,
    dask: Dask = None,
    force: Annotated[bool, typer.Option("--force", help="replace earlier runs of this study")] = False,
    as_json: Json = False,
) -> None:
    """Run every event with every protection of a study file, and list the limits that hold or fail."""
    from fvsolve.studies import scenarios

    with progress_line() as progress:
        result = scenarios.study(file, out, jobs, dask, force, progress)
    if as_json:
        print_json(result.plain() | {"directory": str(result.folder)})
    else:
        _show(result)
    sys.exit(0 if result.ok else 1)


def _show(result) -> None:
    from fvsolve.cli import terminal
    from fvsolve.cli.printing import REASONS_SHOWN, time_formatter, undecided_limit_reason, where_and_when
    from fvsolve.run.result import FAILS, OPEN
    from fvsolve.studies.scenarios import row_name
    from fvsolve.units import span

    console = terminal.console()
    if result.design.title:
        terminal.line(console, result.design.title, "bold")
    limits = {
        verdict["name"]: f"{verdict['name']} [{span(verdict['unit'])}]"
        for row in result.rows
        for verdict in row["verdicts"]
    }
    rows = []
    for row in result.rows:
        verdicts = {verdict["name"]: verdict for verdict in row["verdicts"]}
        cells = [_cell(verdicts.get(name), row) for name in limits]
        rows.append([row_name(row), standing(row), *cells])
    terminal.table(["run", "", *(f"margin of {name}" for name in limits.values())], rows, console)
    for row in result.rows:
        if not row["ok"]:
            terminal.line(console, f"{row_name(row)}: {row['reason']}", "bold red")
        if row["marks"]:
            first = min(row["marks"], key=lambda mark: mark["time"])
            text = f"{first['text']}: results from {time_formatter(row)(first['time'])} on are not to be trusted"
            terminal.line(console, f"{row_name(row)}: {text}", "yellow")
        for note in row["warnings"]:
            if note["kind"] == "end":
                terminal.line(console, f"{row_name(row)}: {note['text']}", "yellow")
        for verdict in verdicts_of(row):
            if verdict.state in (FAILS, OPEN):
                value = "-" if verdict.value is None else f"{verdict.value:.6g}"
                place = where_and_when(verdict._asdict(), row)
                text = f"{row_name(row)}: {verdict.name}: {value} {verdict.unit} ({place})"
                reason = "" if verdict.state == FAILS else f": open, because {undecided_limit_reason(verdict, row)}"
                terminal.line(console, text + reason, "red" if verdict.state == FAILS else "yellow")
        for text in row.get("resolution", {"reasons": []})["reasons"][:REASONS_SHOWN]:
            terminal.line(console, f"{row_name(row)}: error of {text}", "yellow")
    names = [name or "the case as it is" for name in result.holds]
    if result.limited:
        message = f"all limits hold in all events with: {', '.join(names)}"
        message = message if names else "no protection satisfies all limits in all events"
        terminal.line(console, message, "green" if names else "bold red")
    else:
        terminal.line(console, "the case states no limits, so none is checked", "yellow")
    terminal.line(console, f"{result.folder}: study.json, study.csv and a directory for each run")


def verdicts_of(row: dict) -> list:
    """Verdicts on the limits of a run, from its row in a study, as `LimitVerdict`."""
    from fvsolve.run.result import LimitVerdict

    return [LimitVerdict(**verdict) for verdict in row["verdicts"]]


def standing(row: dict) -> str:
    """Status of a run in a word, from its row in a study.

    It is "FAILS" if the run or a limit fails, else "open" or "holds"; "-" for a good run without limits.
    """
    from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN

    states = [FAILS] * (not row["ok"]) + [entry.state for entry in verdicts_of(row)]
    if not states:
        return "-"
    return IN_WORDS[next((entry for entry in (FAILS, OPEN) if entry in states), HOLDS)]


def _cell(verdict, row: dict) -> str:
    from fvsolve.run.result import not_valid

    if verdict is None or verdict["margin"] is None:
        return "-" if verdict is None else not_valid(row) or "-"
    error = "" if verdict["error"] is None else f" +- {verdict['error']:.2g}"
    return f"{verdict['margin']:.5g}{error}"
