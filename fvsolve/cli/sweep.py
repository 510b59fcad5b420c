"""The command `sweep`. Knows how values are listed on a command line; leaves the runs to `studies`."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, app, load_case, print_json, value_of
from fvsolve.cli.studying import Dask, Jobs, Out, Seed, cleared, folder_of, told, writable
from fvsolve.errors import FvsolveError

Values = Annotated[
    list[str], typer.Option("--set", metavar="KEY=a,b,c", help="values of a key, one run each; one value holds for all")
]
Ranges = Annotated[list[str], typer.Option("--vary", metavar="KEY=LOW,HIGH", help="ends of a key, for --sample")]
Outcomes = Annotated[
    list[str], typer.Option("--outcome", metavar="max(PROBE)", help="what is charted, in place of all extremes")
]
WANTED = "KEY=a,b,c, for example links.main.cells=100,200,400"
RANGE = "KEY=LOW,HIGH, for example links.main.length=900,1000"
SHOWN = 6  # columns of a table on a terminal, beside the keys
MOST = 100  # rows of it


@app.command()
def sweep(
    case: One,
    set: Values = [],  # noqa: B006
    points: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="values of every run: a column for each key")
    ] = None,
    sample: Annotated[
        str | None, typer.Option(metavar="sobol:N", help="N runs between the ends of --vary; or lhs:N")
    ] = None,
    vary: Ranges = [],  # noqa: B006
    seed: Seed = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    outcome: Outcomes = [],  # noqa: B006
    out: Out = None,
    as_json: Json = False,
) -> None:
    """One run for every combination of values: a table with a row for each, failed ones with their reason."""
    from fvsolve import studies
    from fvsolve.studies.plans import headed

    given = dict(values_of(text) for text in set)
    fixed = {key: values[0] for key, values in given.items() if len(values) == 1}
    if vary and sample is None:
        raise FvsolveError(f"--vary {vary[0]}: wants --sample sobol:N beside it; values of a grid are --set KEY=a,b,c")
    moved = {key: values for key, values in given.items() if key not in fixed} | ranges(vary, "--vary")
    found = load_case(case, [])
    folder = folder_of(found, "sweep", out)
    with told() as progress:
        made = studies.sweep(found, moved, fixed, jobs, folder, progress, points, sample, seed, dask)
    heads = {key: headed(found.raw, key, [row[key] for row in made.rows]) for key in made.keys}
    charts = write_charts(made, outcome, folder, heads)
    if as_json:
        print_json(made.plain() | {"directory": str(folder), "charts": [str(path) for path in charts]})
    else:
        _show(made, folder, heads)
    sys.exit(0 if all(row["ok"] for row in made.rows) else 1)


def ranges(texts: list[str], option: str) -> dict[str, list]:
    """`KEY=LOW,HIGH` of each key as its two ends."""
    found = [values_of(text, option, RANGE) for text in texts]
    twice = [key for key, _ in found if [one for one, _ in found].count(key) > 1]
    if twice:
        raise FvsolveError(f"{option} {twice[0]} is given twice; keep one")
    return dict(found)


def write_charts(made, outcomes: list[str], folder: Path, heads: dict[str, str]) -> list[Path]:
    """A picture for each outcome in `charts`, all extremes if none is named, keys under their heads; their paths."""
    from fvsolve.draw.sweep import outcome_figure

    known = made.outcomes
    names = [made.outcome(name) for name in outcomes] or [one for one in known if one.startswith(("max(", "min("))]
    cleared(folder / "charts", "*max-*.png", "*min-*.png", "final-*.png")
    paths = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9.@_-]+", "-", name.partition(" [")[0]).strip("-")
        path = writable(folder / "charts") / f"{plain}.png"
        outcome_figure(made, name, heads).savefig(path)
        paths.append(path)
    return paths


def values_of(text: str, option: str = "--set", wanted: str = WANTED) -> tuple[str, list]:
    """`KEY=a,b,c` as the key and its values."""
    key, equals, listed = text.partition("=")
    if not (equals and key.strip() and listed.strip()):
        raise FvsolveError(f"{option} {text}: wanted {wanted}")
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


def _show(made, folder: Path, heads: dict[str, str]) -> None:
    from fvsolve.cli import terminal
    from fvsolve.studies.sweep import pasted

    console = terminal.console()
    columns = [*made.keys, "ok", *(name for name in made.columns if name.startswith(("min(", "max(")))]
    shown = columns[len(made.keys) : len(made.keys) + 1 + SHOWN]
    first = made.rows[:MOST]
    rows = [[*(pasted(row[key]) for key in made.keys), *(_text(row.get(name)) for name in shown)] for row in first]
    terminal.table([*heads.values(), *shown], rows, console)
    for row in first:
        where = ", ".join(f"{key} = {pasted(row[key])}" for key in made.keys)
        if not row["ok"]:
            terminal.line(console, f"{where}: {row['reason']}", "bold red")
        if row.get("marks"):
            terminal.line(console, f"{where}: {row['marks']}", "yellow")
    reused = f", {made.reused} of them found before" if made.reused else ""
    reused += f", the first {MOST} of them here" if len(made.rows) > MOST else ""
    terminal.line(console, f"{folder / 'sweep.csv'}: {len(made.rows)} rows{reused}")


def _text(value) -> str:
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
