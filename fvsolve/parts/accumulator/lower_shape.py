"""Level, gas volume and pressures of a vessel with a shape at the start."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.parts.accumulator import law_shape
from fvsolve.parts.accumulator.shape import UPRIGHT, height_of, length_of

SLOPE_TOLERANCE = 1e-6  # axis rise over radius below which a cylinder counts as horizontal; likewise for upright


class VesselStart:
    """Gas and fluid of a vessel with a shape, at the start.

    gas, fluid_volume : volumes of gas and fluid [m3]; level : level of the fluid above the bottom [m]
    centroid : height of the centroid of the fluid above the bottom [m]
    bottom : height of the bottom above the node [m]
    """

    def __init__(self, start, part) -> None:
        self.law, self.gravity, self.bottom = start.law, start.case.gravity, part.bottom or 0.0
        shape = np.array(shape_numbers(part))
        self.gas = part.gas_volume
        if self.gas is None:
            self.gas = part.volume - float(law_shape.volume_below(shape, 0, part.level))
        self.fluid_volume = part.volume - self.gas
        self.level = float(law_shape.level_at(shape, 0, self.fluid_volume))
        below = float(law_shape.moment_below(shape, 0, self.level))
        self.centroid = below / self.fluid_volume if self.fluid_volume > 0.0 else 0.0

    def gas_pressure(self, p: float) -> tuple[float, float]:
        """(pressure of the gas [Pa], mass of the fluid [kg]) at a pressure p of the node [Pa]."""
        if self.law.linear:
            rho = self.law.rho
            return p - rho * self.gravity * (self.bottom + self.level), rho * self.fluid_volume
        potential = self.gravity * (self.bottom + self.centroid)
        q = float(self.law.pressure_of_enthalpy(self.law.enthalpy(p) - potential))
        rho = float(self.law.density(q))
        return q - rho * self.gravity * (self.level - self.centroid), rho * self.fluid_volume

    def node_pressure(self, gas: float) -> float:
        """Pressure of the node [Pa] at a pressure `gas` of the gas [Pa]."""
        if self.law.linear:
            return gas + self.law.rho * self.gravity * (self.bottom + self.level)
        q = gas
        for _ in range(20):
            q = gas + float(self.law.density(q)) * self.gravity * (self.level - self.centroid)
        return float(self.law.pressure_of_enthalpy(self.law.enthalpy(q) + self.gravity * (self.bottom + self.centroid)))


def shape_numbers(part) -> list[float]:
    """Parameters of the shape of a vessel: kind, level when full [m], three sizes, and for a table of areas its values.

    The sizes are the area [m2] of a prism; or radius [m], length [m] and slope [rad] of a cylinder; or the number of
    levels, after which levels [m], areas [m2] and volumes [m3] follow.
    """
    top = height_of(part)
    if part.diameter is None:
        if not hasattr(part.area, "level") or len(part.area.level) == 1:
            area = part.area if not hasattr(part.area, "level") else part.area.area[0]
            return [law_shape.PRISM, top, float(area), 0.0, 0.0]
        level, area = part.area.level, part.area.area
        steps = [
            0.5 * (a + b) * (high - low) for low, high, a, b in zip(level, level[1:], area, area[1:], strict=False)
        ]
        volume = [math.fsum(steps[:k]) for k in range(len(level))]
        return [law_shape.AREA_TABLE, top, len(level), 0.0, 0.0, *map(float, (*level, *area, *volume))]
    radius, length, slope = 0.5 * part.diameter, length_of(part), UPRIGHT if part.slope is None else part.slope
    if radius * math.cos(slope) <= SLOPE_TOLERANCE * length * math.sin(slope):
        return [law_shape.PRISM, top, math.pi * radius**2, 0.0, 0.0]
    kind = (
        law_shape.HORIZONTAL_CYLINDER
        if length * math.sin(slope) <= SLOPE_TOLERANCE * radius * math.cos(slope)
        else law_shape.INCLINED_CYLINDER
    )
    return [kind, top, radius, length, 0.0 if kind == law_shape.HORIZONTAL_CYLINDER else slope]
