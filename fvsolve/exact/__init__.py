"""Exact solutions, which a case file names under `[exact]`; may import kernels and fluids of `core`."""

import re
from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING

from fvsolve.declarations import Declarations, unreadable
from fvsolve.errors import FvsolveError
from fvsolve.lazy_exports import lazy_attributes

if TYPE_CHECKING:
    from fvsolve.exact.solution import Exact, ExactStart, Solution

__all__ = ["NAMES", "Exact", "ExactStart", "Solution", "find_faults", "solution"]

HEADER = re.compile(r'\n(?P<attribute>[A-Z_]+) = Exact\(\s*"(?P<name>[\w-]+)"')
# names in the case file
NAMES = Declarations("exact solution", "exact solutions", ("exact/*.py",), HEADER)


def find_faults(case) -> Iterator[tuple[tuple, str]]:
    """Yield a fault (keys, message) for everything in a case that its exact solution does not cover.

    keys : key path as a tuple. Parts of types that the solution does not support are reported first; the keys of parts
    are checked only if there are no such parts.
    """
    from fvsolve.exact.solution import law_faults, type_faults

    exact = _exact(case.exact.name)
    if case.controls:
        yield ("controls",), "exact solutions have no controls; remove [controls], or [exact]"
    yield from law_faults(case)
    yield from list(type_faults(case, exact.nodes, exact.links)) or exact.find_faults(case)


def solution(case, start: "ExactStart") -> "Solution":
    """Exact solution that a case names under `[exact]`, from the flows and pressures at the start."""
    return _exact(case.exact.name).solution(case, start)


def _exact(name: str) -> "Exact":
    from fvsolve.exact.solution import Exact

    value = NAMES.load(name)
    if not isinstance(value, Exact):
        found = NAMES[name]
        raise FvsolveError(
            unreadable(
                found.source, found.place, "it is not an Exact; expected one of fvsolve.exact"
            )
        )
    return value


# The module `solution` is imported at the first use of a solution. Its import must not replace the function `solution`.
lazy_attributes(
    __name__,
    ("Exact", "ExactStart", "Solution", "solution"),
    lambda name: getattr(import_module("fvsolve.exact.solution"), name),
)
