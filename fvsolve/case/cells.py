"""What formulas are in the cells of a mesh. Knows points; knows no basin."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fvsolve.parts.formula import Formula

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh

# Three Gauss points along either side of a rectangle, of sqrt(3 / 5) of half of it: centre, corners, sides.
GAUSS = (0, 0), (-1, -1), (1, 1), (-1, 1), (1, -1), (-1, 0), (1, 0), (0, -1), (0, 1)


def is_grid(mesh: Mesh) -> bool:
    """Whether cells are all of a rectangle."""
    return mesh.grid is not None and len(mesh.cells) == mesh.grid.nx * mesh.grid.ny


def samples(shape: Formula | None, mesh: Mesh) -> np.ndarray:
    """A formula in cells, centres first: on grids at nine Gauss points, elsewhere there alone : float64[points, n]."""
    x, y = np.ascontiguousarray(mesh.centre.T)
    if not is_grid(mesh):
        places = np.array([x]), np.array([y])
    else:
        wide, high = np.tile(np.diff(mesh.grid.x), mesh.grid.ny), np.repeat(np.diff(mesh.grid.y), mesh.grid.nx)
        to = 0.5 * math.sqrt(0.6) * np.array(GAUSS)[:, :, None]
        places = x + to[:, 0] * wide, y + to[:, 1] * high
    if shape is None:
        return np.zeros(places[0].shape)
    return shape.at(*(one.ravel() for one in places)).reshape(places[0].shape)


def means(found: np.ndarray) -> np.ndarray:
    """Means over cells of `samples`, in sums that mirrored and turned cells share; what is even stays so to the bit."""
    if len(found) == 1:
        return found[0]
    corners = (found[1] + found[2]) + (found[3] + found[4])
    sides = (found[5] + found[6]) + (found[7] + found[8])
    mean = (25.0 * corners + (40.0 * sides + 64.0 * found[0])) / 324.0
    return np.where(np.ptp(found, axis=0) > 0.0, mean, found[0])
