"""Presentation of the result of a command: JSON, or lines and tables on the terminal."""

import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fvsolve.errors import visible

WIDTH = 160  # line width of output that does not go to a terminal


@dataclass(frozen=True)
class TextTable:
    """Table for the terminal; columns that contain a number or "-" are right-aligned."""

    headers: Sequence[str]
    rows: Sequence[Sequence[str]]


def present(as_json: bool, data: Any, items: Iterable, code: int = 0) -> None:
    """Print the result of a command, and end the program with the exit code `code` unless it is 0.

    as_json : True to print `data` as one JSON object, False to print `items`; see `print_json` and `show`
    """
    if as_json:
        print_json(data)
    else:
        show(items)
    if code:
        sys.exit(code)


def print_json(data: Any) -> None:
    """Print one JSON object on standard output, with unrounded numbers."""
    from fvsolve.output.summary_file import plain

    print(json.dumps(plain(data), allow_nan=False))


def show(items: Iterable) -> None:
    """Print lines and tables on standard output: texts, pairs (text, style), and objects `TextTable` or `ResultTable`.

    Texts are printed literally: markup and control characters have no effect. Output that does not go to a terminal is
    wide and without color.
    """
    from rich.console import Console

    console = Console() if sys.stdout.isatty() else Console(width=WIDTH, no_color=True)
    for item in items:
        if isinstance(item, (str, tuple)):
            text, style = (item, None) if isinstance(item, str) else item
            console.print(visible(text), style=style, highlight=False, markup=False, soft_wrap=True)
        else:
            console.print(_grid(item if isinstance(item, TextTable) else TextTable(*item.words())))


def _grid(table: TextTable):
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid(box=None, pad_edge=False, header_style="bold", show_edge=False)
    for i, header in enumerate(table.headers):
        text = all(not _is_numeric(row[i]) for row in table.rows)
        grid.add_column(Text(visible(header)), justify="left" if text else "right", overflow="fold")
    for row in table.rows:
        grid.add_row(*(Text(visible(cell)) for cell in row))
    return grid


def _is_numeric(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "-"
    return True
