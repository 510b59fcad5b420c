"""Tables of results: columns are declared once for CSV, plain values, text on a terminal, and data frames.

A row is a mapping. A missing value is None: an empty field in CSV, null in JSON, "-" on a terminal.
"""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar

from fvsolve.core.output.summary_file import plain
from fvsolve.file_replacement import replacing


class PlainData:
    """Base class of dataclasses with plain values for JSON.

    json : names of JSON in order, each a field or property, or "NAME=FIELD.ATTRIBUTE"; default: all fields
    also : names of further properties
    """

    json: ClassVar[str] = ""
    also: ClassVar[tuple[str, ...]] = ()

    def plain(self) -> dict:
        """Plain values for JSON: complex numbers as [re, im], None for values that are not finite."""
        names = self.json.split() or [field.name for field in fields(self)]
        paths = (name.partition("=") for name in (*names, *self.also))
        return {name: plain(attrgetter(path or name)(self)) for name, _, path in paths}


@dataclass(frozen=True)
class Column:
    """Column of a table: key of its values, header in files with unit, and format on a terminal.

    key : key of the values in the rows; header : header in files (default the key)
    words : format of numbers such as ".3g", or a function of the row that returns text
    head : header on a terminal (default `header`)
    """

    key: str
    header: str = ""
    words: str | Callable[[Mapping], str] = ""
    head: str = ""

    @property
    def title(self) -> str:
        """Header of the column in files."""
        return self.header or self.key


@dataclass(frozen=True)
class ResultTable:
    """Table of results; rows : for each row a mapping from the keys of the columns to values."""

    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]

    def plain(self) -> list[dict]:
        """Rows of plain values for JSON."""
        return [{column.key: plain(row.get(column.key)) for column in self.columns} for row in self.rows]

    def table_columns(self) -> dict[str, list]:
        """Values of every column by key, for a data frame."""
        return {column.key: [row.get(column.key) for row in self.rows] for column in self.columns}

    def write(self, path: Path) -> Path:
        """Write the table as CSV; returns the path."""
        rows = ([row[column.key] for column in self.columns] for row in self.plain())
        return write_csv(path, [column.title for column in self.columns], rows)

    def words(self) -> tuple[list[str], list[list[str]]]:
        """Headers and rows as text for a terminal."""
        heads = [column.head or column.title for column in self.columns]
        return heads, [[column.words(row) if callable(column.words) else cell_text(row.get(column.key), column.words)
                        for column in self.columns] for row in self.rows]  # fmt: skip


def columns(**titles: str) -> tuple[Column, ...]:
    """Columns from `key = "header"` arguments, for tables that are only written to files."""
    return tuple(Column(key, title) for key, title in titles.items())


def cell_text(value: Any, spec: str = "") -> str:
    """Text of a value: "-" for None, yes or no for bool, numbers by the format `spec`, text unchanged."""
    if value is None or isinstance(value, str):
        return "-" if value is None else value
    return ("yes" if value else "no") if isinstance(value, bool) else format(value, spec)


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> Path:
    """Write a CSV file, with an empty field for None; returns the path."""
    with replacing(path) as fresh, open(fresh, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(["" if value is None else value for value in row] for row in rows)
    return path
