"""EPANET's names as names of a case. Knows what a name may hold; knows no part."""

from __future__ import annotations

import re


class FreeNames:
    """Names of one group of parts, each once; a name that a case cannot hold becomes a near one."""

    def __init__(self) -> None:
        self.given: dict[str, str] = {}  # EPANET's name -> ours
        self.taken: set[str] = set()

    def add(self, name: str) -> str:
        """Our name for one of EPANET's."""
        self.given[name] = self.new(re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_") or "part")
        return self.given[name]

    def new(self, wanted: str) -> str:
        """A name that no part has yet: the wanted one, or that with a number."""
        found, number = wanted, 2
        while found in self.taken:
            found, number = f"{wanted}-{number}", number + 1
        self.taken.add(found)
        return found

    def changed(self) -> dict[str, str]:
        """EPANET's name -> ours, of those that differ."""
        return {name: ours for name, ours in self.given.items() if name != ours}
