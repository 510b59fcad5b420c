"""Properties from CoolProp, stored in files: one for each fluid, state, law and version of CoolProp.

CoolProp is imported only for properties that are not stored.
"""

import functools
import hashlib
import json
import os
import re
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fvsolve.compile.file_access import read as read_closed
from fvsolve.core.fluid.fluid_table import FluidTable
from fvsolve.errors import FluidError
from fvsolve.jit import cache_folder, reading_folders

FORMAT = 1  # version of format and contents of the cache; increase it when either changes


def cached_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    """Fields of `Fluid` from CoolProp, read from a file if they are cached there; CoolProp is then not imported.

    Arguments as for `coolprop_properties`.
    """

    def compute() -> dict[str, Any]:
        source = f"CoolProp {coolprop_version()}"
        from fvsolve.core.fluid.coolprop import coolprop_properties

        return coolprop_properties(name, temperature, pressure, law) | {"source": source}

    return _cached(name, [temperature, pressure, law], compute)


def cached_specific_heat(name: str, temperature: float, pressure: float) -> float:
    """Specific heat at constant pressure from CoolProp [J/kg/K], cached as by `cached_properties`.

    Raises FluidError if CoolProp has none.
    """

    def compute() -> dict[str, Any]:
        from CoolProp.CoolProp import PropsSI

        from fvsolve.core.fluid.coolprop import value_or_none

        value = value_or_none(lambda: PropsSI("C", "T", temperature, "P", pressure, name))
        return {"specific_heat": value, "table": None}

    value = _cached(name, [temperature, pressure, "specific heat"], compute)["specific_heat"]
    if value is None:
        raise FluidError("specific_heat", f"CoolProp has no specific heat of {name}")
    return value


def _cached(name: str, about: list, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Result of `compute`, read from a file if it is cached there; name, about : fluid, and further text of the key."""
    key = json.dumps([FORMAT, coolprop_version(), name, *about])
    stem = re.sub(r"[^A-Za-z0-9.-]+", "-", name)[:40]
    file = f"fluids/{stem}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"
    found = (_read(folder / file, key) for folder in reading_folders())
    properties = next((item for item in found if item is not None), None)
    if properties is None:
        properties = compute()
        _write(cache_folder() / file, key, properties)
    return properties


@functools.cache
def coolprop_version() -> str:
    """Version of CoolProp, without importing it."""
    from importlib.metadata import version

    return version("CoolProp")


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """Properties in a cache file; None if it is missing, damaged, of another key, or open to other users.

    key : text of name, state, law and versions
    """
    try:
        digest, body = (read_closed(path) or b"").decode().split("\n", 1)
        if digest != hashlib.sha256(body.encode()).hexdigest():
            return None
        stored_key, properties = json.loads(body)
        properties["table"] = properties["table"] and FluidTable(**properties["table"])
        return properties if stored_key == key else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _write(path: Path, key: str, properties: dict[str, Any]) -> None:
    """Write properties to a cache file atomically; do nothing if the folder cannot be written. key : as for `_read`"""
    body = json.dumps(
        [key, properties],
        default=lambda item: item.tolist() if hasattr(item, "tolist") else asdict(item),
    )
    text = hashlib.sha256(body.encode()).hexdigest() + "\n" + body
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(part, 0o644)  # users of a shared folder read it
        os.replace(part, path)
    except OSError:
        return
