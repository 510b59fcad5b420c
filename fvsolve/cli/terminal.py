"""Lines and tables on the terminal."""

from __future__ import annotations

import sys

from fvsolve.errors import visible

WIDTH = 160  # line width of output that does not go to a terminal


def console():
    """Console for standard output; wide and without color if the output is not a terminal."""
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=WIDTH, no_color=True)


def line(output, text: str, style: str | None = None) -> None:
    """Print a line literally: markup and control characters have no effect."""
    output.print(visible(text), style=style, highlight=False, markup=False, soft_wrap=True)


def table(headers: list[str], rows: list[list[str]], output=None) -> None:
    """Print a table of rows under their headers; columns that contain a number or "-" are right-aligned."""
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, pad_edge=False, header_style="bold", show_edge=False)
    for i, header in enumerate(headers):
        text = all(not _numeric(row[i]) for row in rows)
        grid.add_column(Text(visible(header)), justify="left" if text else "right", overflow="fold")
    for row in rows:
        grid.add_row(*(Text(visible(cell)) for cell in row))
    (output or console()).print(grid)


def print_sheet(table_data, output=None) -> None:
    """Print a `ResultTable`; its columns state the formats of the values."""
    table(*table_data.words(), output)


def _numeric(text: str) -> bool:
    if text == "-":
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True
