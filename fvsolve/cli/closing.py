"""The command `optimise`. Knows the terminal; leaves the search to `studies`."""

from __future__ import annotations

from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import told
from fvsolve.errors import CaseError, gathered


@app.command()
def optimise(
    case: One,
    law: Annotated[str, typer.Option("--law", metavar="KEY", help="a schedule that goes from one value to another")],
    minimise: Annotated[str, typer.Option(metavar="CLAIM", help='"max(gate.pressure)", "greatest(main.head)"')],
    knots: Annotated[int, typer.Option(metavar="N", help="inner knots of the law")] = 3,
    runs: Annotated[int, typer.Option(metavar="N", help="how many at most")] = 60,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """The law of a valve that makes a peak least, by a few knots, beside the linear one."""
    from fvsolve.studies import closing

    faults, made = [], None
    with gathered(faults):
        made = load_case(case, set)
    faults += closing.asked(made, law, minimise, knots, runs)
    if faults:
        raise CaseError(faults, case)
    with told(kept=False) as progress:
        found = closing.optimise(made, law, minimise, knots, runs, None, lambda done, what: progress(done, runs, what))
    if as_json:
        print_json(found.plain())
    else:
        _show(found, made)


def _show(found, case) -> None:
    from fvsolve.cli import terminal
    from fvsolve.output.column import column, time_column
    from fvsolve.studies.plans import quantity_of

    console, clock = terminal.console(), time_column(case)
    quantity = quantity_of(case.raw, found.key)
    own = column("", "number" if quantity is None else quantity.dimension, case)
    bare, spec = own.dimension == "number", ".4f" if own.dimension == "number" else ".6g"
    rows = [[f"{clock.from_si(t):.6g}", *(format(own.from_si(one), spec) for one in pair)]
            for t, *pair in zip(found.best.time, found.linear.value, found.best.value, strict=True)]  # fmt: skip
    heads = [name if bare else f"{name} [{own.unit}]" for name in ("linear", "best")]
    terminal.table([clock.header, *heads], rows, console)
    peaks = ["-" if one.peak is None else f"{one.peak:.6g} {found.unit}" for one in (found.linear, found.best)]
    terminal.line(console, f"{found.minimise}: linear {peaks[0]}, best {peaks[1]}; {found.runs} runs", "green")
    terminal.line(console, found.schedule)
