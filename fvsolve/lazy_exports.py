"""Public names of a package, imported on first use."""

import sys
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType


def lazy_names(package: str, modules: Mapping[str, str]) -> list[str]:
    """Make names available as attributes of a package, imported on first use; return the sorted names, for `__all__`.

    modules : name -> module in the package, or `.other.module` for a module of a neighbouring package. A function stays
    available after the import of a module with the same name.
    """

    class LazyModule(ModuleType):
        def __getattr__(self, name: str) -> object:
            if name not in modules:
                raise AttributeError(f"module {package!r} has no attribute {name!r}")
            value = getattr(import_module(f".{modules[name]}", package), name)
            super().__setattr__(name, value)
            return value

        def __setattr__(self, name: str, value: object) -> None:
            if not (name in modules and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

        def __dir__(self) -> list[str]:
            return sorted({*vars(self), *modules})

    sys.modules[package].__class__ = LazyModule
    return sorted(modules)
