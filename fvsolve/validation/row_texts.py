"""Texts of the values of a row: measured or exact, computed, numerical error, other programs."""

import math
from typing import NamedTuple

from fvsolve.validation.library import RowResult


class Amounts(NamedTuple):
    """Texts of the values of a row, "-" for none."""

    reference: str
    value: str
    coarser: str
    error: str
    others: str


def amounts(row: RowResult) -> Amounts:
    """Texts of the values of a row, in its unit."""
    measured, exact = row.row.measured or {}, row.row.exact or {}

    def text(value: float) -> str:
        return number(row.in_unit(value))

    if measured.get("spread"):
        reference = " to ".join(text(value) for value in measured["spread"])
    elif measured.get("value") is not None:
        reference = text(measured["value"])
    else:
        value = row.converged if row.converged is not None else exact.get("value")
        reference = f"exact {text(value)}" if value is not None else "-"
    others = [*((item["code"], item["value"]) for item in row.row.others), *row.others]
    return Amounts(
        reference,
        text(row.value),
        "-" if row.coarser is None else text(row.coarser),
        "-" if row.error is None else f"{row.shown.span_from_si(row.error):.1e}",
        "; ".join(f"{code} {text(value)}" for code, value in others) or "-",
    )


def number(value: float) -> str:
    """Text of a number with four digits."""
    return f"{value:.4g}" if math.isfinite(value) else "none"
