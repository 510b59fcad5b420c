"""Columns of the tables: a quantity, its unit, and the way to and from SI. Knows units; knows no files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve import units


@dataclass(frozen=True)
class UnitColumn:
    """A named quantity in the unit that the reader asked for; gauge pressures count from `ambient` [Pa]."""

    name: str
    dimension: str
    unit: str
    ambient: float = 101325.0

    @property
    def header(self) -> str:
        """What stands over the column, for example `gate.pressure [Pa]`."""
        return f"{self.name} [{self.unit}]"

    def from_si(self, value):
        """A number or an array, from SI (pressures absolute) to this column's unit."""
        return value if self.plain else units.convert(value, self.dimension, self.unit, self.ambient)

    def to_si(self, value):
        """A number or an array, from this column's unit to SI (pressures absolute)."""
        if self.plain:
            return value
        unit = units.find(self.unit, self.dimension)
        counts = unit.gauge and self.dimension == "pressure"
        return unit.si(value) + (self.ambient if counts else 0.0)

    def span_from_si(self, value: float) -> float:
        """A difference of two values, from SI to this column's unit: the zero point does not matter."""
        if self.plain:
            return value
        unit = units.find(self.unit, self.dimension)
        return value * unit.denominator / unit.numerator

    @property
    def span_unit(self) -> str:
        """What a difference of two values is told in: bar where they are in barg."""
        return units.span(self.unit)

    @property
    def plain(self) -> bool:
        """True where the column is in SI itself, so that not one bit is touched."""
        return self.dimension == "number" or self.unit == units.DIMENSIONS[self.dimension].si


def column(name: str, dimension: str, case, label: str = "") -> UnitColumn:
    """The column of a quantity in the unit that `case.output.units` asks for, SI where it is silent; or a number's."""
    return UnitColumn(name, dimension, label or case.unit_of(dimension), case.ambient_pressure)


def time_column(case) -> UnitColumn:
    """The first column of history.csv."""
    return column("t", "time", case)


def probe_columns(model) -> list[UnitColumn]:
    """One column per probe of a model, in its order."""
    return [column(probe.text, probe.dimension, model.case, probe.unit) for probe in model.probes]


def split_header(header: str) -> tuple[str, str]:
    """`gate.pressure [Pa]` as (`gate.pressure`, `Pa`); the unit is empty where none is stated."""
    name, bracket, unit = header.strip().rpartition("[")
    return (name.strip(), unit.removesuffix("]").strip()) if bracket else (header.strip(), "")


def converted(columns: list[UnitColumn], values: np.ndarray) -> np.ndarray:
    """`values : float64[k, n]` from SI into the columns' units; the same array where all are SI."""
    if all(one.plain for one in columns):
        return values
    return np.column_stack([one.from_si(values[:, i]) for i, one in enumerate(columns)])
