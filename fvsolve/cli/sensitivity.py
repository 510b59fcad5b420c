"""`fvsolve sensitivity` and `fvsolve calibrate`: sensitivity indices and calibration of keys."""

from __future__ import annotations

from typing import Annotated

import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import Dask, Jobs, Out, Seed, clear_files, folder_of, progress_line
from fvsolve.cli.sweep import ranges


@app.command()
def sensitivity(
    case: SingleCase,
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary",
            metavar="KEY=LOW,HIGH",
            help="key to vary and its range, in SI or with units; repeat the option for more keys",
        ),
    ],
    outcome: Annotated[
        str, typer.Option(metavar="max(PROBE)", help="outcome to analyse: min, max or final of a probe")
    ],
    samples: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="base sample size, a power of two; for k keys the study makes about 1.25 N (k + 2) runs",
        ),
    ] = 64,
    seed: Seed = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Compute the sensitivity of an outcome to keys: Sobol indices and Morris effects over ranges."""
    from fvsolve import studies

    loaded = load_case(case, set)
    folder = folder_of(loaded, "sensitivity", out)
    with progress_line() as progress:
        result = studies.sensitivity(
            loaded, ranges(vary, "--vary"), outcome, samples, seed, None, jobs, dask, folder, progress
        )
    paths = [
        result.sheet.write(clear_files(folder, "sensitivity.csv", "sensitivity.png") / "sensitivity.csv"),
        folder / "sensitivity.png",
    ]
    result.plot(paths[1])
    if as_json:
        print_json(result.plain() | {"directory": str(folder)})
    else:
        print_table(result, f"{paths[0]}: {result.outcome}, {result.runs} runs")


@app.command()
def calibrate(
    case: SingleCase,
    parameter: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=LOW,HIGH",
            help="key to calibrate and its range, in SI or with units; repeat the option for more keys",
        ),
    ],
    seed: Seed = 0,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Calibrate keys of a case against the measured series in its [compare]."""
    from fvsolve import studies

    loaded = load_case(case, set)
    with progress_line(resumable=False) as progress:
        result = studies.calibrate(loaded, ranges(parameter, "--parameter"), None, seed, jobs, dask, progress)
    if as_json:
        print_json(result.plain())
        return
    from fvsolve.cli import terminal
    from fvsolve.studies.sampling import si_unit_of

    probes = {series.probe.text: series.probe for series in loaded.compare.values() if series.probe is not None}
    texts = [f"rms of {name} {difference_text(loaded, probes[name], rms)}" for name, rms in result.rms.items()]
    units = {key: f"{key} [{unit}]" if (unit := si_unit_of(loaded.raw, key)) else key for key in result.values}
    print_table(result, ", ".join([*texts, f"{result.runs} runs"]), units)

    for doubt in result.doubts:
        terminal.line(terminal.console(), doubt, "yellow")


def difference_text(case, probe, value: float) -> str:
    """Text of a difference `value` [SI] of a probe, in the output unit of the probe."""
    from fvsolve.output.unit_columns import column

    unit_column = column(probe.text, probe.dimension, case, probe.unit)
    return f"{unit_column.span_from_si(value):.6g} {unit_column.span_unit}"


def print_table(result, text: str, units: dict[str, str] = {}) -> None:  # noqa: B006
    """Print the table of keys of a sensitivity study or a calibration, and the line `text` below it.

    units : key -> its heading with unit, for keys that have a unit
    """
    from fvsolve.cli import terminal

    console, (heads, rows) = terminal.console(), result.sheet.words()
    terminal.table(heads, [[units.get(key, key), *row] for key, *row in rows], console)
    terminal.line(console, text)
