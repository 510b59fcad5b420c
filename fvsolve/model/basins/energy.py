"""What cells of a basin store. Knows laws of cells; knows no flux and no network.

Free surface, per area: rho (g h^2 / 2 + g h bed + |q|^2 / (2 h)); liquid, per volume and about rest:
c^2 r^2 / (2 rho) + |m|^2 / (2 rho). What is carried has no energy; its square stands in for one.
"""

from __future__ import annotations

import numpy as np

from fvsolve.kernels.plane.shallow_rows import THIN


def weights(basin, y: np.ndarray) -> np.ndarray:
    """Weights w of small deviations d from y that store w d^2 : float64[quantities, n]."""
    area = basin.mesh.area
    if basin.part.physics == "free-surface":
        per, depth = basin.case.properties.density * area, np.maximum(basin.depth + y[0], THIN)
        return np.array([0.5 * basin.case.gravity * per, 0.5 * per / depth, 0.5 * per / depth])
    if basin.part.physics == "liquid":
        per = 0.5 * basin.part.thickness * area / basin.density
        return np.array([basin.speed**2 * per, per, per])
    return np.tile(0.5 * area, (len(basin.quantities), 1))
