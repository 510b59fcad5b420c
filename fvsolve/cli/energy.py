"""`fvsolve energy`: the ledger of energy of a run, and who keeps a network passive. Knows words; computes nothing."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated

import typer

from fvsolve.cli.app import Json, Set, app, load_case, print_json
from fvsolve.cli.studying import Out, cleared, folder_of, listed, methods_of, replaced, told
from fvsolve.errors import FvsolveError
from fvsolve.studies.sheet import Column, Sheet, text

Asked = Annotated[str | None, typer.Argument(metavar="[CASE]", help="a case; without one, schemes and methods alone")]
Port = Annotated[str | None, typer.Option(metavar="NODE", help="ask whether the network is passive at this port")]
Schemes = Annotated[str | None, typer.Option(metavar="S,S,...", help="schemes to try, or to say what they claim of")]
Methods = Annotated[str | None, typer.Option(metavar="M,M,...", help="methods, likewise")]
LINES = 12  # of one kind on the terminal; the rest is in energy.csv
AGAIN = "the same command starts anew"
FILES = ("energy.csv", "energy.png", "energy.svg")


def _limit(key: str) -> Callable[[Mapping], str]:
    """What says the greatest step of a row: any, none or a number."""
    return lambda row: "any" if math.isinf(row[key]) else "none" if row[key] == 0.0 else f"{row[key]:.6g}"


SCHEME = (
    Column("scheme"), Column("passive", "never grows"), Column("rate", "rate [per cell time]", ".4g"),
    Column("gain", "greatest gain", ".4g"),
)  # fmt: skip
METHOD = (
    Column("method"), Column("any_network", "any network"),
    Column("chamber", "driven chamber",
           lambda row: "-" if row["chamber"] is None else "keeps" if row["chamber"] >= 0.0 else "creates"),
    Column("leak", "leak: h/tau", _limit("leak")), Column("resonator", "resonator: h w", _limit("resonator")),
)  # fmt: skip


@app.command()
def energy(
    case: Asked = None,
    port: Port = None,
    scheme: Schemes = None,
    method: Methods = None,
    out: Out = None,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """What energy came in, where it is, what was dissipated, and what the numbers made of it."""
    schemes, methods = listed(scheme, "--scheme"), methods_of(method)
    if case is None:
        refuse({"--port": port, "--out": out, "--set": set})
        claims(schemes, methods, as_json)
    elif schemes or methods:
        pairs(load_case(case, set), schemes, methods, port, out, as_json)
    else:
        ledger(load_case(case, set), port, out, as_json)


def refuse(options: dict) -> None:
    """FvsolveError for options that ask about a run, where there is no case."""
    given = [name for name, value in options.items() if value]
    if given:
        raise FvsolveError(f"{', '.join(given)}: only with a case, as fvsolve energy CASE {given[0]} ...; "
                           "without one, schemes and methods alone are judged and no file is written")  # fmt: skip


@contextmanager
def leaving(words: str) -> Iterator[None]:
    """At Ctrl-C: say so in these words and end with exit code 130."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"\n{words}", file=sys.stderr)
        sys.exit(130)


def ledger(case, port, out, as_json: bool) -> None:
    """One run of a case: its ledger, its picture, the verdict at a port."""
    from fvsolve.cli.progress import watched
    from fvsolve.draw.energy import energy_figure
    from fvsolve.output.column import column, time_column
    from fvsolve.studies.energy.energy import energy as study
    from fvsolve.studies.energy.energy import write_table

    folder = folder_of(case, "energy", out)
    replaced(folder, FILES[0])
    with leaving(f"interrupted: no ledger, {folder} may lack files; {AGAIN}"):
        with watched(case) as progress:
            one = study(case, port=port, progress=progress)
        write_table(one, cleared(folder, *FILES) / FILES[0])
        at_port = None if one.port is None else (one.port.node, one.port.course, one.port.bound)
        clock, own = time_column(case), column("", "energy", case)
        units = clock.unit, None if own.plain else (own.to_si(1.0), own.unit)
        figure = energy_figure(clock.from_si(one.t), one.supplied, one.stored, one.dissipated, one.numerical(),
                               case.title or case.name, at_port, units)  # fmt: skip
        for name in FILES[1:]:
            figure.savefig(folder / name)
    if as_json:
        print_json(one.plain() | {"directory": str(folder), "files": list(FILES)})
    else:
        _ledger(one, case, folder)
    sys.exit(130 if one.reason == "interrupted" else 0 if one.ok else 1)


def _ledger(one, case, folder) -> None:
    from fvsolve.cli.terminal import console, line, table
    from fvsolve.output.column import column

    where, rows, joules = console(), [], column("energy", "energy", case)

    def amount(value: float) -> list[str]:
        share = f"{100.0 * value / one.through:.4g}" if one.through > 0.0 else "-"
        return [f"{joules.from_si(value):.6g}", share]

    for what in ("supplied", "stored", "dissipated"):
        lines = getattr(one, what)
        order = sorted(lines, key=lambda name: -abs(lines[name][-1]))
        rows += [[what, name, *amount(lines[name][-1])] for name in order[:LINES]]
        if len(order) > LINES:
            rest = sum(lines[name][-1] for name in order[LINES:])
            rows.append([what, f"{len(order) - LINES} others", *amount(rest)])
    rows += [["numerical", name, *amount(values[-1])] for name, values in one.numerical().items()]
    table(["what", "part", joules.header, "share [%]"], rows, where)
    line(where, "")
    said, left = f"remainder {case.amount(one.remainder[-1], 'energy')}", one.newton_counts
    if left:
        said += f", what Newton leaves: {case.amount(one.newton[-1], 'energy')}, the rest"
    passed = case.amount(one.through, "energy", 6)
    line(where, f"{said}{'' if left else ','} {one.relative:.3g} of the {passed} that passed: {one.verdict}")
    if one.port is not None:
        line(where, one.port.text, None if one.port.passive else "bold red")
    for mark in one.marks:
        line(where, mark, "yellow")
    cut = one.reason == "interrupted"
    ended = f"{one.reason} at t = {case.amount(one.t[-1], 'time', 6)}" if one.ok or cut else one.reason
    line(where, f"{ended}; {one.steps} steps{f': the ledger is up to there, {AGAIN}' if cut else ''}",
         None if one.ok else "bold red")  # fmt: skip
    line(where, f"{folder}: {', '.join(FILES)}")


def pairs(case, schemes, methods, port, out, as_json: bool) -> None:
    """A case by several schemes and methods: what each makes of its energy."""
    from fvsolve.cli.progress import stoppable
    from fvsolve.cli.terminal import console, line, sheet
    from fvsolve.studies.energy.pairs import PAIR, measured
    from fvsolve.studies.points import Points

    folder = folder_of(case, "energy", out)
    with told() as progress, stoppable() as watch, Points(folder) as points:
        rows = measured(case, schemes, methods, port, progress, points, watch)
    Sheet(PAIR, rows).write(folder / "pairs.csv")
    if as_json:
        print_json({"pairs": rows, "directory": str(folder), "files": ["pairs.csv"]})
        sys.exit(2 if all(row["creates"] is None for row in rows) else 0)
    where = console()
    heads = [_in_unit(one, case) for one in PAIR if port or one.key not in ("relative", "margin")]
    sheet(Sheet(heads, rows), where)
    refused = _outcome(case, rows, where)
    line(where, f"{folder}: pairs.csv, points.jsonl")
    if len(refused) == len(rows):
        sys.exit(2)


def _in_unit(one: Column, case) -> Column:
    """A column of energies as the reader wants them; others as they are."""
    from fvsolve.output.column import column

    if not one.head.endswith(" [J]"):
        return one
    own = column(one.head.removesuffix(" [J]"), "energy", case)

    def words(row: Mapping) -> str:
        return text(None if row[one.key] is None else own.from_si(row[one.key]), one.words)

    return replace(one, head=own.header, words=words)


def _outcome(case, rows, where) -> list[dict]:
    """Which pairs create energy, which were refused and why, and the way out; returns the refused ones."""
    from fvsolve.cli.terminal import line

    refused = [row for row in rows if row["reason"].startswith("refused")]
    ran = [row for row in rows if row not in refused]
    for row in ran:
        if ":" in row["reason"]:
            line(where, f"{_pair(row)}: {row['reason']}", "yellow")
    for reason, pairs in _by_reason(refused).items():
        line(where, f"{', '.join(pairs)}: {reason}", "bold red")
    if case.numerics.step is None and any("estimates no error" in row["reason"] for row in refused):
        span = case.numerics.end - case.numerics.start
        line(
            where, f"or give all of them one step: --set numerics.step={span / 1000.0:.1g} (s, a thousandth of the run)"
        )
    bad = [_pair(row) for row in ran if row["creates"]]
    if bad:
        line(where, f"create energy in this run: {', '.join(bad)}")
    elif ran:
        line(where, f"none of {'those that ran' if refused else 'them'} creates energy in this run")
    else:
        line(where, "none of them ran, so nothing is known of them")
    return refused


def _by_reason(rows) -> dict[str, list[str]]:
    """Pairs by why they were refused; what is said of several methods alike is said once."""
    found: dict[str, list] = {}
    for row in rows:
        found.setdefault(row["reason"].replace(f'method "{row["method"]}"', "each"), []).append(row)
    return {reason if len(several) > 1 else several[0]["reason"]: [_pair(row) for row in several]
            for reason, several in found.items()}  # fmt: skip


def _pair(row) -> str:
    return f"{row['scheme']} with {row['method']}"


def claims(schemes, methods, as_json: bool) -> None:
    """What schemes and methods promise by their coefficients."""
    from fvsolve.cli.terminal import console, line, sheet
    from fvsolve.studies.energy.passivity import CELLS, passivity

    with told() as progress, leaving(f"interrupted: nothing is kept; {AGAIN}"):
        found = passivity(schemes, methods, progress)
    if as_json:
        print_json(found.plain())
        return
    where = console()
    known = [one for one in found.schemes if one.passive is not None]
    line(where, f"Schemes: energy of a closed pipe of {CELLS} cells, continuous in time", "bold")
    sheet(Sheet(SCHEME, [vars(one) for one in known]), where)
    for one in found.schemes:
        if one.passive is None:
            line(where, f"{one.scheme} is limited and has no matrix: try it on a case")
    line(where, "")
    line(where, "Methods: any network at any step; limits on a leaking chamber, a resonator, and a closed pipe", "bold")
    good = [one.scheme for one in known if one.passive]
    limit = {(one.scheme, one.method): one.courant for one in found.pairs}
    rows = [vars(one) | {name: limit[name, one.method] for name in good} for one in found.methods]
    sheet(Sheet([*METHOD, *(Column(name, f"{name}: C", _limit(name)) for name in good)], rows), where)
    bad = [one.scheme for one in known if not one.passive]
    if bad:
        line(where, f"{', '.join(bad)}: create energy at pipe ends with every method, up to the gain above")
    never = [f"{one.scheme} with {one.method}" for one in found.pairs if one.courant == 0.0 and one.scheme in good]
    if never:
        line(where, f"create energy at every step: {', '.join(never)}")
