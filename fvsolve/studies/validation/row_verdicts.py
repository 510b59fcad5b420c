"""Verdicts on rows of a validation: within, model differs, outside."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from fvsolve.case.validation_table import EXACT, MEASURED, OF_ERROR, OTHERS, Row

WITHIN, DIFFERS, OUTSIDE = VERDICTS = ("within", "equations solved, model differs", "outside")
ROUNDING = 1e-12
# numerical errors that a gate may be wide beside the spread of the values: they are estimates
SAFETY = 2.0


class Judged(NamedTuple):
    """Verdict on a row, its tolerance in the unit of the value, and the reason in words ("" if it is within)."""

    verdict: str
    tolerance: float
    text: str


class Known(NamedTuple):
    """Values with which a row is compared; all in the unit of the row. An error has the value 0 as measured and exact.

    measured, others, exact : (least, greatest) of the values of each kind, None without
    """

    measured: tuple[float, float] | None
    others: tuple[float, float] | None
    exact: tuple[float, float] | None

    def span(self, of: str) -> float:
        """Difference of the greatest and the least value that may widen a gate; a measurement widens no exact gate."""
        pairs = (self.others, self.exact) if of == EXACT else self
        values = [value for pair in pairs if pair is not None for value in pair]
        return max(values) - min(values) if values else 0.0


def known_values(row: Row, others: Sequence[float] = (), converged: float | None = None) -> Known:
    """Values with which a row is compared.

    others : values of other programs that were computed with the row; converged : value at a finer resolution
    """
    codes = [*(item["value"] for item in row.others), *others]
    measured, exact = row.measured or {}, row.exact or {}
    pairs = {
        MEASURED: [measured.get("value"), *(measured.get("spread") or ())],
        OTHERS: codes,
        EXACT: [exact.get("value"), converged],
    }
    if row.measure is None or row.measure.function in OF_ERROR:  # programs compute errors
        reference = pairs[MEASURED if row.gate["of"] == MEASURED else EXACT]
        reference += [0.0] if converged is None else []
        pairs[OTHERS] += [0.0] if codes else []
    numbers = {
        key: [value for value in values if value is not None] for key, values in pairs.items()
    }
    return Known(*((min(values), max(values)) if values else None for values in numbers.values()))


def judge(row: Row, value: float, error: float | None, known: Known) -> Judged:
    """Verdict on a computed value; error : its numerical error, None if it is unknown"""
    gate, of = row.gate, row.gate["of"]
    reference = getattr(known, of)
    if reference is None:
        return Judged(OUTSIDE, 0.0, f"there is no value of {of}")
    if not math.isfinite(value):
        return Judged(OUTSIDE, 0.0, "the computed value does not exist")
    tolerance = tolerance_of(gate, reference)
    allowed = known.span(of) + SAFETY * (error or 0.0)
    if tolerance > allowed * (1.0 + 1e-9) + ROUNDING and not gate["reason"]:
        text = (
            f"the gate, {tolerance:.3g}, is wider than the spread of measurement, codes and numerical error "
            f"together, {allowed:.3g}; narrow it, or write gate.reason"
        )
        return Judged(OUTSIDE, tolerance, text)
    passes = beyond(value, reference) <= tolerance + ROUNDING * abs(value)
    outside_measured = 0.0 if known.measured is None else beyond(value, known.measured)
    if passes and (
        of == MEASURED or outside_measured <= tolerance_of(gate, known.measured or (0.0, 0.0))
    ):
        return Judged(WITHIN, tolerance, "")
    supported = passes or (
        of == MEASURED
        and any(
            pair is not None and beyond(value, pair) <= tolerance_of(gate, pair)
            for pair in (known.others, known.exact)
        )
    )
    if not supported:
        return Judged(
            OUTSIDE, tolerance, f"{beyond(value, reference):.3g} beyond the values of {of}"
        )
    if not row.because:
        return Judged(
            OUTSIDE,
            tolerance,
            "the model differs from the measurement without a reason; write `because`",
        )
    return Judged(DIFFERS, tolerance, row.because)


def tolerance_of(gate: dict[str, Any], values: tuple[float, float]) -> float:
    """Tolerance of a gate about values (least, greatest)."""
    return gate["rtol"] * max(abs(values[0]), abs(values[1])) + gate["atol"]


def beyond(value: float, pair: tuple[float, float]) -> float:
    """Distance of a value from the interval between the least and the greatest value; 0 inside."""
    return max(pair[0] - value, value - pair[1], 0.0)
