"""Cache of finished study points on disk, so that an interrupted study resumes."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from fvsolve.argument_checks import PATH, Kind
from fvsolve.compile.cache_folders import EXTRA_FOLDERS, PACKAGE
from fvsolve.core.output.directory import lock_folder, release
from fvsolve.core.output.restart import identity
from fvsolve.core.output.summary_file import plain
from fvsolve.core.schemes import LIMITERS
from fvsolve.core.steppers.tableau import BUILT_IN, METHODS
from fvsolve.errors import RunError


class ResultCache:
    """Results of the points (runs) of a study, in `points.jsonl` of a folder; in memory without a folder.

    The folder is locked until the cache is closed (context manager). Raises RunError if another study has the lock, or
    if the folder cannot be written.
    A result is reused only for the same case (as resolved, with its files), the same extra settings and the same
    versions and sources of fvsolve and its dependencies. Lines that are damaged or were changed are not used.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = None if folder is None else Path(folder) / "points.jsonl"
        self.results: dict[str, dict] = {}
        self.reused_keys: set[str] = set()  # requested keys with results from earlier studies
        self.new_keys: set[str] = set()  # keys with results of this study
        self.lock = None if folder is None else lock_folder(Path(folder), "a study")
        self.file = None
        if self.path is not None and self.path.is_file():
            self._read()

    def _read(self) -> None:
        data = self.path.read_bytes()
        # an incomplete line follows if a study was killed or the disk was full
        complete = data.rfind(b"\n") + 1
        for line in data[:complete].decode("utf-8", errors="replace").splitlines():
            try:
                point = json.loads(line)
                if point["seal"] == seal_of(point["key"], point["found"]):
                    self.results[point["key"]] = point["found"]
            except (ValueError, KeyError, TypeError, RecursionError):
                continue
        if complete < len(data):
            with write_errors(self.path), open(self.path, "r+b") as file:
                file.truncate(complete)

    def __enter__(self) -> ResultCache:
        return self

    def __exit__(self, *_) -> None:
        """Close the file and release the lock."""
        if self.file is not None:
            self.file.close()
        if self.lock is not None:
            release(self.lock)

    @property
    def reused(self) -> int:
        """Number of requested points with results from earlier studies."""
        return len(self.reused_keys)

    def get(self, case, extra: dict, make: Callable[[], dict]) -> dict:
        """Result for a case and settings, computed by `make()` if it is new; values that are not finite become None."""
        known = self.find(case, extra)
        return self.store(case_key(case, extra), extra, make()) if known is None else known

    def find(self, case, extra: dict) -> dict | None:
        """Stored result for a case and settings, or None."""
        return self.lookup(case_key(case, extra))

    def lookup(self, key: str) -> dict | None:
        """Stored result with the hash `key`, or None; a result of an earlier study also counts as reused."""
        known = self.results.get(key)
        if known is not None and key not in self.new_keys:
            self.reused_keys.add(key)
        return known

    def store(self, key: str, settings: Any, result: dict) -> dict:
        """Store a result under the hash `key` and return it as plain values. Raises RunError if it cannot be written.

        settings : written with the result, for readers of the file
        """
        result = self.results[key] = plain(result)
        self.new_keys.add(key)
        if self.path is not None:
            seal = seal_of(key, result)
            line = (
                json.dumps({"key": key, "of": plain(settings), "found": result, "seal": seal})
                + "\n"
            )
            with write_errors(self.path):
                self.file = self.file or open(self.path, "ab", buffering=0)
                if self.file.write(line.encode()) < len(line.encode()):
                    raise OSError(28, "No space left on device")
        return result


def seal_of(key: str, result: dict) -> str:
    """Hash of a stored result: a line that was changed after it was written is not used."""
    return hashlib.sha256(json.dumps([key, result]).encode()).hexdigest()[:24]


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Context manager that turns an OSError of writing a file into a RunError."""
    try:
        yield
    except OSError as error:
        raise RunError(
            f"{path}: cannot be written: {error.strerror or error}. Finished results are kept; remove the "
            "cause and repeat the command to resume"
        ) from None


def case_key(case, extra: dict) -> str:
    """Hash of a case, of program versions, and of the further settings `extra`."""
    return digest_of(identity(case) | {"resolved": case.table(), "extra": plain(extra)})


@functools.cache
def package_hash() -> str:
    """Hash of all source files of fvsolve."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def digest_of(who: dict) -> str:
    """Hash of the values `who`, the sources of fvsolve and plugins, and methods and limiters of users in `who`.

    The result of a point of a study depends on these alone.
    """
    who = who | {
        "package": package_hash(),
        "outside": sorted(
            name for folder, name in EXTRA_FOLDERS.items() if PACKAGE not in folder.parents
        ),
    }
    text = json.dumps(who, sort_keys=True, default=str)
    arrays = [
        method.text
        for name, method in METHODS.items()
        if name not in BUILT_IN and f'"{name}"' in text
    ]
    arrays += [row.own.digest for name, row in LIMITERS.items() if row.own and f'"{name}"' in text]
    return hashlib.sha256("\n".join([text, *arrays]).encode()).hexdigest()[:24]


OUT = Kind(lambda given: PATH.accepts(given) or isinstance(given, ResultCache), PATH.expected)


def cache_in(out: str | Path | ResultCache | None):
    """Context manager that gives a result cache.

    out : folder whose cache is opened and closed, None for a cache in memory, or an open cache, which stays open
    """
    return nullcontext(out) if isinstance(out, ResultCache) else ResultCache(out)
