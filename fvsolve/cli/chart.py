"""`fvsolve chart`: what accuracy costs. Knows the terminal; computes nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated

import typer

from fvsolve.cli.app import Json, One, Set, app, load_case, print_json
from fvsolve.cli.studying import Dask, Jobs, Out, folder_of, listed, methods_of, told
from fvsolve.errors import FvsolveError
from fvsolve.studies.sheet import Column, Sheet


@app.command()
def chart(
    case: One,
    scheme: Annotated[str | None, typer.Option(metavar="LIST", help="upwind,muscl,upwind5,weno5 by default")] = None,
    method: Annotated[str | None, typer.Option(metavar="LIST", help="a telling few by default")] = None,
    cells: Annotated[
        str | None, typer.Option(metavar="LIST", help="of the longest pipe, or side of a basin: 50,100,200")
    ] = None,
    rtol: Annotated[str | None, typer.Option(metavar="LIST", help="of a case without pipes: 1e-3,1e-6")] = None,
    step: Annotated[
        str | None, typer.Option(metavar="LIST", help="the same for methods that estimate no error")
    ] = None,
    target: Annotated[float | None, typer.Option(metavar="ERROR", help="print the lines for [numerics]")] = None,
    models: Annotated[bool, typer.Option("--models", help="models of the scene in place of methods")] = False,
    jobs: Jobs = 1,
    dask: Dask = None,
    set: Set = [],  # noqa: B006
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Error against CPU time and work over schemes, methods and resolution; the cheapest setting for each error."""
    from fvsolve.studies.accuracy.chart import chart as study
    from fvsolve.studies.accuracy.files import write

    found = load_case(case, set, scheme, method)
    if target is not None and not 0.0 < target < 1.0:
        raise FvsolveError(f"--target: {target:g} is no error; wanted a part of the range, above 0 and below 1")
    if models:
        several = None if jobs == 1 else jobs
        _refuse(scheme=scheme, method=method, cells=cells, rtol=rtol, step=step, jobs=several, dask=dask, out=out)
        from fvsolve.cli.models import show_models
        from fvsolve.studies.accuracy.models import TARGET

        return show_models(found, target or TARGET, as_json)
    folder = folder_of(found, "chart", out)
    sizes = [_numbers(name, text) for name, text in (("cells", cells), ("rtol", rtol), ("step", step))]
    with told() as progress:
        made = study(found, None, listed(scheme, "--scheme"), methods_of(method), *sizes, target, folder, progress,
                     jobs, dask)  # fmt: skip
    paths = write(made, folder)
    if as_json:
        print_json(made.plain() | {"files": paths})
    else:
        _show(made, paths)


def _refuse(**given) -> None:
    """FvsolveError that names what was given and means nothing beside --models."""
    names = [f"--{name}" for name, value in given.items() if value is not None]
    if names:
        raise FvsolveError(
            f"{', '.join(names)}: not with --models, which runs models of the scene as [numerics] says and writes no "
            "files; leave it out, or state it with --set"
        )


def _numbers(name: str, text: str | None) -> list | None:
    """`50,100` as numbers; FvsolveError that names what is none."""
    found = []
    for word in listed(text) or ():
        try:
            value = int(word) if name == "cells" else float(word)
        except ValueError:
            value = 0
        if not 0 < value < float("inf"):
            wanted = "a whole number above 0" if name == "cells" else "a number above 0"
            raise FvsolveError(f"--{name}: {word} is not {wanted}")
        found.append(value)
    return found or None


def _show(made, paths) -> None:
    from fvsolve.cli.terminal import console, line, sheet

    where = console()
    floor = made.floor["trajectory"]
    line(where, f"{made.case}: error over the trajectory (mean over time, of the worst probe's range)")
    sheet(Sheet(FRONT, [vars(row) for row in made.front]), where)
    stands = made.stands
    line(where, f"default: {made.default}; times and updates between two runs of a curve are interpolated")
    if stands is not None:
        said = f"error {stands.trajectory:.2g} in {stands.seconds * 1e3:.3g} ms" if stands.ok else stands.reason
        line(where, f"default as it stands, {stands.setting.fineness}: {said}")
    line(
        where,
        f"errors against {made.reference}; {made.second} differs from it by {floor:.2g}: below, the chart says nothing",
    )
    if made.left_out:
        line(where, f"left out: {', '.join(made.left_out)}, which do not follow cavities in pipes")
    for text in made.told:
        line(where, f"no reference: {text}")
    for point in made.failed:
        line(where, f"failed: {point.setting.name}, {point.setting.fineness}: {point.reason}")
    line(where, f"compiled or loaded before in {made.compile_seconds:.2g} s, in no time above"
         + (f"; {made.reused} points were known" if made.reused else ""))  # fmt: skip
    line(where, "wrote " + ", ".join(str(path) for path in paths))
    if made.aim is not None:
        _show_aim(where, made)


def _ms(key: str) -> Callable[[Mapping], str]:
    """What says the seconds of a row in milliseconds."""
    return lambda row: "-" if row[key] is None else f"{row[key] * 1e3:.3g}"


def _times(row: Mapping) -> str:
    """How many times as long the default takes."""
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


def _show_aim(where, made) -> None:
    from fvsolve.cli.terminal import line

    point = made.aim.point
    line(
        where, f"\n# error {point.trajectory:.2g} of {made.aim.target:g} asked, {point.seconds * 1e3:.3g} ms; stands in"
    )
    line(where, "# [numerics] in place of scheme, method, courant, step, rtol and cell_time")
    for text in made.aim.lines():
        line(where, text)
