"""`fvsolve warm`. Knows the terminal; leaves the compiling to `run`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from fvsolve.cli.app import Json, app, print_json


@app.command()
def warm(
    cases: Annotated[list[str], typer.Option("--for", metavar="CASE", help="only what these cases ask for")] = [],  # noqa: B006
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="processes (default: as many as processors)")
    ] = None,
    as_json: Json = False,
) -> None:
    """Compile for this machine what all shipped cases ask for, so that no run waits for it."""
    from fvsolve.case import load, shipped
    from fvsolve.cli import terminal
    from fvsolve.cli.progress import counted
    from fvsolve.run.warming import warm as warmed

    paths = [shipped.find(name) for name in cases or shipped.names()]
    for path in paths:  # all that is wrong with one is said before anything is compiled
        load(path)
    with counted("compiling") as progress:
        found = warmed(paths, not cases, jobs, progress)
    if as_json:
        print_json(asdict(found))
        return
    where = terminal.console()
    said = (
        f"{found.compiled} functions compiled in {found.seconds:.0f} s"
        if found.compiled
        else "nothing was left to compile"
    )
    terminal.line(where, f"{said}; {found.functions} are kept, {found.bytes / 1e6:.1f} MB, for {found.target}")
    terminal.line(where, f"{found.directory}")
