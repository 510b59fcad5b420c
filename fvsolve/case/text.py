"""TOML text of a case."""

from __future__ import annotations

import json
import re
from typing import Any

from fvsolve.errors import LONGEST_NAME


def write(table: dict[str, Any]) -> str:
    """TOML text of nested dicts.

    Tables of the first level, and of the second level in nodes, links, signals and scalars, have a header. All other
    tables are written inline.
    """
    lines = [f"{_key(key)} = {inline(value)}" for key, value in table.items() if not isinstance(value, dict)]
    for key, value in table.items():
        if isinstance(value, dict):
            lines += _section(key, value)
    return "\n".join(lines) + "\n"


def path(keys: tuple[Any, ...]) -> str:
    """Text of a key path for messages, such as `links.main.length` or `output.probes[2]`."""
    text = ""
    for key in keys:
        name = str(key) if len(str(key)) <= LONGEST_NAME else f"{str(key)[:57]}..."
        text += f"[{key}]" if isinstance(key, int) else ("." if text else "") + _key(name)
    return text


def _section(key: str, table: dict[str, Any]) -> list[str]:
    deep = key in ("nodes", "links", "signals", "scalars")
    if deep:
        lines = []
        for name, part in table.items():
            if isinstance(part, dict):
                lines += ["", f"[{_key(key)}.{_key(name)}]"]
                lines += [f"{_key(k)} = {inline(v)}" for k, v in part.items()]
        plain = [f"{_key(k)} = {inline(v)}" for k, v in table.items() if not isinstance(v, dict)]
        return (["", f"[{_key(key)}]", *plain] if plain else []) + lines
    return ["", f"[{_key(key)}]"] + [f"{_key(k)} = {inline(v)}" for k, v in table.items()]


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _text(key)


def inline(value: Any) -> str:
    """TOML text of a value to the right of `key =`; tables are written inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {inline(v)}" for k, v in value.items()) + " }" if value else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(inline(item) for item in value) + "]"
    return repr(value)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
