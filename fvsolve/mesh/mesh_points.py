"""Search for points in a plane mesh, and interpolation weights of its cells."""

from __future__ import annotations

import numpy as np

from fvsolve.mesh.mesh import Mesh

OUTLINE_TOLERANCE = 1e-9  # of the mesh's extent: points this close to its outline count as inside
CANDIDATES = 16  # cells with the nearest centres, tried before all cells
RINGS = 2  # greatest number of rings of neighbours
WEIGHT_TOLERANCE = 1e-9  # of a cell's size: error of exact weights
SUM_WEIGHT = 1e4  # weight of the sum of weights over that of their point, for points beyond all centres
TINY = 1e-300  # least squared length
INWARD_FRACTION = 1e-3  # of the distance from the outline to the centre of its cell


class MeshPoints:
    """Search for points in a mesh: cell that contains a point, and interpolation weights there."""

    def __init__(self, mesh: Mesh) -> None:
        from scipy.spatial import cKDTree

        self.mesh, self.near = mesh, OUTLINE_TOLERANCE * float(np.ptp(mesh.points, axis=0).max())
        self.low, self.high = mesh.points.min(axis=0) - self.near, mesh.points.max(axis=0) + self.near
        self.tree = cKDTree(mesh.centre)
        order = np.argsort(mesh.cells, axis=None, kind="stable")
        first = np.searchsorted(mesh.cells.ravel()[order], np.arange(len(mesh.points) + 1))
        # cells at point p: cells_of_points[first[p] : first[p + 1]]
        self.cells_of_points, self.first = order // 4, first

    def cell(self, x: float, y: float) -> int:
        """Number of the cell that contains the point (x, y) [m]; the lowest number on an edge, -1 outside all cells."""
        n = len(self.mesh.cells)
        if not np.all((self.low <= (x, y)) & ((x, y) <= self.high)):  # far points, whose distances overflow, and NaN
            return -1
        nearest = np.sort(np.ravel(self.tree.query((x, y), min(CANDIDATES, n))[1]))
        for cells in (nearest, np.arange(n)):
            inside = self._inside(cells, x, y)
            if inside.any():
                return int(cells[np.argmax(inside)])
        return -1

    def _inside(self, cells: np.ndarray, x: float, y: float) -> np.ndarray:
        corners = self.mesh.cells[cells]
        corners = np.where(corners < 0, corners[:, :1], corners)  # a triangle's fourth side has no length
        a = self.mesh.points[corners]
        along = np.roll(a, -1, axis=1) - a
        left = along[..., 0] * (y - a[..., 1]) - along[..., 1] * (x - a[..., 0])
        return (left >= -self.near * np.hypot(along[..., 0], along[..., 1])).all(axis=1)

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """Position (x, y) [m] just inside the mesh, near the boundary point that is nearest to a point outside.

        It lies a thousandth of the way from that boundary point to the centre of the cell there.
        """
        mesh = self.mesh
        outer = slice(mesh.inner, None)
        a, b = (mesh.points[mesh.ends[outer, k]] for k in (0, 1))
        along, point = b - a, np.array([x, y])
        share = np.clip(((point - a) * along).sum(1) / np.maximum((along * along).sum(1), TINY), 0.0, 1.0)
        foot = a + share[:, None] * along
        k = int(np.argmin(np.hypot(*(foot - point).T)))
        inside = foot[k] + INWARD_FRACTION * (mesh.centre[mesh.left[outer][k]] - foot[k])
        return float(inside[0]), float(inside[1])

    def cell_weights(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Cells around a point inside, and their weights in the value of a field there : int64[k], float64[k].

        Weights have the sum 1 and are not negative. On grids without holes they are bilinear between centres. Otherwise
        the cells share a corner with the cell of the point, or with a neighbour of that cell. Weights are exact for
        linear fields, except beyond the outermost centres, where the nearest position between centres is used.
        """
        grid = self.mesh.grid
        if grid is not None and len(self.mesh.cells) == grid.nx * grid.ny:
            (i, p), (j, q) = (_neighbour_columns(lines, value) for lines, value in ((grid.x, x), (grid.y, y)))
            cells = (j[:, None] * grid.nx + i).ravel()
            weights = np.outer(q, p).ravel()
        else:
            cells, weights = self._of_neighbours(self.cell(x, y), x, y)
        positive = weights > 0.0
        return cells[positive], weights[positive] / weights[positive].sum()

    def _of_neighbours(self, cell: int, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        from scipy.optimize import nnls

        cells, attempts = [cell], []
        for _ in range(RINGS):
            cells += sorted(
                {
                    int(near)
                    for c in cells
                    for p in self.mesh.cells[c]
                    if p >= 0
                    for near in self.cells_of_points[self.first[p] : self.first[p + 1]]
                }
                - set(cells)
            )
            away = (self.mesh.centre[cells] - (x, y)) / np.sqrt(self.mesh.area[cell])
            weights, residual = nnls(
                np.vstack([np.full(len(cells), SUM_WEIGHT), away.T]), np.array([SUM_WEIGHT, 0.0, 0.0])
            )
            attempts.append((np.array(cells), weights))
            if residual < WEIGHT_TOLERANCE:
                return attempts[-1]
        return attempts[0]


def _neighbour_columns(lines: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray]:
    """Two columns with `value` between their centres, and their weights : int64[2], float64[2].

    Beyond the outermost centres the outermost column has weight 1. lines : grid lines [m]; value : coordinate [m]
    """
    centres = 0.5 * (lines[1:] + lines[:-1])
    k = int(np.clip(np.searchsorted(centres, value) - 1, 0, max(centres.size - 2, 0)))
    after = min(k + 1, centres.size - 1)
    wide = centres[after] - centres[k]
    share = float(np.clip((value - centres[k]) / wide, 0.0, 1.0)) if wide > 0.0 else 0.0
    return np.array([k, after]), np.array([1.0 - share, share])
