"""Display of results at a prompt and in a notebook: a line, a table, a plot."""

import io
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any, ClassVar

from fvsolve.argument_checks import PATH, validated
from fvsolve.file_replacement import replacing

TABLE_ROWS = 12  # rows of a table in a notebook; `.frame()` contains all rows
PICTURE_DPI = 72  # resolution of a plot in a notebook; `.plot()` returns the figure itself


class Displayable:
    """Base class of results with a summary line, a table and a plot.

    picture : "module:function" of the function that draws the plot
    """

    picture: ClassVar[str] = ""

    def summary_line(self) -> str:
        """Summary of the result in one line, for `repr`."""
        raise NotImplementedError

    def table_columns(self) -> Mapping[str, Sequence[Any]]:
        """Columns of the table by name, in the units of the result."""
        raise NotImplementedError

    def frame(self):
        """Table as a pandas DataFrame. Raises FvsolveError if pandas is not installed."""
        from fvsolve.errors import FvsolveError

        try:
            import pandas
        except ImportError:
            raise FvsolveError(
                f"{type(self).__name__}.frame() needs pandas: pip install pandas"
            ) from None
        return pandas.DataFrame(dict(self.table_columns()))

    @validated(path=PATH)
    def plot(self, path=None):
        """Plot of the result as a matplotlib Figure, also written to the file `path` if given.

        Raises FvsolveError if `path` is not a path or cannot be written.
        """
        module, _, name = self.picture.partition(":")
        return save_if_path(getattr(import_module(module), name)(self), path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.summary_line()}>"

    def _repr_html_(self) -> str:
        columns = {name: list(values) for name, values in self.table_columns().items()}
        rows = list(zip(*columns.values(), strict=True))
        head = "".join(f"<th>{escape(str(name))}</th>" for name in columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(_cell(x))}</td>" for x in row) + "</tr>"
            for row in rows[:TABLE_ROWS]
        )
        more = (
            f"<p>{len(rows) - TABLE_ROWS} more rows in .frame()</p>"
            if len(rows) > TABLE_ROWS
            else ""
        )
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>{more}{self._picture_html()}"

    def _picture_html(self) -> str:
        """Plot as HTML that contains the picture; "" if it cannot be drawn, for example without matplotlib."""
        try:
            self.plot().savefig(data := io.BytesIO(), format="png", dpi=PICTURE_DPI)
        except Exception:  # a notebook then shows the table alone; `.plot()` raises the error
            return ""
        text = escape(self.summary_line(), quote=True)
        return (
            f'<img alt="{text}" src="data:image/png;base64,{b64encode(data.getvalue()).decode()}">'
        )


def save(figure, path) -> None:
    """Write a figure to a file. A .png is drawn only once; `savefig` would draw it twice, with an equal result."""
    write = figure.canvas.print_png if str(path).endswith(".png") else figure.savefig
    with replacing(path) as fresh:
        write(fresh)


def save_if_path(figure, path):
    """Write a figure to the file `path` unless it is None; returns the figure. Raises FvsolveError if writing fails."""
    try:
        if path is not None:
            save(figure, path)
    except (OSError, ValueError) as error:  # no such folder, unknown file type
        from fvsolve.errors import FvsolveError

        raise FvsolveError(f"{path}: the picture cannot be written: {error}") from error
    return figure


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
