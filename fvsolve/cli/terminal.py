"""Lines and tables on the terminal. Knows rich; knows no run."""

from __future__ import annotations

import sys

from fvsolve.errors import visible

WIDTH = 160  # of output that goes to no terminal


def console():
    """Where things are printed: plain and wide where no terminal listens."""
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=WIDTH, no_color=True)


def line(where, text: str, style: str | None = None) -> None:
    """One line, as it is: nothing in it is markup or steers the terminal."""
    where.print(visible(text), style=style, highlight=False, markup=False, soft_wrap=True)


def table(headers: list[str], rows: list[list[str]], where=None) -> None:
    """Rows under their headers; columns of numbers stand to the right."""
    from rich.table import Table
    from rich.text import Text

    made = Table(box=None, pad_edge=False, header_style="bold", show_edge=False)
    for i, header in enumerate(headers):
        text = all(not _numeric(row[i]) for row in rows)
        made.add_column(Text(visible(header)), justify="left" if text else "right", overflow="fold")
    for row in rows:
        made.add_row(*(Text(visible(cell)) for cell in row))
    (where or console()).print(made)


def sheet(made, where=None) -> None:
    """A sheet in its words."""
    table(*made.words(), where)


def _numeric(text: str) -> bool:
    if text == "-":
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True
