"""The command `size`. Knows the terminal; leaves the search to `studies`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import told
from fvsolve.cli.sweep import RANGE, values_of
from fvsolve.errors import CaseError, FvsolveError, gathered


@app.command()
def size(
    case: One,
    vary: Annotated[str, typer.Option("--vary", metavar="KEY=LOW,HIGH", help="what is sized, and between which ends")],
    goal: Annotated[str, typer.Option(metavar="least|greatest", help="which value that holds all limits")] = "least",
    tie: Annotated[
        list[str], typer.Option(metavar='"KEY = formula"', help="another key as a formula of x, the value in SI")
    ] = [],  # noqa: B006
    rtol: Annotated[float, typer.Option(help="how closely it is bracketed, of itself")] = 0.01,
    error: Annotated[
        bool, typer.Option("--error", help="limits hold by more than their errors, by two more runs of each value")
    ] = False,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """The value of a key at which all limits of a case hold, by bracketing."""
    from fvsolve.studies import sizing

    faults, key, listed, ties, made = [], "", [], {}, None
    with gathered(faults):
        key, listed = values_of(vary, "--vary", RANGE)
        if len(listed) != 2:
            listed = []
            raise FvsolveError(f"--vary {vary}: wanted {RANGE}")
    with gathered(faults):
        ties = sizing.tied(tie)
    with gathered(faults):
        made = load_case(case, set)
    faults += sizing.asked(made, key, listed, goal, ties, rtol)
    if faults:
        raise CaseError(faults, case)
    with told(kept=False) as progress:
        found = sizing.size(made, key, *listed, goal, ties, None, rtol,
                            lambda done, what: progress(done, sizing.MOST_RUNS, what), error)  # fmt: skip
    if as_json:
        print_json(found.plain())
    else:
        _show(found)
    sys.exit(0 if found.value is not None else 1)


def _show(found) -> None:
    from fvsolve.cli import terminal

    console = terminal.console()
    rows = [[f"{one.value:.6g}", "holds" if one.ok else "open" if one.open else "FAILS",
             "-" if one.margin is None else f"{one.margin:.4g}",
             one.limit if one.reason == "finished" else one.reason] for one in found.runs]  # fmt: skip
    unit = f" {found.unit}" if found.unit else ""
    key = f"{found.key} [{found.unit}]" if unit else found.key
    terminal.table([key, "", "least margin over limit", "of"], rows, console)
    for text in found.ties:
        terminal.line(console, f"with {text}")
    for text in dict.fromkeys(one.open for one in found.runs if one.open):
        terminal.line(console, f"open: {text}", "yellow")
    if found.value is None:
        terminal.line(console, _unmet(found), "bold red")
        return
    where = "at the end of the range" if found.bracket is None else (
        f"{min(found.bracket):.6g} to {max(found.bracket):.6g}{unit} bracket it")  # fmt: skip
    said = f"{found.goal} value that holds all limits: {found.value:.6g}{unit}; {where}; {len(found.runs)} runs"
    terminal.line(console, said, "green")


def _unmet(found) -> str:
    """What came nearest, by how much it fell short, and where it might be met."""
    near, tried = found.nearest, sorted(one.value for one in found.runs)
    unit = f" {found.unit}" if found.unit else ""
    text = (f"no value between {tried[0]:.6g} and {tried[-1]:.6g}{unit} that was tried holds all limits; "
            f"{near.value:.6g} comes nearest")  # fmt: skip
    if near.margin is None:
        return f"{text}; of none is a margin known"
    text += f", with a margin of {near.margin:.3g} of the limit {near.limit}"
    beyond = {tried[0]: "below", tried[-1]: "above"}.get(near.value)
    return f"{text}; margins grow to that end: look {beyond} it, or change something else" if beyond else text
