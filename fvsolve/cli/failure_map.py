"""`fvsolve failure-map`: map of the failures of methods on a case."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import Column, ResultTable
from fvsolve.display import save
from fvsolve.errors import FvsolveError


@cli.command("failure-map", order=110)
def failure_map(
    case: cli.SingleCase,
    scheme: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="schemes, one panel for each (default upwind and the "
            "scheme of the case, or the latter alone for a stiff case or a case without cells)",
        ),
    ] = None,
    method: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="methods, one row for each (default euler, ssp-rk3, rk4 "
            "and four implicit methods)",
        ),
    ] = None,
    courant: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="Courant numbers, one column for each, or a single one "
            "with --key (default 0.25 to 3, or ten time steps for a stiff case or a case without cells)",
        ),
    ] = None,
    step: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help='time steps instead of Courant numbers, for example "1 '
            'ms,2 ms", one column for each, or a single step with --key',
        ),
    ] = None,
    key: Annotated[
        str | None,
        Option(
            metavar="KEY=A,B",
            help="key of the case and its values, one column for each, "
            "instead of columns of time steps or Courant numbers",
        ),
    ] = None,
    tolerance: Annotated[
        float,
        Option(
            metavar="X",
            help="greatest accepted error of a probe: mean over the run, as "
            "a fraction of the probe's range",
        ),
    ] = 0.02,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    out: Annotated[
        Path | None,
        Option(metavar="DIR", help="folder of the table and pictures (default runs/NAME.map)"),
    ] = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Map failures of methods over time steps or values of a key. Each run is stable, ringing, wrong, blown up, ..."""
    from fvsolve.studies.failure_map import failure_map as study
    from fvsolve.studies.result_cache import ResultCache
    from fvsolve.studies.sampling import key_with_unit

    read_case = cli.load_case(case, set, scheme, method)
    folder = cli.folder_of(read_case, "map", out)
    steps = (
        None
        if step is None
        else [cli.quantity_of(word, "time", f"--step {step}") for word in cli.comma_list(step)]
    )
    with progress_line() as progress, ResultCache(folder) as points:
        result = study(
            read_case,
            cli.comma_list(scheme, "--scheme"),
            cli.method_names(method),
            _numbers("--courant", courant),
            steps,
            _key(key),
            tolerance,
            points,
            progress,
            jobs=jobs,
            dask=dask,
        )
    head = (
        result.key
        if result.key == "step"
        else key_with_unit(read_case.raw, result.key, result.values)
    )
    files = _write_files(result, folder, head)
    present(
        as_json,
        result.plain() | {"files": [str(file) for file in files]},
        map_text(result, files, head),
    )


def _numbers(option: str, text: str | None) -> list[float] | None:
    try:
        return None if text is None else [float(word) for word in cli.comma_list(text)]
    except ValueError:
        raise FvsolveError(
            f"{option} {text}: not a list of numbers; expected numbers with commas, for example {option} 0.5,0.9,1"
        ) from None


def _key(text: str | None) -> tuple[str, list] | None:
    if text is None:
        return None
    name, equals, values = text.partition("=")
    if not equals or not name.strip():
        raise FvsolveError(
            f"--key {text}: expected KEY=A,B, for example nodes.body.volume=1e-6,1e-5"
        )
    return name.strip(), [cli.value_of(word) for word in cli.comma_list(values)]


def _write_files(result, folder: Path, head: str) -> list[Path]:
    from fvsolve.report.draw.stability_pictures import failure_map_figure

    rows = [{"value": result.values[row["column"]]} | row for row in result.plain()["squares"]]
    table = ResultTable([Column(key) for key in rows[0]], rows).write(
        cli.clear_files(folder, "map.csv", "map.png", "map.svg") / "map.csv"
    )
    figure = failure_map_figure(result, f"{result.case}: where methods fail", head)
    pictures = [folder / f"map.{kind}" for kind in ("png", "svg")]
    for picture in pictures:
        save(figure, picture)
    return [table, *pictures]


def map_text(result, files: list[Path], head: str) -> Iterator:
    """Verdict of each run of a failure map, meaning of the verdicts, reference and files; head : label of columns"""
    from fvsolve.report.draw.stability_pictures import column_labels
    from fvsolve.studies.failure_map import VERDICT_TEXTS

    for scheme in result.schemes:
        heading = "steps" if result.key == "step" else head
        yield f"{scheme}, {heading}:" if result.wave_rate else f"{heading}:", "bold"
        heads = [
            "method",
            *(
                label.split("\n")[-1 if _by_courant(result) else 0]
                for label in column_labels(result)
            ),
            "predicted",
        ]
        squares = {method: result.row(scheme, method) for method in result.methods}
        rows = [
            [method, *(square.verdict for square in row), _limit_text(result, row)]
            for method, row in squares.items()
        ]
        yield ResultTable.of("", heads, rows)
        yield ""
    present = {square.verdict: None for square in result.squares}
    for word in VERDICT_TEXTS:
        if word in present:
            yield f"{word}: {VERDICT_TEXTS[word]}"
    yield f"tolerance: {result.tolerance:g} of a probe's range (mean error over the run, worst probe)"
    yield f"reference: {result.reference}; its error is at most {result.doubt:.2g}"
    yield (
        "predicted limit: least step at which an eigenmode grows 1000 times within the run "
        "(docs/course.md, equation 13)"
    )
    if result.lines:
        yield (
            "or at which a wave between a delay line and a node that stores liquid grows 1000 times; growth caused by "
            "jumps is not predicted"
        )
    if result.limited:
        yield (
            f"predicted limits of {', '.join(result.limited)}: estimates with the weights of the scheme in smooth "
            "flow, not bounds"
        )
    for reason in {
        square.measures.reason: None for square in result.squares if square.verdict == "refused"
    }:
        yield f"refused: {reason}"
    yield from map(str, files)


def _by_courant(result) -> bool:
    """True if the columns of a failure map have Courant numbers as labels.

    They do if the columns are time steps that all have a Courant number of 0.01 or more.
    """
    return (
        result.key == "step"
        and bool(result.wave_rate)
        and min(result.values) * result.wave_rate >= 0.01
    )


def _limit_text(result, row) -> str:
    from fvsolve.report.draw.stability_pictures import time_text

    limits = {square.limit for square in row}
    if len(limits) > 1:
        return "by column"
    (limit,) = limits
    if limit is None:
        return "not known"
    if limit == float("inf"):
        return "none"
    if limit == 0.0:
        return "any step"
    return f"C {limit * result.wave_rate:.3g}" if _by_courant(result) else time_text(limit)
