"""`fvsolve linearise` and `fvsolve response`: state-space matrices and poles, transfer function at a port."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import Column, ResultTable, write_csv
from fvsolve.core.output.unit_columns import column
from fvsolve.display import save
from fvsolve.errors import FvsolveError
from fvsolve.file_replacement import replacing

POLES_SHOWN = 24  # greatest number of poles on the terminal; poles.csv has all
SYMBOLS = {"admittance": "Y", "impedance": "Z"}


@cli.command("linearise", order=150)
def linearise(
    case: cli.SingleCase,
    inputs: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="inputs of the linear system, such as valve.opening,lake.pressure (default none)",
        ),
    ] = None,
    outputs: Annotated[
        str | None,
        Option(metavar="A,B", help="probes used as outputs (default probes of the case)"),
    ] = None,
    at: cli.AtTime = None,
    before: cli.BeforeJump = False,
    scheme: cli.LinearScheme = None,
    out: cli.Out = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Linearise a case about a state: matrices A, B, C, D and poles."""
    from fvsolve.core.model.energy_norm import energy_form
    from fvsolve.studies.linearise import POLES, poles_of
    from fvsolve.studies.linearise import linearise as ask

    system = ask(
        cli.load_case(case, set),
        cli.comma_list(inputs, "--inputs") or (),
        cli.comma_list(outputs, "--outputs"),
        cli.quantity_of(at, "time", f"--at {at}"),
        before,
        scheme,
    )
    values = poles_of(system.a, energy_form(system.at.model, system.at.y))
    poles = values.poles()
    folder = cli.folder_of(system.at.model.case, "linearise", out)
    cli.warn_replaced(folder, "linear.npz")
    cli.clear_files(folder, "A.csv", "A-sparse.csv")  # only one of the two files is written
    ResultTable(POLES, poles).write(folder / "poles.csv")
    write_matrices(folder, system)
    result = system.plain() | {
        "poles": poles,
        "poles_are": values.description,
        "directory": str(folder),
    }
    present(as_json, result, system_text(system, values, poles, folder))


def write_matrices(folder: Path, system) -> None:
    """Write linear.npz, and the matrices A, B, C, D as CSV tables with named rows and columns.

    A sparse matrix A is written to A-sparse.csv instead, with a row for each entry. system : result of `linearise`
    """
    a, names = system.a, system.states
    arrays = {"A": a}
    if system.sparse:
        arrays = {
            "A_data": a.data,
            "A_indices": a.indices,
            "A_indptr": a.indptr,
            "A_shape": np.array(a.shape),
        }
    save_arrays(
        folder / "linear.npz",
        **arrays,
        B=system.b,
        C=system.c,
        D=system.d,
        states=np.array(names),
        state_units=np.array(system.state_units),
        inputs=np.array(system.inputs, dtype=str),
        outputs=np.array(system.outputs, dtype=str),
        input_units=np.array(system.input_units, dtype=str),
        output_units=np.array(system.output_units, dtype=str),
        state=system.at.y,
        rate=system.at.rate,
        time=np.array(system.at.t),
    )
    rates = [f"d {name} / dt" for name in names]
    if system.sparse:
        entries = a.tocoo()
        rows = zip(
            (rates[i] for i in entries.row),
            (names[j] for j in entries.col),
            entries.data.tolist(),
            strict=True,
        )
        write_csv(folder / "A-sparse.csv", ["rate", "state", "value"], rows)
    else:
        write_csv(folder / "A.csv", ["", *names], with_names(rates, a))
    write_csv(folder / "B.csv", ["", *system.inputs], with_names(rates, system.b))
    write_csv(folder / "C.csv", ["", *names], with_names(system.outputs, system.c))
    write_csv(folder / "D.csv", ["", *system.inputs], with_names(system.outputs, system.d))


def save_arrays(path: Path, **arrays) -> None:
    """Write arrays to a .npz file in a single step."""
    with replacing(path) as fresh:
        np.savez(fresh, **arrays)


def with_names(names, matrix):
    """Rows of a matrix, each preceded by its name."""
    return ([name, *row] for name, row in zip(names, matrix.tolist(), strict=True))


def system_text(system, values, poles: list[dict], folder: Path) -> Iterator:
    """Time and size of a linearised system, the accuracy of its difference quotients, and its slowest poles.

    system : result of `linearise`; values : result of `poles_of`; poles : rows of the table of poles
    folder : folder of the files, whose names are listed
    """
    from fvsolve.studies.linearise import POLES

    moving = np.abs(system.at.rate) / system.at.model.scale
    yield (
        f"{system.at.model.case.name} at {system.at.when}: {len(system.states)} states, "
        f"{len(system.inputs)} inputs, {len(system.outputs)} outputs; SI"
    )
    if np.max(moving) > 1e-9:
        yield (
            f"  not a steady state: {system.states[int(np.argmax(moving))]} changes fastest; "
            "schedules are held at their values of that time"
        )
    worst = max(system.error.values())
    yield f"  derivatives from deviations of two sizes agree to {worst:.1e} (relative)"
    yield ResultTable([column for column in POLES if column.key != "pair"], poles[:POLES_SHOWN])
    more = len(poles) - POLES_SHOWN
    yield f"poles: {values.description}" + (
        f"; faster poles in poles.csv: {more}" if more > 0 else ""
    )
    yield f"{folder}: linear.npz, {'A-sparse' if system.sparse else 'A'}.csv, B.csv, C.csv, D.csv, poles.csv"


@cli.command("response", order=240)
def response(
    case: cli.SingleCase,
    port: Annotated[
        str | None,
        Option(
            metavar="NODE",
            help="node at which flow and pressure are taken: a reservoir, "
            "junction, inflow, chamber or tank",
        ),
    ] = None,
    input: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="input in place of a port, such as valve.opening or controls.NAME.setpoint",
        ),
    ] = None,
    output: Annotated[
        str | None, Option(metavar="PROBE", help="probe that responds to the input")
    ] = None,
    at: cli.AtTime = None,
    before: cli.BeforeJump = False,
    scheme: cli.LinearScheme = None,
    out: cli.Out = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Compute a transfer function: of pressure and flow at a node, or of an input and a probe."""
    from fvsolve.studies.ports.response import response as ask

    loaded = cli.load_case(case, set)
    if port is None or input is not None or output is not None:
        respond(
            loaded,
            port,
            input,
            output,
            cli.quantity_of(at, "time", f"--at {at}"),
            before,
            scheme,
            out,
            as_json,
        )
        return
    result = ask(loaded, port, cli.quantity_of(at, "time", f"--at {at}"), before, scheme)
    folder = cli.folder_of(loaded, "response", out)
    name = f"{port}.response"
    header = [
        "frequency [Hz]",
        "w [rad/s]",
        "real",
        "imaginary",
        f"magnitude [{si_unit(result)}]",
        "phase [deg]",
    ]
    h = result.h
    columns = [
        result.w / (2.0 * np.pi),
        result.w,
        h.real,
        h.imag,
        np.abs(h),
        np.degrees(np.angle(h)),
    ]
    cli.warn_replaced(folder, f"{name}.npz")
    cli.clear_files(folder, f"{name}.png", f"{name}.svg")
    write_csv(folder / f"{name}.csv", header, np.column_stack(columns).tolist())
    save_arrays(
        folder / f"{name}.npz",
        A=result.a,
        B=result.b,
        C=result.c,
        D=result.d,
        states=np.array(result.states),
    )
    unit = output_unit(loaded, result)
    draw(result, folder / name, *unit)
    present(
        as_json,
        result.plain() | {"directory": str(folder)},
        response_text(result, folder, name, unit[1]),
    )


def respond(case, port, input, output, at, before, scheme, out, as_json: bool) -> None:
    """Compute and write the transfer function from an input to a probe; arguments as for `response`."""
    from fvsolve.report.draw.stability_pictures import response_figure
    from fvsolve.studies.loops.input_response import input_response

    if port is not None or input is None or output is None:
        given = "--port" if port is not None else "--input" if input is not None else "no option"
        raise FvsolveError(
            f"{given} alone names no transfer function; expected --port NODE, or --input NAME with "
            "--output PROBE"
        )
    result = input_response(case, input, output, at, before, scheme)
    folder = cli.folder_of(case, "response", out)
    stem = f"{input}-{output}.response".replace("/", "-")
    h = result.h
    header = ["frequency [Hz]", "w [rad/s]", "real", "imaginary", "magnitude", "phase [deg]"]
    table = [result.w / (2.0 * np.pi), result.w, h.real, h.imag, np.abs(h), np.degrees(np.angle(h))]
    cli.warn_replaced(folder, f"{stem}.csv")
    cli.clear_files(folder, f"{stem}.png", f"{stem}.svg")
    write_csv(folder / f"{stem}.csv", header, np.column_stack(table).tolist())
    title = f"{result.case} at {result.when}: {output} over {input}"
    unit = f"{result.units[1]} / {result.units[0]}"
    figure = response_figure(result.w, h, ("H", unit), title=title, note="real part")
    for ending in ("png", "svg"):
        save(figure, folder / f"{stem}.{ending}")
    present(
        as_json,
        result.plain() | {"directory": str(folder)},
        input_response_text(result, folder, stem),
    )


def input_response_text(result, folder: Path, stem: str) -> Iterator:
    """Definition of a transfer function from an input to a probe, its size, its poles, and the files."""
    yield (
        f"{result.case} at {result.when}: {result.output} [{result.units[1]}] over {result.input} "
        f"[{result.units[0]}]; {len(result.states)} states"
    )
    if result.moving > 1e-9:
        yield "  not a steady state; schedules are held at their values of that time"
    if result.system.delays.size:
        yield f"  delays: {', '.join(f'{delay:.4g} s' for delay in result.system.delays)}, exact"
    first, last = result.h[0], result.h[-1]
    yield f"  H = {first.real:.6g} {first.imag:+.6g}j at {result.w[0]:.4g} rad/s"
    yield f"  H = {last.real:.6g} {last.imag:+.6g}j at {result.w[-1]:.4g} rad/s"
    rows = [
        {"pole": f"{s.real:.6g} {s.imag:+.6g}j" if s.imag else f"{s.real:.6g}"}
        for s in result.poles
        if s.imag >= 0
    ]
    yield ResultTable([Column("pole", "pole [1/s]")], rows[:POLES_SHOWN])
    yield f"{folder}: {stem}.csv, {stem}.png, {stem}.svg"


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
    from fvsolve.report.draw.stability_pictures import response_figure

    verdict = result.verdict
    dips = [(dip.low, dip.high) for dip in verdict.dips]
    poles = {abs(s.imag) for s in verdict.axis} - {0.0}
    text = f"positive real: {verdict.answer}"
    title = f"{result.case} at {result.when}: {result.kind} at {result.port}"
    labels = (SYMBOLS[result.kind], unit)
    figure = response_figure(
        result.w, size * result.h, labels, dips, poles, verdict.tolerance, title, text
    )
    for ending in ("png", "svg"):
        save(figure, path.with_name(f"{path.name}.{ending}"))


def response_text(result, folder: Path, name: str, unit: str) -> Iterator:
    """Definition of the transfer function, the verdict with its reasons, and the files.

    result : as from `response`; name : name of the files without their endings; unit : unit of the transfer function
    """
    verdict = result.verdict
    quantity = {
        "admittance": "flow into the network over pressure",
        "impedance": "pressure over inflow",
    }[result.kind]
    scheme = f", scheme {result.scheme}" if result.scheme else ""
    states = f"{len(result.states)} state" + ("s" if len(result.states) > 1 else "")
    yield (
        f"{result.case} at {result.when}: {result.kind} at {result.port}, {quantity} [{unit}]; {states}{scheme}"
    )
    if result.moving > 1e-9:
        yield "  not a steady state; schedules are held at their values of that time"
    yield f"positive real: {verdict.answer}", "bold"
    yield from (f"  {reason}" for reason in verdict.reasons)
    yield (
        f"  searched {verdict.low:.3g} to {verdict.high:.3g} rad/s; the sign of Re H is undecided "
        f"below {verdict.tolerance:.0e} |H| "
        f"(error of the derivatives: {result.error:.0e})"
    )
    yield f"{folder}: {name}.csv, {name}.npz, {name}.png, {name}.svg"
