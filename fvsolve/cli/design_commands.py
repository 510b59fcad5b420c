"""`fvsolve size`, `optimise` and `study`: values of keys, valve schedules and protections that keep the limits."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli.app import Dask, Jobs, Json, Set, SingleCase, command, load_case
from fvsolve.cli.sweep import RANGE_FORMAT, key_and_values
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import ResultTable
from fvsolve.errors import CaseError, FvsolveError, collect_faults


@command("size", order=290)
def size(
    case: SingleCase,
    vary: Annotated[
        str,
        Option(
            "--vary", metavar="KEY=LOW,HIGH", help="key to size and its range, in SI or with units"
        ),
    ],
    goal: Annotated[
        str,
        Option(
            metavar="minimum|maximum",
            help="value to find: the minimum or the maximum that satisfies all limits",
        ),
    ] = "minimum",
    dependent: Annotated[
        list[str],
        Option(
            metavar='"KEY = formula"',
            help="other key to set by a "
            'formula of x, the value of the sized key in SI, for example "nodes.vessel.gas_volume = 0.4 * '
            'x"; repeat the option for more keys',
        ),
    ] = [],  # noqa: B006
    rtol: Annotated[
        float,
        Option(
            help="relative tolerance: greatest distance of the value found from a value that fails"
        ),
    ] = 0.01,
    estimate_error: Annotated[
        bool,
        Option(
            "--estimate-error",
            help="require that margins exceed their numerical errors, estimated from further runs",
        ),
    ] = False,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Find by bracketing the minimum or maximum value of a key at which all limits of a case hold."""
    from fvsolve.studies import sizing

    faults = []
    key = ""
    values = []
    ties = {}
    loaded = None
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
        result = sizing.size(
            loaded,
            key,
            *values,
            goal,
            ties,
            None,
            rtol,
            lambda done, label: progress(done, sizing.MAX_RUNS, label),
            estimate_error,
        )
    present(as_json, result.plain(), size_text(result), code=0 if result.value is not None else 1)


def size_text(result) -> Iterator:
    """Values tried in a size search, and the value found."""
    rows = [
        [
            f"{run.value:.6g}",
            "holds" if run.ok else "open" if run.open else "FAILS",
            "-" if run.margin is None else f"{run.margin:.4g}",
            run.limit if run.reason == "finished" else run.reason,
        ]
        for run in result.runs
    ]
    unit = f" {result.unit}" if result.unit else ""
    key = f"{result.key} [{result.unit}]" if unit else result.key
    yield ResultTable.of("", [key, "", "least margin over limit", "of"], rows)
    for text in result.ties:
        yield f"with {text}"
    for text in dict.fromkeys(run.open for run in result.runs if run.open):
        yield f"open: {text}", "yellow"
    if result.value is None:
        yield _no_value_text(result), "bold red"
        return
    bracket = (
        "at the end of the range"
        if result.bracket is None
        else (f"bracket {min(result.bracket):.6g} to {max(result.bracket):.6g}{unit}")
    )
    line = (
        f"{result.goal} value that satisfies all limits: {result.value:.6g}{unit}; "
        f"{bracket}; {len(result.runs)} runs"
    )
    yield line, "green"


def _no_value_text(result) -> str:
    """Text for a size search without result: the value with the greatest margin, and a direction for further search."""
    nearest, values = result.nearest, sorted(run.value for run in result.runs)
    unit = f" {result.unit}" if result.unit else ""
    text = (
        f"none of the values tried between {values[0]:.6g} and {values[-1]:.6g}{unit} satisfies all limits; "
        f"the nearest to the limits is {nearest.value:.6g}{unit}"
    )
    if nearest.margin is None:
        return f"{text}; no margin is known"
    text += f", with a margin of {nearest.margin:.3g} of the limit {nearest.limit}"
    beyond = {values[0]: "below", values[-1]: "above"}.get(nearest.value)
    return (
        f"{text}; margins increase towards this value; try values {beyond} it or change another key"
        if beyond
        else text
    )


@command("optimise", order=170)
def optimise(
    case: SingleCase,
    schedule: Annotated[
        str,
        Option(
            metavar="KEY",
            help="key of the schedule to optimise, for example "
            "links.valve.opening; its ends keep their times and values",
        ),
    ],
    minimise: Annotated[
        str,
        Option(
            metavar="max(PROBE)",
            help='peak to minimise, for example "max(gate.pressure)" or "max(main.head)"',
        ),
    ],
    knots: Annotated[
        int, Option(metavar="N", help="number of knots between the ends of the schedule, 1 to 12")
    ] = 3,
    runs: Annotated[int, Option(metavar="N", help="greatest number of runs")] = 60,
    set: Set = [],  # noqa: B006
    as_json: Json = False,
) -> None:
    """Optimise a valve schedule, given by a few knots, to minimise a peak; compare it with the linear schedule."""
    from fvsolve.studies import closure_optimisation

    faults, loaded = [], None
    with collect_faults(faults):
        loaded = load_case(case, set)
    faults += closure_optimisation.find_faults(loaded, schedule, minimise, knots, runs)
    if faults:
        raise CaseError(faults, case)
    with progress_line(resumable=False) as progress:
        result = closure_optimisation.optimise(
            loaded,
            schedule,
            minimise,
            knots,
            runs,
            None,
            lambda done, text: progress(done, runs, text),
        )
    present(as_json, result.plain(), schedule_text(result, loaded))


def schedule_text(result, case) -> Iterator:
    """Linear and best schedule of an optimisation, and their peaks."""
    from fvsolve.core.output.unit_columns import column, time_column
    from fvsolve.studies.sampling import key_quantity

    clock = time_column(case)
    quantity = key_quantity(case.raw, result.key)
    own = column("", "number" if quantity is None else quantity.dimension, case)
    bare, spec = own.dimension == "number", ".4f" if own.dimension == "number" else ".6g"
    rows = [
        [f"{clock.from_si(t):.6g}", *(format(own.from_si(value), spec) for value in pair)]
        for t, *pair in zip(result.best.time, result.linear.value, result.best.value, strict=True)
    ]
    heads = [name if bare else f"{name} [{own.unit}]" for name in ("linear", "best")]
    yield ResultTable.of("", [clock.header, *heads], rows)
    peaks = [
        "-" if value.peak is None else f"{value.peak:.6g} {result.unit}"
        for value in (result.linear, result.best)
    ]
    yield f"{result.minimise}: linear {peaks[0]}, best {peaks[1]}; {result.runs} runs", "green"
    yield result.schedule


@command("study", order=250)
def study(
    file: Annotated[
        Path, Argument(metavar="FILE", help="TOML file of a study: case, events, protections")
    ],
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="folder of the run directories and tables (default "
            "runs/NAME, the name of FILE without .toml)",
        ),
    ] = None,
    jobs: Jobs = 1,
    dask: Dask = None,
    force: Annotated[bool, Option("--force", help="replace earlier runs of this study")] = False,
    as_json: Json = False,
) -> None:
    """Run every event with every protection of a study file, and list the limits that hold or fail."""
    from fvsolve.studies import scenarios

    with progress_line() as progress:
        result = scenarios.study(file, out, jobs, dask, force, progress)
    facts = result.plain() | {"directory": str(result.folder)}
    present(as_json, facts, study_text(result), code=0 if result.ok else 1)


def study_text(result) -> Iterator:
    """Margins of all limits in all runs of a study, failed and open limits, and protections that hold all limits."""
    from fvsolve.cli import printing
    from fvsolve.core.output.summary_shape import FAILS, OPEN, LimitVerdict
    from fvsolve.studies.scenarios import row_name

    if result.design.title:
        yield result.design.title, "bold"
    yield _margin_table(result)
    for row in result.rows:
        if not row["ok"]:
            yield f"{row_name(row)}: {row['reason']}", "bold red"
        if row["marks"]:
            first = min(row["marks"], key=lambda mark: mark["time"])
            time = printing.time_formatter(row)(first["time"])
            yield (
                f"{row_name(row)}: {first['text']}: results from {time} on are not to be trusted",
                "yellow",
            )
        for note in row["warnings"]:
            if note["kind"] == "end":
                yield f"{row_name(row)}: {note['text']}", "yellow"
        for verdict in [LimitVerdict(**verdict) for verdict in row["verdicts"]]:
            if verdict.state in (FAILS, OPEN):
                value = "-" if verdict.value is None else f"{verdict.value:.6g}"
                place = printing.where_and_when(verdict._asdict(), row)
                text = f"{row_name(row)}: {verdict.name}: {value} {verdict.unit} ({place})"
                if verdict.state == OPEN:
                    text += f": open, because {printing.undecided_limit_reason(verdict, row)}"
                yield text, "red" if verdict.state == FAILS else "yellow"
        for text in row.get("resolution", {"reasons": []})["reasons"][: printing.REASONS_SHOWN]:
            yield f"{row_name(row)}: error of {text}", "yellow"
    names = [name or "the case as it is" for name in result.holds]
    if result.limited:
        message = f"all limits hold in all events with: {', '.join(names)}"
        message = message if names else "no protection satisfies all limits in all events"
        yield message, "green" if names else "bold red"
    else:
        yield "the case states no limits, so none is checked", "yellow"
    yield f"{result.folder}: study.json, study.csv and a directory for each run"


def _margin_table(result) -> ResultTable:
    """Table of the status of each run of a study, and of the margin of each limit in it.

    The status is "FAILS" if the run or a limit fails, else "open" or "holds"; "-" for a good run without limits.
    """
    from fvsolve.core.output.summary_shape import FAILS, HOLDS, IN_WORDS, OPEN
    from fvsolve.core.run.result import not_valid
    from fvsolve.studies.scenarios import row_name
    from fvsolve.units import span

    limits, rows = {}, []
    for verdict in [verdict for row in result.rows for verdict in row["verdicts"]]:
        limits[verdict["name"]] = f"{verdict['name']} [{span(verdict['unit'])}]"
    for row in result.rows:
        states = [FAILS] * (not row["ok"]) + [verdict["state"] for verdict in row["verdicts"]]
        status = (
            IN_WORDS[next((state for state in (FAILS, OPEN) if state in states), HOLDS)]
            if states
            else "-"
        )
        margins = dict.fromkeys(limits, "-")
        for verdict in row["verdicts"]:
            error = "" if verdict["error"] is None else f" +- {verdict['error']:.2g}"
            known = verdict["margin"] is not None
            margins[verdict["name"]] = (
                f"{verdict['margin']:.5g}{error}" if known else not_valid(row) or "-"
            )
        rows.append([row_name(row), status, *margins.values()])
    return ResultTable.of("", ["run", "", *(f"margin of {name}" for name in limits.values())], rows)
