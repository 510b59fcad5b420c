"""Rows under columns that are declared once: as CSV, as plain values, as words on a terminal, as a table for a frame.

Knows no study. A row is a mapping; what a row does not have is None: an empty field, null, "-".
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

from fvsolve.output.summary import plain


class Plain:
    """What says itself in plain values: all its fields, and what is asked of them besides."""

    also: ClassVar[tuple[str, ...]] = ()  # names of properties

    def plain(self) -> dict:
        """For JSON: complex numbers as [re, im], None for what is not finite."""
        return {name: plain(getattr(self, name)) for name in (*(one.name for one in fields(self)), *self.also)}


@dataclass(frozen=True)
class Column:
    """A column: the key of its values, the header of files with its unit, and how a terminal says it.

    header : the key if left out; words : a format of numbers, or what says a whole row; head : the header there
    """

    key: str
    header: str = ""
    words: str | Callable[[Mapping], str] = ""
    head: str = ""

    @property
    def title(self) -> str:
        """The header in files."""
        return self.header or self.key

    def said(self, row: Mapping) -> str:
        """The value of a row in words."""
        return self.words(row) if callable(self.words) else text(row.get(self.key), self.words)


@dataclass(frozen=True)
class Sheet:
    """Rows under columns."""

    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]

    def plain(self) -> list[dict]:
        """Rows of plain values, as JSON says them."""
        return [{one.key: plain(row.get(one.key)) for one in self.columns} for row in self.rows]

    def listed(self) -> dict[str, list]:
        """The values of every column, by key: what a frame is made of."""
        return {one.key: [row.get(one.key) for row in self.rows] for one in self.columns}

    def write(self, path: Path) -> Path:
        """As CSV; returns its path."""
        rows = ([row[one.key] for one in self.columns] for row in self.plain())
        return write(path, [one.title for one in self.columns], rows)

    def words(self) -> tuple[list[str], list[list[str]]]:
        """Headers and rows for a terminal."""
        heads = [one.head or one.title for one in self.columns]
        return heads, [[one.said(row) for one in self.columns] for row in self.rows]


def columns(**titles: str) -> tuple[Column, ...]:
    """Columns by key and header, for what is only written."""
    return tuple(Column(key, title) for key, title in titles.items())


def text(value: Any, spec: str = "") -> str:
    """A value in words: "-" for None, yes and no, numbers by their format, words as they are."""
    if value is None or isinstance(value, str):
        return "-" if value is None else value
    return ("yes" if value else "no") if isinstance(value, bool) else format(value, spec)


def write(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> Path:
    """A CSV, an empty field for None; returns its path."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        made = csv.writer(file)
        made.writerow(header)
        made.writerows(["" if value is None else value for value in row] for row in rows)
    return path
