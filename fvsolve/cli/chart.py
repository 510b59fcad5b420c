"""`fvsolve chart`: work-precision charts of methods and models."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated

import typer

from fvsolve.cli.app import Json, Set, SingleCase, app, load_case, print_json
from fvsolve.cli.study_options import Dask, Jobs, Out, comma_list, folder_of, method_names, progress_line
from fvsolve.errors import FvsolveError
from fvsolve.studies.result_table import Column, ResultTable


@app.command()
def chart(
    case: SingleCase,
    scheme: Annotated[
        str | None, typer.Option(metavar="LIST", help="schemes to compare (default upwind,muscl,upwind5,weno5)")
    ] = None,
    method: Annotated[
        str | None, typer.Option(metavar="LIST", help="methods to compare (default a selection that suits the case)")
    ] = None,
    cells: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help="numbers of cells to compare, for example 50,100,200, of the pipe with the longest travel time or of "
            "the basin side with most cells (default up to five numbers that suit the case)",
        ),
    ] = None,
    rtol: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help="relative tolerances to compare, for example 1e-3,1e-6, for a case without pipes and basins "
            "(default 1e-2 to 1e-10)",
        ),
    ] = None,
    step: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help="fixed time steps [s] to compare, for example 1e-3,1e-4, for a case without cells "
            "(default seven or eight steps)",
        ),
    ] = None,
    target: Annotated[
        float | None,
        typer.Option(
            metavar="ERROR",
            help="greatest accepted error of a probe, as a fraction of its range, for which the cheapest settings or "
            "model are printed (default none, or 0.01 with --models)",
        ),
    ] = None,
    models: Annotated[
        bool, typer.Option("--models", help="compare models, from lumped volumes to cells, instead of methods")
    ] = False,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Chart error against CPU time and work for schemes, methods and resolutions; list the cheapest for each error."""
    from fvsolve.studies.accuracy.chart import chart as study
    from fvsolve.studies.accuracy.work_precision import write_chart

    loaded = load_case(case, set, scheme, method)
    if target is not None and not 0.0 < target < 1.0:
        raise FvsolveError(
            f"--target: {target:g} is not a valid error. Expected a fraction of the range, between 0 and 1"
        )
    if models:
        several_jobs = None if jobs == 1 else jobs
        _refuse(scheme=scheme, method=method, cells=cells, rtol=rtol, step=step, jobs=several_jobs, dask=dask, out=out)
        from fvsolve.cli.models_output import show_models
        from fvsolve.studies.accuracy.model_hierarchy import DEFAULT_TARGET

        return show_models(loaded, target or DEFAULT_TARGET, as_json)
    folder = folder_of(loaded, "chart", out)
    sizes = [_numbers(name, text) for name, text in (("cells", cells), ("rtol", rtol), ("step", step))]
    with progress_line() as progress:
        result = study(
            loaded,
            None,
            comma_list(scheme, "--scheme"),
            method_names(method),
            *sizes,
            target,
            folder,
            progress,
            jobs,
            dask,
        )
    paths = write_chart(result, folder)
    if as_json:
        print_json(result.plain() | {"files": paths})
    else:
        _show(result, paths)


def _refuse(**options) -> None:
    """Raise FvsolveError if options are given that have no effect with --models.

    options : name of an option -> its value, None if it is not given
    """
    names = [f"--{name}" for name, value in options.items() if value is not None]
    if names:
        raise FvsolveError(
            f"{', '.join(names)}: not valid with --models, which compares models of the case with the settings of "
            f"[numerics] and writes no files. Remove {'these options' if len(names) > 1 else 'this option'}; "
            "keys of [numerics] can be changed with --set"
        )


def _numbers(name: str, text: str | None) -> list | None:
    """Numbers of a list such as `50,100`; None without a list.

    name : name of the option that gives the list
    Raises FvsolveError for a word that is not a positive number, or for `cells` not a positive whole number.
    """
    numbers = []
    for word in comma_list(text) or ():
        try:
            value = int(word) if name == "cells" else float(word)
        except ValueError:
            value = 0
        if not 0 < value < float("inf"):
            expected = "a whole number above 0" if name == "cells" else "a number above 0"
            raise FvsolveError(f"--{name}: {word} is not {expected}")
        numbers.append(value)
    return numbers or None


def _show(result, paths) -> None:
    from fvsolve.cli.terminal import console, line, print_sheet

    terminal = console()
    floor = result.floor["trajectory"]
    line(
        terminal,
        f"{result.case}: error over the trajectory (mean over time, of the probe with the largest relative error)",
    )
    print_sheet(ResultTable(FRONT, [vars(row) for row in result.front]), terminal)
    own = result.stands
    line(
        terminal,
        f"default: {result.default}; times and cell updates are interpolated between the runs of each pair of scheme "
        "and method",
    )
    if own is not None:
        outcome = f"error {own.trajectory:.2g} in {own.seconds * 1e3:.3g} ms" if own.ok else own.reason
        line(terminal, f"default at its own resolution, {own.setting.fineness}: {outcome}")
    line(
        terminal,
        f"errors against {result.reference}; {result.second} differs from it by {floor:.2g}: "
        "smaller errors have no meaning",
    )
    if result.left_out:
        line(terminal, f"left out, because they cannot model cavities in pipes: {', '.join(result.left_out)}")
    for text in result.told:
        line(terminal, f"no reference: {text}")
    for point in result.failed:
        line(terminal, f"failed: {point.setting.name}, {point.setting.fineness}: {point.reason}")
    line(terminal, f"compiling or loading took {result.compile_seconds:.2g} s, not included in the times above"
         + (f"; points reused from earlier runs: {result.reused}" if result.reused else ""))  # fmt: skip
    line(terminal, "wrote " + ", ".join(str(path) for path in paths))
    if result.aim is not None:
        _show_target(terminal, result)


def _ms(key: str) -> Callable[[Mapping], str]:
    """Function that formats the time [s] in the column `key` of a row in milliseconds."""
    return lambda row: "-" if row[key] is None else f"{row[key] * 1e3:.3g}"


def _times(row: Mapping) -> str:
    """Text of the ratio of CPU times, default setting over cheapest setting, at the error of a row.

    It is "-" if the default setting does not reach this error.
    """
    default = row["default_seconds"]
    return "-" if default is None else f"{default / row['seconds']:.2g}"


FRONT = (
    Column("target", "error", ".0e"),
    Column("name", "cheapest by CPU time", lambda row: f"{row['name']}, {row['fineness']}" if row["name"] else "none"),
    Column("seconds", "ms", _ms("seconds")),
    Column("by_updates", "cheapest by updates", lambda row: row["by_updates"] or "none"),
    Column("updates", words=".2e"),
    Column("default", words=lambda row: "not reached" if row["default_seconds"] is None else row["default_fineness"]),
    Column("default_seconds", "ms", _ms("default_seconds")),
    Column("times", words=_times),
    Column("default_updates", "updates", ".2e"),
)


def _show_target(terminal, result) -> None:
    from fvsolve.cli.terminal import line

    point = result.aim.point
    line(
        terminal,
        f"\n# error {point.trajectory:.2g} (target {result.aim.target:g}), {point.seconds * 1e3:.3g} ms; use in",
    )
    line(terminal, "# [numerics] in place of scheme, method, courant, step, rtol and cell_time")
    for text in result.aim.toml_lines():
        line(terminal, text)
