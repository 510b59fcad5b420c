"""The commands `sensitivity` and `fit`. Know how ranges are said; leave the runs to `studies`."""

from __future__ import annotations

from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Dask, Jobs, Out, Seed, cleared, folder_of, told
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
    paths = [
        made.sheet.write(cleared(folder, "sensitivity.csv", "sensitivity.png") / "sensitivity.csv"),
        folder / "sensitivity.png",
    ]
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
    from fvsolve.cli import terminal
    from fvsolve.studies.plans import bare_unit

    probes = {one.probe.text: one.probe for one in found.compare.values() if one.probe is not None}
    left = [f"rms of {name} {difference(found, probes[name], rms)}" for name, rms in made.rms.items()]
    units = {key: f"{key} [{unit}]" if (unit := bare_unit(found.raw, key)) else key for key in made.values}
    show(made, ", ".join([*left, f"{made.runs} runs"]), units)

    for doubt in made.doubts:
        terminal.line(terminal.console(), doubt, "yellow")


def difference(case, probe, value: float) -> str:
    """A difference of a probe [SI] with the unit that it is recorded in."""
    from fvsolve.output.column import column

    own = column(probe.text, probe.dimension, case, probe.unit)
    return f"{own.span_from_si(value):.6g} {own.span_unit}"


def show(made, last: str, units: dict[str, str] = {}) -> None:  # noqa: B006
    """A table of keys, those in `units` as these say them, and a line below."""
    from fvsolve.cli import terminal

    console, (heads, rows) = terminal.console(), made.sheet.words()
    terminal.table(heads, [[units.get(key, key), *row] for key, *row in rows], console)
    terminal.line(console, last)
