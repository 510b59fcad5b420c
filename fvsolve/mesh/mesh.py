"""Data of a plane mesh: cells, faces and named patches, all SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WALL = "wall"  # patch of all boundary faces without a name


@dataclass(frozen=True, eq=False)
class Grid:
    """Grid lines of a rectangle.

    nx, ny : numbers of columns and rows; x : float64[nx + 1], y : float64[ny + 1]  positions of lines [m]
    index : int64[ny, nx]  number of the cell in row j and column i, -1 in a hole; without holes j nx + i
    """

    nx: int
    ny: int
    x: np.ndarray
    y: np.ndarray
    index: np.ndarray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Cells and the faces between them; inner faces come first, then boundary faces, patch by patch.

    points : float64[p, 2]  corners of cells [m]
    cells : int64[n, 4]  points of a cell, anticlockwise; -1 in the last column for a triangle
    area : float64[n]  areas of cells [m2]; centre : float64[n, 2]  centroids of cells [m]
    left : int64[f]  cell on the left of a face
    right : int64[f]  cell on the right, with a higher number than left, or -1 - k on the boundary, k the patch
    normal : float64[f, 2]  unit vectors, from left to right or outward; length : float64[f]  lengths of faces [m]
    middle : float64[f, 2]  middles of faces [m]; ends : int64[f, 2]  points of faces, anticlockwise around left
    patches : names of the patches, the last one always "wall"; grid : grid lines, None if the mesh is not a rectangle
    notes : remarks about the mesh file for the user
    """

    points: np.ndarray
    cells: np.ndarray
    area: np.ndarray
    centre: np.ndarray
    left: np.ndarray
    right: np.ndarray
    normal: np.ndarray
    length: np.ndarray
    middle: np.ndarray
    ends: np.ndarray
    patches: tuple[str, ...]
    grid: Grid | None = None
    notes: tuple[str, ...] = ()

    @property
    def inner(self) -> int:
        """Number of faces between two cells; the remaining faces are the boundary."""
        return int(np.count_nonzero(self.right >= 0))

    @property
    def centroid(self) -> np.ndarray:
        """Centroid of all cells : float64[2] [m]."""
        return self.area @ self.centre / self.area.sum()

    def patch(self, name: str) -> slice:
        """Range of the faces of a patch; raises ValueError for an unknown name."""
        k = self.patches.index(name)
        first, last = np.searchsorted(-self.right, [k + 1, k + 2])  # -right of inner faces is 0 or less, in any order
        return slice(int(first), int(last))
