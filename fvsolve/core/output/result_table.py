"""Tables of results: columns are declared once for CSV, plain values, text on a terminal, data frames and reports.

A missing value is None: an empty field in CSV, null in JSON, "-" on a terminal, a dash in a report.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar

from fvsolve.core.output.summary_file import plain
from fvsolve.file_replacement import replacing

MAX_ROWS = 60  # greatest number of rows of a table on a page, unless the table states `most`


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
    """Column of a table: key of its values, header, unit, and format on a terminal.

    key : key of the values in rows that are mappings; header : header without unit (default the key)
    words : format of numbers such as ".3g", or a function of the row that returns text
    head : header on a terminal (default `title`)
    unit : unit of all values; "" for words, for numbers without unit, and if the header states the unit
    mixed : True if the rows have different units
    """

    key: str = ""
    header: str = ""
    words: str | Callable[[Mapping], str] = ""
    head: str = ""
    unit: str = ""
    mixed: bool = False

    @property
    def name(self) -> str:
        """Header of the column without its unit."""
        return self.header or self.key

    @property
    def title(self) -> str:
        """Header of the column in files, with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class ResultTable:
    """Table of results, for a terminal, a file, JSON, a data frame or a report.

    rows : for each row a mapping from the keys of the columns to values, or the values of all columns in order
    title : caption in a report; bad : indices of highlighted rows; most : greatest number of rows on a page
    more : text that states where the rows are that a page leaves out
    links : address of a page for each row, to which the first cell links
    """

    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any] | Sequence[Any]]
    title: str = ""
    bad: frozenset[int] = frozenset()
    most: int = MAX_ROWS
    more: str = ""
    links: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        title: str,
        headers: Sequence[str],
        rows: Sequence[Sequence[Any]],
        units: Sequence[str] = (),
        bad: frozenset[int] = frozenset(),
        mixed: Collection[int] = (),
        **more: Any,
    ) -> ResultTable:
        """Table with these headers of columns.

        units : unit of each column, or of the first columns; mixed : indices of columns whose rows have different units
        more : further fields of the table
        """
        units = [*units, *[""] * (len(headers) - len(units))]
        columns = [
            Column(header=header, unit=unit, mixed=k in mixed)
            for k, (header, unit) in enumerate(zip(headers, units, strict=True))
        ]
        return cls(columns, rows, title, bad, **more)

    def __bool__(self) -> bool:
        """True if the table has rows; a report leaves out a table without rows."""
        return bool(self.rows)

    @property
    def heads(self) -> list[tuple[str, str]]:
        """Pairs (header, unit) of all columns."""
        return [(column.name, column.unit) for column in self.columns]

    @property
    def values(self) -> list[list]:
        """Values of all rows in the order of the columns; None for a missing value."""
        keys = [column.key for column in self.columns]
        return [
            [row.get(key) for key in keys] if isinstance(row, Mapping) else [*row]
            for row in self.rows
        ]

    def plain(self) -> list[dict]:
        """Rows of plain values for JSON."""
        keys = [column.key for column in self.columns]
        return [
            {key: plain(value) for key, value in zip(keys, row, strict=True)} for row in self.values
        ]

    def table_columns(self) -> dict[str, list]:
        """Values of every column by key, for a data frame."""
        values = self.values
        return {column.key: [row[k] for row in values] for k, column in enumerate(self.columns)}

    def write(self, path: Path) -> Path:
        """Write the table as CSV; returns the path."""
        return write_csv(path, [column.title for column in self.columns], plain(self.values))

    def words(self) -> tuple[list[str], list[list[str]]]:
        """Headers and rows as text for a terminal."""
        heads = [column.head or column.title for column in self.columns]
        return heads, [
            [
                column.words(row) if callable(column.words) else cell_text(value, column.words)
                for column, value in zip(self.columns, cells, strict=True)
            ]
            for row, cells in zip(self.rows, self.values, strict=True)
        ]


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
