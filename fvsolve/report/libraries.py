"""The only door to Jinja2, Plotly, XlsxWriter and rainflow, the extra `report`; says what to install."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fvsolve.errors import FvsolveError


def library(name: str) -> Any:
    """A module of the extra; FvsolveError that says what to install where it is not there."""
    try:
        return import_module(name)
    except ImportError:
        raise FvsolveError(f'a report needs {name.partition(".")[0]}: pip install "fvsolve[report]"') from None


def template(text: str) -> Any:
    """A page to be filled in: whatever is put into it stands there as text, never as markup."""
    jinja = library("jinja2")
    return jinja.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja.StrictUndefined,
                             ).from_string(text)  # fmt: skip


def charts() -> str:
    """The source of plotly.js as Plotly's wheel ships it, so that nothing is fetched."""
    return library("plotly.offline").get_plotlyjs()


def workbook(path: str) -> Any:
    """An empty workbook in which text is text: no formula, no link."""
    plain = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
    return library("xlsxwriter").Workbook(path, {**plain, "nan_inf_to_errors": True})
