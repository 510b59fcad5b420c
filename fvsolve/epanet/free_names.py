"""Valid and unique names of parts, made from EPANET's names."""

from __future__ import annotations

import re


class FreeNames:
    """Unique names for a group of parts; characters that a case file does not allow are replaced.

    given : EPANET's name -> name in the case
    """

    def __init__(self) -> None:
        self.given: dict[str, str] = {}  # EPANET's name -> name in the case
        self.taken: set[str] = set()

    def add(self, name: str) -> str:
        """Add a name of EPANET; return the name of the part in the case."""
        self.given[name] = self.new(re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_") or "part")
        return self.given[name]

    def new(self, base: str) -> str:
        """Unused name: `base`, or `base` followed by a number."""
        name, number = base, 2
        while name in self.taken:
            name, number = f"{base}-{number}", number + 1
        self.taken.add(name)
        return name

    def changed(self) -> dict[str, str]:
        """EPANET's name -> name in the case, for all parts whose names differ."""
        return {name: ours for name, ours in self.given.items() if name != ours}
