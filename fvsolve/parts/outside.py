"""Parts of others: in a folder that is named, or offered by an installed package. Knows folders; knows no part."""

from __future__ import annotations

import os
import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.metadata import entry_points
from importlib.util import module_from_spec
from pathlib import Path

from fvsolve.doors import PATH, door
from fvsolve.errors import FvsolveError
from fvsolve.jit import add_sources
from fvsolve.units import show

GROUP = "fvsolve.parts"
NAMED = "FVSOLVE_PARTS"  # variable that tells other processes of folders that are named
HOME = "fvsolve_parts"  # package in which folders that are named appear


@door(folder=PATH)
def register(folder: str | os.PathLike) -> None:
    """Make the part in a folder one like any other: `part.py`, with `lower.py` and `law.py` where it has a law.

    Modules of the folder import one another relatively. Its sources join the cache: an edit compiles them anew.
    Processes that this one starts know it too; the environment variable FVSOLVE_PARTS names such folders to any.
    Raises FvsolveError where there is no part.py, or what it declares has a name that is taken.
    """
    path = Path(folder).resolve()
    if not (path / "part.py").is_file():
        raise FvsolveError(f"register: {show(str(folder))} has no part.py; wanted the folder of a part")
    package = f"{HOME}.{path.name}"
    for name, places in ((HOME, []), (package, [str(path)])):
        if name not in sys.modules:
            spec = ModuleSpec(name, None, is_package=True)
            spec.submodule_search_locations = places
            sys.modules[name] = module_from_spec(spec)
    if sys.modules[package].__path__ != [str(path)]:
        raise FvsolveError(f"register: a part in a folder {show(path.name)} is there already; wanted another name")
    declare(package)
    os.environ[NAMED] = os.pathsep.join(dict.fromkeys([*named(), str(path)]))


def named() -> list[str]:
    """Folders of parts that the environment names."""
    return [folder for folder in os.environ.get(NAMED, "").split(os.pathsep) if folder]


def declare(package: str) -> None:
    """Import the declaration of a part's package, and let its sources be compiled and cached."""
    (path, *_) = import_module(package).__path__
    add_sources(Path(path))
    import_module(f"{package}.part")


def declare_offered() -> None:
    """Declare what installed packages offer and the environment names; a warning tells of what cannot be read."""
    found = [(f"{one.name} of the entry points {GROUP}", declare, one.value) for one in entry_points(group=GROUP)]
    for said, read, place in [*found, *((NAMED, register, folder) for folder in named())]:
        try:
            read(place)
        except Exception as error:
            text = f"{said}: the part {place} cannot be read: {error}; mend it or take it away"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
