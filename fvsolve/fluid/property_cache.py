"""Disk cache of fluid properties: one file per fluid, state, law and CoolProp version."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fvsolve.fluid.coolprop import coolprop_properties
from fvsolve.fluid.isentrope_table import FluidTable
from fvsolve.jit import cache_folder

FORMAT = 1  # version of file format and contents; increase it when either changes


def cached_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    """Fields of `Fluid` from CoolProp, read from a file if they are cached there; CoolProp is then not imported.

    Arguments as for `coolprop_properties`.
    """
    key = json.dumps([FORMAT, coolprop_version(), name, temperature, pressure, law])
    stem = re.sub(r"[^A-Za-z0-9.-]+", "-", name)[:40]
    path = cache_folder() / "fluids" / f"{stem}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"
    properties = _read(path, key)
    if properties is None:
        properties = coolprop_properties(name, temperature, pressure, law) | {
            "source": f"CoolProp {coolprop_version()}"
        }
        _write(path, key, properties)
    return properties


@functools.cache
def coolprop_version() -> str:
    """Version of CoolProp, without importing it."""
    from importlib.metadata import version

    return version("CoolProp")


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """Properties in a cache file; None if the file is missing or damaged, or was written for another key.

    key : text of name, state, law and versions
    """
    try:
        digest, body = path.read_text(encoding="utf-8").split("\n", 1)
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
        [key, properties], default=lambda item: item.tolist() if hasattr(item, "tolist") else asdict(item)
    )
    text = hashlib.sha256(body.encode()).hexdigest() + "\n" + body
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(part, path)
    except OSError:
        return
