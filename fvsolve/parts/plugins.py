"""Plugins: parts in a folder or an installed package, and limiters of installed packages."""

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from typing import Any

from fvsolve.argument_checks import PATH, validated
from fvsolve.core.schemes import LIMITERS_VARIABLE
from fvsolve.declarations import OUTSIDE_FOLDERS, EntryPoint, entry_points, unreadable
from fvsolve.errors import FvsolveError
from fvsolve.jit import add_sources
from fvsolve.units import show

GROUP, LIMITERS = "fvsolve.parts", "fvsolve.limiters"  # entry points
# environment variable with the folders of registered parts, for other processes
VARIABLE = "FVSOLVE_PARTS"
FEATURE = re.compile(r"^\s*(?:from|import) fvsolve\.features\.(\w+)", re.MULTILINE)


@validated(folder=PATH)
def register_part(folder: str | os.PathLike[str]) -> None:
    """Register the part in a folder: `part.py`, and `lower.py` and `law.py` if the part has a compiled law.

    Modules of the folder use relative imports. Their sources belong to the key of the compilation cache, so they are
    recompiled after an edit.
    Child processes register the part too; the environment variable FVSOLVE_PARTS lists the folders.
    Raises FvsolveError if there is no part.py, or if the name of the part or of its folder exists already.
    """
    path = Path(folder).resolve()
    if not (path / "part.py").is_file():
        raise FvsolveError(
            f"register_part: {show(str(folder))} has no part.py; expected the folder of a part"
        )
    package = f"{OUTSIDE_FOLDERS}.{path.name}"
    for name, places in ((OUTSIDE_FOLDERS, []), (package, [str(path)])):
        if name not in sys.modules:
            spec = ModuleSpec(name, None, is_package=True)
            spec.submodule_search_locations = places
            sys.modules[name] = module_from_spec(spec)
    if sys.modules[package].__path__ != [str(path)]:
        raise FvsolveError(
            f"register_part: a part in a folder {show(path.name)} exists already; expected another name"
        )
    declare(package)
    os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys([*registered_folders(), str(path)]))


def registered_folders() -> list[str]:
    """Folders of registered parts, from the environment variable FVSOLVE_PARTS."""
    return [folder for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]


def declare(package: str) -> None:
    """Import the declaration of the part in a package, and add its sources to the compilation cache."""
    (path, *_) = import_module(package).__path__
    folder = Path(path)
    add_sources(folder, called=called_features(folder))
    import_module(f"{package}.part")


def called_features(folder: Path) -> list[Path]:
    """Folders of the features that the modules of a folder import, whose compiled functions they may call."""
    texts = [path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.py"))]
    names = sorted({name for text in texts for name in FEATURE.findall(text)})
    return [Path(import_module(f"fvsolve.features.{name}").__path__[0]) for name in names]


def installed_limiters() -> Iterator[tuple[str, Callable[[Any], None], Any]]:
    """Yield the limiters of installed packages and of the environment variable, as `declare_installed` reads them."""
    found = entry_points(LIMITERS)
    if not found and not os.environ.get(LIMITERS_VARIABLE):
        return
    from fvsolve.parts import own_limiters

    def register(entry: EntryPoint) -> None:
        own_limiters.register_limiter(entry.name, entry.load())

    yield from ((f"entry points {LIMITERS} of {entry.package}", register, entry) for entry in found)
    yield from (
        (LIMITERS_VARIABLE, own_limiters.read_entry, entry) for entry in own_limiters.entries()
    )


def declare_installed() -> None:
    """Declare parts and limiters of installed packages and of environment variables; warn of unreadable ones."""
    offered: list[tuple[str, Callable[[Any], None], Any]] = [
        *(
            (f"{entry.name} of the entry points {GROUP} of {entry.package}", declare, entry.place)
            for entry in entry_points(GROUP)
        ),
        *((VARIABLE, register_part, folder) for folder in registered_folders()),
        *installed_limiters(),
    ]
    for source, read, place in offered:
        try:
            read(place)
        except Exception as error:
            warnings.warn(unreadable(source, place, error), RuntimeWarning, stacklevel=2)
