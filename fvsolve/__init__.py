"""Hydraulic transients by finite volumes. Knows the public names and where they live; imports nothing."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

_HOMES = {
    "Case": "fvsolve.case",
    "CaseError": "fvsolve.errors",
    "FluidError": "fvsolve.errors",
    "FvsolveError": "fvsolve.errors",
    "Model": "fvsolve.model",
    "Result": "fvsolve.run",
    "RunError": "fvsolve.errors",
    "State": "fvsolve.model",
    "advance": "fvsolve.solve",
    "build": "fvsolve.model",
    "initial_state": "fvsolve.solve",
    "integrate": "fvsolve.steppers.ode",
    "load": "fvsolve.case",
    "open_run": "fvsolve.run",
    "run": "fvsolve.run",
    "solve": "fvsolve.solve",
    "tableau": "fvsolve.steppers.tableau",
}

__all__ = sorted(_HOMES)  # noqa: PLE0605


class _Package(ModuleType):
    """The package, whose functions `run` and `solve` are not hidden by the modules that they live in."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    setattr(sys.modules[__name__], name, value)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
