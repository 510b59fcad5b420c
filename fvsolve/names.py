"""Public names of a package, fetched when they are first asked for. Knows where they live; imports nothing before."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType


def offer(package: str, homes: Mapping[str, str]) -> list[str]:
    """Let a package offer names from modules, name -> module within it, or beside it as `.room.module`.

    Returns the sorted names, for `__all__`. A function is not hidden by the module of its own name that it lives in.
    """

    class Offering(ModuleType):
        def __getattr__(self, name: str) -> object:
            if name not in homes:
                raise AttributeError(f"module {package!r} has no attribute {name!r}")
            value = getattr(import_module(f".{homes[name]}", package), name)
            super().__setattr__(name, value)
            return value

        def __setattr__(self, name: str, value: object) -> None:
            if not (name in homes and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

        def __dir__(self) -> list[str]:
            return sorted({*vars(self), *homes})

    sys.modules[package].__class__ = Offering
    return sorted(homes)
