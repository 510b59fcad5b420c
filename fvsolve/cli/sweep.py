"""`fvsolve sweep`, `sensitivity` and `calibrate`: runs over combinations, samples and ranges of keys."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import ResultTable
from fvsolve.display import save
from fvsolve.errors import FvsolveError

Values = Annotated[
    list[str],
    Option(
        "--set",
        metavar="KEY=a,b,c",
        help="values of a key, one run for each, or a single value for all runs; repeat the option for more keys",
    ),
]
Ranges = Annotated[
    list[str],
    Option(
        "--vary",
        metavar="KEY=LOW,HIGH",
        help="key to vary with --sample and its range, in SI or with units; repeat the option for more keys",
    ),
]
Quantities = Annotated[
    list[str],
    Option(
        "--quantity",
        metavar="max(PROBE)",
        help="quantity to chart over the keys: max, min or final of a probe; repeat the option for more quantities "
        "(default max and min of all probes)",
    ),
]
VALUES_FORMAT = "KEY=a,b,c, for example links.main.cells=100,200,400"
RANGE_FORMAT = "KEY=LOW,HIGH, for example links.main.length=900,1000"
MAX_COLUMNS = 6  # greatest number of columns of the table on a terminal, without the keys
MAX_ROWS = 100  # greatest number of rows of that table


@cli.command("sweep", order=260)
def sweep(
    case: cli.SingleCase,
    set: Values = [],  # noqa: B006
    points: Annotated[
        Path | None,
        Option(
            metavar="FILE.csv",
            help="CSV file of the values of keys in all runs: a "
            "row for each run, a column for each key",
        ),
    ] = None,
    sample: Annotated[
        str | None,
        Option(
            metavar="sobol:N",
            help="sample of N runs in the ranges of --vary: sobol:N "
            "(Sobol) or lhs:N (Latin hypercube)",
        ),
    ] = None,
    vary: Ranges = [],  # noqa: B006
    seed: cli.Seed = 0,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    quantity: Quantities = [],  # noqa: B006
    out: cli.Out = None,
    as_json: cli.Json = False,
) -> None:
    """Run a case for every combination of values. The table has a row for each run; a failed run has its reason."""
    from fvsolve import studies
    from fvsolve.studies.sampling import key_with_unit

    values_by_key = dict(key_and_values(text) for text in set)
    fixed = {key: values[0] for key, values in values_by_key.items() if len(values) == 1}
    if vary and sample is None:
        raise FvsolveError(
            f"--vary {vary[0]}: expected --sample sobol:N too. For a grid of values use --set KEY=a,b,c"
        )
    varied = {key: values for key, values in values_by_key.items() if key not in fixed} | ranges(
        vary, "--vary"
    )
    loaded = cli.load_case(case, [])
    folder = cli.folder_of(loaded, "sweep", out)
    with progress_line() as progress:
        result = studies.sweep(
            loaded, varied, fixed, jobs, folder, progress, points, sample, seed, dask
        )
    heads = {
        key: key_with_unit(loaded.raw, key, [row[key] for row in result.rows])
        for key in result.keys
    }
    charts = write_charts(result, quantity, folder, heads)
    facts = result.plain() | {"directory": str(folder), "charts": [str(path) for path in charts]}
    present(
        as_json,
        facts,
        sweep_text(result, folder, heads),
        code=0 if all(row["ok"] for row in result.rows) else 1,
    )


def ranges(texts: list[str], option: str) -> dict[str, list]:
    """Ranges of keys from texts `KEY=LOW,HIGH` : key -> [low, high]. Raises FvsolveError for a key that is given twice.

    The number of values is not checked. option : name of the option, for the message
    """
    pairs = [key_and_values(text, option, RANGE_FORMAT) for text in texts]
    duplicates = [key for key, _ in pairs if [name for name, _ in pairs].count(key) > 1]
    if duplicates:
        raise FvsolveError(f"{option} {duplicates[0]} is given twice; give it once")
    return dict(pairs)


def write_charts(result, quantities: list[str], folder: Path, heads: dict[str, str]) -> list[Path]:
    """Draw a picture of each quantity (default all extremes) in the folder `charts`; returns the paths.

    Pictures of earlier sweeps in this folder are deleted. heads : key -> heading of the key with its unit
    """
    from fvsolve.report.draw.object_pictures import quantity_figure

    names = [result.quantity(name) for name in quantities]
    names = names or [column for column in result.quantities if column.startswith(("max(", "min("))]
    cli.clear_files(folder / "charts", "*max-*.png", "*min-*.png", "final-*.png")
    paths = []
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9.@_-]+", "-", name.partition(" [")[0]).strip("-")
        path = cli.writable_folder(folder / "charts") / f"{stem}.png"
        save(quantity_figure(result, name, heads), path)
        paths.append(path)
    return paths


def key_and_values(
    text: str, option: str = "--set", expected: str = VALUES_FORMAT
) -> tuple[str, list]:
    """Key and list of values from a text `KEY=a,b,c`. Raises FvsolveError for any other text.

    option, expected : name of the option and valid form of the text, for the message
    """
    key, equals, listed = text.partition("=")
    if not (equals and key.strip() and listed.strip()):
        raise FvsolveError(f"{option} {text}: expected {expected}")
    return key.strip(), [cli.value_of(entry) for entry in split_list(listed)]


def split_list(text: str) -> list[str]:
    """Split a text at commas outside of brackets, braces and quotes."""
    parts = [""]
    depth = 0
    quote = ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        depth += (letter in "[{") - (letter in "]}") if not quote else 0
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def sweep_text(result, folder: Path, heads: dict[str, str]) -> Iterator:
    from fvsolve.studies.sweep import as_option_text

    judged = ["verdicts"] * any(row.get("verdicts") is not None for row in result.rows)
    columns = [
        *result.keys,
        "ok",
        *judged,
        *(name for name in result.columns if name.startswith(("min(", "max("))),
    ]
    shown = columns[len(result.keys) : len(result.keys) + 1 + len(judged) + MAX_COLUMNS]
    first_rows = result.rows[:MAX_ROWS]
    rows = [
        [
            *(as_option_text(row[key]) for key in result.keys),
            *(_text(row.get(name)) for name in shown),
        ]
        for row in first_rows
    ]
    yield ResultTable.of("", [*heads.values(), *shown], rows)
    for row in first_rows:
        values = ", ".join(f"{key} = {as_option_text(row[key])}" for key in result.keys)
        if not row["ok"]:
            yield f"{values}: {row['reason']}", "bold red"
        if row.get("marks"):
            yield f"{values}: {row['marks']}", "yellow"
    reused = f", {result.reused} of them reused from an earlier sweep" if result.reused else ""
    reused += f", the first {MAX_ROWS} are printed here" if len(result.rows) > MAX_ROWS else ""
    yield f"{folder / 'sweep.csv'}: {len(result.rows)} rows{reused}"


def _text(value) -> str:
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


@cli.command("sensitivity", order=270)
def sensitivity(
    case: cli.SingleCase,
    vary: Annotated[
        list[str],
        Option(
            "--vary",
            metavar="KEY=LOW,HIGH",
            help="key to vary and its range, in SI or with units; repeat the option for more keys",
        ),
    ],
    quantity: Annotated[
        str, Option(metavar="max(PROBE)", help="quantity to analyse: max, min or final of a probe")
    ],
    samples: Annotated[
        int,
        Option(
            metavar="N",
            help="base sample size, a power of two; for k keys the study makes "
            "about 1.25 N (k + 2) runs",
        ),
    ] = 64,
    seed: cli.Seed = 0,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    set: cli.Set = [],  # noqa: B006
    out: cli.Out = None,
    as_json: cli.Json = False,
) -> None:
    """Compute the sensitivity of a quantity to keys: Sobol indices and Morris effects over ranges."""
    from fvsolve import studies

    loaded = cli.load_case(case, set)
    folder = cli.folder_of(loaded, "sensitivity", out)
    with progress_line() as progress:
        result = studies.sensitivity(
            loaded,
            ranges(vary, "--vary"),
            quantity,
            samples,
            seed,
            None,
            jobs,
            dask,
            folder,
            progress,
        )
    cli.clear_files(folder, "sensitivity.csv", "sensitivity.png")
    path = result.sheet.write(folder / "sensitivity.csv")
    result.plot(folder / "sensitivity.png")
    below = f"{path}: {result.quantity}, {result.runs} runs"
    present(as_json, result.plain() | {"directory": str(folder)}, [_key_table(result), below])


@cli.command("calibrate", order=280)
def calibrate(
    case: cli.SingleCase,
    vary: Annotated[
        list[str],
        Option(
            "--vary",
            metavar="KEY=LOW,HIGH",
            help="key to calibrate and its range, in SI or "
            "with units; repeat the option for more keys",
        ),
    ],
    seed: cli.Seed = 0,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Calibrate keys of a case against the measured series in its [compare]."""
    from fvsolve import studies

    loaded = cli.load_case(case, set)
    with progress_line(resumable=False) as progress:
        result = studies.calibrate(loaded, ranges(vary, "--vary"), None, seed, jobs, dask, progress)
    present(as_json, result.plain(), calibration_text(loaded, result))


def calibration_text(case, result) -> Iterator:
    """Calibrated values of the keys, differences from the measured series, and doubts."""
    from fvsolve.core.output.unit_columns import column
    from fvsolve.studies.sampling import si_unit_of

    probes = {
        series.probe.text: series.probe
        for series in case.compare.values()
        if series.probe is not None
    }
    texts = []
    for name, rms in result.rms.items():
        probe = probes[name]
        unit_column = column(probe.text, probe.dimension, case, probe.unit)
        texts.append(f"rms of {name} {unit_column.span_from_si(rms):.6g} {unit_column.span_unit}")
    units = {
        key: f"{key} [{unit}]" if (unit := si_unit_of(case.raw, key)) else key
        for key in result.values
    }
    yield _key_table(result, units)
    yield ", ".join([*texts, f"{result.runs} runs"])
    yield from ((doubt, "yellow") for doubt in result.doubts)


def _key_table(result, units: dict[str, str] = {}) -> ResultTable:  # noqa: B006
    """Table of the keys of a sensitivity study or a calibration; units : key -> its heading with unit, if it has one"""
    heads, rows = result.sheet.words()
    return ResultTable.of("", heads, [[units.get(key, key), *row] for key, *row in rows])
