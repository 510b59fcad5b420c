"""Import of an EPANET network as a case file."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from fvsolve.case import shipped
from fvsolve.cli.app import value_of
from fvsolve.errors import FvsolveError, listing

WAVE_SPEED = "1200 m/s"
SHORT = 'shorter than a cell: with line = "cells" use --shortest'


def write(
    source: Path,
    name: str | None,
    file: Path | None,
    hour: float | None,
    wave_speed: str | None,
    shortest: str | None,
) -> None:
    """Write the case of an EPANET network and its schema, and print all differences from EPANET."""
    from fvsolve.epanet import import_network

    to = file or Path(f"{name or source.stem}.toml")
    if to.is_dir():
        to = to / f"{name or source.stem}.toml"
    if to.exists():
        raise FvsolveError(f"{to} exists. Give another file: fvsolve new NAME FILE --from {source}")
    speed = _positive("--wave-speed", wave_speed or WAVE_SPEED, "velocity")
    least = _positive("--shortest", shortest, "length") if shortest else 0.0
    network = import_network(source, hour or 0.0, speed, least)
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(network.text, encoding="utf-8")
    written = [to]
    described = to.parent / shipped.SCHEMA
    if (shipped.folder() / shipped.SCHEMA).is_file() and not described.exists():
        shutil.copyfile(shipped.folder() / shipped.SCHEMA, described)
        written.append(described)
    for path in written:
        print(path)
    for text, names in [*network.notes, *([(SHORT, network.short)] if network.short else [])]:
        print(f"{text}: {listing(names)}", file=sys.stderr)


def _positive(option: str, text: str, dimension: str) -> float:
    """Value of an option in SI. Raises FvsolveError if it is not positive."""
    from fvsolve.units import parse

    try:
        value = parse(value_of(text), dimension)
        if not value > 0.0:
            raise ValueError(f"{text} is not positive")
    except ValueError as error:
        raise FvsolveError(f"{option}: {error}") from None
    return value
