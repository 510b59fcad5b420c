"""Reports and pictures of finished runs: a page, a workbook, `draw`; the page may import all but cli."""

from importlib import import_module
from typing import Any

from fvsolve.errors import FvsolveError


def import_library(name: str) -> Any:
    """Import a module of the extra `report`: Jinja2, Plotly, markdown-it-py, XlsxWriter or rainflow.

    Raises FvsolveError with the command to install it if it is missing.
    """
    try:
        return import_module(name)
    except ImportError:
        raise FvsolveError(
            f'a report needs {name.partition(".")[0].replace("_it", "-it-py")}: pip install "fvsolve[report]"'
        ) from None
