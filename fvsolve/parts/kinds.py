"""Classes of the types of parts, of controls and of the physics of basins, each imported at its first use."""

import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import Any

from fvsolve.declarations import headers
from fvsolve.errors import FvsolveError
from fvsolve.units import show

PATTERNS = (
    "parts/[a-z]*.py",
    "parts/*/part.py",
    "features/*/*/part.py",
)  # modules that declare types
# Header of a class that declares a type: `kind` of a part, `name` of a physics, `pipe_model` of a pipe. A search for
# "\nclass" takes a seventh of the time of "^class" in lines.
# in one line or in several, as a formatter leaves it
DECLARATION = re.compile(r'\nclass \w+\([^()]*\b(kind|name|pipe_model)=(?:"([^"]+)"|\w+),?\s*\)')
# a basin or a pipe needs the modules of all physics or pipe models
SHARED = {"name": "basin", "pipe_model": "pipe"}


@cache
def modules_of_types() -> dict[str, list[str]]:
    """Modules that declare each type : type in the case file -> names of modules."""
    modules: dict[str, list[str]] = {}
    for module, match in headers(PATTERNS, DECLARATION):
        key, kind = match.groups(default="")
        for needed in {kind, SHARED.get(key, kind)} - {""}:
            modules.setdefault(needed, []).append(module)
    return modules


class Kinds(dict[str, Any]):
    """Types of a group : type in the case file -> class.

    A look-up imports the modules that declare the type. Iteration imports the modules of all types; its order is that
    of the names.
    """

    def __init__(self) -> None:
        super().__init__()
        self.imported: set[str] = set()
        self.complete = False  # True if the modules of all types are imported

    def load(self, *kinds: object) -> None:
        """Import the modules that declare these types."""
        for kind in kinds:
            if isinstance(kind, str) and kind not in self.imported:
                for module in modules_of_types().get(kind, ()):
                    import_module(module)
                self.imported.add(kind)  # last, so that another thread waits for the import

    def declare(self, kind: str, model: type, noun: str, *others: str) -> None:
        """Add the class of a type. Raises FvsolveError if the type exists already.

        noun : of the type, for messages; others : built-in types that exist before a class of another package is added
        """
        if model.__module__ not in modules_of_types().get(kind, ()):  # a class of another package
            self.load(kind, *others)
        if super().__contains__(kind):
            raise FvsolveError(f"{noun} {show(kind)} exists already; expected another name")
        self[kind] = model

    def __getitem__(self, kind: str) -> Any:
        self.load(kind)
        return super().__getitem__(kind)

    def __contains__(self, kind: object) -> bool:
        self.load(kind)
        return super().__contains__(kind)

    def get(self, kind: str, default: Any = None) -> Any:
        self.load(kind)
        return super().get(kind, default)

    def __iter__(self) -> Iterator[str]:
        if not self.complete:
            self.load(*modules_of_types())
            self.complete = True
        return iter(sorted(super().keys()))

    def __len__(self) -> int:
        self.load(*modules_of_types())
        return super().__len__()

    def keys(self) -> Any:
        return list(iter(self))

    def values(self) -> Any:
        return [self[kind] for kind in self]

    def items(self) -> Any:
        return [(kind, self[kind]) for kind in self]

    def __repr__(self) -> str:
        return f"Kinds({', '.join(self)})"
