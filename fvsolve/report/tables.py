"""Report tables: rows of words and numbers under headers with units, aligned at the decimal points."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fvsolve.errors import visible

DIGITS = 5  # significant digits of the greatest number of a column
DECIMALS = 6  # greatest number of decimals, unless the least number of the column needs more
MAX_SHARED_DIGITS = 7  # greatest number of digits after the first if all numbers of a column have the same decimals
MAX_ROWS = 60  # greatest number of rows of a table on the page, unless the table states `most`
ERROR_HEADER = "\u00b1"  # header of columns of errors, shown with two digits
# Spaces: between thousands, as wide as a digit, as wide as a point.
NARROW_SPACE, FIGURE_SPACE, POINT_SPACE = "\u202f", "\u2007", "\u2008"


def in_unit(unit_column, value: float | None) -> float | None:
    """Convert a number from SI to the unit of a column; None is returned unchanged."""
    return None if value is None else float(unit_column.from_si(value))


@dataclass(frozen=True)
class ReportTable:
    """Table of a report with headers; cells are words, numbers, truth values or None.

    units : unit of each column, "" for words and numbers without unit
    bad : indices of highlighted rows
    mixed_units : indices of columns whose rows have different units
    most : greatest number of rows on the page
    more : text that states where the rows are that the page leaves out
    links : address of a page for each row, to which the first cell links
    """

    title: str
    headers: Sequence[str]
    rows: Sequence[Sequence[Any]]
    units: Sequence[str] = ()
    bad: frozenset[int] = frozenset()
    mixed_units: frozenset[int] = frozenset()
    most: int = MAX_ROWS
    more: str = ""
    links: Sequence[str] = ()

    def __bool__(self) -> bool:
        """True if the table has rows; a table without rows is left out."""
        return bool(self.rows)

    @property
    def heads(self) -> list[tuple[str, str]]:
        """Pairs (header, unit) of all columns."""
        return list(zip(self.headers, [*self.units, *[""] * (len(self.headers) - len(self.units))], strict=True))

    @property
    def named(self) -> bool:
        """True if any column has a header."""
        return any(self.headers)

    @property
    def numeric(self) -> list[bool]:
        """List with True for each column that contains numbers and no words; it is then aligned to the right."""
        columns = [[row[k] for row in self.rows] for k in range(len(self.headers))]
        return [any(is_number(value) for value in column) and not any(isinstance(value, str) for value in column)
                for column in columns]  # fmt: skip

    @property
    def words(self) -> list[list[str]]:
        """Texts of the cells in the rows that the page shows, aligned by column."""
        shown = self.rows[: self.most]
        rough = [k for k, head in enumerate(self.headers) if head == ERROR_HEADER]
        shown = [[float(f"{value:.2g}") if k in rough and is_number(value) else value for k, value in enumerate(row)]
                 for row in shown]  # fmt: skip
        columns = [aligned_texts([row[k] for row in shown], k in self.mixed_units) for k in range(len(self.headers))]
        return [list(row) for row in zip(*columns, strict=True)]

    @property
    def left_out(self) -> str:
        """Note below a table that has more rows than the page shows; "" if all rows are shown."""
        hidden = len(self.rows) - self.most
        text = f"{hidden} more row{'' if hidden == 1 else 's'}: {self.more or 'in the workbook (--xlsx)'}"
        return text if hidden > 0 else ""


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def aligned_texts(values: Sequence[Any], loose: bool = False) -> list[str]:
    """Texts of the values of a column, padded so that decimal points align.

    loose : True if the rows have different units, so that numbers may have different numbers of decimals
    """
    places = None if loose else decimal_places([value for value in values if is_number(value)])
    words = [value_text(value, places) for value in values]
    behind = [text.partition(".")[1:] for text, value in zip(words, values, strict=True) if is_number(value)]
    widest = max((len(rest) for point, rest in behind if point), default=-1)
    if widest < 0:
        return words
    return [_padded(text, widest) if is_number(value) or value is None else text
            for text, value in zip(words, values, strict=True)]  # fmt: skip


def _padded(text: str, widest: int) -> str:
    _, point, rest = text.partition(".")
    return text + ("" if point else POINT_SPACE) + FIGURE_SPACE * (widest - len(rest))


def decimal_places(numbers: Sequence[float]) -> int | None:
    """Number of decimals of all numbers in a column; None if they differ too much in size for a common number."""
    sizes = [abs(size) for size in numbers if math.isfinite(size) and size != 0.0]
    if not sizes:
        return 0
    top = math.floor(math.log10(max(sizes)))
    places = min(max(DIGITS - 1 - top, 0), DECIMALS)
    least = 0 if all(float(size).is_integer() for size in sizes) else 1 - math.floor(math.log10(min(sizes)))
    places = max(places, least)
    if top > 9 or top + places > MAX_SHARED_DIGITS:
        return None
    texts = [f"{size:.{places}f}" for size in sizes]
    while places and all(text.endswith("0") for text in texts):
        texts, places = [text[:-1] for text in texts], places - 1
    return places


def value_text(value: Any, places: int | None = None) -> str:
    """Text of a value; a number has `places` decimals, or if that is None `DIGITS` significant digits.

    The text of None and of numbers that are not finite is an en dash.
    """
    if value is None or is_number(value) and not math.isfinite(value):
        return "\u2013"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not is_number(value):
        return visible(str(value))
    text = _digits(value) if places is None else f"{value:,.{places}f}"
    text = text if text.strip("-0.,") else text.lstrip("-")  # no minus sign before zero
    text = text if abs(value) >= 1e4 else text.replace(",", "")
    return text.replace(",", NARROW_SPACE).replace("-", "\u2212")


def _digits(value: float) -> str:
    if isinstance(value, int) or value == 0.0:
        return f"{value:,.0f}"
    top = math.floor(math.log10(abs(value)))
    if not -4 <= top <= 9:
        return f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")
    text = f"{value:,.{max(DIGITS - 1 - top, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
