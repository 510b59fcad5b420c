"""Texts of the values of a row: measured or exact, computed, numerical error, other programs."""

import math
from typing import NamedTuple

from fvsolve.case.validation_table import OF_ERROR
from fvsolve.studies.validation.library import RowResult
from fvsolve.studies.validation.row_verdicts import known_values


class Amounts(NamedTuple):
    """Texts of the values of a row, "-" for none; limits : least and greatest value that pass the gate."""

    reference: str
    value: str
    coarser: str
    error: str
    others: str
    limits: str


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
        " to ".join(number(limit) for limit in limits_of(row)),
    )


def is_error(row: RowResult) -> bool:
    """True if the value of a row is an error, which is 0 in a perfect agreement."""
    return row.row.measure is None or row.row.measure.function in OF_ERROR


def limits_of(row: RowResult) -> tuple[float, float]:
    """Least and greatest value that pass the gate of a row, in its unit; the least error is 0."""
    known = known_values(row.row, [value for _, value in row.others], row.converged)
    least, greatest = getattr(known, row.row.gate["of"]) or (row.value, row.value)
    least = 0.0 if is_error(row) else least - row.tolerance
    return row.in_unit(least), row.in_unit(greatest + row.tolerance)


def number(value: float) -> str:
    """Text of a number with four digits."""
    return f"{value:.4g}" if math.isfinite(value) else "none"
