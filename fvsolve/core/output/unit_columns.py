"""Columns of result tables: name, dimension and unit, with conversion from and to SI."""

from typing import NamedTuple

import numpy as np

from fvsolve import units
from fvsolve.core.model.compiled_case import once_per_model


class UnitColumn(NamedTuple):
    """Column of a table: name, dimension and output unit of a quantity. ambient : zero of gauge pressures [Pa]"""

    name: str
    dimension: str
    unit: str
    ambient: float = 101325.0

    @property
    def header(self) -> str:
        """Header of the column, for example `gate.pressure [Pa]`."""
        return f"{self.name} [{self.unit}]"

    def from_si(self, value):
        """Convert a number or an array from SI (absolute pressures) to the unit of the column."""
        return (
            value if self.plain else units.convert(value, self.dimension, self.unit, self.ambient)
        )

    def to_si(self, value):
        """Convert a number or an array from the unit of the column to SI (absolute pressures)."""
        if self.plain:
            return value
        unit = units.find(self.unit, self.dimension)
        is_gauge = unit.gauge and self.dimension == "pressure"
        return unit.si(value) + (self.ambient if is_gauge else 0.0)

    def span_from_si(self, value: float) -> float:
        """Convert a difference of two values from SI to the unit of the column, without the offset of its zero."""
        if self.plain:
            return value
        unit = units.find(self.unit, self.dimension)
        return value * unit.denominator / unit.numerator

    @property
    def span_unit(self) -> str:
        """Unit of a difference of two values of the column, for example bar for values in barg."""
        return units.span(self.unit)

    @property
    def plain(self) -> bool:
        """True if the unit of the column is the SI unit, so that values need no conversion."""
        return self.dimension == "number" or self.unit == units.DIMENSIONS[self.dimension].si


def column(name: str, dimension: str, case, label: str = "") -> UnitColumn:
    """Column of a quantity in the unit of `case.output.units` (default: SI). label : unit of a plain number"""
    return UnitColumn(name, dimension, label or case.unit_of(dimension), case.ambient_pressure)


def time_column(case) -> UnitColumn:
    """Column of the time, the first column of history.csv."""
    return column("t", "time", case)


@once_per_model
def probe_columns(model) -> list[UnitColumn]:
    """Columns of the probes of a model, in the order of the probes."""
    return [column(probe.text, probe.dimension, model.case, probe.unit) for probe in model.probes]


def split_header(header: str) -> tuple[str, str]:
    """Split `gate.pressure [Pa]` into (`gate.pressure`, `Pa`); the unit is "" if the header has none."""
    name, bracket, unit = header.strip().rpartition("[")
    return (name.strip(), unit.removesuffix("]").strip()) if bracket else (header.strip(), "")


def to_column_units(columns: list[UnitColumn], values: np.ndarray) -> np.ndarray:
    """Convert values : float64[k, n] from SI to the units of n columns; returns `values` itself if all units are SI."""
    if all(column.plain for column in columns):
        return values
    return np.column_stack([column.from_si(values[:, i]) for i, column in enumerate(columns)])
