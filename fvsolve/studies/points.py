"""Finished points of a study on disk, so that an interrupted one goes on. Knows files; knows no question."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from fvsolve import jit
from fvsolve.doors import PATH, Kind
from fvsolve.errors import RunError
from fvsolve.output.lock import let_go, locked
from fvsolve.output.restart import identity
from fvsolve.output.summary import plain
from fvsolve.steppers.tableau import METHODS, OWN


class Points:
    """What was found before, by case and settings, in `points.jsonl` of a folder; in memory without one.

    While it is open (`with Points(folder) as points`) no other study writes there: RunError where one does.

    A point is reused only for the same case (as resolved, with its files), the same extra settings and the same
    versions and sources of fvsolve and what it computes with.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = None if folder is None else Path(folder) / "points.jsonl"
        self.found: dict[str, dict] = {}
        self.before: set[str] = set()  # keys that were asked for and had been found before this study
        self.fresh: set[str] = set()  # keys that it has found itself
        self.lock = None if folder is None else locked(Path(folder), "a study")
        self.file = None
        if self.path is not None and self.path.is_file():
            self._read()

    def _read(self) -> None:
        data = self.path.read_bytes()
        whole = data.rfind(b"\n") + 1  # behind it is the last line of a study that was killed, or had no room left
        for line in data[:whole].decode("utf-8", errors="replace").splitlines():
            try:
                point = json.loads(line)
                self.found[point["key"]] = point["found"]
            except (ValueError, KeyError, TypeError):
                continue
        if whole < len(data):
            with writing(self.path), open(self.path, "r+b") as file:
                file.truncate(whole)

    def __enter__(self) -> Points:
        return self

    def __exit__(self, *_) -> None:
        """Let go of the folder."""
        if self.file is not None:
            self.file.close()
        if self.lock is not None:
            let_go(self.lock)

    @property
    def reused(self) -> int:
        """How many points that were asked for had been found before."""
        return len(self.before)

    def get(self, case, extra: dict, make: Callable[[], dict]) -> dict:
        """What was found for a case and settings, made now where it is new; None stands for what is not finite."""
        known = self.find(case, extra)
        return self.keep(key_of(case, extra), extra, make()) if known is None else known

    def find(self, case, extra: dict) -> dict | None:
        """What was found for a case and settings before, or None."""
        return self.known(key_of(case, extra))

    def known(self, key: str) -> dict | None:
        """What was found before under a key, or None."""
        known = self.found.get(key)
        if known is not None and key not in self.fresh:
            self.before.add(key)
        return known

    def keep(self, key: str, of: Any, made: dict) -> dict:
        """What was found under a key, kept from now on; RunError where the disk does not take it."""
        made = self.found[key] = plain(made)
        self.fresh.add(key)
        if self.path is not None:
            line = json.dumps({"key": key, "of": plain(of), "found": made}) + "\n"
            with writing(self.path):
                self.file = self.file or open(self.path, "ab", buffering=0)
                if self.file.write(line.encode()) < len(line.encode()):
                    raise OSError(28, "No space left on device")
        return made


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Where a file is written: what the system has against it is a RunError."""
    try:
        yield
    except OSError as error:
        raise RunError(f"{path}: cannot be written: {error.strerror or error}; what is finished is kept, and the same "
                       "command goes on once it can") from None  # fmt: skip


def key_of(case, extra: dict) -> str:
    """A name for a case with settings: what it says, what it computes with, and the settings."""
    return hashed(identity(case) | {"resolved": case.table(), "extra": plain(extra)})


@functools.cache
def package_hash() -> str:
    """What changes with any source of the package: of what compiles, lowers and studies alike."""
    digest = hashlib.sha256()
    for path in sorted(jit.PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def hashed(who: dict) -> str:
    """A name for all that a point depends on, the sources of fvsolve and of parts from outside among it."""
    who = who | {"package": package_hash(), "outside": sorted(jit.OUTSIDE.values())}
    text = json.dumps(who, sort_keys=True, default=str)
    arrays = [method.text for name, method in METHODS.items() if name not in OWN and f'"{name}"' in text]
    return hashlib.sha256("\n".join([text, *arrays]).encode()).hexdigest()[:24]


OUT = Kind(lambda given: PATH.holds(given) or isinstance(given, Points), PATH.wanted)


def kept_in(out: str | Path | Points | None):
    """Points of a folder, to be closed again, or those of a caller who goes on with them."""
    return nullcontext(out) if isinstance(out, Points) else Points(out)
