"""Line numbers of the keys in a TOML text that tomllib has checked."""

from __future__ import annotations

import bisect
import re

Path = tuple[str | int, ...]

_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)+")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""")
_TEXT = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL)
_BARE = re.compile(r"[^,\]\}\s#]+")
_SPACE = re.compile(r"[ \t]*")


def key_lines(text: str) -> dict[Path, int]:
    """Line number (from 1) of every key path of a valid TOML text; the key of an item of a list is its index."""
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
        self.lines: dict[Path, int] = {}
        self.counts: dict[Path, int] = {}
        self.breaks = [match.start() for match in re.finditer("\n", text)]

    def document(self) -> None:
        prefix: Path = ()
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

    def header(self) -> Path:
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

    def pair(self, prefix: Path) -> None:
        start = self.at
        keys = self.key()
        for count in range(1, len(keys) + 1):
            self.mark(prefix + keys[:count], start)
        self.skip(_SPACE)
        self.at += 1  # =
        self.value(prefix + keys)

    def key(self) -> Path:
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

    def value(self, path: Path) -> None:
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

    def inside(self, close: str, path: Path) -> None:
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

    def mark(self, path: Path, at: int | None = None) -> None:
        position = self.at if at is None else at
        self.lines.setdefault(path, bisect.bisect_left(self.breaks, position) + 1)


def _unquote(key: str) -> str:
    if key[0] == "'":
        return key[1:-1]
    if key[0] != '"':
        return key
    import tomllib

    return next(iter(tomllib.loads(f"{key} = 0")))
