"""`fvsolve fmu`: export of a case as a functional mock-up unit."""

from pathlib import Path
from typing import Annotated

from typer import Option

from fvsolve.cli.app import Set, SingleCase, command, load_case
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import ResultTable


@command("fmu", order=120)
def fmu(
    case: SingleCase,
    out: Annotated[
        Path | None,
        Option(metavar="FILE", help="file of the FMU (default NAME.fmu in the current folder)"),
    ] = None,
    set: Set = [],  # noqa: B006
) -> None:
    """Export a case as an FMU (FMI 2.0, co-simulation): schedules and setpoints as inputs, probes as outputs."""
    from fvsolve.exchange.fmi.export import write_fmu

    path, variables = write_fmu(load_case(case, set), out)
    rows = []
    for item in variables:
        start = "" if item.start is None else f"{item.start:.6g}"
        rows.append([item.name, "input" if item.is_input else "output", item.unit, start])
    last = f"{path}: needs fvsolve of this version in the Python of its host"
    present(False, {}, [ResultTable.of("", ["variable", "", "unit", "start"], rows), last])
