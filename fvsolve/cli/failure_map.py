"""`fvsolve map`: where methods fail on a case. Knows options and words; leaves the runs to `studies`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json, value_of
from fvsolve.cli.studying import Dask, Jobs, Out, cleared, folder_of, listed, methods_of, told
from fvsolve.errors import FvsolveError
from fvsolve.studies.sheet import Column, Sheet
from fvsolve.units import parse


@app.command("map")
def map_(
    case: One,
    scheme: Annotated[str | None, typer.Option(metavar="A,B", help="schemes, one panel each")] = None,
    method: Annotated[str | None, typer.Option(metavar="A,B", help="methods, one row each")] = None,
    courant: Annotated[str | None, typer.Option(metavar="A,B", help="columns: Courant numbers")] = None,
    step: Annotated[str | None, typer.Option(metavar="A,B", help='columns: steps, "1 ms,2 ms"')] = None,
    key: Annotated[str | None, typer.Option(metavar="KEY=A,B", help="columns: values of a key of the case")] = None,
    tolerance: Annotated[float, typer.Option(metavar="X", help="mean error over a probe's range")] = 0.02,
    jobs: Jobs = 1,
    dask: Dask = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Failure map: methods against steps or a key, each square run for real: stable, ringing, wrong, blown up ..."""
    from fvsolve.studies.failure.failure_map import failures
    from fvsolve.studies.plans import headed
    from fvsolve.studies.points import Points

    read_case = load_case(case, set, scheme, method)
    folder = folder_of(read_case, "map", out)
    with told() as progress, Points(folder) as points:
        found = failures(
            read_case, listed(scheme, "--scheme"), methods_of(method), _numbers("--courant", courant),
            _steps(step), _key(key), tolerance, points, progress, jobs=jobs, dask=dask,
        )  # fmt: skip
    head = found.key if found.key == "step" else headed(read_case.raw, found.key, found.values)
    files = _written(found, folder, head)
    if as_json:
        print_json(found.plain() | {"files": [str(file) for file in files]})
    else:
        _show(found, files, head)


def _numbers(option: str, text: str | None) -> list[float] | None:
    try:
        return None if text is None else [float(word) for word in listed(text)]
    except ValueError:
        raise FvsolveError(f"{option} {text} is not made of numbers; wanted, for example, {option} 0.5,0.9,1") from None


def _steps(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [parse(value_of(word), "time") for word in listed(text)]
    except ValueError as error:
        raise FvsolveError(f"--step {text}: {error}") from None


def _key(text: str | None) -> tuple[str, list] | None:
    if text is None:
        return None
    name, equals, values = text.partition("=")
    if not equals or not name.strip():
        raise FvsolveError(f"--key {text}: wanted KEY=A,B, for example nodes.body.volume=1e-6,1e-5")
    return name.strip(), [value_of(word) for word in listed(values)]


def _written(found, folder: Path, head: str) -> list[Path]:
    from fvsolve.draw.failure_map import failure_map_figure

    rows = [{"value": found.values[row["column"]]} | row for row in found.plain()["squares"]]
    table = Sheet([Column(key) for key in rows[0]], rows).write(
        cleared(folder, "map.csv", "map.png", "map.svg") / "map.csv"
    )
    figure = failure_map_figure(found, f"{found.case}: where methods fail", head)
    pictures = [folder / f"map.{kind}" for kind in ("png", "svg")]
    for picture in pictures:
        figure.savefig(picture)
    return [table, *pictures]


def _show(found, files: list[Path], head: str) -> None:
    from fvsolve.cli import terminal
    from fvsolve.draw.failure_map import column_labels
    from fvsolve.studies.failure.verdict import VERDICTS

    console = terminal.console()
    for scheme in found.schemes:
        what = "steps" if found.key == "step" else head
        terminal.line(console, f"{scheme}, {what}:" if found.wave_rate else f"{what}:", "bold")
        heads = [
            "method",
            *(label.split("\n")[-1 if _by_courant(found) else 0] for label in column_labels(found)),
            "predicted",
        ]
        rows = [
            [method, *(one.verdict for one in found.row(scheme, method)), _limit(found, found.row(scheme, method))]
            for method in found.methods
        ]
        terminal.table(heads, rows, console)
        terminal.line(console, "")
    seen = {one.verdict: None for one in found.squares}
    for word in VERDICTS:
        if word in seen:
            terminal.line(console, f"{word}: {VERDICTS[word]}")
    terminal.line(console, f"tolerance: {found.tolerance:g} of a probe's range, mean over the run, worst probe")
    terminal.line(console, f"reference: {found.reference}; off by up to {found.doubt:.2g}")
    terminal.line(console, "predicted limit: first step at which an eigenvalue grows by 1000 within the run (13)")
    if found.lines:
        terminal.line(console, "or a wave between a store and a delay line does, of which jumps are not known")
    if found.limited:
        terminal.line(
            console, f"of {', '.join(found.limited)}: by the weights in smooth flow, an estimate and no bound"
        )
    for reason in {one.measures.reason: None for one in found.squares if one.verdict == "refused"}:
        terminal.line(console, f"refused: {reason}")
    for file in files:
        terminal.line(console, str(file))


def _by_courant(found) -> bool:
    """Whether Courant numbers are the shorter words for the columns."""
    return found.key == "step" and bool(found.wave_rate) and min(found.values) * found.wave_rate >= 0.01


def _limit(found, row) -> str:
    from fvsolve.draw.failure_map import seconds

    limits = {one.limit for one in row}
    if len(limits) > 1:
        return "by column"
    (limit,) = limits
    if limit is None:
        return "not known"
    if limit == float("inf"):
        return "none"
    if limit == 0.0:
        return "any step"
    return f"C {limit * found.wave_rate:.3g}" if _by_courant(found) else seconds(limit)
