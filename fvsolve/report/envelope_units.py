"""Units of the envelope of a result, and conversion of pressures to heads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.output.envelope import ENVELOPE_QUANTITIES
from fvsolve.output.unit_columns import UnitColumn


def envelope_column(result, name: str) -> UnitColumn:
    """Column of a quantity of the envelope (extremes along pipes), with its unit and conversions from and to SI."""
    unit, ambient = result.summary["envelope_units"][name], result.summary["ambient_pressure"]
    return UnitColumn(name, ENVELOPE_QUANTITIES[name], unit, ambient)


def head_of(result, pressure: float | np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Heads of absolute pressures [Pa] at elevations; heads and elevations are in the units of the envelope."""
    height = envelope_column(result, "elevation")
    law: Callable[..., Any] = result.case.law.head
    return envelope_column(result, "max_head").from_si(law(pressure, height.to_si(elevation)))
