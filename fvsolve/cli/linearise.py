"""`fvsolve linearise`. Knows what is asked and how it is shown; leaves the derivatives to `studies`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Out, cleared, folder_of, listed, replaced
from fvsolve.studies.sheet import Sheet, write

SHOWN = 24  # poles on the terminal; the others are in the file

At = Annotated[str | None, typer.Option(metavar="T", help="time of the state: seconds, or `20 ms`; default the start")]
Before = Annotated[bool, typer.Option("--before", help="at a kink or jump of a schedule: just before it")]


def time_of(text: str | None) -> float | None:
    """A time as a case file writes it [s]; raises FvsolveError for a text that is none."""
    from fvsolve import units
    from fvsolve.cli.app import value_of
    from fvsolve.errors import FvsolveError

    try:
        return None if text is None else units.parse(value_of(text), "time")
    except ValueError as error:
        raise FvsolveError(f"--at {text}: {error}") from None


@app.command()
def linearise(
    case: One,
    inputs: Annotated[str | None, typer.Option(metavar="A,B", help="inputs: valve.opening, lake.pressure")] = None,
    outputs: Annotated[str | None, typer.Option(metavar="A,B", help="probes; default those of the case")] = None,
    at: At = None,
    before: Before = False,
    scheme: Annotated[str | None, typer.Option(metavar="NAME", help="a linear scheme in place of the case's")] = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """A case as A, B, C, D about a state, with its poles."""
    from fvsolve.model.energy import energy_form
    from fvsolve.studies.linear.linearise import linearise as ask
    from fvsolve.studies.linear.spectrum import POLES, poles_of

    found = ask(
        load_case(case, set),
        listed(inputs, "--inputs") or (),
        listed(outputs, "--outputs"),
        time_of(at),
        before,
        scheme,
    )
    values = poles_of(found.a, energy_form(found.at.model, found.at.y))
    poles = values.poles()
    folder = folder_of(found.at.model.case, "linearise", out)
    replaced(folder, "linear.npz")
    cleared(folder, "A.csv", "A-sparse.csv")  # of which one is written
    Sheet(POLES, poles).write(folder / "poles.csv")
    write_matrices(folder, found)
    said = found.plain() | {"poles": poles, "poles_are": values.said, "directory": str(folder)}
    if as_json:
        print_json(said)
    else:
        say(found, values, poles, folder)


def write_matrices(folder: Path, found) -> None:
    """linear.npz, and A, B, C, D as tables with names."""
    a, names = found.a, found.states
    kept = {"A": a}
    if found.sparse:
        kept = {"A_data": a.data, "A_indices": a.indices, "A_indptr": a.indptr, "A_shape": np.array(a.shape)}
    np.savez(
        folder / "linear.npz", **kept, B=found.b, C=found.c, D=found.d, states=np.array(names),
        state_units=np.array(found.state_units), inputs=np.array(found.inputs, dtype=str),
        outputs=np.array(found.outputs, dtype=str), input_units=np.array(found.input_units, dtype=str),
        output_units=np.array(found.output_units, dtype=str), state=found.at.y, rate=found.at.rate,
        time=np.array(found.at.t),
    )  # fmt: skip
    rates = [f"d {name} / dt" for name in names]
    if found.sparse:
        entries = a.tocoo()
        rows = zip((rates[i] for i in entries.row), (names[j] for j in entries.col), entries.data.tolist(), strict=True)
        write(folder / "A-sparse.csv", ["rate", "state", "value"], rows)
    else:
        write(folder / "A.csv", ["", *names], labelled(rates, a))
    write(folder / "B.csv", ["", *found.inputs], labelled(rates, found.b))
    write(folder / "C.csv", ["", *names], labelled(found.outputs, found.c))
    write(folder / "D.csv", ["", *found.inputs], labelled(found.outputs, found.d))


def labelled(names, matrix):
    """Rows of a matrix behind their names."""
    return ([name, *row] for name, row in zip(names, matrix.tolist(), strict=True))


def say(found, values, poles: list[dict], folder: Path) -> None:
    """What a person reads: where, how well, and the slowest poles."""
    from fvsolve.cli import terminal
    from fvsolve.studies.linear.spectrum import POLES

    where = terminal.console()
    moving = np.abs(found.at.rate) / found.at.model.scale
    terminal.line(where, f"{found.at.model.case.name} at {found.at.when}: {len(found.states)} states, "
                         f"{len(found.inputs)} inputs, {len(found.outputs)} outputs; SI")  # fmt: skip
    if np.max(moving) > 1e-9:
        terminal.line(where, f"  not at rest there: {found.states[int(np.argmax(moving))]} changes quickest; schedules "
                             "stand still at that time")  # fmt: skip
    worst = max(found.error.values())
    terminal.line(where, f"  two steps of the differences agree to {worst:.1e} of each row")
    terminal.sheet(Sheet([one for one in POLES if one.key != "pair"], poles[:SHOWN]), where)
    more = len(poles) - SHOWN
    terminal.line(where, f"poles: {values.said}" + (f"; {more} more, quicker ones, in poles.csv" if more > 0 else ""))
    terminal.line(
        where, f"{folder}: linear.npz, {'A-sparse' if found.sparse else 'A'}.csv, B.csv, C.csv, D.csv, poles.csv"
    )
