"""Finished points of a study on disk, so that an interrupted one goes on. Knows files; knows no question."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

from fvsolve.doors import PATH, Kind
from fvsolve.output.lock import let_go, locked
from fvsolve.output.restart import identity
from fvsolve.output.summary import plain


class Points:
    """What was found before, by case and settings, in `points.jsonl` of a folder; in memory without one.

    While it is open (`with Points(folder) as points`) no other study writes there: RunError where one does.

    A point is reused only for the same case (as resolved, with its files), the same extra settings and the same
    versions of fvsolve and what it computes with.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = None if folder is None else Path(folder) / "points.jsonl"
        self.found: dict[str, dict] = {}
        self.reused = 0
        self.lock = None if folder is None else locked(Path(folder), "a study")
        if self.path is not None and self.path.is_file():
            for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
                try:
                    point = json.loads(line)
                    self.found[point["key"]] = point["found"]
                except (ValueError, KeyError, TypeError):  # the last line of a study that was killed
                    continue

    def __enter__(self) -> Points:
        return self

    def __exit__(self, *_) -> None:
        """Let go of the folder."""
        if self.lock is not None:
            let_go(self.lock)

    def get(self, case, extra: dict, make: Callable[[], dict]) -> dict:
        """What was found for a case and settings, made now where it is new; None stands for what is not finite."""
        known = self.find(case, extra)
        if known is not None:
            return known
        key, made = key_of(case, extra), plain(make())
        self.found[key] = made
        if self.path is not None:
            with open(self.path, "a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, "of": plain(extra), "found": made}) + "\n")
        return made

    def find(self, case, extra: dict) -> dict | None:
        """What was found for a case and settings before, or None."""
        known = self.found.get(key_of(case, extra))
        self.reused += known is not None
        return known


def key_of(case, extra: dict) -> str:
    """A name for a case with settings: what it says, what it computes with, and the settings."""
    who = identity(case) | {"resolved": case.resolved(), "extra": plain(extra)}
    return hashlib.sha256(json.dumps(who, sort_keys=True).encode()).hexdigest()[:24]


OUT = Kind(lambda given: PATH.holds(given) or isinstance(given, Points), PATH.wanted)


def kept_in(out: str | Path | Points | None):
    """Points of a folder, to be closed again, or those of a caller who goes on with them."""
    return nullcontext(out) if isinstance(out, Points) else Points(out)
