"""A case on its way to another process, with the methods that only this one knows. Knows cases; runs nothing."""

from __future__ import annotations

from typing import Any

from fvsolve.case import Case
from fvsolve.case.load import named
from fvsolve.case.raw import Raw, read_raw
from fvsolve.steppers.tableau import METHODS, OWN


class Sent:
    """What `load` takes; elsewhere what a case says, not what it was read as, which may hold functions and meshes."""

    def __init__(self, source: Any) -> None:
        self.source = source

    def __getstate__(self) -> dict[str, Any]:
        known = self.source
        if isinstance(known, Case):
            known = Raw(known.raw, known.name, known.path, known.folder)
        source = known if isinstance(known, Raw) else read_raw(named(known))
        return {"source": source, "methods": {name: one for name, one in METHODS.items() if name not in OWN}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        METHODS.update(state["methods"])
        self.source = state["source"]
