"""Units of the envelope of a result, and conversion of pressures to heads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.output.column import UnitColumn
from fvsolve.output.envelope import QUANTITIES


def in_units(result, name: str) -> UnitColumn:
    """Unit column of a quantity of the envelope."""
    unit, ambient = result.summary["envelope_units"][name], result.summary["ambient_pressure"]
    return UnitColumn(name, QUANTITIES[name], unit, ambient)


def head_of(result, pressure: float | np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Head of an absolute pressure [Pa] at elevations; head and elevations in the units of the envelope."""
    height = in_units(result, "elevation")
    law: Callable[..., Any] = result.case.law.head
    return in_units(result, "max_head").from_si(law(pressure, height.to_si(elevation)))
