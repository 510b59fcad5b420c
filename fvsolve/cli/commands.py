"""Commands for runs and cases."""

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli.app import (
    Cases,
    Json,
    RunDirectory,
    Set,
    SingleCase,
    command,
    load_case,
    quantity_of,
)
from fvsolve.cli.terminal import present, print_json, show
from fvsolve.core.output.result_table import ResultTable
from fvsolve.errors import FvsolveError, visible


@command("run", order=10)
def run(
    cases: Cases,
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="run directory, or for several cases the folder of their "
            "run directories DIR/NAME (default runs/NAME)",
        ),
    ] = None,
    set: Set = [],  # noqa: B006
    resume: Annotated[
        bool, Option("--resume", help="continue an interrupted run from its last checkpoint")
    ] = False,
    force: Annotated[
        bool, Option("--force", help="replace an earlier run in the run directory")
    ] = False,
    threads: Annotated[
        int, Option(metavar="N", help="number of threads that share the rows of basin cells")
    ] = 1,
    no_pictures: Annotated[bool, Option("--no-pictures", help="write no pictures")] = False,
    estimate_error: Annotated[
        bool,
        Option(
            "--estimate-error",
            help="estimate the errors of peaks, from further runs "
            "at half, one and twice the resolution",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Solve cases and write their run directories."""
    from fvsolve.report.draw.plot_process import PlotProcess

    results = []
    # its process starts before other modules are imported
    with PlotProcess(second_process=not no_pictures) as painter:
        from fvsolve.cli import printing
        from fvsolve.core.run import model_of, mpi_run

        if not gc.get_freeze_count():  # once in a process, since it keeps unused objects too
            gc.freeze()
        gc.enable()
        if mpi_run.is_other_rank():
            painter.end()
            for name in dict.fromkeys(cases):
                mpi_run.serve_rank(lambda name=name: model_of(load_case(name, set)))
            sys.exit(0)
        with mpi_run.rank_zero_first(mpi_run.world()):
            places = _places(cases, out)
        for name, place in places.items():
            with mpi_run.rank_zero_first(mpi_run.world()):
                model = model_of(load_case(name, set))
            results.append(
                _run(
                    model,
                    place,
                    force,
                    resume,
                    threads,
                    None if no_pictures else painter,
                    as_json,
                    estimate_error,
                )
            )
            if results[-1].reason.startswith("interrupted"):
                break
    if as_json:
        summaries = [result.summary | {"directory": str(result.directory)} for result in results]
        print_json(summaries[0] if len(cases) == 1 else {"runs": summaries})
    sys.exit(max(printing.exit_code(result) for result in results))


def _run(
    model, place: Path, force: bool, resume: bool, threads: int, painter, quiet: bool, error: bool
):
    """Solve a case, print its results, draw them, and return its `Result`.

    place : run directory; painter : `PlotProcess`, or None for no pictures; quiet : True to print no results
    error : True to estimate the errors of peaks; force, resume, threads : as for the command `run`
    """
    from fvsolve.cli import printing
    from fvsolve.cli.terminal import run_progress
    from fvsolve.core.run import draw, sink_of, solved

    if text := printing.cost_estimate(model):
        print(visible(text), file=sys.stderr, flush=True)
    with closing(sink_of(model, place, force, resume, threads)) as sink:
        with run_progress(model.case) as progress:
            result = solved(model, sink, progress, threads)
        if error:
            from fvsolve.core.output.summary_file import write_summary
            from fvsolve.studies.peak_error import peak_errors

            name = model.case.name
            peak_errors(
                result,
                model.case,
                lambda text: print(f"{name} again: {text}", file=sys.stderr, flush=True),
            )
            write_summary(result.directory / "summary.json", result.summary)
        if not quiet:
            show(printing.result_text(result))
            sys.stdout.flush()
        if painter is not None:
            draw(result, painter)
    if not quiet:
        show(printing.files_text(result))
    return result


@command("check", order=20)
def check(
    case: SingleCase,
    set: Set = [],  # noqa: B006
    every: Annotated[bool, Option("--all", help="print all rows of long tables")] = False,
    picture: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="picture of the case to draw (.png): scheme with sizes and levels, maps of basins, long "
            "sections with the heads at the start",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Print the contents of a case as read, its initial state and its expected cost."""
    from fvsolve.cli import printing
    from fvsolve.core.run import model_of
    from fvsolve.core.solve.partition import divisible_rows
    from fvsolve.core.step_limits.step_notices import step_limits

    model = model_of(load_case(case, set))
    report_data = model.checks
    report_data["warnings"] += [notice.plain() for notice in step_limits(model)]
    report_data["threads"] = divisible_rows(model)
    if picture is not None:
        from fvsolve.report.case_picture import write_case_picture

        write_case_picture(model, picture)
    present(as_json, report_data, printing.check_text(model.case, report_data, every))


@command("list", order=30)
def list_cases(as_json: Json = False) -> None:
    """List the shipped cases."""
    from fvsolve.case import shipped

    titles = shipped.titles()
    present(as_json, titles, [ResultTable.of("", ["case", "title"], [*titles.items()])])


@command("new", order=40)
def new(
    name: Annotated[
        str | None,
        Argument(metavar="NAME", help="a shipped case, see `fvsolve list`; none with --template"),
    ] = None,
    file: Annotated[
        Path | None, Argument(metavar="FILE", help="file to write (default NAME.toml)")
    ] = None,
    template: Annotated[
        str | None,
        Option(
            metavar="TEMPLATE",
            help="template in place of a shipped case, a case with comments for your own "
            "values: pumping-main, network, street-and-sewer, servo, tank-and-wave or course",
        ),
    ] = None,
) -> None:
    """Copy a shipped case and the files it uses, or write a template: fvsolve new --template TEMPLATE [FILE]."""
    from fvsolve.case import load, shipped

    if template is not None:
        if file is not None:
            raise FvsolveError(
                "a template has no NAME; expected fvsolve new --template TEMPLATE [FILE]"
            )
        paths = shipped.copy_template(template, Path(name or f"{template}.toml"))
        return present(False, None, template_text(paths))
    if name is None:
        raise FvsolveError(
            "NAME is missing; give a shipped case (fvsolve list), "
            f"or --template with one of {', '.join(shipped.templates())}"
        )
    for path in shipped.copy(name, file or Path(f"{name}.toml"), load):
        print(path)


def template_text(paths: list[Path]) -> Iterator[str]:
    """Lines on a written template: its files, and the next commands."""
    yield from map(str, paths)
    case, *studies = paths
    yield f"next: change the values marked >>>, then fvsolve check {case}"
    yield f"fvsolve run {case} && fvsolve report runs/{case.stem}"
    for study in studies:
        yield f"fvsolve study {study} && fvsolve report runs/{study.stem}"


@command("schema", order=50)
def schema() -> None:
    """Print the JSON schema of a case file."""
    from fvsolve.case.schema import schema as made
    from fvsolve.case.schema import schema_text

    print(schema_text(made()))


@command("compare", order=70)
def compare(
    run_a: Annotated[
        Path, Argument(metavar="RUN_A", help="run directory, as written by fvsolve run --out")
    ],
    run_b: Annotated[
        Path, Argument(metavar="RUN_B", help="run directory that is compared with RUN_A")
    ],
    as_json: Json = False,
) -> None:
    """Compare two runs: greatest and rms difference (RUN_B minus RUN_A) of each common probe."""
    from fvsolve.cli import printing
    from fvsolve.core.run import open_run
    from fvsolve.core.run.verdicts import differences

    first = open_run(run_a)
    result = differences(first, open_run(run_b))
    present(as_json, result, printing.difference_text(result, first.summary))


@command("view", order=80)
def view(
    directory: RunDirectory,
    time: Annotated[
        str | None,
        Option(
            metavar="T",
            help='time whose nearest frame is drawn: seconds, or "20 ms" (default the last frame)',
        ),
    ] = None,
    field: Annotated[
        str | None,
        Option(
            help="quantity to draw, such as pressure, head, flow, velocity or depth "
            "(default pressure, or for a case without pipes the first field of its basins or the speed of its "
            "bodies)"
        ),
    ] = None,
    contours: Annotated[
        int,
        Option(
            metavar="N", min=0, max=100, help="number of contour lines on the surfaces of basins"
        ),
    ] = 0,
    animate: Annotated[
        Path | None, Option(metavar="FILE", help="animation of all frames, a .gif or .mp4 file")
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="picture file, or a page .html in which the scene can be "
            "turned (default RUN/view-FIELD.png, with the name of the field)",
        ),
    ] = None,
) -> None:
    """Draw a quantity in all parts at one time, or an animation of all stored times, into a file."""
    from fvsolve.core.run import open_run

    when = quantity_of(time, "time", "--time")
    if animate is not None and not time is out is None:
        raise FvsolveError("--animate draws all times into its own file; remove --time and --out")
    run = open_run(directory)
    print(
        run.view(when, field, out, contours)
        if animate is None
        else run.animate(animate, field, contours)
    )


def _places(cases: list[str], out: Path | None) -> dict[str, Path]:
    """Map each case to its run directory : case -> directory.

    cases : case files or names of shipped cases; out : as the option --out of the command `run`
    Raises FvsolveError if a case is named twice, or if two cases would have the same directory.
    """
    from fvsolve.case import shipped

    paths, taken = {}, {}
    for name in cases:
        stem = shipped.find(name).stem
        place = out if out and len(cases) == 1 else (out or Path("runs")) / stem
        other = taken.setdefault(os.path.normcase(place), name)
        if name in paths or other != name:
            if other == name:
                raise FvsolveError(f"{name} is named twice; name each case once")
            raise FvsolveError(
                f"{other} and {name} would both write {place}; run each case in a command of its own with its own "
                "--out DIR, or rename a case"
            )
        paths[name] = place
    return paths
