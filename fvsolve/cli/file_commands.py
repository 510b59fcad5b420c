"""`fvsolve report`, `plot`, `fatigue`, `import` and `precompile`: reports of runs, networks, compiled code."""

import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from fvsolve.case import shipped
from fvsolve.cli.app import Json, RunDirectory, Set, SingleCase, command, load_case, quantity_of
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import ResultTable
from fvsolve.errors import FvsolveError, listing
from fvsolve.file_replacement import replacing, write_file

if TYPE_CHECKING:
    from fvsolve.exchange.epanet import Imported

DAY = 86400.0  # [s]
SHORT = (
    'pipes shorter than a cell, which make steps small with pipe_model = "finite-volume" '
    "(--min-pipe-length lengthens them)"
)


@command("report", order=210)
def report(
    directory: Annotated[
        Path, Argument(metavar="RUN_OR_STUDY", help="directory of a run or a study")
    ],
    out: Annotated[
        Path | None,
        Option(metavar="FILE", help="file of the report (default RUN_OR_STUDY/report.html)"),
    ] = None,
    xlsx: Annotated[
        bool,
        Option(
            "--xlsx", help="also write the tables as an Excel workbook in the folder of the report"
        ),
    ] = False,
    pdf: Annotated[
        bool,
        Option(
            "--pdf",
            help="also print the page to a PDF on A4, by an installed Chromium, Chrome or Edge",
        ),
    ] = False,
    gpkg: Annotated[
        bool,
        Option(
            "--gpkg",
            help="also write a GeoPackage of nodes, links, gauges, sections and walls with their extremes, of a run",
        ),
    ] = False,
) -> None:
    """Write an offline HTML page of a run or a study: verdicts, maps, long sections, histories, model, numerics."""
    from fvsolve.report.report_files import write_report

    if pdf and out is not None and out.suffix == ".pdf":
        raise FvsolveError(
            f"--out {out} is the name of the PDF; expected --out FILE.html with --pdf"
        )
    paths = write_report(directory, out, xlsx)
    for path in paths:
        print(path)
    if pdf:
        from fvsolve.report.pdf_file import write_pdf

        print(write_pdf(paths[0]))
    if gpkg:
        from fvsolve.report.maps.result_layers import write_layers
        from fvsolve.report.report_files import open_checked_run

        print(write_layers(open_checked_run(directory), paths[0].with_suffix(".gpkg")))


@command("plot", order=220)
def plot(
    directory: RunDirectory,
    probes: Annotated[
        str, Option(metavar="A,B", help="probes whose histories are drawn (default none)")
    ] = "",
    route: Annotated[
        str,
        Option(
            metavar="NAME",
            help="route whose long section is drawn (default all routes, or "
            "none with --probes, --phase or --map)",
        ),
    ] = "",
    phase: Annotated[
        list[str],
        Option(
            metavar="X:Y",
            help="phase plane to draw, probe Y over probe X; "
            "repeat the option for more (default none)",
        ),
    ] = [],  # noqa: B006
    map: Annotated[
        bool,
        Option(
            "--map",
            help="maps of basins (greatest depth, speed and depth times speed, time of arrival, duration of "
            "flooding) and of the network (pressures and heads)",
        ),
    ] = False,
    out: Annotated[
        Path | None, Option(metavar="DIR", help="folder of the pictures (default RUN)")
    ] = None,
) -> None:
    """Draw long sections (heads, limits, devices), histories of probes, phase planes and maps, without a browser."""
    from fvsolve.report.report_files import write_pictures

    for path in write_pictures(directory, probes, route, phase, out, map):
        print(path)


@command("fatigue", order=230)
def fatigue(
    directory: RunDirectory,
    probes: Annotated[
        str,
        Option(
            metavar="A,B",
            help="probes of pressure or head whose cycles are counted (default all such probes)",
        ),
    ] = "",
    range: Annotated[
        float | None,
        Option(
            metavar="R",
            help="range of pressure or head that causes failure after "
            "--allowable-range cycles, in the unit of the probe (default none: cycles are only counted)",
        ),
    ] = None,
    allowable_range: Annotated[
        float | None,
        Option(
            metavar="N",
            help="number of cycles of the range --range until failure, required with --range",
        ),
    ] = None,
    slope: Annotated[
        float | None,
        Option(
            metavar="M",
            help="exponent of the fatigue strength, required with "
            "--range: N (R/r)^M cycles of a range r cause failure",
        ),
    ] = None,
    per_day: Annotated[
        float,
        Option(
            metavar="N",
            help="number of occurrences of the run per day, from which its "
            "fatigue life in years follows",
        ),
    ] = 1.0,
    as_json: Json = False,
) -> None:
    """Count pressure cycles of a run by rainflow counting, and estimate the fatigue life of its parts."""
    from fvsolve.core.run import open_run
    from fvsolve.report import cycles as counting

    given = [entry for entry in (range, allowable_range, slope) if entry is not None]
    if len(given) not in (0, 3) or any(not entry > 0.0 for entry in given) or not per_day > 0.0:
        raise FvsolveError(
            "--range, --allowable-range, --slope: expected all three or none; these and --per-day must be above 0"
        )
    strength = counting.FatigueStrength(*given) if given else None
    names = [name.strip() for name in probes.split(",") if name.strip()]
    results = counting.cycles(open_run(directory), names or None, strength)
    present(as_json, {"probes": results}, cycle_text(results, per_day))


def cycle_text(results: list[dict], per_day: float) -> Iterator:
    """Table of pressure cycles, and the fatigue life of each part if its strength is given.

    results : as from `cycles`; per_day : number of occurrences of the run per day
    """
    rows = [
        [entry["probe"], entry["unit"], f"{size:.5g}", f"{count:g}"]
        for entry in results
        for size, count in entry["cycles"]
    ]
    yield ResultTable.of("", ["probe", "unit", "range up to", "cycles"], rows)
    for entry in [entry for entry in results if "share" in entry]:
        years = 1.0 / (entry["share"] * per_day * 365.25) if entry["share"] > 0.0 else float("inf")
        life = "unlimited" if years == float("inf") else f"{years:.4g} years"
        yield (
            f"{entry['probe']}: a run uses {entry['share']:.3g} of the fatigue life; with {per_day:g} runs a day the "
            f"life is {life}"
        )


@command("import", order=130)
def import_(
    source: Annotated[
        Path, Argument(metavar="FILE", help="EPANET network to import, for example town.inp")
    ],
    case: Annotated[
        Path | None,
        Argument(
            metavar="CASE",
            help="case file to write, or its folder (default the name "
            "of FILE with .toml, in the current folder)",
        ),
    ] = None,
    hour: Annotated[
        float,
        Option(
            metavar="H",
            help="hours from the start of the EPANET run to the initial state of the case",
        ),
    ] = 0.0,
    wave_speed: Annotated[
        str, Option(metavar="A", help="wave speed of all pipes, in m/s or with a unit")
    ] = "1200 m/s",
    min_pipe_length: Annotated[
        str | None,
        Option(
            metavar="L",
            help="length to which shorter pipes are lengthened, "
            'for example "10 m" (default none: pipes keep their lengths)',
        ),
    ] = None,
    day: Annotated[
        bool,
        Option(
            "--day",
            help="a run of 24 h from hour 0, with patterns, controls and rules, and with "
            "pipes whose flow follows their losses at once (default a run of seconds, with waves)",
        ),
    ] = False,
    duration: Annotated[
        str | None,
        Option(
            metavar="T",
            help="duration of the run of --day, in s or with a unit, for "
            'example "7 d" (default 24 h)',
        ),
    ] = None,
    pressure_dependent: Annotated[
        str | None,
        Option(
            metavar="P",
            help="pressure from which demands are full, in Pa "
            'or with a unit, for example "2 bar"; below it they depend on pressure, as with PDA in EPANET (default '
            "demands as in FILE)",
        ),
    ] = None,
    check: Annotated[
        bool | None,
        Option(
            "--check/--no-check",
            help="comparison of heads and flows, with --day also of "
            "levels over a day, with EPANET on FILE (default yes; the day of more than 2000 nodes with --check only)",
        ),
    ] = None,
) -> None:
    """Import an EPANET network: write its case file, print all differences from EPANET and compare both."""
    from fvsolve.exchange.epanet import import_network
    from fvsolve.exchange.epanet.part_tables import WEIGHT

    to = case or Path(f"{source.stem}.toml")
    if to.is_dir():
        to = to / f"{source.stem}.toml"
    if not to.suffix:
        to = to.with_suffix(".toml")
    if to.exists():
        raise FvsolveError(f"{to} exists; give another file: fvsolve import {source} CASE")
    speed = _positive("--wave-speed", wave_speed, "velocity")
    shortest = _positive("--min-pipe-length", min_pipe_length, "length") if min_pipe_length else 0.0
    if duration and not day:
        raise FvsolveError(
            f"--duration {duration} has no effect without --day; add --day, or set numerics.end"
        )
    end = _positive("--duration", duration, "time") if duration else DAY
    required = (
        _positive("--pressure-dependent", pressure_dependent, "pressure_drop")
        if pressure_dependent
        else 0.0
    )
    network = import_network(source, hour, speed, shortest, day, end, required / WEIGHT)
    to.parent.mkdir(parents=True, exist_ok=True)
    write_file(to, network.text)
    written = [to]
    described = to.parent / shipped.SCHEMA
    if (shipped.folder() / shipped.SCHEMA).is_file() and not described.exists():
        with replacing(described) as fresh:
            shutil.copyfile(shipped.folder() / shipped.SCHEMA, fresh)
        written.append(described)
    for path in written:
        print(path)
    for text, names in [
        *network.notes,
        *([(SHORT, network.short_pipes)] if network.short_pipes else []),
    ]:
        print(f"{text}: {listing(names)}", file=sys.stderr)
    if check is not False:
        is_long = len(network.network.nodes) > MOST_NODES and not check
        _compare(network, to, day and not is_long)
        if day and is_long:
            nodes = len(network.network.nodes)
            print(
                f"self-check: the day of {nodes} nodes is not compared; --check compares it",
                file=sys.stderr,
            )


@command("export", order=140)
def export(
    case: SingleCase,
    epanet: Annotated[
        Path | None, Option(metavar="FILE", help="EPANET network (.inp) to write (needed)")
    ] = None,
    set: Set = [],  # noqa: B006
) -> None:
    """Export a case as an EPANET network: pipes, pumps, valves, tanks, patterns and controls of levels."""
    from fvsolve.exchange.epanet import network_text

    if epanet is None:
        raise FvsolveError(
            "--epanet FILE is missing; expected the EPANET network to write, for example town.inp"
        )
    if epanet.exists():
        raise FvsolveError(f"{epanet} exists; give another file: --epanet FILE")
    text, notes = network_text(load_case(case, set))
    epanet.parent.mkdir(parents=True, exist_ok=True)
    write_file(epanet, text)
    print(epanet)
    for note in notes:
        print(note, file=sys.stderr)


MOST_NODES = 2000  # of a network whose day is compared with EPANET without --check: a minute or so


def _compare(network: "Imported", case: Path, day: bool) -> None:
    """Print the comparison of a case with EPANET on the original file; exit with 1 for a difference without cause."""
    from fvsolve.case import load
    from fvsolve.exchange.epanet.self_check import check_day, check_start

    found = [check_start(network, load(case))]
    if day and not found[0].fault:
        found.append(check_day(network, case))
    for result in found:
        for line in result.lines():
            print(line, file=sys.stderr)
    if not all(result.agrees for result in found):
        raise Exit(1)


def _positive(option: str, text: str, dimension: str) -> float:
    """Value [SI] of an option from its text; raises FvsolveError if it is not positive."""
    value = quantity_of(text, dimension, option)
    if not value > 0.0:
        raise FvsolveError(f"{option}: {text} is not positive")
    return value


@command("precompile", order=190)
def precompile(
    cases: Annotated[
        list[str],
        Option(
            "--for",
            metavar="CASE",
            help="case file or shipped case to "
            "compile for; repeat the option for more (default all shipped cases)",
        ),
    ] = [],  # noqa: B006
    jobs: Annotated[
        int | None,
        Option(metavar="N", min=1, help="number of processes (default number of processors)"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compile the functions that cases need on this machine, so that later runs start at once."""
    from fvsolve.case import load, shipped
    from fvsolve.cli.terminal import progress_bar
    from fvsolve.core.run.precompilation import warm as warmed

    paths = [shipped.find(name) for name in cases or shipped.names()]
    for path in paths:  # report faults of a case before compiling
        load(path)
    with progress_bar("compiling") as progress:
        result = warmed(paths, not cases, jobs, progress)
    done = (
        f"{result.compiled} functions compiled in {result.seconds:.0f} s"
        if result.compiled
        else ("all functions were compiled already")
    )
    cache = f"the cache holds {result.functions} functions, {result.bytes / 1e6:.1f} MB, for {result.target}"
    present(as_json, asdict(result), [f"{done}; {cache}", f"{result.directory}"])
