"""CSV files: header, rows of numbers and units, and time series read from them.

The separator is a tab, a semicolon or a comma: the first that gives every row as many cells as the header. A longer or
shorter row is a fault, since its meaning would be ambiguous.
"""

import codecs
import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fvsolve import units
from fvsolve.errors import did_you_mean
from fvsolve.parts.value import ReadContext
from fvsolve.units import show

COMMA_HINT = "; with decimal commas, separate columns by ; or tabs"
SEPARATORS = ("\t", ";", ",")
PLAIN_SIGNS = frozenset("0123456789+-.eE")
NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")
MOST_COLUMNS = 4096


class CsvError(ValueError):
    """Fault of a CSV file, with its line number if known."""

    def __init__(self, file: str, message: str, line: int | None = None) -> None:
        self.message, self.line = message, line
        super().__init__(f"{file}{'' if line is None else f', line {line}'}: {message}")


@dataclass(frozen=True)
class CsvRows:
    """Rows of a CSV file.

    file : name of the file; header : column names with their units; lines : line number of each row
    cells : texts of each row, as many as the header has names
    """

    file: str
    header: list[str]
    lines: list[int]
    cells: list[list[str]]

    @property
    def names(self) -> list[str]:
        """Names of the columns, without units."""
        return [split_header(name)[0] for name in self.header]

    def column(self, name: str | None, default: int) -> int:
        """Index of a column by its name, with or without unit; `default` if the name is None.

        Raises ValueError if there is no such column, or if several columns have the name.
        """
        if name is None:
            if len(self.header) <= default:
                raise ValueError(
                    f"{self.file} has one column; expected a column of times and a column of values"
                )
            return default
        for known in (self.header, self.names):
            if known.count(name) > 1:
                raise ValueError(
                    f"{self.file} has {known.count(name)} columns {show(name)}; expected a single column of that name"
                )
            if name in known:
                return known.index(name)
        shown = f"{did_you_mean(name, self.header)}; columns are {', '.join(map(show, self.header[:20]))}"
        shown += ", ..." if len(self.header) > 20 else ""
        raise ValueError(f"{self.file} has no column {show(name)}{shown}")

    def numbers(
        self, column: int, dimension: str, ambient: float = 101325.0, stated: str = ""
    ) -> np.ndarray:
        """Values of a column in SI : float64[n].

        The header of the column states its unit; without one it is the unit `stated`, or else SI. Pressures become
        absolute.
        dimension : dimension that the unit must have; ambient : ambient pressure [Pa], added to gauge pressures
        Raises ValueError for a unit of another dimension, for two units, and for texts that are not numbers.
        """
        unit = split_header(self.header[column])[1]
        if unit and stated:
            text = f"{self.file}, column {show(self.header[column])} has its own unit; leave out `unit`"
            raise ValueError(text)
        unit = unit or stated
        try:
            known = units.find(unit, dimension) if unit else None
        except ValueError as error:
            raise ValueError(f"{self.file}, column {show(self.header[column])}: {error}") from None
        values = np.array(self.plain(column))
        if known is None:
            return values
        return known.si(values) + (ambient if known.gauge and dimension == "pressure" else 0.0)

    def plain(self, column: int) -> list[float]:
        """Numbers of a column without conversion of units.

        Raises CsvError for other texts, and for a decimal comma below a number with a decimal point.
        """
        texts = [row[column] for row in self.cells]
        if PLAIN_SIGNS.issuperset("".join(texts)):  # for long columns: NumPy reads the same numbers
            try:
                if np.isfinite(array := np.array(texts, float)).all():
                    return array.tolist()
            except ValueError:
                pass
        values, points = [], False
        for k, (line, row) in enumerate(zip(self.lines, self.cells, strict=True)):
            text = row[column]
            value = number(text)
            if value is None:
                message = f"{show(text)} is not a number in column {show(self.header[column])}"
                if k == 0 and all(number(cell) is None for cell in row):
                    message += f"; expected units in the header, for example {self.names[0]} [s]"
                raise CsvError(self.file, message, line)
            points = points or "." in text
            if points and "," in text:
                message = f"{show(text)} has a decimal comma, but numbers above have decimal points"
                raise CsvError(
                    self.file, f"{message}; expected one decimal sign in the column", line
                )
            values.append(value)
        return values


def split_header(header: str) -> tuple[str, str]:
    """(name, unit) of a header such as "t [s]" or "t (s)"; the unit is empty if the header has none.

    Text in round brackets that is not a unit belongs to the name.
    """
    for opening, closing in ("[]", "()"):
        name, bracket, unit = header[:-1].partition(opening)
        if header.endswith(closing) and bracket and (opening == "[" or units.is_unit(unit)):
            return name.rstrip(), unit
    return header, ""


def number(text: str) -> float | None:
    """Value of the text of a cell, with a decimal point or comma; None if it is not a finite number."""
    text = text.replace("\N{MINUS SIGN}", "-")
    value = float(text.replace(",", ".")) if NUMBER.fullmatch(text) else np.inf
    return value if np.isfinite(value) else None


def read_rows(path: Path) -> CsvRows:
    """Read header and rows of a CSV file; empty lines and lines that begin with # are skipped.

    Raises ValueError for a file that cannot be read, a missing header, or rows that do not match the header.
    """
    lines = [
        (n, line)
        for n, line in enumerate(read_text(path).splitlines(), 1)
        if line.strip() and line[0] != "#"
    ]
    if len(lines) < 2:
        raise ValueError(f"{path.name} has no rows; expected a header and rows of numbers")
    readings = {
        mark: split_lines(path, lines, mark) for mark in SEPARATORS if mark in lines[0][1]
    } or {",": split_lines(path, lines)}
    header, *rows = next(iter(readings.values()))
    # the first with at least two cells in each row, as many in all rows
    for reading in readings.values():
        if len(reading[0]) > 1 and {len(row) for row in reading} == {len(reading[0])}:
            header, *rows = reading
            break
    if len(header) > MOST_COLUMNS:
        raise ValueError(f"{path.name} has {len(header)} columns; expected at most {MOST_COLUMNS}")
    if all(number(name) is not None for name in header):
        raise ValueError(f'{path.name} has no header; expected for example "t [s],opening [-]"')
    for (line, _), row in zip(lines[1:], rows, strict=True):
        if len(row) != len(header):
            count = f"{len(row)} cell{'' if len(row) == 1 else 's'} under {len(header)} header"
            raise CsvError(
                path.name,
                f"{count}{'' if len(header) == 1 else 's'}{COMMA_HINT * (len(row) > len(header))}",
                line,
            )
        nameless = next(
            (cell for cell, name in zip(row, header, strict=True) if cell and not name), None
        )
        if nameless is not None:
            raise CsvError(path.name, f"{show(nameless)} has no header{COMMA_HINT}", line)
    return CsvRows(path.name, header, [line for line, _ in lines[1:]], rows)


def split_lines(path: Path, lines: list[tuple[int, str]], mark: str = ",") -> list[list[str]]:
    """Split each line into the texts of its cells; mark : separator; path : file, for messages"""
    if not any('"' in line for _, line in lines):
        return [[cell.strip() for cell in line.split(mark)] for _, line in lines]
    try:
        return [
            [cell.strip() for cell in next(csv.reader([line], delimiter=mark))] for _, line in lines
        ]
    except csv.Error as error:
        raise ValueError(f"{path.name}: {error}") from None


def read_text(path: Path) -> str:
    """Text of a file in UTF-8 or UTF-16, with or without byte order mark. Raises ValueError if it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path.name}: {error.strerror}") from None
    coding = "utf-8-sig"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        coding = "utf-16"
    elif data[1:2] == b"\0" or data[:1] == b"\0":
        coding = "utf-16-le" if data[1:2] == b"\0" else "utf-16-be"
    try:
        text = data.decode(coding)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise ValueError(f"{path.name} is not UTF-8 or UTF-16 text; expected a file saved as UTF-8")
    return text


def find_file(name: str, setting: ReadContext) -> Path:
    """Path of a file whose name is relative to the case; add the file to those of the context.

    Raises ValueError if it is missing.
    """
    setting.lookups += 1
    path = Path(name)
    if not path.is_absolute():
        path = (setting.folder or Path.cwd()) / path
    try:
        if not path.is_file():
            others = [other.name for other in path.parent.iterdir()] if path.parent.is_dir() else []
            near = did_you_mean(path.name, others)
            state = "is a directory, not a file" if path.is_dir() else "there is no such file"
            raise ValueError(
                f"{show(name)}: {state}{near}; a relative path starts at the folder of the case file, {path.parent}"
            )
    except OSError as error:
        raise ValueError(f"{show(name)}: {error.strerror}") from None
    setting.files.setdefault(copy_name(path, setting), path)
    return path


def copy_name(path: Path, setting: ReadContext) -> str:
    """Name of the copy of a file beside the resolved case: its own name, numbered if another file has it."""
    name, number = path.name, 2
    while setting.files.get(name, path) != path:
        name, number = f"{path.stem}-{number}{path.suffix}", number + 1
    return name


def read_columns(
    path: Path,
    time: str | None,
    value: str | None,
    dimension: str,
    setting: ReadContext,
    unit: str = "",
) -> tuple[np.ndarray, np.ndarray, str, str]:
    """(times [s], values [SI, pressures absolute], header of the times, header of the values) of a CSV file.

    Times and values are float64[n].
    time, value : headers of the columns, with or without unit; None for the first and the second column
    unit : unit of the values if their header has none; "" for SI
    Raises ValueError with the faulty line of the file.
    """
    rows = read_rows(path)
    time_column, value_column = rows.column(time, 0), rows.column(value, 1)
    t = rows.numbers(time_column, "time")
    v = rows.numbers(value_column, dimension, setting.ambient, unit)
    return t, v, rows.header[time_column], rows.header[value_column]
