"""`fvsolve linearise`: state-space matrices and poles of a case."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import Out, clear_files, comma_list, folder_of, warn_replaced
from fvsolve.studies.result_table import ResultTable, write_csv

SHOWN = 24  # greatest number of poles on the terminal; poles.csv has all

AtTime = Annotated[
    str | None,
    typer.Option(
        metavar="T",
        help='time of the state about which the case is linearised: seconds, or "20 ms" (default start of the run)',
    ),
]
BeforeJump = Annotated[
    bool,
    typer.Option("--left-limit", help="if a schedule has a kink or jump at the time --at, use its values just before"),
]


def time_of(text: str | None) -> float | None:
    """Time [s] from a text in the format of a case file; None for None. Raises FvsolveError for any other text."""
    from fvsolve import units
    from fvsolve.cli.app import value_of
    from fvsolve.errors import FvsolveError

    try:
        return None if text is None else units.parse(value_of(text), "time")
    except ValueError as error:
        raise FvsolveError(f"--at {text}: {error}") from None


@app.command()
def linearise(
    case: SingleCase,
    inputs: Annotated[
        str | None,
        typer.Option(
            metavar="A,B", help="inputs of the linear system, such as valve.opening,lake.pressure (default none)"
        ),
    ] = None,
    outputs: Annotated[
        str | None, typer.Option(metavar="A,B", help="probes used as outputs (default probes of the case)")
    ] = None,
    at: AtTime = None,
    before: BeforeJump = False,
    scheme: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="linear scheme, for example upwind5 (default scheme of the case, if it is linear)"
        ),
    ] = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Linearise a case about a state: matrices A, B, C, D and poles."""
    from fvsolve.model.energy_norm import energy_form
    from fvsolve.studies.linear.linearise import POLES, poles_of
    from fvsolve.studies.linear.linearise import linearise as ask

    system = ask(
        load_case(case, set),
        comma_list(inputs, "--inputs") or (),
        comma_list(outputs, "--outputs"),
        time_of(at),
        before,
        scheme,
    )
    values = poles_of(system.a, energy_form(system.at.model, system.at.y))
    poles = values.poles()
    folder = folder_of(system.at.model.case, "linearise", out)
    warn_replaced(folder, "linear.npz")
    clear_files(folder, "A.csv", "A-sparse.csv")  # only one of the two files is written
    ResultTable(POLES, poles).write(folder / "poles.csv")
    write_matrices(folder, system)
    result = system.plain() | {"poles": poles, "poles_are": values.description, "directory": str(folder)}
    if as_json:
        print_json(result)
    else:
        print_system(system, values, poles, folder)


def write_matrices(folder: Path, system) -> None:
    """Write linear.npz, and the matrices A, B, C, D as CSV tables with named rows and columns.

    A sparse matrix A is written to A-sparse.csv instead, with a row for each entry. system : result of `linearise`
    """
    a, names = system.a, system.states
    arrays = {"A": a}
    if system.sparse:
        arrays = {"A_data": a.data, "A_indices": a.indices, "A_indptr": a.indptr, "A_shape": np.array(a.shape)}
    np.savez(
        folder / "linear.npz", **arrays, B=system.b, C=system.c, D=system.d, states=np.array(names),
        state_units=np.array(system.state_units), inputs=np.array(system.inputs, dtype=str),
        outputs=np.array(system.outputs, dtype=str), input_units=np.array(system.input_units, dtype=str),
        output_units=np.array(system.output_units, dtype=str), state=system.at.y, rate=system.at.rate,
        time=np.array(system.at.t),
    )  # fmt: skip
    rates = [f"d {name} / dt" for name in names]
    if system.sparse:
        entries = a.tocoo()
        rows = zip((rates[i] for i in entries.row), (names[j] for j in entries.col), entries.data.tolist(), strict=True)
        write_csv(folder / "A-sparse.csv", ["rate", "state", "value"], rows)
    else:
        write_csv(folder / "A.csv", ["", *names], with_names(rates, a))
    write_csv(folder / "B.csv", ["", *system.inputs], with_names(rates, system.b))
    write_csv(folder / "C.csv", ["", *names], with_names(system.outputs, system.c))
    write_csv(folder / "D.csv", ["", *system.inputs], with_names(system.outputs, system.d))


def with_names(names, matrix):
    """Rows of a matrix, each preceded by its name."""
    return ([name, *row] for name, row in zip(names, matrix.tolist(), strict=True))


def print_system(system, values, poles: list[dict], folder: Path) -> None:
    """Print the time and size of a linearised system, the accuracy of its difference quotients, and its slowest poles.

    system : result of `linearise`; values : result of `poles_of`; poles : rows of the table of poles
    folder : folder of the files, whose names are printed
    """
    from fvsolve.cli import terminal
    from fvsolve.studies.linear.linearise import POLES

    output = terminal.console()
    moving = np.abs(system.at.rate) / system.at.model.scale
    terminal.line(output, f"{system.at.model.case.name} at {system.at.when}: {len(system.states)} states, "
                         f"{len(system.inputs)} inputs, {len(system.outputs)} outputs; SI")  # fmt: skip
    if np.max(moving) > 1e-9:
        terminal.line(output, f"  not a steady state: {system.states[int(np.argmax(moving))]} changes fastest; "
                              "schedules are held at their values of that time")  # fmt: skip
    worst = max(system.error.values())
    terminal.line(output, f"  derivatives from deviations of two sizes agree to {worst:.1e} (relative)")
    terminal.print_sheet(ResultTable([column for column in POLES if column.key != "pair"], poles[:SHOWN]), output)
    more = len(poles) - SHOWN
    terminal.line(output, f"poles: {values.description}" + (f"; faster poles in poles.csv: {more}" if more > 0 else ""))
    terminal.line(
        output, f"{folder}: linear.npz, {'A-sparse' if system.sparse else 'A'}.csv, B.csv, C.csv, D.csv, poles.csv"
    )
