"""`fvsolve response`. Knows what is asked and how it is shown; leaves the verdict to `studies`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.linearise import At, Before, time_of
from fvsolve.cli.studying import Out, cleared, folder_of, replaced
from fvsolve.output.column import column
from fvsolve.studies.sheet import write

SYMBOLS = {"admittance": "Y", "impedance": "Z"}


@app.command()
def response(
    case: One,
    port: Annotated[str, typer.Option(metavar="NODE", help="a reservoir, junction, inflow, chamber or tank")],
    at: At = None,
    before: Before = False,
    scheme: Annotated[str | None, typer.Option(metavar="NAME", help="a linear scheme in place of the case's")] = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Pressure against flow at a port: state space, frequency response, and whether it is positive real."""
    from fvsolve.studies.ports.response import response as ask

    read = load_case(case, set)
    found = ask(read, port, time_of(at), before, scheme)
    folder = folder_of(read, "response", out)
    name = f"{port}.response"
    header = ["frequency [Hz]", "w [rad/s]", "real", "imaginary", f"magnitude [{unit_of(found)}]", "phase [deg]"]
    h = found.h
    columns = [found.w / (2.0 * np.pi), found.w, h.real, h.imag, np.abs(h), np.degrees(np.angle(h))]
    replaced(folder, f"{name}.npz")
    write(cleared(folder, f"{name}.png", f"{name}.svg") / f"{name}.csv", header, np.column_stack(columns).tolist())
    np.savez(folder / f"{name}.npz", A=found.a, B=found.b, C=found.c, D=found.d, states=np.array(found.states))
    shown = unit_in(read, found)
    draw(found, folder / name, *shown)
    if as_json:
        print_json(found.plain() | {"directory": str(folder)})
    else:
        say(found, folder, name, shown[1])


def unit_of(found) -> str:
    """SI unit of H."""
    return "m3/s/Pa" if found.kind == "admittance" else "Pa s/m3"


def unit_in(case, found) -> tuple[float, str]:
    """(size of 1 SI, unit) of H as `[output]` has pressures and flows."""
    flow, pressure = column("", "flow", case), column("", "pressure", case)
    if flow.plain and pressure.plain:
        return 1.0, unit_of(found)
    size = flow.span_from_si(1.0) / pressure.span_from_si(1.0)
    if found.kind == "admittance":
        return size, f"{flow.unit}/{pressure.span_unit}"
    below = f"({flow.unit})" if "/" in flow.unit else flow.unit
    return 1.0 / size, f"{pressure.span_unit}/{below}"


def draw(found, path: Path, size: float, unit: str) -> None:
    """PNG and SVG, of H in a unit that 1 SI is `size` of."""
    from fvsolve.draw.response import response_figure

    verdict = found.verdict
    dips, poles = [(dip.low, dip.high) for dip in verdict.dips], {abs(s.imag) for s in verdict.axis} - {0.0}
    said = f"positive real: {verdict.answer}"
    title = f"{found.case} at {found.when}: {found.kind} at {found.port}"
    labels = (SYMBOLS[found.kind], unit)
    figure = response_figure(found.w, size * found.h, labels, dips, poles, verdict.tolerance, title, said)
    for ending in ("png", "svg"):
        figure.savefig(path.with_name(f"{path.name}.{ending}"))


def say(found, folder: Path, name: str, unit: str) -> None:
    """What a person reads: what was asked, the verdict with its reasons, and the files."""
    from fvsolve.cli import terminal

    where, verdict = terminal.console(), found.verdict
    what = {"admittance": "flow into the network over pressure", "impedance": "pressure over flow fed in"}[found.kind]
    scheme = f", scheme {found.scheme}" if found.scheme else ""
    states = f"{len(found.states)} state" + ("s" if len(found.states) > 1 else "")
    terminal.line(where, f"{found.case} at {found.when}: {found.kind} at {found.port}, {what} [{unit}]; "
                         f"{states}{scheme}")  # fmt: skip
    if found.moving > 1e-9:
        terminal.line(where, "  not at rest there; schedules stand still at that time")
    terminal.line(where, f"positive real: {verdict.answer}", "bold")
    for reason in verdict.reasons:
        terminal.line(where, f"  {reason}")
    terminal.line(where, f"  searched {verdict.low:.3g} to {verdict.high:.3g} rad/s; nothing is decided within "
                         f"{verdict.tolerance:.0e} of |H| (differences agree to {found.error:.0e})")  # fmt: skip
    terminal.line(where, f"{folder}: {name}.csv, {name}.npz, {name}.png, {name}.svg")
