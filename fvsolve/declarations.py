"""Index of declarations: objects that the package, installed packages and files of a user declare under a name.

A declaration is found by its header in the text of a module, or by an entry point of an installed package. Its module
is imported at its first use.
"""

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any, NamedTuple, TypeVar
from zlib import crc32

from fvsolve.errors import FvsolveError, did_you_mean, listing

PACKAGE = Path(__file__).parent
OUTSIDE_FOLDERS = "fvsolve_parts"  # package in which registered folders of parts appear
Declared = TypeVar("Declared")


def declared(noun: str, name: str = "", **options: Any) -> Callable[[Declared], Declared]:
    """Decorator that is the header of a declaration. It returns the object unchanged: the index reads its text.

    noun : of the index, such as "study"; name : that of the function or class if left out; options : of the index
    """
    return lambda value: value


def header_of(noun: str) -> re.Pattern[str]:
    """Regular expression of a header `@declared("NOUN", "NAME")`, further decorators, and the class or function."""
    # in one line or in several, as a formatter leaves it
    head = rf'\n@declared\(\s*"{noun}"(?:,\s*"(?P<name>[\w-]+)")?[^()]*\)\n'
    return re.compile(head + r"(?:[@ )].*\n)*(?:class|def) (?P<attribute>\w+)")


def headers(
    patterns: Iterable[str], header: re.Pattern[str]
) -> Iterator[tuple[str, re.Match[str]]]:
    """Headers in the files of the package that match glob patterns: name of the module, match."""
    for pattern in patterns:
        for path in sorted(PACKAGE.glob(pattern)):
            name = ".".join((PACKAGE.name, *path.relative_to(PACKAGE).with_suffix("").parts))
            for match in header.finditer(path.read_text(encoding="utf-8")):
                yield name, match


class EntryPoint(NamedTuple):
    """Entry point of an installed package: a line `name = place` of a group; place : MODULE or MODULE:OBJECT."""

    package: str
    group: str
    name: str
    place: str

    def __str__(self) -> str:
        return f"{self.name} = {self.place}"

    def load(self) -> Any:
        """Module or object at the place."""
        module, _, attribute = self.place.partition(":")
        return member(import_module(module.strip()), attribute.strip())


def member(module: ModuleType, attribute: str) -> Any:
    """Object of a module by its qualified name, such as "Class.method"; the module for ""."""
    value: Any = module
    for name in filter(None, attribute.split(".")):
        value = getattr(value, name)
    return value


# group of entry points -> noun; complete, although the indices are made when their modules are imported
GROUPS = {
    "fvsolve.case_tables": "case table",
    "fvsolve.commands": "command",
    "fvsolve.exact_solutions": "exact solution",
    "fvsolve.features": "feature",
    "fvsolve.limiters": "limiter",
    "fvsolve.parts": "part",
    "fvsolve.sinks": "sink",
    "fvsolve.studies": "study",
}


def entry_points(group: str = "") -> list[EntryPoint]:
    """Entry points of a group, or of all groups, of all installed packages."""
    found = _entry_points_on(tuple(sys.path))
    return [entry for entry in found if group in ("", entry.group)]


@cache
def _entry_points_on(path: tuple[str, ...]) -> list[EntryPoint]:
    """Entry points of the groups `fvsolve.*`, from the files of packages in the folders of `path`.

    The module importlib.metadata would take a fifth of the time of `fvsolve --help`. A package that is installed twice
    counts once, as at an import. An unknown group causes a warning.
    """
    packages: dict[str, str] = {}
    for folder in path:
        try:
            names = os.listdir(folder or ".")
        except NotADirectoryError:  # a zip file
            from importlib.metadata import distributions

            for package in distributions(path=[folder]):
                text = package.read_text("entry_points.txt") or ""
                if "[fvsolve" in text:
                    packages.setdefault(package.name, text)
            continue
        except OSError:
            continue
        for name in sorted(name for name in names if name.endswith((".dist-info", ".egg-info"))):
            try:
                with open(os.path.join(folder, name, "entry_points.txt"), encoding="utf-8") as file:
                    text = file.read()
            except (OSError, UnicodeDecodeError):  # most packages have no such file
                text = ""
            packages.setdefault(name.partition("-")[0], text)
    found = [
        entry
        for name, text in packages.items()
        if "[fvsolve" in text
        for entry in _parsed(name, text)
    ]
    for owner, group in dict.fromkeys((entry.package, entry.group) for entry in found):
        hint = did_you_mean(group, GROUPS)
        if group not in GROUPS and (hint or group.startswith("fvsolve.")):
            expected = hint or f"; expected one of {', '.join(GROUPS)}"
            text = f"unknown group of entry points {group} of {owner}{expected}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
    return found


def _parsed(package: str, text: str) -> Iterator[EntryPoint]:
    group = ""
    for line in filter(None, (line.strip() for line in text.splitlines())):
        if line.startswith("["):
            group = line.strip("[] ")
        elif "=" in line and group.startswith("fvsolve") and not line.startswith(("#", ";")):
            name, _, place = line.partition("=")
            yield EntryPoint(package, group, name.strip(), place.partition("[")[0].strip())


def unreadable(source: str, place: object, error: object) -> str:
    """Text about a declaration that cannot be read: its source, the fault and the remedy."""
    return f"{source}: {place} cannot be read: {error}; correct or remove it"


class Declaration(NamedTuple):
    """Declaration of an object: noun, name, module or file of Python, qualified name of the object in it.

    options : further groups of the header; source : place of the declaration, for messages, "" in this package
    """

    noun: str
    name: str
    module: str
    attribute: str
    options: dict[str, str]
    source: str = ""

    @property
    def place(self) -> str:
        """Module and object, as in an entry point."""
        return f"{self.module}:{self.attribute}"

    def load(self) -> Any:
        """Import the module, and return the object. Raises FvsolveError if a module outside the package fails."""
        try:
            module = (
                _module_of_file(self.module)
                if self.module.endswith(".py")
                else import_module(self.module)
            )
            return member(module, self.attribute)
        except (Exception, SystemExit) as error:
            if not self.source:
                raise
            raise FvsolveError(unreadable(self.source, self.place, error)) from error

    def text(self) -> str:
        """Text of the module, which is not imported; "" if it has none."""
        try:
            return Path(
                self.module if self.module.endswith(".py") else _path_of(self.module)
            ).read_text("utf-8")
        except (ImportError, OSError, ValueError):
            return ""


def _path_of(module: str) -> str:
    """Path of a module that is not imported, nor are the packages that contain it. Raises ImportError if unknown."""
    first, *names = module.split(".")
    spec = find_spec(first)
    for name in names:
        if spec is None:
            break
        first = f"{first}.{name}"
        spec = PathFinder.find_spec(first, spec.submodule_search_locations)
    if spec is None or not spec.origin:
        raise ImportError(f"no module {module}")
    return spec.origin


@cache
def _module_of_file(path: str) -> ModuleType:
    """Module of a file that belongs to no package."""
    name = f"fvsolve_file_{crc32(path.encode()):08x}_{Path(path).stem}"
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError("expected a file of Python")
    sys.modules[name] = module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


class Declarations(Mapping[str, Declaration]):
    """Declarations of a noun by name: those of the package, of entry points, and of files of a user.

    The order is that of the option `order`, then that of the files. The package is read up to the name in question.
    Other packages are read only for a name that the package does not declare. An unreadable or repeated declaration
    outside the package causes a warning.

    noun, plural : words for messages; for "study" the group of entry points is "fvsolve.studies", and the environment
    variable with files and folders of a user is FVSOLVE_STUDIES
    patterns : glob patterns of files in the package
    header : regular expression with the groups `attribute` and `name`; further groups are options
    """

    def __init__(
        self,
        noun: str,
        plural: str,
        patterns: tuple[str, ...],
        header: re.Pattern[str] | None = None,
    ):
        self.noun = noun
        self.header = header or header_of(noun)
        self.group = f"fvsolve.{plural.replace(' ', '_')}"
        GROUPS.setdefault(self.group, noun)
        self.variable = f"FVSOLVE_{plural.replace(' ', '_').upper()}"
        self._unread = headers(patterns, self.header)
        self._own: dict[str, Declaration] = {}
        self._others: dict[tuple[str, ...], dict[str, Declaration]] = {}
        self._lock = RLock()

    def own(self, name: str | None = None) -> dict[str, Declaration]:
        """Declarations of the package, read up to `name`; all for None."""
        with self._lock:
            while name is None or name not in self._own:
                module, match = next(self._unread, ("", None))
                if match is None:
                    break
                found = self._declaration(module, match, "")
                self._own.setdefault(found.name, found)
        return self._own

    def others(self) -> dict[str, Declaration]:
        """Declarations outside the package; a warning for each that is unreadable or repeated."""
        key = (os.environ.get(self.variable, ""), *sys.path)
        with self._lock:
            if key not in self._others:
                self._others[key] = self._read_others()
        return self._others[key]

    def load(self, name: str) -> Any:
        """Object with this name. Raises FvsolveError if the name is unknown, or if its module cannot be imported."""
        if name not in self:
            hint = did_you_mean(name, self) or f"; expected one of {listing(self)}"
            raise FvsolveError(f'unknown {self.noun} "{name}"{hint}')
        return self[name].load()

    def _declaration(self, module: str, match: re.Match[str], source: str) -> Declaration:
        options = {key: text for key, text in match.groupdict().items() if text is not None}
        attribute = options.pop("attribute")
        return Declaration(
            self.noun, options.pop("name", attribute), module, attribute, options, source
        )

    def _read_others(self) -> dict[str, Declaration]:
        result: dict[str, Declaration] = {}
        for found in [*self._of_entry_points(), *self._of_files()]:
            if found.name in result or found.name in self.own():
                error = f'a declaration of the {self.noun} "{found.name}" exists already; expected another name'
                warnings.warn(
                    unreadable(found.source, found.place, error), RuntimeWarning, stacklevel=2
                )
            else:
                result[found.name] = found
        return result

    def _of_entry_points(self) -> Iterator[Declaration]:
        for entry in entry_points(self.group):
            module, _, attribute = (part.strip() for part in entry.place.partition(":"))
            source = f"{entry.name} of the entry points {self.group} of {entry.package}"
            if module and attribute:
                yield Declaration(self.noun, entry.name, module, attribute, {}, source)
            else:
                text = unreadable(source, entry.place, "it names no object; expected MODULE:OBJECT")
                warnings.warn(text, RuntimeWarning, stacklevel=2)

    def _of_files(self) -> Iterator[Declaration]:
        for place in filter(None, os.environ.get(self.variable, "").split(os.pathsep)):
            path = Path(place).resolve()
            try:
                for file in sorted(path.glob("*.py")) if path.is_dir() else [path]:
                    for match in self.header.finditer(file.read_text(encoding="utf-8")):
                        yield self._declaration(str(file), match, self.variable)
            except (OSError, ValueError) as error:
                warnings.warn(unreadable(self.variable, place, error), RuntimeWarning, stacklevel=2)

    def __getitem__(self, name: str) -> Declaration:
        own = self.own(name)
        return own[name] if name in own else self.others()[name]

    def __iter__(self) -> Iterator[str]:
        """Names: those of the package in their order, then those of others in alphabetical order."""
        own = sorted(self.own().values(), key=lambda found: int(found.options.get("order", 0)))
        return iter([*(found.name for found in own), *sorted(self.others())])

    def __len__(self) -> int:
        return len(self.own()) + len(self.others())
