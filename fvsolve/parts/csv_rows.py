"""Table files, CSV or Excel: header, rows of numbers and units, and time series read from them.

The separator is a tab, a semicolon or a comma: the first that gives every row as many cells as the header. A longer or
shorter row is a fault, since its meaning would be ambiguous.
"""

import codecs
import csv
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.errors import did_you_mean
from fvsolve.parts.date_keys import DATE_KEYS
from fvsolve.parts.table_model import FILE_KEYS, SHEET_KEY, read_keys
from fvsolve.parts.time_stamps import (
    Stamp,
    StampError,
    StartTime,
    begins_as_stamp,
    order_fault,
    read_stamp,
    read_zone,
)
from fvsolve.parts.value import UNREAD, ReadContext, ValueFault
from fvsolve.units import show

SPREADSHEETS = (".xlsx", ".xlsm", ".xls", ".xlsb", ".ods")  # suffixes
COMMA_HINT = "; with decimal commas, separate columns by ; or tabs"
SEPARATORS = ("\t", ";", ",")
PLAIN_SIGNS = frozenset("0123456789+-.eE")
NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")
SEPARATOR_LINE = re.compile(r"sep=[,;\t]?", re.IGNORECASE)
MOST_COLUMNS = 4096
MIDNIGHT = " 00:00:00"  # of a date in a cell of Excel
ZONE_HEADER = re.compile(r"[\[(]((?:UTC|GMT|Z)(?:[+-][\d:]+)?|[+-][\d:]+)[\])]$")


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
    texts : (index of the row, index of the column) of cells of a workbook that hold text, so that they are no numbers
    """

    file: str
    header: list[str]
    lines: list[int]
    cells: list[list[str]]
    texts: frozenset[tuple[int, int]] = frozenset()

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

    def with_dates(self, date: str, clock: str) -> "CsvRows":
        """Rows with a further column of dates with times of the day, from a column of each. Raises ValueError."""
        first, second = self.column(date, 0), self.column(clock, 0)
        texts = [f"{row[first].removesuffix(MIDNIGHT)} {row[second]}" for row in self.cells]
        if not begins_as_stamp(texts[0]):
            text = f"{self.file}: {show(texts[0])} of the columns {show(date)} and {show(clock)} is not a date"
            raise ValueError(f"{text}; expected a column of dates and a column of times of the day")
        cells = [[*row, text] for row, text in zip(self.cells, texts, strict=True)]
        return replace(self, header=[*self.header, self.header[first]], cells=cells)

    def seconds(
        self, column: int, start: Any, order: str | None = None, zone: str | None = None
    ) -> np.ndarray:
        """Times t [s] of a column of numbers or of dates : float64[n].

        start : instant of t = 0 (`StartTime`), None if the case has none, UNREAD if it is faulty
        order, zone : values of the keys `date_order` and `time_zone`, None without them
        Raises ValueError for the faults of `numbers`, for dates that are not valid, do not rise or lack an instant of
        t = 0, and for keys of dates with a column of numbers.
        """
        texts = [row[column] for row in self.cells]
        place = f"{self.file}, column {show(self.header[column])}"
        if not begins_as_stamp(texts[0]):
            for key, value in (("date_order", order), ("time_zone", zone)):
                if value is not None:
                    raise ValueError(f"{place} has numbers, not dates; leave out `{key}`")
            return self.numbers(column, "time")
        stated = ZONE_HEADER.search(self.header[column])
        unit = split_header(self.header[column])[1]
        if unit and not stated:
            text = f"{place} has the unit {show(unit)}, but {show(texts[0])} is a date"
            raise ValueError(
                f"{text}; expected a header without unit, or with a zone such as [UTC]"
            )
        try:
            offset = read_zone(zone or stated[1]) if zone is not None or stated else None
        except StampError as error:
            raise ValueError(f"{place}: {error}") from None
        stamps = self.stamps(column, order, offset)
        try:
            if start is None:
                text = f"{show(texts[0])} is a date, and the case has no start time"
                raise StampError(f"{text}; expected numerics.start_time, for example {stamps[0]}")
            zero = StartTime(stamps[0]) if start is UNREAD else start
            return np.array([zero.seconds(stamp) for stamp in stamps])
        except StampError as error:
            raise CsvError(self.file, str(error), self.lines[0]) from None

    def stamps(self, column: int, order: str | None, offset: int | None) -> list[Stamp]:
        """Instants of a column of dates, which must rise; order, offset : as for `read_stamp`

        Raises CsvError with the faulty line, also if only some of the dates have a zone.
        """
        stamps: list[Stamp] = []
        texts = [row[column] for row in self.cells]
        for k, text in enumerate(texts):
            try:
                stamps.append(read_stamp(text, order, offset))
            except StampError as error:
                raise CsvError(self.file, str(error), self.lines[k]) from None
            if (stamps[k].offset is None) != (stamps[0].offset is None):
                state = f"{show(text)} and {show(texts[0])}: only one of them has a zone"
                remedy = "expected a zone in all rows or in none"
                raise CsvError(self.file, f"{state}; {remedy}", self.lines[k])
        if fault := order_fault(stamps, texts):
            raise CsvError(self.file, fault[1], self.lines[fault[0]])
        return stamps

    def plain(self, column: int) -> list[float]:
        """Numbers of a column without conversion of units.

        Raises CsvError for other texts, and for a decimal comma below a number with a decimal point.
        """
        texts = [row[column] for row in self.cells]
        for k, text in enumerate(texts if self.texts else ()):
            if (k, column) in self.texts and number(text) is not None:
                message = f"{show(text)} is stored as text in column {show(self.header[column])}"
                raise CsvError(self.file, f"{message}; expected a number", self.lines[k])
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


def read_rows(path: Path, sheet: str | None = None) -> CsvRows:
    """Read header and rows of a CSV file or of a sheet of an Excel workbook.

    Empty lines, lines that begin with #, and a first line `sep=;` are skipped.
    sheet : name of the sheet, None for the only one
    Raises ValueError for a file that cannot be read, a missing header, or rows that do not match the header.
    """
    if path.suffix.lower() in SPREADSHEETS:
        from fvsolve.parts import excel_files  # most cases have no workbooks

        if excel_files.is_workbook(path):
            return rows_of_sheet(path.name, sheet, excel_files.read_sheet(path, sheet))
    if sheet is not None:
        raise ValueError(
            f"{path.name} is not an Excel workbook and has no sheets; leave out `sheet`"
        )
    lines = [
        (n, line)
        for n, line in enumerate(read_text(path).splitlines(), 1)
        if line.strip() and line[0] != "#"
    ]
    if lines and SEPARATOR_LINE.fullmatch(lines[0][1].strip()):  # which Excel writes and reads
        del lines[0]
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
    found = CsvRows(path.name, header, [line for line, _ in lines[1:]], rows)
    check_header(found, COMMA_HINT)
    return found


def rows_of_sheet(file: str, name: str | None, sheet: Any) -> CsvRows:
    """Rows of a sheet of a workbook (`SheetRows`); file : name of the workbook, name : of the sheet, None if not stated

    Raises ValueError as `read_rows` does, and for percentages below a header in %, of which Excel shows a hundredfold.
    """
    place = file if name is None else f"{file}, sheet {show(name)}"
    found = CsvRows(place, sheet.header, sheet.lines, sheet.cells, sheet.texts)
    check_header(found, "")
    for k, column in sorted(sheet.percents):
        if (
            split_header(found.header[column])[1] == "%"
            and number(found.cells[k][column]) is not None
        ):
            value = found.cells[k][column]
            text = f"{value} is shown as a percentage below the header {show(found.header[column])}"
            raise CsvError(
                place, f"{text}; expected a header without unit, or plain numbers", found.lines[k]
            )
    return found


def check_header(rows: CsvRows, hint: str) -> None:
    """Raise ValueError if rows do not match their header; hint : remedy for rows that are too long"""
    header = rows.header
    if len(header) > MOST_COLUMNS:
        raise ValueError(f"{rows.file} has {len(header)} columns; expected at most {MOST_COLUMNS}")
    if all(number(name) is not None for name in header):
        raise ValueError(f'{rows.file} has no header; expected for example "t [s],opening [-]"')
    for line, row in zip(rows.lines, rows.cells, strict=True):
        if len(row) != len(header):
            count = f"{len(row)} cell{'' if len(row) == 1 else 's'} under {len(header)} header"
            text = f"{count}{'' if len(header) == 1 else 's'}{hint * (len(row) > len(header))}"
            raise CsvError(rows.file, text, line)
        nameless = next(
            (cell for cell, name in zip(row, header, strict=True) if cell and not name), None
        )
        if nameless is not None:
            raise CsvError(rows.file, f"{show(nameless)} has no header{hint}", line)


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
    path: Path, keys: dict[str, Any], dimension: str, setting: ReadContext
) -> tuple[np.ndarray, np.ndarray, str | list[str], str]:
    """(times [s], values [SI, pressures absolute], header(s) of the times, header of the values) of a table file.

    Times and values are float64[n].
    keys : as read: `time`, `value`, headers of the columns, with or without unit, None for the first and the second
    column, and for `time` also the headers of a column of dates and of a column of times of the day;
    `unit` of the values if their header has none, "" for SI; and those of `DATE_KEYS` and `SHEET_KEY`
    Raises ValueError with the faulty line of the file.
    """
    rows = read_rows(path, keys["sheet"])
    value_column = rows.column(keys["value"], 1)
    if isinstance(keys["time"], tuple):
        time_header: Any = list(keys["time"])
        rows, time_column = rows.with_dates(*keys["time"]), len(rows.header)
    else:
        time_column = rows.column(keys["time"], 0)
        time_header = rows.header[time_column]
    t = rows.seconds(time_column, setting.start_time, keys["date_order"], keys["time_zone"])
    v = rows.numbers(value_column, dimension, setting.ambient, keys.get("unit", ""))
    return t, v, time_header, rows.header[value_column]


def stated_keys(keys: dict[str, Any]) -> dict[str, Any]:
    """Keys of `SHEET_KEY` and `DATE_KEYS` that have a value, for the resolved case."""
    return {key: keys[key] for key in (*SHEET_KEY, *DATE_KEYS) if keys[key] is not None}


def read_table_file(
    given: dict[str, Any], setting: ReadContext
) -> tuple[Path, CsvRows, dict[str, str]]:
    """(path, rows, table for the resolved case) of a table `{ file }` or `{ file, sheet }` of a case file.

    Raises ValueFault for faults of the table and of the file.
    """
    keys = read_keys(given, FILE_KEYS, setting)
    try:
        path = find_file(keys["file"], setting)
        rows = read_rows(path, keys["sheet"])
    except ValueError as error:
        raise ValueFault([(("file",), str(error))]) from None
    stated = {} if keys["sheet"] is None else {"sheet": keys["sheet"]}
    return path, rows, {"file": copy_name(path, setting), **stated}
