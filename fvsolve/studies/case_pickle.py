"""Pickle support for a case, including user-defined Runge-Kutta methods."""

from __future__ import annotations

from typing import Any

from fvsolve.case import Case
from fvsolve.case.load import find_source
from fvsolve.case.raw import Raw, read_raw
from fvsolve.steppers.tableau import BUILT_IN, METHODS


class PickledCase:
    """Case that can be pickled. A `Case` is pickled as the values of its file, because it may contain functions.

    User-defined methods are pickled too. source : argument of `load`, such as a path, a dict or a `Case`
    """

    def __init__(self, source: Any) -> None:
        self.source = source

    def __getstate__(self) -> dict[str, Any]:
        raw = self.source
        if isinstance(raw, Case):
            raw = Raw(raw.raw, raw.name, raw.path, raw.folder)
        source = raw if isinstance(raw, Raw) else read_raw(find_source(raw))
        return {"source": source, "methods": {name: method for name, method in METHODS.items() if name not in BUILT_IN}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        METHODS.update(state["methods"])
        self.source = state["source"]
