"""Comparison of two dumps of a run to the bit, with a map of renamed words. Imports nothing of fvsolve.

A dump maps places to values: a place is a tuple of texts, such as ("summary.json", "extremes", "gate.head", "least"),
a value is None, a bool, an int, a float, a text, or a numpy array.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

Dump = dict[tuple[str, ...], Any]
KINDS = ("module", "name", "member", "column", "arg", "public")  # kinds of lines of a map
WORD = re.compile(r"[^\W\d]\w*(?:-\w+)*")
DOTTED = re.compile(rf"{WORD.pattern}(?:\.{WORD.pattern})*")
# Keys of texts for people, which may differ. Only the words of a reason before the colon are compared.
PROSE = ("title", "description", "source", "text", "why")
REASON = "reason"
LABELS = "expectations"  # place in which `text` is an expression of the case file, not prose
MANY = 6  # greatest number of renamed words of a place; above it, either all or none are renamed


class Difference(NamedTuple):
    """Place at which two dumps differ, and both values as text."""

    place: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.place}: {self.old} and {self.new}"


class Names:
    """Map of old names to new names. Raises ValueError with all faults of its lines.

    public : words of keys, columns and texts; "extremes.least" is `least` anywhere below `extremes`; a name with blanks
    is a whole text
    other kinds : names of Python, of which the last part counts
    """

    def __init__(self, lines: list[str] | None = None) -> None:
        self.words: dict[str, list[tuple[list[str], list[str]]]] = {}
        self.whole: dict[str, str] = {}
        self.python: list[tuple[str, str]] = []
        self.used: set[str] = set()
        self.known: dict[str, list[str]] = {}
        faults = [
            fault
            for number, line in enumerate(lines or [], 1)
            if (fault := self._add(number, line))
        ]
        if faults:
            raise ValueError("\n".join(faults))

    def _add(self, number: int, line: str) -> str:
        """Add a line and return the text of its fault, empty for a valid line."""
        if not line.strip() or line.startswith("#"):
            return ""
        fields = [field.strip() for field in line.split("\t")]
        if len(fields) != 3 or not all(fields):
            return f"line {number}: {len(fields)} fields; expected kind, old and new name with tabs between"
        kind, old, new = fields
        if kind not in KINDS:
            return f"line {number}: unknown kind {kind}; expected one of {', '.join(KINDS)}"
        if kind != "public":
            self.python.append((old.rpartition(".")[2], new.rpartition(".")[2]))
        elif not DOTTED.fullmatch(old):
            self.whole[old] = new
        else:
            before, after = old.split("."), new.split(".")
            if len(before) != len(after):
                return f"line {number}: {old} has {len(before)} parts and {new} has {len(after)}; expected as many"
            entries = self.words.setdefault(before[-1], [])
            if any(known == before and other != after for known, other in entries):
                return f"line {number}: {old} has two new names"
            entries.append((before, after))
            entries.sort(key=lambda entry: len(entry[0]))
        return ""

    def spellings(self, name: str) -> list[str]:
        """Spellings of a name of Python or of a key: the name, then all names that the map connects with it."""
        if name in self.known:
            return self.known[name]
        pairs = self.python + [
            (a[-1], b[-1]) for entries in self.words.values() for a, b in entries
        ]
        self.known[name] = found = [name]
        for one in found:  # the list grows in the loop
            pairs_of = [b for a, b in pairs if a == one] + [a for a, b in pairs if b == one]
            found += [other for other in dict.fromkeys(pairs_of) if other not in found]
        return found

    def renamed(self, words: list[str]) -> list[str]:
        """New words of a list of old words. The parts of an entry must occur among them in order."""
        found = list(words)
        for at, word in enumerate(words):
            for before, after in self.words.get(word, ()):  # entries with most parts last
                places = _above(words[:at], before[:-1])
                if places is None:
                    continue
                self.used.add(".".join(before))
                for place, new in zip([*places, at], after, strict=True):
                    found[place] = new
        return found

    def unused(self) -> list[str]:
        """Public names of the map that occur in no place and no text."""
        known = {".".join(before) for entries in self.words.values() for before, _ in entries}
        return sorted((known | self.whole.keys()) - self.used)

    def places(self, place: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        """Possible new places of an old place: all words renamed, then some words, then none."""
        if any(part in self.whole for part in place):
            self.used.update(part for part in place if part in self.whole)
            yield tuple(self.whole.get(part, part) for part in place)
        words = [WORD.findall(part) for part in place]
        old = [word for part in words for word in part]
        new = self.renamed(old)
        changed = [k for k in range(len(old)) if old[k] != new[k]]
        sides = (
            itertools.product((True, False), repeat=len(changed))
            if len(changed) <= MANY
            else _ends(len(changed))
        )
        for taken in sides:
            now = list(old)
            for k, take in zip(changed, taken, strict=True):
                now[k] = new[k] if take else old[k]
            left = iter(now)
            yield tuple(WORD.sub(lambda _, left=left: next(left), part) for part in place)

    def same_text(self, place: tuple[str, ...], old: str, new: str) -> bool:
        """True if each word of the new text is the old word or its new name."""
        if self.whole.get(old) == new:
            self.used.add(old)
            return True
        above = [word for part in place for word in WORD.findall(part)]
        before, after = WORD.findall(old), WORD.findall(new)
        if WORD.split(old) != WORD.split(new) or len(before) != len(after):
            return False
        renamed = self.renamed(above + before)[len(above) :]
        return all(b in (a, c) for a, b, c in zip(before, after, renamed, strict=True))


def compare(old: Dump, new: Dump, names: Names) -> list[Difference]:
    """Differences of two dumps in the order of the old dump, then places of the new dump alone."""
    pairs, left = _paired(old, new, names)
    found = []
    for place, other in pairs.items():
        shown = (
            "/".join(place) if other in (None, place) else f"{'/'.join(place)} ({'/'.join(other)})"
        )
        if other is None:
            found.append(Difference(shown, _shown(old[place]), "nothing"))
        elif (values := _different(place, old[place], new[other], names)) is not None:
            at, *both = values
            found.append(Difference(shown + at, *both))
    return found + [Difference("/".join(place), "nothing", _shown(new[place])) for place in left]


def count(dump: Dump) -> int:
    """Number of values of a dump; each element of an array counts."""
    return sum(np.size(value) for value in dump.values())


def _paired(old: Dump, new: Dump, names: Names) -> tuple[dict, list]:
    """Old place -> new place or None, and the new places without an old place."""
    free, pairs = dict.fromkeys(new), {}
    candidates = {place: list(names.places(place)) for place in old}
    for place, likely in candidates.items():
        if likely[0] in free:
            pairs[place] = likely[0]
            del free[likely[0]]
    for place, likely in candidates.items():
        if place not in pairs and (found := next((one for one in likely if one in free), None)):
            pairs[place] = found
            del free[found]
    return {place: pairs.get(place) for place in old}, list(free)


def _different(
    place: tuple[str, ...], old: Any, new: Any, names: Names
) -> tuple[str, str, str] | None:
    """Position at which two values of a place differ, and both values as text; None if they are equal."""
    if type(old) is not type(new):
        return "", _shown(old), _shown(new)
    if isinstance(old, np.ndarray):
        return _different_arrays(old, new)
    if isinstance(old, float):
        return None if _bits(old) == _bits(new) else ("", _shown(old), _shown(new))
    if isinstance(old, str):
        return _different_texts(place, old, new, names)
    return None if old == new else ("", _shown(old), _shown(new))


def _different_texts(place, old: str, new: str, names: Names) -> tuple[str, str, str] | None:
    """Position and text of the first line that differs; None for equal texts and for prose."""
    known = [set(names.spellings(key)) for key in PROSE]
    if any(place[-1] in key for key in known) and not any(
        one in place for one in names.spellings(LABELS)
    ):
        return None
    if place[-1] in names.spellings(REASON):
        old, new = old.partition(":")[0], new.partition(":")[0]
    if old == new or names.same_text(place, old, new):
        return None
    before, after = old.splitlines(), new.splitlines()
    for k, (a, b) in enumerate(zip(before, after, strict=False)):
        if a != b and not names.same_text(place, a, b):
            return (f"[{k}]" if len(before) > 1 else ""), _shown(a), _shown(b)
    return "", f"{len(before)} lines", f"{len(after)} lines"


def _different_arrays(old: np.ndarray, new: np.ndarray) -> tuple[str, str, str] | None:
    """Index of the first number that differs, with the count of the others, and both numbers; None if all are equal."""
    if old.dtype != new.dtype or old.shape != new.shape:
        return "", f"{old.dtype}{list(old.shape)}", f"{new.dtype}{list(new.shape)}"
    a, b = (np.ascontiguousarray(one).reshape(-1) for one in (old, new))
    if a.tobytes() == b.tobytes():
        return None
    rows_a, rows_b = (one.view(np.uint8).reshape(one.size, -1) for one in (a, b))
    where = np.flatnonzero((rows_a != rows_b).any(axis=1))
    at = ", ".join(map(str, np.unravel_index(where[0], old.shape)))
    more = f" and {len(where) - 1} more" if len(where) > 1 else ""
    return f"[{at}]{more}", _shown(a[where[0]].item()), _shown(b[where[0]].item())


def _shown(value: Any) -> str:
    """Value as text; a float also in hexadecimal form."""
    if isinstance(value, float):
        return f"{value!r} ({value.hex() if value == value else _bits(value).hex()})"
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _bits(value: float) -> bytes:
    return np.float64(value).tobytes()


def _above(words: list[str], parts: list[str]) -> list[int] | None:
    """Positions of the parts among the words in order, each the last possible; None if a part is missing."""
    places, at = [], len(words)
    for part in reversed(parts):
        at = next((k for k in range(at - 1, -1, -1) if words[k] == part), -1)
        if at < 0:
            return None
        places.append(at)
    return places[::-1]


def _ends(many: int) -> Iterator[tuple[bool, ...]]:
    """Two choices: all true, and all false."""
    yield (True,) * many
    yield (False,) * many
