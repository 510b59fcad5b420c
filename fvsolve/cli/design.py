"""The command `study`. Knows the terminal; leaves the runs to `studies`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json
from fvsolve.cli.studying import Dask, Jobs, Out, told


@app.command()
def study(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="a study file: case, events, protections")],
    out: Out = None,
    jobs: Jobs = 1,
    dask: Dask = None,
    force: Annotated[bool, typer.Option("--force", help="replace earlier runs")] = False,
    as_json: Json = False,
) -> None:
    """Run every event with every protection of a design, and say which limits hold."""
    from fvsolve.studies import design

    with told() as progress:
        found = design.study(file, out, jobs, dask, force, progress)
    if as_json:
        print_json(found.plain() | {"directory": str(found.folder)})
    else:
        _show(found)
    sys.exit(0 if found.ok else 1)


def _show(found) -> None:
    from fvsolve.cli import terminal
    from fvsolve.cli.report import REASONS_SHOWN, open_as, when, where_and_when
    from fvsolve.run.result import FAILS, OPEN
    from fvsolve.studies.design import name_of
    from fvsolve.units import span

    console = terminal.console()
    if found.design.title:
        terminal.line(console, found.design.title, "bold")
    limits = {one["name"]: f"{one['name']} [{span(one['unit'])}]" for row in found.rows for one in row["verdicts"]}
    rows = []
    for row in found.rows:
        verdicts = {one["name"]: one for one in row["verdicts"]}
        cells = [_cell(verdicts.get(name), row) for name in limits]
        rows.append([name_of(row), standing(row), *cells])
    terminal.table(["run", "", *(f"margin of {name}" for name in limits.values())], rows, console)
    for row in found.rows:
        if not row["ok"]:
            terminal.line(console, f"{name_of(row)}: {row['reason']}", "bold red")
        if row["marks"]:
            first = min(row["marks"], key=lambda mark: mark["time"])
            text = f"{first['text']}: results from {when(row)(first['time'])} on are not to be trusted"
            terminal.line(console, f"{name_of(row)}: {text}", "yellow")
        for note in row["warnings"]:
            if note["kind"] == "end":
                terminal.line(console, f"{name_of(row)}: {note['text']}", "yellow")
        for one in verdicts_of(row):
            if one.state in (FAILS, OPEN):
                value = "-" if one.value is None else f"{one.value:.6g}"
                text = f"{name_of(row)}: {one.name}: {value} {one.unit} ({where_and_when(one._asdict(), row)})"
                why = "" if one.state == FAILS else f": open, as {open_as(one, row)}"
                terminal.line(console, text + why, "red" if one.state == FAILS else "yellow")
        for text in row.get("resolution", {"reasons": []})["reasons"][:REASONS_SHOWN]:
            terminal.line(console, f"{name_of(row)}: error of {text}", "yellow")
    names = [name or "the case as it is" for name in found.holds]
    if found.limited:
        told = f"all limits hold in all events: {', '.join(names)}"
        told = told if names else "nothing holds all limits in all events"
        terminal.line(console, told, "green" if names else "bold red")
    else:
        terminal.line(console, "no limits are stated, so none can hold or fail", "yellow")
    terminal.line(console, f"{found.folder}: study.json, study.csv and a run directory for each")


def verdicts_of(row: dict) -> list:
    """Of a run."""
    from fvsolve.run.result import LimitVerdict

    return [LimitVerdict(**one) for one in row["verdicts"]]


def standing(row: dict) -> str:
    """Of a run in one word."""
    from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN

    states = [FAILS] * (not row["ok"]) + [one.state for one in verdicts_of(row)]
    if not states:
        return "-"
    return IN_WORDS[next((one for one in (FAILS, OPEN) if one in states), HOLDS)]


def _cell(verdict, row: dict) -> str:
    from fvsolve.run.result import not_valid

    if verdict is None or verdict["margin"] is None:
        return "-" if verdict is None else not_valid(row) or "-"
    error = "" if verdict["error"] is None else f" +- {verdict['error']:.2g}"
    return f"{verdict['margin']:.5g}{error}"
