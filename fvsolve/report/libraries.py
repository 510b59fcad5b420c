"""Imports of Jinja2, Plotly, XlsxWriter and rainflow (extra `report`), with a message on how to install them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fvsolve.errors import FvsolveError


def import_library(name: str) -> Any:
    """Import a module of the extra `report`; raises FvsolveError with the command to install it if it is missing."""
    try:
        return import_module(name)
    except ImportError:
        raise FvsolveError(f'a report needs {name.partition(".")[0]}: pip install "fvsolve[report]"') from None


def template(text: str) -> Any:
    """Jinja template from its text; it escapes all values, so that they never become markup."""
    jinja = import_library("jinja2")
    return jinja.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja.StrictUndefined,
                             ).from_string(text)  # fmt: skip


def plotly_source() -> str:
    """Source of plotly.js from the Plotly wheel, so that the page needs no network."""
    return import_library("plotly.offline").get_plotlyjs()


def empty_workbook(path: str) -> Any:
    """New workbook at `path` that stores text as text, never as a formula, link or number."""
    plain = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
    return import_library("xlsxwriter").Workbook(path, {**plain, "nan_inf_to_errors": True})
