"""Sheets of Excel workbooks (.xlsx, .xlsm) as header and rows of texts, through openpyxl.

Numbers become texts with all digits, dates become ISO 8601, so that a sheet and the same table as CSV give equal bits.
"""

import datetime
import warnings
import zipfile
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

SUFFIXES = (".xlsx", ".xlsm")
OTHER_SUFFIXES = (".xls", ".xlsb", ".ods")  # of spreadsheets that are not read
MOST_BYTES = 500_000_000  # of the unpacked files of a workbook
MOST_CELLS = 5_000_000  # of a sheet
MIDNIGHT = datetime.time()


class SheetRows(NamedTuple):
    """Rows of a sheet.

    header : names of the columns; lines : number of each row in the sheet; cells : texts of each row
    texts : (index of the row, index of the column) of cells that hold text, not numbers or dates
    percents : the same of cells that Excel shows as percentages
    """

    header: list[str]
    lines: list[int]
    cells: list[list[str]]
    texts: frozenset[tuple[int, int]]
    percents: frozenset[tuple[int, int]]


def is_workbook(path: Path) -> bool:
    """True for the path of an Excel workbook. Raises ValueError for spreadsheets of other formats."""
    suffix = path.suffix.lower()
    if suffix in OTHER_SUFFIXES:
        raise ValueError(
            f"{path.name} is a spreadsheet of the format {suffix}; expected it saved as .xlsx or .csv"
        )
    return suffix in SUFFIXES


def read_sheet(path: Path, sheet: str | None) -> SheetRows:
    """Rows of a sheet of a workbook; the last few sheets are kept.

    sheet : name of the sheet, None for the only one
    Raises ValueError for a file that is not a workbook, an unknown sheet, merged cells and formulas without values, and
    if openpyxl is not installed.
    """
    try:
        stat = path.stat()
    except OSError as error:
        raise ValueError(f"{path.name}: {error.strerror}") from None
    return _read_sheet(path, stat.st_mtime_ns, stat.st_size, sheet)


@lru_cache(maxsize=8)
def _read_sheet(path: Path, time: int, size: int, name: str | None) -> SheetRows:
    """Rows of a sheet; time, size : of the file, so that a changed file is read again"""
    sheet = open_sheet(path, name, True)
    if sheet.max_row * sheet.max_column > MOST_CELLS:
        text = f"{place(path, sheet)} has more than {MOST_CELLS:g} cells"
        raise ValueError(f"{text}; expected a smaller table, or a CSV file")
    rows = [row for row in sheet.iter_rows() if any(is_filled(cell) for cell in row)]
    rows = [row for row in rows if not str(row[0].value or "").startswith("#")]
    if len(rows) < 2:
        raise ValueError(f"{place(path, sheet)} has no rows; expected a header and rows of numbers")
    used = [k for k in range(len(rows[0])) if any(is_filled(row[k]) for row in rows)]
    rows = [[row[k] for k in used] for row in rows]
    refuse_merged(path, sheet, rows)
    gaps = [cell.coordinate for row in rows for cell in row if cell.value is None]
    if gaps:
        refuse_formulas(path, sheet.title, gaps)
    header, *body = rows
    return SheetRows(
        [cell_text(cell.value) for cell in header],
        [row[0].row for row in body],
        [[cell_text(cell.value) for cell in row] for row in body],
        marked(body, lambda cell: isinstance(cell.value, (str, bool)) and is_filled(cell)),
        marked(body, lambda cell: "%" in (cell.number_format or "")),
    )


def open_sheet(path: Path, name: str | None, stored: bool) -> Any:
    """Sheet of a workbook; stored : True for the stored values of formulas, False for the formulas

    Raises ValueError as `read_sheet` does.
    """
    try:
        openpyxl = import_module("openpyxl")
    except ImportError:
        text = f"{path.name} is an Excel workbook, which needs openpyxl"
        raise ValueError(f'{text}: pip install "fvsolve[excel]"') from None
    try:
        with zipfile.ZipFile(path) as parts:
            size = sum(part.file_size for part in parts.infolist())
        if size > MOST_BYTES:
            raise ValueError(
                f"{path.name} has {size:.3g} bytes when unpacked; expected at most {MOST_BYTES:g}"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of parts that hold no cells, such as lists of choices
            book = openpyxl.load_workbook(path, data_only=stored)
    except zipfile.BadZipFile:
        text = f"{path.name} is not an Excel workbook, or a password protects it"
        raise ValueError(f"{text}; expected it saved as .xlsx without a password") from None
    except (OSError, KeyError, TypeError, IndexError, AttributeError, SyntaxError) as error:
        raise ValueError(
            f"{path.name} is a damaged workbook ({error}); expected it saved again as .xlsx"
        ) from None
    sheets = {sheet.title: sheet for sheet in book.worksheets}
    if name is None and len(sheets) != 1:
        text = f"{path.name} has {len(sheets)} sheets: {listing([*map(show, sheets)])}"
        raise ValueError(f"{text}; expected the key `sheet`")
    if name is not None and name not in sheets:
        known = did_you_mean(name, sheets) or f"; sheets are {listing([*map(show, sheets)])}"
        raise ValueError(f"{path.name} has no sheet {show(name)}{known}")
    return next(iter(sheets.values())) if name is None else sheets[name]


def place(path: Path, sheet: Any) -> str:
    """Name of a sheet for messages."""
    return f"{path.name}, sheet {show(sheet.title)}"


def is_filled(cell: Any) -> bool:
    """True if a cell holds a value other than blanks."""
    return cell.value is not None and not (isinstance(cell.value, str) and not cell.value.strip())


def cell_text(value: Any) -> str:
    """Text of the value of a cell: numbers with all digits, dates in ISO 8601, "" for an empty cell."""
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, bool):
        return str(value).upper()
    return repr(value) if isinstance(value, (int, float)) else str(value).strip()


def marked(rows: list[list], is_marked: Any) -> frozenset[tuple[int, int]]:
    """(index of the row, index of the column) of cells for which a function returns True."""
    return frozenset(
        (i, k) for i, row in enumerate(rows) for k, cell in enumerate(row) if is_marked(cell)
    )


def refuse_merged(path: Path, sheet: Any, rows: list[list]) -> None:
    """Raise ValueError if a cell of the rows is merged with other cells."""
    used = {cell.coordinate for row in rows for cell in row}
    for merged in sheet.merged_cells.ranges:
        inside = {
            sheet.cell(i, k).coordinate
            for i in range(merged.min_row, min(merged.max_row, sheet.max_row) + 1)
            for k in range(merged.min_col, min(merged.max_col, sheet.max_column) + 1)
        }
        if inside & used:
            text = f"{place(path, sheet)}: cells {merged.coord} are merged"
            raise ValueError(
                f"{text}; expected a header in the first row, without titles above it, and single cells"
            )


def refuse_formulas(path: Path, name: str, gaps: list[str]) -> None:
    """Raise ValueError if one of the cells without a value holds a formula; gaps : coordinates of the cells"""
    sheet = open_sheet(path, name, False)
    for coordinate in gaps:
        if sheet[coordinate].data_type == "f":
            text = f"{place(path, sheet)}: cell {coordinate} holds a formula without a stored value"
            raise ValueError(
                f"{text}; expected a workbook that a spreadsheet program has computed and saved"
            )
