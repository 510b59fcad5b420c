"""TOML text of a case, and line numbers of the keys in a TOML text."""

import bisect
import datetime
import json
import re
import tomllib
from typing import Any

from fvsolve.errors import LONGEST_NAME

KeyPath = tuple[str | int, ...]

_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)+")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""")
_TEXT = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL
)
_BARE = re.compile(r"[^,\]\}\s#]+")
_SPACE = re.compile(r"[ \t]*")


def write(table: dict[str, Any]) -> str:
    """TOML text of nested dicts.

    Tables of the first level, and of the second level in nodes, links, signals and scalars, have a header. All other
    tables are written inline.
    """
    lines = [
        f"{_key(key)} = {inline(value)}"
        for key, value in table.items()
        if not isinstance(value, dict)
    ]
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
        return (
            "{ " + ", ".join(f"{_key(k)} = {inline(v)}" for k, v in value.items()) + " }"
            if value
            else "{}"
        )
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(inline(item) for item in value) + "]"
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    return repr(value)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


# Strings end at the first closing quote: the quantifiers take all they can and give nothing back, so that a search
# without a closing quote takes a time in proportion to the text.
_STRINGS = {
    '"': re.compile(r'(?:[^"\\\n]|\\.)*+"'),
    "'": re.compile(r"[^'\n]*+'"),
    '"""': re.compile(r'(?:[^"\\]|\\.|"(?!""))*+"{3,5}', re.DOTALL),
    "'''": re.compile(r"(?:[^']|'(?!''))*+'{3,5}"),
}
_TOKEN = re.compile(r'"""|\'\'\'|["\'#.]|[A-Za-z0-9_-]+|[ \t]+|[^A-Za-z0-9_"\'#. \t-]+')


def find_long_key(text: str, limit: int) -> int | None:
    """Line number of the first dotted key of more than `limit` names in a TOML text; None without such a key.

    tomllib takes time and memory that grow with the square of the number of names.
    """
    if all(line.count(".") < limit for line in text.split("\n")):
        return None
    at, dots = 0, 0
    while at < len(text):
        token = _TOKEN.match(text, at)[0]
        start, at = at, at + len(token)
        if token in _STRINGS:
            end = _STRINGS[token].match(text, at)
            if end is None:  # not valid TOML
                return None
            at = end.end()
        elif token == ".":
            dots += 1
            if dots >= limit:
                return text.count("\n", 0, start) + 1
        elif token == "#":
            at = text.find("\n", at)
            if at < 0:
                return None
        elif not (token[0] in " \t" or token[0].isalnum() or token[0] in "_-"):
            dots = 0
    return None


def key_lines(text: str) -> dict[KeyPath, int]:
    """Line number (from 1) of every key path of a TOML text that tomllib has checked.

    The key of an item of a list is its index.
    """
    scan = _Scan(text)
    try:
        scan.document()
    except (IndexError, RecursionError):  # return the lines collected so far
        pass
    return scan.lines


class _Scan:
    """Scanner of a TOML text: records the line of each key path."""

    def __init__(self, text: str):
        self.text = text
        self.at = 0
        self.lines: dict[KeyPath, int] = {}
        self.counts: dict[KeyPath, int] = {}
        self.breaks = [match.start() for match in re.finditer("\n", text)]

    def document(self) -> None:
        prefix: KeyPath = ()
        while True:
            self.skip(_BLANK)
            if self.at >= len(self.text):
                return
            if self.text[self.at] == "[":
                prefix = self.header()
            else:
                self.pair(prefix)
            end = self.text.find("\n", self.at)
            self.at = len(self.text) if end < 0 else end

    def header(self) -> KeyPath:
        several = self.text.startswith("[[", self.at)
        self.at += 2 if several else 1
        path = self.key()
        for count in range(1, len(path)):
            self.mark(path[:count])
        if several:
            number = self.counts.get(path, 0)
            self.counts[path] = number + 1
            self.mark(path)
            path = (*path, number)
        self.mark(path)
        return path

    def pair(self, prefix: KeyPath) -> None:
        start = self.at
        keys = self.key()
        for count in range(1, len(keys) + 1):
            self.mark(prefix + keys[:count], start)
        self.skip(_SPACE)
        self.at += 1  # =
        self.value(prefix + keys)

    def key(self) -> KeyPath:
        keys: list[str | int] = []
        while True:
            self.skip(_SPACE)
            match = _KEY.match(self.text, self.at)
            if match is None:
                raise IndexError("no key")
            self.at = match.end()
            keys.append(_unquote(match[0]))
            self.skip(_SPACE)
            if self.text[self.at] != ".":
                return tuple(keys)
            self.at += 1

    def value(self, path: KeyPath) -> None:
        self.skip(_SPACE)
        first = self.text[self.at]
        if first == "{":
            self.inside("}", path)
        elif first == "[":
            self.inside("]", path)
        elif first in "\"'":
            self.skip(_TEXT)
        else:
            self.skip(_BARE)

    def inside(self, close: str, path: KeyPath) -> None:
        """Read the items of an inline table or list at the key path `path`, up to its closing bracket `close`."""
        self.at += 1
        number = 0
        while True:
            self.skip(_BLANK)
            if self.text[self.at] == close:
                self.at += 1
                return
            if self.text[self.at] == ",":
                self.at += 1
            elif close == "}":
                self.pair(path)
            else:
                self.mark((*path, number))
                self.value((*path, number))
                number += 1

    def skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at

    def mark(self, path: KeyPath, at: int | None = None) -> None:
        position = self.at if at is None else at
        self.lines.setdefault(path, bisect.bisect_left(self.breaks, position) + 1)


def _unquote(key: str) -> str:
    if key[0] == "'":
        return key[1:-1]
    if key[0] != '"':
        return key
    return next(iter(tomllib.loads(f"{key} = 0")))
