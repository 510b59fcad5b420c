"""The commands `sensitivity` and `fit`. Know how ranges are said; leave the runs to `studies`."""

from __future__ import annotations

from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Dask, Jobs, Out, Seed, folder_of, told
from fvsolve.cli.sweep import ranges


@app.command()
def sensitivity(
    case: One,
    vary: Annotated[list[str], typer.Option("--vary", metavar="KEY=LOW,HIGH", help="the two ends of a key")],
    outcome: Annotated[str, typer.Option(metavar="max(PROBE)", help="min, max or final of a probe")],
    samples: Annotated[int, typer.Option(metavar="N", help="a power of two: N (keys + 2) runs and some")] = 64,
    seed: Seed = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Which keys an outcome hangs on: Sobol's indices and Morris's effects over ranges."""
    from fvsolve import studies

    found = load_case(case, set)
    folder = folder_of(found, "sensitivity", out)
    with told() as progress:
        made = studies.sensitivity(
            found, ranges(vary, "--vary"), outcome, samples, seed, None, jobs, dask, folder, progress
        )
    paths = [made.sheet.write(folder / "sensitivity.csv"), folder / "sensitivity.png"]
    made.plot(paths[1])
    if as_json:
        print_json(made.plain() | {"directory": str(folder)})
    else:
        show(made, f"{paths[0]}: {made.outcome}, {made.runs} runs")


@app.command()
def fit(
    case: One,
    free: Annotated[list[str], typer.Option("--free", metavar="KEY=LOW,HIGH", help="a key and where it may lie")],
    seed: Seed = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Values of keys by which a case comes nearest to the measured series of its [compare]."""
    from fvsolve import studies

    found = load_case(case, set)
    with told(kept=False) as progress:
        made = studies.calibrate(found, ranges(free, "--free"), None, seed, jobs, dask, progress)
    if as_json:
        print_json(made.plain())
        return
    show(made, ", ".join(f"rms of {probe} {rms:.6g}" for probe, rms in made.rms.items()) + f", {made.runs} runs")
    from fvsolve.cli import terminal

    for doubt in made.doubts:
        terminal.line(terminal.console(), doubt, "yellow")


def show(made, last: str) -> None:
    """A table of keys, and a line below."""
    from fvsolve.cli import terminal

    console = terminal.console()
    terminal.table(*made.sheet.words(), console)
    terminal.line(console, last)
