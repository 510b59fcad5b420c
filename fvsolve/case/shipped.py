"""The cases that come with the package. Knows where they lie; knows not what they say."""

from __future__ import annotations

import shutil
import tomllib
from filecmp import cmp
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


def copy(name: str, to: Path) -> list[Path]:
    """Copy a shipped case to `to` and the files it uses beside it; FvsolveError rather than overwrite one."""
    from fvsolve.case import load

    if name not in names():
        raise FvsolveError(f"no shipped case {name}{did_you_mean(name, names())}; cases are {listing(names())}")
    if to.is_dir():
        to = to / f"{name}.toml"
    source = folder() / f"{name}.toml"
    pairs = [(source, to)]
    pairs += [(Path(path), to.parent / Path(path).absolute().relative_to(folder())) for path in load(source).files]
    described = to.parent / SCHEMA
    pairs = pairs[:1] + [pair for pair in pairs[1:] if not (pair[1].is_file() and cmp(*pair, shallow=False))]
    for _, target in pairs:
        if target.exists():
            raise FvsolveError(f"{target} exists; state another file: fvsolve new {name} FILE")
    if (folder() / SCHEMA).is_file() and not described.exists():
        pairs.append((folder() / SCHEMA, described))
    for path, target in pairs:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return [target for _, target in pairs]
