"""Tables of a report: words and numbers under headers with units, aligned on their points. Knows no run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fvsolve.errors import visible

DIGITS = 5  # of the greatest number of a column
DECIMALS = 6  # behind a point, unless its least number needs more
MOST = 7  # digits behind the first of a column whose numbers all have the same decimals
ROWS = 60  # of a table on the page, unless it says how many (`most`)
ERROR = "\u00b1"  # the header of what is known to two digits
NARROW, FIGURE, POINT = "\u202f", "\u2007", "\u2008"  # spaces between thousands, as wide as a digit, as a point


def in_unit(shown, value: float | None) -> float | None:
    """A number [SI] in the unit of a column; None stays."""
    return None if value is None else float(shown.from_si(value))


@dataclass(frozen=True)
class ReportTable:
    """Rows of words, numbers, truths and None under headers.

    units : of each column, "" of words and pure numbers; bad : numbers of the rows that stand out
    loose : columns whose rows are in units of their own; more : where rows are that the page leaves out
    links : of each row, the page that its first word leads to
    """

    title: str
    headers: Sequence[str]
    rows: Sequence[Sequence[Any]]
    units: Sequence[str] = ()
    bad: frozenset[int] = frozenset()
    loose: frozenset[int] = frozenset()
    most: int = ROWS
    more: str = ""
    links: Sequence[str] = ()

    @property
    def heads(self) -> list[tuple[str, str]]:
        """Header and unit of every column."""
        return list(zip(self.headers, [*self.units, *[""] * (len(self.headers) - len(self.units))], strict=True))

    @property
    def named(self) -> bool:
        """Whether any column has a header."""
        return any(self.headers)

    @property
    def numeric(self) -> list[bool]:
        """Which columns hold numbers, and so stand to the right."""
        columns = [[row[k] for row in self.rows] for k in range(len(self.headers))]
        return [any(is_number(one) for one in column) and not any(isinstance(one, str) for one in column)
                for column in columns]  # fmt: skip

    @property
    def words(self) -> list[list[str]]:
        """The rows that the page shows, in words."""
        shown = self.rows[: self.most]
        rough = [k for k, head in enumerate(self.headers) if head == ERROR]
        shown = [[float(f"{one:.2g}") if k in rough and is_number(one) else one for k, one in enumerate(row)]
                 for row in shown]  # fmt: skip
        columns = [aligned([row[k] for row in shown], k in self.loose) for k in range(len(self.headers))]
        return [list(row) for row in zip(*columns, strict=True)]

    @property
    def left_out(self) -> str:
        """What is said below a table that is longer than the page shows."""
        hidden = len(self.rows) - self.most
        return f"{hidden} more rows: {self.more or 'in the workbook (--xlsx)'}" if hidden > 0 else ""


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def aligned(values: Sequence[Any], loose: bool = False) -> list[str]:
    """A column in words, as wide behind the points of its numbers as the widest; `loose` where their units differ."""
    places = None if loose else decimals([one for one in values if is_number(one)])
    words = [worded(one, places) for one in values]
    behind = [text.partition(".")[1:] for text, one in zip(words, values, strict=True) if is_number(one)]
    widest = max((len(rest) for point, rest in behind if point), default=-1)
    if widest < 0:
        return words
    return [_padded(text, widest) if is_number(one) or one is None else text
            for text, one in zip(words, values, strict=True)]  # fmt: skip


def _padded(text: str, widest: int) -> str:
    _, point, rest = text.partition(".")
    return text + ("" if point else POINT) + FIGURE * (widest - len(rest))


def decimals(numbers: Sequence[float]) -> int | None:
    """Decimals of a column, as many as its greatest number needs; None of numbers of many sizes."""
    sizes = [abs(one) for one in numbers if math.isfinite(one) and one != 0.0]
    if not sizes:
        return 0
    top = math.floor(math.log10(max(sizes)))
    places = min(max(DIGITS - 1 - top, 0), DECIMALS)
    least = 0 if all(float(one).is_integer() for one in sizes) else 1 - math.floor(math.log10(min(sizes)))
    places = max(places, least)
    if top > 9 or top + places > MOST:
        return None
    texts = [f"{one:.{places}f}" for one in sizes]
    while places and all(text.endswith("0") for text in texts):
        texts, places = [text[:-1] for text in texts], places - 1
    return places


def worded(value: Any, places: int | None = None) -> str:
    """One value in words, a number with so many decimals, or with as many digits as tell it."""
    if value is None or is_number(value) and not math.isfinite(value):
        return "\u2013"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not is_number(value):
        return visible(str(value))
    text = _digits(value) if places is None else f"{value:,.{places}f}"
    text = text if text.strip("-0.,") else text.lstrip("-")  # no minus before a nought
    text = text if abs(value) >= 1e4 else text.replace(",", "")
    return text.replace(",", NARROW).replace("-", "\u2212")


def _digits(value: float) -> str:
    if isinstance(value, int) or value == 0.0:
        return f"{value:,.0f}"
    top = math.floor(math.log10(abs(value)))
    if not -4 <= top <= 9:
        return f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")
    text = f"{value:,.{max(DIGITS - 1 - top, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
