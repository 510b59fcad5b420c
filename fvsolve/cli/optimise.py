"""`fvsolve optimise`: schedule of a valve that minimises a peak."""

from __future__ import annotations

from typing import Annotated

import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import progress_line
from fvsolve.errors import CaseError, collect_faults


@app.command()
def optimise(
    case: SingleCase,
    schedule: Annotated[
        str,
        typer.Option(
            metavar="KEY",
            help="key of the schedule to optimise, for example links.valve.opening; its ends keep their times "
            "and values",
        ),
    ],
    minimise: Annotated[
        str,
        typer.Option(
            metavar="max(PROBE)", help='peak to minimise, for example "max(gate.pressure)" or "max(main.head)"'
        ),
    ],
    knots: Annotated[
        int, typer.Option(metavar="N", help="number of knots between the ends of the schedule, 1 to 12")
    ] = 3,
    runs: Annotated[int, typer.Option(metavar="N", help="greatest number of runs")] = 60,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Optimise a valve schedule, given by a few knots, to minimise a peak; compare it with the linear schedule."""
    from fvsolve.studies import closure_optimisation

    faults, loaded = [], None
    with collect_faults(faults):
        loaded = load_case(case, set)
    faults += closure_optimisation.find_faults(loaded, schedule, minimise, knots, runs)
    if faults:
        raise CaseError(faults, case)
    with progress_line(resumable=False) as progress:
        result = closure_optimisation.optimise(
            loaded, schedule, minimise, knots, runs, None, lambda done, text: progress(done, runs, text)
        )
    if as_json:
        print_json(result.plain())
    else:
        _show(result, loaded)


def _show(result, case) -> None:
    from fvsolve.cli import terminal
    from fvsolve.output.unit_columns import column, time_column
    from fvsolve.studies.sampling import key_quantity

    console, clock = terminal.console(), time_column(case)
    quantity = key_quantity(case.raw, result.key)
    own = column("", "number" if quantity is None else quantity.dimension, case)
    bare, spec = own.dimension == "number", ".4f" if own.dimension == "number" else ".6g"
    rows = [[f"{clock.from_si(t):.6g}", *(format(own.from_si(value), spec) for value in pair)]
            for t, *pair in zip(result.best.time, result.linear.value, result.best.value, strict=True)]  # fmt: skip
    heads = [name if bare else f"{name} [{own.unit}]" for name in ("linear", "best")]
    terminal.table([clock.header, *heads], rows, console)
    peaks = ["-" if value.peak is None else f"{value.peak:.6g} {result.unit}" for value in (result.linear, result.best)]
    terminal.line(console, f"{result.minimise}: linear {peaks[0]}, best {peaks[1]}; {result.runs} runs", "green")
    terminal.line(console, result.schedule)
