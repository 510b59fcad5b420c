"""The cases that come with the package. Knows where they lie; knows not what they say."""

from __future__ import annotations

import tomllib
from pathlib import Path

from fvsolve.errors import FvsolveError, did_you_mean, listing

SCHEMA = "schema.json"  # beside the cases: what editors complete and check them by


def folder() -> Path:
    """Where the cases are: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "cases"
    return inside if inside.is_dir() else package.parent / "cases"


def names() -> list[str]:
    """Names of the shipped cases, sorted."""
    return sorted(path.stem for path in folder().glob("*.toml"))


def find(name: str) -> Path:
    """The file that is meant: one that exists, else a shipped case of that name. FvsolveError for neither."""
    path = Path(name)
    if path.is_file():
        return path
    if name in names():  # whatever folder of that name may stand here
        return folder() / f"{name}.toml"
    if path.is_dir():
        raise FvsolveError(f"{name} is a folder; wanted a case file or one of: {listing(names())}")
    raise FvsolveError(f"no file and no shipped case {name}{did_you_mean(name, names())}; see `fvsolve list`")


def titles() -> dict[str, str]:
    """Name -> title of every shipped case."""
    found = {}
    for name in names():
        with open(folder() / f"{name}.toml", "rb") as file:
            found[name] = tomllib.load(file).get("title", "")
    return found
