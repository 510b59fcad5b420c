"""The command `sweep`. Knows how values are listed on a command line; leaves the runs to `studies`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, app, load_case, print_json, value_of
from fvsolve.cli.studying import Out, folder_of, told
from fvsolve.errors import FvsolveError

Values = Annotated[
    list[str], typer.Option("--set", metavar="KEY=a,b,c", help="values of a key, one run each; one value holds for all")
]
SHOWN = 6  # columns of a table on a terminal, beside the keys


@app.command()
def sweep(
    case: One,
    set: Values,
    jobs: Annotated[int, typer.Option(metavar="N", help="runs at a time")] = 1,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """One run for every combination of values: a table with a row for each, failed ones with their reason."""
    from fvsolve import studies

    given = dict(_values(text) for text in set)
    fixed = {key: values[0] for key, values in given.items() if len(values) == 1}
    found = load_case(case, [])
    folder = folder_of(found, "sweep", out)
    with told() as progress:
        made = studies.sweep(found, {k: v for k, v in given.items() if k not in fixed}, fixed, jobs, folder, progress)
    if as_json:
        print_json(made.plain() | {"directory": str(folder)})
    else:
        _show(made, folder)
    sys.exit(0 if all(row["ok"] for row in made.rows) else 1)


def _values(text: str) -> tuple[str, list]:
    """`KEY=a,b,c` as the key and its values."""
    key, equals, listed = text.partition("=")
    if not (equals and key.strip() and listed.strip()):
        raise FvsolveError(f"--set {text}: wanted KEY=a,b,c, for example links.main.cells=100,200,400")
    return key.strip(), [value_of(one) for one in split(listed)]


def split(text: str) -> list[str]:
    """The parts between commas that stand in no brackets, braces or quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        depth += (letter in "[{") - (letter in "]}") if not quote else 0
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def _show(made, folder: Path) -> None:
    from fvsolve.cli import terminal
    from fvsolve.studies.sweep import pasted

    console = terminal.console()
    columns = [*made.keys, "ok", *(name for name in made.columns if name.startswith(("min(", "max(")))]
    shown = columns[len(made.keys) : len(made.keys) + 1 + SHOWN]
    rows = [[*(pasted(row[key]) for key in made.keys), *(_text(row.get(name)) for name in shown)] for row in made.rows]
    terminal.table([*made.keys, *shown], rows, console)
    for row in made.rows:
        where = ", ".join(f"{key} = {pasted(row[key])}" for key in made.keys)
        if not row["ok"]:
            terminal.line(console, f"{where}: {row['reason']}", "bold red")
        if row.get("marks"):
            terminal.line(console, f"{where}: {row['marks']}", "yellow")
    reused = f", {made.reused} of them found before" if made.reused else ""
    terminal.line(console, f"{folder / 'sweep.csv'}: {len(made.rows)} rows{reused}")


def _text(value) -> str:
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
