"""A case from an EPANET file, written and talked about. Knows files; leaves the translation to `epanet`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from fvsolve.case import shipped
from fvsolve.cli.app import value_of
from fvsolve.errors import FvsolveError, listing

WAVE_SPEED = "1200 m/s"


def write(source: Path, name: str | None, file: Path | None, hour: float | None, wave_speed: str | None) -> None:
    """Write the case of an EPANET network, its schema beside it; say what is not as EPANET has it."""
    from fvsolve.epanet import import_network
    from fvsolve.units import parse

    to = file or Path(f"{name or source.stem}.toml")
    if to.is_dir():
        to = to / f"{name or source.stem}.toml"
    if to.exists():
        raise FvsolveError(f"{to} exists; state another file: fvsolve new NAME FILE --from {source}")
    try:
        speed = parse(value_of(wave_speed or WAVE_SPEED), "velocity")
        if not speed > 0.0:
            raise ValueError(f"{wave_speed} is not positive")
    except ValueError as error:
        raise FvsolveError(f"--wave-speed: {error}") from None
    made = import_network(source, hour or 0.0, speed)
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(made.text, encoding="utf-8")
    written = [to]
    described = to.parent / shipped.SCHEMA
    if (shipped.folder() / shipped.SCHEMA).is_file() and not described.exists():
        shutil.copyfile(shipped.folder() / shipped.SCHEMA, described)
        written.append(described)
    for path in written:
        print(path)
    for what, names in made.notes:
        print(f"{what}: {listing(names)}", file=sys.stderr)
