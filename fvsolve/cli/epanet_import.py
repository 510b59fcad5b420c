"""`fvsolve import`: an EPANET network as a case file."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.case import shipped
from fvsolve.cli.app import app, value_of
from fvsolve.errors import FvsolveError, listing

SHORT = (
    'pipes shorter than a cell, which make steps small with pipe_model = "finite-volume" '
    "(--min-pipe-length lengthens them)"
)


@app.command("import")
def import_(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="EPANET network to import, for example town.inp")],
    case: Annotated[
        Path | None,
        typer.Argument(
            metavar="CASE",
            help="case file to write, or its folder (default the name of FILE with .toml, in the current folder)",
        ),
    ] = None,
    hour: Annotated[
        float, typer.Option(metavar="H", help="hours from the start of the EPANET run to the initial state of the case")
    ] = 0.0,
    wave_speed: Annotated[
        str, typer.Option(metavar="A", help="wave speed of all pipes, in m/s or with a unit")
    ] = "1200 m/s",
    min_pipe_length: Annotated[
        str | None,
        typer.Option(
            metavar="L",
            help='length to which shorter pipes are lengthened, for example "10 m" (default none: pipes keep their '
            "lengths)",
        ),
    ] = None,
) -> None:
    """Import an EPANET network: write its case file and print all differences from EPANET."""
    from fvsolve.epanet import import_network

    to = case or Path(f"{source.stem}.toml")
    if to.is_dir():
        to = to / f"{source.stem}.toml"
    if not to.suffix:
        to = to.with_suffix(".toml")
    if to.exists():
        raise FvsolveError(f"{to} exists. Give another file: fvsolve import {source} CASE")
    speed = _positive("--wave-speed", wave_speed, "velocity")
    shortest = _positive("--min-pipe-length", min_pipe_length, "length") if min_pipe_length else 0.0
    network = import_network(source, hour, speed, shortest)
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(network.text, encoding="utf-8")
    written = [to]
    described = to.parent / shipped.SCHEMA
    if (shipped.folder() / shipped.SCHEMA).is_file() and not described.exists():
        shutil.copyfile(shipped.folder() / shipped.SCHEMA, described)
        written.append(described)
    for path in written:
        print(path)
    for text, names in [*network.notes, *([(SHORT, network.short_pipes)] if network.short_pipes else [])]:
        print(f"{text}: {listing(names)}", file=sys.stderr)


def _positive(option: str, text: str, dimension: str) -> float:
    """Value [SI] of an option from its text; raises FvsolveError if it is not positive."""
    from fvsolve.units import parse

    try:
        value = parse(value_of(text), dimension)
        if not value > 0.0:
            raise ValueError(f"{text} is not positive")
    except ValueError as error:
        raise FvsolveError(f"{option}: {error}") from None
    return value
