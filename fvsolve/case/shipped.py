"""Cases that are shipped with the package: folder, names, paths, titles."""

from __future__ import annotations

import tomllib
from pathlib import Path

from fvsolve.errors import FvsolveError, did_you_mean, listing

SCHEMA = "schema.json"  # file beside the cases; editors use it for completion and checks


def folder() -> Path:
    """Folder of the shipped cases: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "cases"
    return inside if inside.is_dir() else package.parent / "cases"


def names() -> list[str]:
    """Names of the shipped cases, sorted."""
    return sorted(path.stem for path in folder().glob("*.toml"))


def find(name: str) -> Path:
    """Path of an existing file, or of the shipped case of that name. Raises FvsolveError if there is neither."""
    path = Path(name)
    if path.is_file():
        return path
    if name in names():  # even if the working folder has a folder of that name
        return folder() / f"{name}.toml"
    if path.is_dir():
        raise FvsolveError(f"{name} is a folder; expected a case file or one of: {listing(names())}")
    raise FvsolveError(f"no file and no shipped case {name}{did_you_mean(name, names())}; see `fvsolve list`")


def titles() -> dict[str, str]:
    """Title of every shipped case by name."""
    result = {}
    for name in names():
        with open(folder() / f"{name}.toml", "rb") as file:
            result[name] = tomllib.load(file).get("title", "")
    return result
