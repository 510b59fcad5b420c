"""Tables: units, pipe materials and classes, pump characteristics, words of other programs, symbols of parts."""

import functools
import tomllib
from pathlib import Path
from typing import Any


@functools.cache
def read_table(name: str) -> dict[str, Any]:
    """Content of the file NAME.toml in this folder."""
    return tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8"))
