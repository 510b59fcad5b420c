"""A liquid between two plates: waves about rest at a pressure. Knows no network."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.model.basins.basin import Basin

SCALE = 1e5  # [Pa]


class Liquid(Basin, physics="liquid"):
    """Mass and momentum with bulk modulus, states density [kg/m3] and mass flows per area [kg/(m2 s)]."""

    quantities = ("density", "flow_x", "flow_y")
    units = {"pressure": "Pa", "velocity": "m/s"}

    def __init__(self, case, name: str) -> None:
        super().__init__(case, name)
        fluid = case.properties
        self.density, self.speed = fluid.density, self.part.wave_speed
        if self.speed is None:
            self.speed = math.sqrt(fluid.bulk_modulus / fluid.density)

    def scales(self) -> list[float]:
        return [SCALE / self.speed**2, SCALE / self.speed, SCALE / self.speed]

    def reflection(self, patch) -> float:
        if patch.impedance is None:
            return super().reflection(patch)
        own = self.density * self.speed
        return (patch.impedance - own) / (patch.impedance + own)

    def lower(self, scene, row) -> None:
        row["thickness"], row["speed"] = self.part.thickness, self.speed
        height = self.case.properties.density * self.case.gravity * (self.part.elevation or 0.0)
        row["rest"] = self.part.pressure - self.case.ambient_pressure + height
        row["kind"] = rec.ACOUSTIC_GRID if self.is_grid else rec.ACOUSTIC_FACES

    def start(self) -> np.ndarray:
        found, given = np.zeros((3, self.n)), self.part.start
        if given is not None:
            found[0] = self.formula(given.pressure) / self.speed**2
            found[1], found[2] = self.density * self.formula(given.u), self.density * self.formula(given.v)
        return found

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        velocity = np.column_stack([y[1], y[2], np.zeros(self.n)]) / self.density
        return {"pressure": self.part.pressure + self.speed**2 * y[0], "velocity": velocity}

    def mass(self) -> tuple[float, np.ndarray]:
        per = self.part.thickness * self.mesh.area
        strain = (self.part.pressure - self.case.properties.pressure) / (self.density * self.speed**2)
        return float(np.sum(per)) * self.density * (1.0 + strain), per
