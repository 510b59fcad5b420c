"""What cells of a basin store. Knows laws of cells; knows no flux and no network.

Free surface, per area: rho (g h^2 / 2 + g h bed + |q|^2 / (2 h)); liquid, per volume and about rest:
c^2 r^2 / (2 rho) + |m|^2 / (2 rho). What is carried has no energy; its square stands in for one.
"""

from __future__ import annotations

import numpy as np

from fvsolve.basins.free_surface.rows import THIN


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


def above(basin, y: np.ndarray, datum: float) -> float:
    """Energy at deviations y over that at rest and at P = 0, a surface at the datum or on the bed [J]."""
    area, part, gravity = basin.mesh.area, basin.part, basin.case.gravity
    rho = basin.case.properties.density
    if part.physics == "free-surface":
        depth = np.maximum(basin.depth + y[0], 0.0)
        bed = basin.bed + (part.elevation or 0.0) - datum
        height = 0.5 * gravity * ((bed + depth) ** 2 - np.maximum(bed, 0.0) ** 2)
        wet = np.maximum(depth, THIN)
        moves = depth / (depth**2 + wet**2) * (y[1] ** 2 + y[2] ** 2)
        return float(rho * np.sum(area * (height + moves)))
    if part.physics == "liquid":
        rest = part.pressure - basin.case.ambient_pressure + rho * gravity * ((part.elevation or 0.0) - datum)
        square = (rest + basin.speed**2 * y[0]) ** 2 / basin.speed**2 + y[1] ** 2 + y[2] ** 2
        return float(0.5 * part.thickness / rho * np.sum(area * square))
    return 0.0
