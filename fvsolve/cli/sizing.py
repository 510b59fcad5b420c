"""`fvsolve size`: value of a key at which all limits of a case hold."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import progress_line
from fvsolve.cli.sweep import RANGE_FORMAT, key_and_values
from fvsolve.errors import CaseError, FvsolveError, collect_faults


@app.command()
def size(
    case: SingleCase,
    vary: Annotated[
        str,
        typer.Option("--vary", metavar="KEY=LOW,HIGH", help="key to size and its range, in SI or with units"),
    ],
    goal: Annotated[
        str,
        typer.Option(
            metavar="minimum|maximum", help="value to find: the minimum or the maximum that satisfies all limits"
        ),
    ] = "minimum",
    dependent: Annotated[
        list[str],
        typer.Option(
            metavar='"KEY = formula"',
            help="other key to set by a formula of x, the value of the sized key in SI, for example "
            '"nodes.vessel.gas_volume = 0.4 * x"; repeat the option for more keys',
        ),
    ] = [],  # noqa: B006
    rtol: Annotated[
        float, typer.Option(help="relative tolerance: greatest distance of the value found from a value that fails")
    ] = 0.01,
    error: Annotated[
        bool,
        typer.Option("--error", help="require that margins exceed their numerical errors, estimated from further runs"),
    ] = False,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Find by bracketing the minimum or maximum value of a key at which all limits of a case hold."""
    from fvsolve.studies import sizing

    faults, key, values, ties, loaded = [], "", [], {}, None
    with collect_faults(faults):
        key, values = key_and_values(vary, "--vary", RANGE_FORMAT)
        if len(values) != 2:
            values = []
            raise FvsolveError(f"--vary {vary}: expected {RANGE_FORMAT}")
    with collect_faults(faults):
        ties = sizing.parse_ties(dependent)
    with collect_faults(faults):
        loaded = load_case(case, set)
    faults += sizing.find_faults(loaded, key, values, goal, ties, rtol)
    if faults:
        raise CaseError(faults, case)
    with progress_line(resumable=False) as progress:
        result = sizing.size(loaded, key, *values, goal, ties, None, rtol,
                            lambda done, label: progress(done, sizing.MAX_RUNS, label), error)  # fmt: skip
    if as_json:
        print_json(result.plain())
    else:
        _show(result)
    sys.exit(0 if result.value is not None else 1)


def _show(result) -> None:
    from fvsolve.cli import terminal

    console = terminal.console()
    rows = [[f"{run.value:.6g}", "holds" if run.ok else "open" if run.open else "FAILS",
             "-" if run.margin is None else f"{run.margin:.4g}",
             run.limit if run.reason == "finished" else run.reason] for run in result.runs]  # fmt: skip
    unit = f" {result.unit}" if result.unit else ""
    key = f"{result.key} [{result.unit}]" if unit else result.key
    terminal.table([key, "", "least margin over limit", "of"], rows, console)
    for text in result.ties:
        terminal.line(console, f"with {text}")
    for text in dict.fromkeys(run.open for run in result.runs if run.open):
        terminal.line(console, f"open: {text}", "yellow")
    if result.value is None:
        terminal.line(console, _no_value_text(result), "bold red")
        return
    bracket = "at the end of the range" if result.bracket is None else (
        f"bracket {min(result.bracket):.6g} to {max(result.bracket):.6g}{unit}")  # fmt: skip
    line = (
        f"{result.goal} value that satisfies all limits: {result.value:.6g}{unit}; {bracket}; {len(result.runs)} runs"
    )
    terminal.line(console, line, "green")


def _no_value_text(result) -> str:
    """Text for a size search without result: the value with the greatest margin, and a direction for further search."""
    nearest, values = result.nearest, sorted(run.value for run in result.runs)
    unit = f" {result.unit}" if result.unit else ""
    text = (f"none of the values tried between {values[0]:.6g} and {values[-1]:.6g}{unit} satisfies all limits; "
            f"the nearest to the limits is {nearest.value:.6g}{unit}")  # fmt: skip
    if nearest.margin is None:
        return f"{text}; no margin is known"
    text += f", with a margin of {nearest.margin:.3g} of the limit {nearest.limit}"
    beyond = {values[0]: "below", values[-1]: "above"}.get(nearest.value)
    return (
        f"{text}; margins increase towards this value. Try values {beyond} it or change another key" if beyond else text
    )
