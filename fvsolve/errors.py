"""Error classes, faults of cases and notices of runs, and functions for the texts of messages."""

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

LONGEST_NAME = 200  # length of a name above which it is not compared with others
MOST_COMPARED = 500  # names that are compared with others for one error
LONGEST_MESSAGE = 1500  # greatest length of the message of a fault; the rest is cut
MOST_FAULTS = 50  # faults that a message lists; of further faults it states the number
# Control characters, direction marks, line ends other than "\n", halves of surrogate pairs.
INVISIBLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


@dataclass(frozen=True)
class Fault:
    """Fault of a case file.

    place : key path, such as "links.main.length"; message : text with the found and the expected value
    line : line number in the file, or None; override : True if the value came from --set, not from the file
    """

    place: str
    message: str
    line: int | None = None
    override: bool = False

    def __str__(self) -> str:
        where = "--set " if self.override else f"line {self.line}: " if self.line else ""
        cut = (
            self.message
            if len(self.message) <= LONGEST_MESSAGE
            else f"{self.message[:LONGEST_MESSAGE]}..."
        )
        return f"{where}{self.place}: {cut}" if self.place else f"{where}{cut}"


@dataclass(frozen=True)
class Notice:
    """Notice of a case or a run, an item of its `warnings`: a valid but unusual situation.

    kind : "start", "mesh", "step-limit", "step-error", "growth", "ledger", "range", ...
    place : part or section, such as "nodes.a"; key : key of that part, or None
    value, limit : compared numbers in SI units, or None; ok : False if the results of the run are not reliable
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

    def plain(self) -> dict[str, Any]:
        """Fields of the notice as a dictionary, for JSON."""
        return {
            "kind": self.kind,
            "place": self.place,
            "key": self.key,
            "value": self.value,
            "limit": self.limit,
            "ok": self.ok,
            "text": self.text,
        }


class FvsolveError(Exception):
    """Base class of all errors that fvsolve raises deliberately; `str` gives the message for the user.

    compared : number of names that were compared with others since the last error, see `nearest`
    """

    compared: ClassVar[int] = 0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        FvsolveError.compared = 0


class CaseError(FvsolveError):
    """Invalid case, with all its faults: those of the file in the order of their lines, then those of overrides.

    further : number of faults that are counted only, of a file with thousands of faults
    """

    def __init__(self, faults: Iterable[Fault], file: str = "case", further: int = 0):
        self.faults = sorted(faults, key=lambda fault: (fault.override, fault.line or 0))
        self.file, self.further = str(file), further
        super().__init__(self.faults, self.file, further)

    def __str__(self) -> str:
        count = len(self.faults) + self.further
        head = f"{self.file}: {count} fault{'' if count == 1 else 's'}"
        listed = [f"  {fault}" for fault in self.faults[:MOST_FAULTS]]
        further = [f"  and {count - MOST_FAULTS} further faults"] * (count > MOST_FAULTS)
        return "\n".join([head, *listed, *further])


@contextmanager
def collect_faults(faults: list[Fault], place: str = "") -> Iterator[None]:
    """Catch errors raised in the `with` block and append them to `faults`.

    A CaseError adds all its faults; any other FvsolveError or a ValueError adds one fault with the key path `place`.
    """
    try:
        yield
    except CaseError as error:
        faults += error.faults
    except (ValueError, FvsolveError) as error:
        faults.append(Fault(place, str(error)))


class MeshError(CaseError):
    """Invalid mesh, with all its faults; `file` is the name of the mesh file, or "rectangle"."""


class FluidError(FvsolveError):
    """Invalid fluid; `key` is the faulty key of `[fluid]`."""

    def __init__(self, key: str, message: str):
        self.key = key
        self.message = message
        super().__init__(key, message)

    def __str__(self) -> str:
        return f"fluid.{self.key}: {self.message}"


class RunError(FvsolveError):
    """Run that cannot start or continue: an existing run directory, an unsuitable restart file, ..."""


def visible(text: str) -> str:
    """Text that is safe for terminals: escapes replace invisible characters, except tabs and line ends "\\n"."""
    return INVISIBLE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def nearest(name: str, names: Iterable[str]) -> str | None:
    """Valid name in `names` that is most similar to `name`; None if no name is similar.

    Names longer than `LONGEST_NAME` are not compared. A comparison takes 0.1 ms, so of a hundred thousand names for one
    error, as in a hostile file, only the first `MOST_COMPARED` are compared: its message lists fewer.
    """
    if len(name) > LONGEST_NAME or FvsolveError.compared >= MOST_COMPARED:
        return None
    FvsolveError.compared += 1
    names = [valid for valid in dict.fromkeys(names) if len(valid) <= LONGEST_NAME]
    folded = {other.casefold().replace("_", "-"): other for other in names}
    close = difflib.get_close_matches(name.casefold().replace("_", "-"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Hint for a message, such as `; did you mean "opening"?`; "" if no valid name in `names` is similar to `name`."""
    close = nearest(name, names)
    return f'; did you mean "{close}"?' if close else ""


def article(noun: str) -> str:
    """Noun with its indefinite article: "a pipe", "an accumulator"."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


EXTRA_NAMES = 2  # names above the limit of a listing that are still listed


def listing(names: Iterable[str], limit: int = 12) -> str:
    """Text that lists names, sorted, without duplicates.

    Of more than `limit` + `EXTRA_NAMES` names it lists the first `limit`, and states the number of all names.
    """
    names = sorted({*names})
    if len(names) <= limit + EXTRA_NAMES:
        return ", ".join(names)
    return ", ".join(names[:limit]) + f", ... ({len(names)} in all)"
