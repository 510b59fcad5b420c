"""`fvsolve energy`: energy ledger of a run, and passivity of schemes, methods and ports."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import interrupt_message, present, progress_line, run_progress
from fvsolve.core.output.result_table import Column, ResultTable, cell_text
from fvsolve.display import save
from fvsolve.errors import FvsolveError

EFFECTS = {  # verdict of the JSON file -> text of the terminal
    "rounding": "rounding only",
    "the numbers dissipate": "the numerical method dissipates energy",
    "the numbers create energy": "the numerical method creates energy",
}
LINES = 12  # greatest number of lines of a kind on the terminal; energy.csv has all
RESTARTS = "the same command starts from the beginning"
FILES = ("energy.csv", "energy.png", "energy.svg")
SCHEME = (
    Column("scheme"),
    Column("passive", "never grows"),
    Column("rate", "rate [per cell time]", ".4g"),
    Column("gain", "greatest gain", ".4g"),
)


def _limit(key: str) -> Callable[[Mapping], str]:
    """Function that formats the greatest passive step in column `key`: "any", "none" or a number."""
    return lambda row: (
        "any" if math.isinf(row[key]) else "none" if row[key] == 0.0 else f"{row[key]:.6g}"
    )


METHOD = (
    Column("method"),
    Column("any_network", "any network"),
    Column(
        "chamber",
        "driven chamber",
        lambda row: (
            "-" if row["chamber"] is None else "keeps" if row["chamber"] >= 0.0 else "creates"
        ),
    ),
    Column("leak", "leak: h/tau", _limit("leak")),
    Column("resonator", "resonator: h w", _limit("resonator")),
)


@cli.command("energy", order=100)
def energy(
    case: Annotated[
        str | None,
        Argument(
            metavar="CASE",
            help="case file or shipped case to run (default none: list "
            "the passivity of schemes and methods)",
        ),
    ] = None,
    port: Annotated[
        str | None,
        Option(
            metavar="NODE",
            help="node at which the passivity of the network is checked: "
            "a reservoir, inflow or junction (default none)",
        ),
    ] = None,
    scheme: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="schemes to study (default scheme of the case, or without a case all schemes)",
        ),
    ] = None,
    method: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="methods to study (default method of the case, or without a case all methods)",
        ),
    ] = None,
    out: cli.Out = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Print the energy ledger of a run: energy supplied, stored, dissipated, and changed by the numerical method."""
    schemes, methods = cli.comma_list(scheme, "--scheme"), cli.method_names(method)
    if case is None:
        from fvsolve.studies.passivity import passivity

        needs_case = [
            name for name, value in (("--port", port), ("--out", out), ("--set", set)) if value
        ]
        if needs_case:
            raise FvsolveError(
                f"{', '.join(needs_case)}: valid only with a case; expected fvsolve energy CASE "
                f"{needs_case[0]} ...; without a case the passivity of schemes and methods is listed, "
                "without files"
            )
        with (
            progress_line() as progress,
            interrupt_message(f"interrupted: no results are saved; {RESTARTS}"),
        ):
            result = passivity(schemes, methods, progress)
        present(as_json, result.plain(), passivity_text(result))
    elif schemes or methods:
        compare_pairs(cli.load_case(case, set), schemes, methods, port, out, as_json)
    else:
        ledger(cli.load_case(case, set), port, out, as_json)


def ledger(case, port, out, as_json: bool) -> None:
    """Run a case, write its energy balance and a picture, and print the balance with the passivity verdict at a port.

    It ends the program, with exit code 130 if interrupted, 1 if the run is not ok, else 0.
    port : name of a node, or None for no verdict; out : folder of the files, or None for runs/NAME.energy
    """
    from fvsolve.core.output.unit_columns import column, time_column
    from fvsolve.report.draw.accuracy_pictures import energy_figure
    from fvsolve.studies.energy_balance import energy as study
    from fvsolve.studies.energy_balance import write_table

    folder = cli.folder_of(case, "energy", out)
    cli.warn_replaced(folder, FILES[0])
    with interrupt_message(
        f"interrupted: no ledger is written, {folder} may lack files; {RESTARTS}"
    ):
        with run_progress(case) as progress:
            result = study(case, port=port, progress=progress)
        write_table(result, cli.clear_files(folder, *FILES) / FILES[0])
        at_port = (
            None
            if result.port is None
            else (result.port.node, result.port.course, result.port.bound)
        )
        clock, own = time_column(case), column("", "energy", case)
        units = clock.unit, None if own.plain else (own.to_si(1.0), own.unit)
        figure = energy_figure(
            clock.from_si(result.t),
            result.supplied,
            result.stored,
            result.dissipated,
            result.numerical(),
            case.title or case.name,
            at_port,
            units,
        )
        for name in FILES[1:]:
            save(figure, folder / name)
    facts = result.plain() | {"directory": str(folder), "files": list(FILES)}
    code = 130 if result.reason == "interrupted" else 0 if result.ok else 1
    present(as_json, facts, ledger_text(result, case, folder), code)


def ledger_text(result, case, folder) -> Iterator:
    """Energy balance of a run by part, its remainder, the passivity verdict at a port, and the files."""
    from fvsolve.core.output.unit_columns import column

    rows, joules = [], column("energy", "energy", case)

    def amount(value: float) -> list[str]:
        share = f"{100.0 * value / result.throughput:.4g}" if result.throughput > 0.0 else "-"
        return [f"{joules.from_si(value):.6g}", share]

    for kind in ("supplied", "stored", "dissipated"):
        lines = getattr(result, kind)
        order = sorted(lines, key=lambda name: -abs(lines[name][-1]))
        rows += [[kind, name, *amount(lines[name][-1])] for name in order[:LINES]]
        if len(order) > LINES:
            rest = sum(lines[name][-1] for name in order[LINES:])
            rows.append([kind, f"{len(order) - LINES} others", *amount(rest)])
    rows += [
        ["numerical", name, *amount(values[-1])] for name, values in result.numerical().items()
    ]
    yield ResultTable.of("", ["kind", "part", joules.header, "share [%]"], rows)
    if result.energy_use:
        from fvsolve.cli.printing import energy_use_text

        yield ""
        yield from energy_use_text(result.energy_use)
    yield ""
    text, left = f"remainder {case.amount(result.remainder[-1], 'energy')}", result.newton_counts
    if left:
        text += f", of which Newton residuals cause {case.amount(result.newton[-1], 'energy')}; the rest is"
    passed, effect = case.amount(result.throughput, "energy", 6), EFFECTS[result.verdict]
    yield f"{text}{'' if left else ','} {result.relative:.3g} of the energy throughput {passed}: {effect}"
    if result.port is not None:
        yield result.port.text, None if result.port.passive else "bold red"
    for mark in result.marks:
        yield mark, "yellow"
    cut = result.reason == "interrupted"
    ended = (
        f"{result.reason} at t = {case.moment(result.t[-1])}" if result.ok or cut else result.reason
    )
    yield (
        f"{ended}; {result.steps} steps{f': the ledger ends at this time, {RESTARTS}' if cut else ''}",
        None if result.ok else "bold red",
    )
    yield f"{folder}: {', '.join(FILES)}"


def compare_pairs(case, schemes, methods, port, out, as_json: bool) -> None:
    """Run a case with several schemes and methods, and print the energy that each pair of them creates.

    It ends the program with exit code 2 if all pairs were refused.
    port : name of a node, or None; out : folder of the files, or None for runs/NAME.energy
    """
    from fvsolve.studies.energy_balance import PAIR_COLUMNS, measure_pairs
    from fvsolve.studies.result_cache import ResultCache

    folder = cli.folder_of(case, "energy", out)
    with progress_line() as progress, run_progress() as watch, ResultCache(folder) as points:
        rows = measure_pairs(case, schemes, methods, port, progress, points, watch)
    ResultTable(PAIR_COLUMNS, rows).write(folder / "pairs.csv")
    heads = [
        _in_unit(column, case)
        for column in PAIR_COLUMNS
        if port or column.key not in ("relative", "margin")
    ]
    text = [
        ResultTable(heads, rows),
        *_outcome_text(case, rows),
        f"{folder}: pairs.csv, points.jsonl",
    ]
    facts = {"pairs": rows, "directory": str(folder), "files": ["pairs.csv"]}
    present(as_json, facts, text, code=2 if all(row["creates"] is None for row in rows) else 0)


def _in_unit(heading: Column, case) -> Column:
    """Convert a column of energies from J to the unit of `[output]`, and return any other column unchanged."""
    from fvsolve.core.output.unit_columns import column

    if not heading.head.endswith(" [J]"):
        return heading
    own = column(heading.head.removesuffix(" [J]"), "energy", case)

    def words(row: Mapping) -> str:
        return cell_text(
            None if row[heading.key] is None else own.from_si(row[heading.key]), heading.words
        )

    return replace(heading, head=own.header, words=words)


def _outcome_text(case, rows) -> Iterator:
    """Pairs of scheme and method that create energy, and refused pairs with reason and remedy."""
    refused = [row for row in rows if row["reason"].startswith("refused")]
    ran = [row for row in rows if row not in refused]
    for row in ran:
        if ":" in row["reason"]:
            yield f"{_pair(row)}: {row['reason']}", "yellow"
    groups: dict[str, list] = {}  # a reason that is the same for several methods appears once
    for row in refused:
        groups.setdefault(row["reason"].replace(f'method "{row["method"]}"', "each"), []).append(
            row
        )
    for reason, rows_of_reason in groups.items():
        text = reason if len(rows_of_reason) > 1 else rows_of_reason[0]["reason"]
        yield f"{', '.join(map(_pair, rows_of_reason))}: {text}", "bold red"
    if case.numerics.step is None and any("estimates no error" in row["reason"] for row in refused):
        span = case.numerics.end - case.numerics.start
        yield f"or set a fixed step for all pairs: --set numerics.step={span / 1000.0:.1g} (s, run time / 1000)"
    bad = [_pair(row) for row in ran if row["creates"]]
    if bad:
        yield f"pairs that create energy in this run: {', '.join(bad)}"
    elif ran:
        yield f"none of {'the pairs that ran' if refused else 'the pairs'} creates energy in this run"
    else:
        yield "no pair ran, so the creation of energy was not checked"


def _pair(row) -> str:
    return f"{row['scheme']} with {row['method']}"


def passivity_text(result) -> Iterator:
    """Passivity of schemes and methods that follows from their coefficients."""
    from fvsolve.studies.passivity import CELLS

    known = [entry for entry in result.schemes if entry.passive is not None]
    yield f"Schemes: energy of a closed pipe of {CELLS} cells, continuous in time", "bold"
    yield ResultTable(SCHEME, [vars(entry) for entry in known])
    for entry in result.schemes:
        if entry.passive is None:
            yield (
                f"{entry.scheme} is limited (nonlinear), so no matrix describes it; check its energy in a run: "
                f"fvsolve energy CASE --scheme {entry.scheme}"
            )
    yield ""
    yield (
        "Methods: passivity on any network at any step; greatest passive step on a leak, a resonator, a closed pipe",
        "bold",
    )
    good = [entry.scheme for entry in known if entry.passive]
    limit = {(entry.scheme, entry.method): entry.courant for entry in result.pairs}
    rows = [
        vars(entry) | {name: limit[name, entry.method] for name in good} for entry in result.methods
    ]
    yield ResultTable([*METHOD, *(Column(name, f"{name}: C", _limit(name)) for name in good)], rows)
    bad = [entry.scheme for entry in known if not entry.passive]
    if bad:
        yield f"schemes that create energy at pipe ends with every method, up to the gain above: {', '.join(bad)}"
    never = [
        f"{entry.scheme} with {entry.method}"
        for entry in result.pairs
        if entry.courant == 0.0 and entry.scheme in good
    ]
    if never:
        yield f"pairs that create energy at every step size: {', '.join(never)}"
