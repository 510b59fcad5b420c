"""Values of a formula at points in the cells of a mesh, and their means over cells."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fvsolve.parts.formula import SpatialField

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh

# Three Gauss points in each direction of a rectangle, at 0 and +-sqrt(3 / 5) of its half: centre, corners, sides.
GAUSS = (0, 0), (-1, -1), (1, 1), (-1, 1), (1, -1), (-1, 0), (1, 0), (0, -1), (0, 1)


def is_grid(mesh: Mesh) -> bool:
    """True if the mesh is a full rectangular grid of nx times ny cells."""
    return mesh.grid is not None and len(mesh.cells) == mesh.grid.nx * mesh.grid.ny


def samples(shape: SpatialField | None, mesh: Mesh) -> np.ndarray:
    """Values of a formula at points in the n cells of a mesh : float64[points, n]; zeros if `shape` is None.

    On full rectangular grids there are nine Gauss points per cell, in the order of `GAUSS`; on other meshes there is
    only the centre.
    """
    x, y = np.ascontiguousarray(mesh.centre.T)
    if not is_grid(mesh):
        places = np.array([x]), np.array([y])
    else:
        wide, high = np.tile(np.diff(mesh.grid.x), mesh.grid.ny), np.repeat(np.diff(mesh.grid.y), mesh.grid.nx)
        to = 0.5 * math.sqrt(0.6) * np.array(GAUSS)[:, :, None]
        places = x + to[:, 0] * wide, y + to[:, 1] * high
    if shape is None:
        return np.zeros(places[0].shape)
    return shape.at(*(coordinate.ravel() for coordinate in places)).reshape(places[0].shape)


def means(values: np.ndarray) -> np.ndarray:
    """Means over each cell of the values from `samples` : float64[n].

    If all values of a cell are equal, its mean is exactly this value. The order of the sums makes the result the same
    to the bit for mirrored and rotated cells.
    """
    if len(values) == 1:
        return values[0]
    corners = (values[1] + values[2]) + (values[3] + values[4])
    sides = (values[5] + values[6]) + (values[7] + values[8])
    mean = (25.0 * corners + (40.0 * sides + 64.0 * values[0])) / 324.0
    return np.where(np.ptp(values, axis=0) > 0.0, mean, values[0])
