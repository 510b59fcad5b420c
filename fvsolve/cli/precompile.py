"""`fvsolve precompile`: compilation ahead of runs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json


@app.command()
def precompile(
    cases: Annotated[
        list[str],
        typer.Option(
            "--for",
            metavar="CASE",
            help="case file or shipped case to compile for; repeat the option for more (default all shipped cases)",
        ),
    ] = [],  # noqa: B006
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="number of processes (default number of processors)")
    ] = None,
    as_json: Json = False,
) -> None:
    """Compile the functions that cases need on this machine, so that later runs start at once."""
    from fvsolve.case import load, shipped
    from fvsolve.cli import terminal
    from fvsolve.cli.progress import progress_bar
    from fvsolve.run.precompilation import warm as warmed

    paths = [shipped.find(name) for name in cases or shipped.names()]
    for path in paths:  # report faults of a case before compiling
        load(path)
    with progress_bar("compiling") as progress:
        result = warmed(paths, not cases, jobs, progress)
    if as_json:
        print_json(asdict(result))
        return
    console = terminal.console()
    text = (
        f"{result.compiled} functions compiled in {result.seconds:.0f} s"
        if result.compiled
        else "all functions were compiled already"
    )
    terminal.line(
        console,
        f"{text}; the cache holds {result.functions} functions, {result.bytes / 1e6:.1f} MB, for {result.target}",
    )
    terminal.line(console, f"{result.directory}")
