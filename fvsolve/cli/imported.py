"""A case from an EPANET file, written and talked about. Knows files; leaves the translation to `epanet`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from fvsolve.case import shipped
from fvsolve.cli.app import value_of
from fvsolve.errors import FvsolveError, listing

WAVE_SPEED = "1200 m/s"
SHORT = 'shorter than a cell, for line = "cells" see --shortest'


def write(
    source: Path,
    name: str | None,
    file: Path | None,
    hour: float | None,
    wave_speed: str | None,
    shortest: str | None,
) -> None:
    """Write the case of an EPANET network, its schema beside it; say what is not as EPANET has it."""
    from fvsolve.epanet import import_network

    to = file or Path(f"{name or source.stem}.toml")
    if to.is_dir():
        to = to / f"{name or source.stem}.toml"
    if to.exists():
        raise FvsolveError(f"{to} exists; state another file: fvsolve new NAME FILE --from {source}")
    speed = _positive("--wave-speed", wave_speed or WAVE_SPEED, "velocity")
    least = _positive("--shortest", shortest, "length") if shortest else 0.0
    made = import_network(source, hour or 0.0, speed, least)
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(made.text, encoding="utf-8")
    written = [to]
    described = to.parent / shipped.SCHEMA
    if (shipped.folder() / shipped.SCHEMA).is_file() and not described.exists():
        shutil.copyfile(shipped.folder() / shipped.SCHEMA, described)
        written.append(described)
    for path in written:
        print(path)
    for what, names in [*made.notes, *([(SHORT, made.short)] if made.short else [])]:
        print(f"{what}: {listing(names)}", file=sys.stderr)


def _positive(option: str, given: str, dimension: str) -> float:
    """What an option gives, in SI."""
    from fvsolve.units import parse

    try:
        found = parse(value_of(given), dimension)
        if not found > 0.0:
            raise ValueError(f"{given} is not positive")
    except ValueError as error:
        raise FvsolveError(f"{option}: {error}") from None
    return found
