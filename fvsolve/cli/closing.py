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
        _show(found)


def _show(found) -> None:
    from fvsolve.cli import terminal

    console = terminal.console()
    rows = [[f"{t:.6g}", f"{a:.4f}", f"{b:.4f}"]
            for t, a, b in zip(found.best.time, found.linear.value, found.best.value, strict=True)]  # fmt: skip
    terminal.table(["t [s]", "linear", "best"], rows, console)
    peaks = ["-" if one.peak is None else f"{one.peak:.6g} {found.unit}" for one in (found.linear, found.best)]
    terminal.line(console, f"{found.minimise}: linear {peaks[0]}, best {peaks[1]}; {found.runs} runs", "green")
    terminal.line(console, found.schedule)
