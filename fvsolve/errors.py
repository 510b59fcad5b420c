"""What can go wrong, in words. Knows how a fault is worded; knows nothing of what it is about."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

# Control characters, marks of direction, ends of lines that are no "\n", halves of letters.
LONGEST = 200  # letters of a name that are compared with others
UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


@dataclass(frozen=True)
class Fault:
    """One fault of a case file: the key path, what was found and wanted, and the line in the file."""

    place: str
    message: str
    line: int | None = None
    override: bool = False  # the value came from --set, not from the file

    def __str__(self) -> str:
        where = "--set " if self.override else f"line {self.line}: " if self.line else ""
        return f"{where}{self.place}: {self.message}" if self.place else f"{where}{self.message}"


@dataclass(frozen=True)
class Notice:
    """What is legal but to be known: one of the `warnings` of a case or a run.

    kind : "start", "mesh", "step-limit", "step-error", "growth", "ledger", "range", ...; place : part or section,
    "nodes.a"; key : of it, or None; value, limit : numbers that are compared, SI, or None; ok : False where the numbers
    of a run are wrong
    """

    kind: str
    place: str
    text: str
    key: str | None = None
    value: float | None = None
    limit: float | None = None
    ok: bool = True

    def __str__(self) -> str:
        return self.text

    def plain(self) -> dict:
        """As JSON says it."""
        return {"kind": self.kind, "place": self.place, "key": self.key, "value": self.value, "limit": self.limit,
                "ok": self.ok, "text": self.text}  # fmt: skip


class FvsolveError(Exception):
    """Base of every error fvsolve raises on purpose; `str` is what a person reads."""


class CaseError(FvsolveError):
    """A case that cannot be read: all its faults at once, in the order of the file."""

    def __init__(self, faults: Iterable[Fault], file: str = "case"):
        self.faults = sorted(faults, key=lambda fault: (fault.override, fault.line or 0))
        self.file = str(file)
        super().__init__(self.faults, self.file)

    def __str__(self) -> str:
        count = len(self.faults)
        head = f"{self.file}: {count} fault{'' if count == 1 else 's'}"
        return "\n".join([head, *(f"  {fault}" for fault in self.faults)])


@contextmanager
def gathered(faults: list[Fault], place: str = "") -> Iterator[None]:
    """Adds what goes wrong within to the faults, an error of values at the place, all of a case; then goes on."""
    try:
        yield
    except CaseError as error:
        faults += error.faults
    except (ValueError, FvsolveError) as error:
        faults.append(Fault(place, str(error)))


class MeshError(CaseError):
    """A mesh that cannot be had as asked: all its faults at once; `file` is its file, or "rectangle"."""


class FluidError(FvsolveError):
    """A fluid that cannot be had as asked; `key` is the key of `[fluid]` that is to blame."""

    def __init__(self, key: str, message: str):
        self.key = key
        self.message = message
        super().__init__(key, message)

    def __str__(self) -> str:
        return f"fluid.{self.key}: {self.message}"


class RunError(FvsolveError):
    """A run that cannot start or go on: a finished run in the way, a restart that does not fit, ..."""


def visible(text: str) -> str:
    """Text that steers no terminal: what cannot be seen stands as its escape, but for ends of lines and tabs."""
    return UNSEEN.sub(lambda one: one[0].encode("unicode_escape").decode(), text)


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The valid name that was probably meant by `name`, or None."""
    if len(name) > LONGEST:
        return None
    names = [one for one in dict.fromkeys(names) if len(one) <= LONGEST]
    folded = {other.casefold().replace("_", "-"): other for other in names}
    close = difflib.get_close_matches(name.casefold().replace("_", "-"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """'; did you mean "opening"?' where a valid name is near, else the empty string."""
    close = nearest(name, names)
    return f'; did you mean "{close}"?' if close else ""


FEW = 2  # more names are not worth hiding


def listing(names: Iterable[str], limit: int = 12) -> str:
    """The names in one line, sorted, each once, cut where there are many."""
    names = sorted({*names})
    if len(names) <= limit + FEW:
        return ", ".join(names)
    return ", ".join(names[:limit]) + f", ... ({len(names)} in all)"
