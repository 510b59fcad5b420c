"""Copying of a shipped case with all files that it uses."""

from __future__ import annotations

import shutil
from filecmp import cmp
from pathlib import Path

from fvsolve.case.load import load
from fvsolve.case.shipped import SCHEMA, folder, names
from fvsolve.errors import FvsolveError, did_you_mean, listing


def copy(name: str, to: Path) -> list[Path]:
    """Copy a shipped case to the file `to`, and its other files beside it; returns the paths of the copies.

    `to` may also be a folder. The schema of case files is copied too, if it is not there. Raises FvsolveError for an
    unknown case, if `to` exists, and if another of these files exists with other contents.
    """
    if name not in names():
        raise FvsolveError(f"no shipped case {name}{did_you_mean(name, names())}; cases are {listing(names())}")
    if to.is_dir():
        to = to / f"{name}.toml"
    source = folder() / f"{name}.toml"
    pairs = [(source, to)]
    pairs += [(Path(path), to.parent / Path(path).absolute().relative_to(folder())) for path in load(source).files]
    schema = to.parent / SCHEMA
    pairs = pairs[:1] + [pair for pair in pairs[1:] if not (pair[1].is_file() and cmp(*pair, shallow=False))]
    for _, target in pairs:
        if target.exists():
            raise FvsolveError(f"{target} exists; give another file: fvsolve new {name} FILE")
    if (folder() / SCHEMA).is_file() and not schema.exists():
        pairs.append((folder() / SCHEMA, schema))
    for path, target in pairs:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return [target for _, target in pairs]
