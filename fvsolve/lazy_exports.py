"""Public names of a package, imported on first use."""

import sys
from collections.abc import Callable, Collection, Mapping
from importlib import import_module
from types import ModuleType


def lazy_names(package: str, modules: Mapping[str, str]) -> list[str]:
    """Make names available as attributes of a package, imported on first use; return the sorted names, for `__all__`.

    modules : name -> module in the package, or `.other.module` for a module of a neighbouring package.
    """

    def load(name: str) -> object:
        return getattr(import_module(f".{modules[name]}", package), name)

    lazy_attributes(package, modules, load)
    return sorted(modules)


def lazy_attributes(package: str, names: Collection[str], load: Callable[[str], object]) -> None:
    """Make names available as attributes of a package, each computed by `load` on first use.

    A function stays available after the import of a module with the same name. `__all__` contains the names, unless
    the package defines it.
    """

    class LazyModule(ModuleType):
        def __getattr__(self, name: str) -> object:
            if name == "__all__":
                return sorted(names)
            if name.startswith("__") or name not in names:
                raise AttributeError(f"module {package!r} has no attribute {name!r}")
            value = load(name)
            super().__setattr__(name, value)
            return value

        def __setattr__(self, name: str, value: object) -> None:
            if not (isinstance(value, ModuleType) and name in names):
                super().__setattr__(name, value)

        def __dir__(self) -> list[str]:
            return sorted({*vars(self), *names})

    sys.modules[package].__class__ = LazyModule
