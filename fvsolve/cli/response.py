"""`fvsolve response`: transfer function at a port and its positive realness."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.linearise import AtTime, BeforeJump, time_of
from fvsolve.cli.study_options import Out, clear_files, folder_of, warn_replaced
from fvsolve.output.unit_columns import column
from fvsolve.studies.result_table import write_csv

SYMBOLS = {"admittance": "Y", "impedance": "Z"}


@app.command()
def response(
    case: SingleCase,
    port: Annotated[
        str,
        typer.Option(
            metavar="NODE",
            help="node at which flow and pressure are taken: a reservoir, junction, inflow, chamber or tank",
        ),
    ],
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
    """Compute the transfer function of pressure and flow at a node: matrices, frequency response, positive realness."""
    from fvsolve.studies.ports.response import response as ask

    loaded = load_case(case, set)
    result = ask(loaded, port, time_of(at), before, scheme)
    folder = folder_of(loaded, "response", out)
    name = f"{port}.response"
    header = ["frequency [Hz]", "w [rad/s]", "real", "imaginary", f"magnitude [{si_unit(result)}]", "phase [deg]"]
    h = result.h
    columns = [result.w / (2.0 * np.pi), result.w, h.real, h.imag, np.abs(h), np.degrees(np.angle(h))]
    warn_replaced(folder, f"{name}.npz")
    write_csv(
        clear_files(folder, f"{name}.png", f"{name}.svg") / f"{name}.csv", header, np.column_stack(columns).tolist()
    )
    np.savez(folder / f"{name}.npz", A=result.a, B=result.b, C=result.c, D=result.d, states=np.array(result.states))
    unit = output_unit(loaded, result)
    draw(result, folder / name, *unit)
    if as_json:
        print_json(result.plain() | {"directory": str(folder)})
    else:
        print_response(result, folder, name, unit[1])


def si_unit(result) -> str:
    """SI unit of the transfer function H."""
    return "m3/s/Pa" if result.kind == "admittance" else "Pa s/m3"


def output_unit(case, result) -> tuple[float, str]:
    """Unit of the transfer function H by the units of `[output]` : (factor from SI to this unit, name of the unit)."""
    flow, pressure = column("", "flow", case), column("", "pressure", case)
    if flow.plain and pressure.plain:
        return 1.0, si_unit(result)
    size = flow.span_from_si(1.0) / pressure.span_from_si(1.0)
    if result.kind == "admittance":
        return size, f"{flow.unit}/{pressure.span_unit}"
    below = f"({flow.unit})" if "/" in flow.unit else flow.unit
    return 1.0 / size, f"{pressure.span_unit}/{below}"


def draw(result, path: Path, size: float, unit: str) -> None:
    """Write PNG and SVG pictures of the transfer function H; size : factor from SI to `unit`."""
    from fvsolve.draw.response_picture import response_figure

    verdict = result.verdict
    dips, poles = [(dip.low, dip.high) for dip in verdict.dips], {abs(s.imag) for s in verdict.axis} - {0.0}
    text = f"positive real: {verdict.answer}"
    title = f"{result.case} at {result.when}: {result.kind} at {result.port}"
    labels = (SYMBOLS[result.kind], unit)
    figure = response_figure(result.w, size * result.h, labels, dips, poles, verdict.tolerance, title, text)
    for ending in ("png", "svg"):
        figure.savefig(path.with_name(f"{path.name}.{ending}"))


def print_response(result, folder: Path, name: str, unit: str) -> None:
    """Print the transfer function's definition, the verdict with its reasons, and the files.

    result : as from `response`; name : name of the files without their endings; unit : unit of the transfer function
    """
    from fvsolve.cli import terminal

    console, verdict = terminal.console(), result.verdict
    quantity = {"admittance": "flow into the network over pressure", "impedance": "pressure over inflow"}[result.kind]
    scheme = f", scheme {result.scheme}" if result.scheme else ""
    states = f"{len(result.states)} state" + ("s" if len(result.states) > 1 else "")
    terminal.line(console, f"{result.case} at {result.when}: {result.kind} at {result.port}, {quantity} [{unit}]; "
                         f"{states}{scheme}")  # fmt: skip
    if result.moving > 1e-9:
        terminal.line(console, "  not a steady state; schedules are held at their values of that time")
    terminal.line(console, f"positive real: {verdict.answer}", "bold")
    for reason in verdict.reasons:
        terminal.line(console, f"  {reason}")
    terminal.line(console, f"  searched {verdict.low:.3g} to {verdict.high:.3g} rad/s; the sign of Re H is undecided "
                         f"below {verdict.tolerance:.0e} |H| "
                         f"(error of the derivatives: {result.error:.0e})")  # fmt: skip
    terminal.line(console, f"{folder}: {name}.csv, {name}.npz, {name}.png, {name}.svg")
