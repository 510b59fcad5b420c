"""Data of a plane mesh, all SI: cells, faces and named patches, quality measures, search for points, and weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

WALL = "wall"  # patch of all boundary faces without a name
# no mate: a boundary edge; more than one neighbour, or a neighbour on the same side
NO_NEIGHBOUR, CROWDED = -1, -2


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
    notes : remarks about the mesh file for the user; interior : cells of each interior patch, name -> int64[count]
    groups : name -> int64[:] faces between cells that a group of the mesh file contains, of groups that are no patches
    regions : name -> int64[:] cells of a group of cells of the mesh file
    heights : float64[p]  elevations of the points in the mesh file [m], None if they are not read
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
    interior: dict[str, np.ndarray] = field(default_factory=dict)
    groups: Mapping[str, np.ndarray] = field(default_factory=dict)
    regions: Mapping[str, np.ndarray] = field(default_factory=dict)
    heights: np.ndarray | None = None

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
        # -right of inner faces is 0 or less, in any order
        first, last = np.searchsorted(-self.right, [k + 1, k + 2])
        return slice(int(first), int(last))

    def neighbouring_faces(self, name: str) -> np.ndarray:
        """Numbers in a patch of the faces before and after each of its faces, its own at ends : int64[2, count]."""
        starts, stops = self.ends[self.patch(name)].T
        numbers = np.arange(starts.size)
        at_start = np.argsort(starts)
        at_stop = np.argsort(stops)
        before = at_stop[np.searchsorted(stops[at_stop], starts).clip(max=starts.size - 1)]
        after = at_start[np.searchsorted(starts[at_start], stops).clip(max=starts.size - 1)]
        ends = (stops[before] == starts, before), (starts[after] == stops, after)
        return np.array([np.where(joined, other, numbers) for joined, other in ends])

    def extrapolation(
        self, name: str, size: int, walls: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nearest cells around the cell behind each face of a boundary patch, and their weights in extrapolation.

        They are neighbours and neighbours of these, `size` at most: with the nearest three, noise on triangles grows.
        Cells beyond the faces `walls` are left out.
        A field that is linear by least squares is, at the middle of the face and at the mirror image of the centre of
        the cell, its value in the cell plus the sum of weights times differences from this cell.
        Returns (int64[count, size], float64[count, size, 2]).
        """
        faces = np.arange(self.left.size)[self.patch(name)]
        left, right = (np.delete(side[: self.inner], walls) for side in (self.left, self.right))
        own, beyond = np.concatenate([left, right]), np.concatenate([right, left])
        order = np.argsort(own, kind="stable")
        starts = np.searchsorted(own[order], np.arange(self.area.size + 1))

        def next_to(cell: int) -> np.ndarray:
            return beyond[order[starts[cell] : starts[cell + 1]]]

        cells = np.repeat(self.left[faces, None], size, axis=1)
        weights = np.zeros((faces.size, size, 2))
        for m, (face, cell) in enumerate(zip(faces, self.left[faces], strict=True)):
            near = np.unique(np.concatenate([next_to(k) for k in (cell, *next_to(cell))]))
            near = near[near != cell]
            near = near[
                np.argsort(np.hypot(*(self.centre[near] - self.centre[cell]).T), kind="stable")
            ][:size]
            offsets = self.centre[near] - self.centre[cell]
            middle = self.middle[face] - self.centre[cell]
            mirrored = 2.0 * (middle @ self.normal[face]) * self.normal[face]
            gradient = np.linalg.pinv(offsets, rcond=0.05)
            cells[m, : near.size], weights[m, : near.size] = (
                near,
                (np.array([middle, mirrored]) @ gradient).T,
            )
        return cells, weights

    def faces(self, name: str) -> "PatchFaces":
        """Faces of a patch: on the boundary, or around an interior patch."""
        if name not in self.interior:
            own, count = self.patch(name), self.left.size
            faces = np.arange(count)[own]
            return PatchFaces(faces, self.left[own], self.left[own], self.normal[own])
        within = np.zeros(self.area.size, bool)
        within[self.interior[name]] = True
        inner = self.inner
        left, right = self.left[:inner], self.right[:inner]
        faces = np.flatnonzero(within[left] != within[right])
        leaves = within[right[faces]]  # from the left cell into the patch
        outside = np.where(leaves, left[faces], right[faces])
        inside = np.where(leaves, right[faces], left[faces])
        return PatchFaces(
            faces, outside, inside, np.where(leaves, 1.0, -1.0)[:, None] * self.normal[faces]
        )


class PatchFaces(NamedTuple):
    """Faces of a patch: indices; cells behind them, and of the patch; unit normals out of the cells behind.

    The cells behind an interior patch are those around it. On the boundary the cells of the patch are those behind.
    index, behind, inside : int64[faces]; normal : float64[faces, 2]
    """

    index: np.ndarray
    behind: np.ndarray
    inside: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of all cells, by cell and corner, anticlockwise; an edge between two cells occurs twice.

    cell : int64[e]  cell of the edge; start, stop : int64[e]  points at its ends
    key : int64[e]  number of the pair of points, equal for both directions
    mate : int64[e]  index of the same edge in the neighbour, NO_NEIGHBOUR on the boundary, CROWDED where cells overlap
    The argument `cells` of the methods is the number of cells.
    """

    cell: np.ndarray
    start: np.ndarray
    stop: np.ndarray
    key: np.ndarray
    mate: np.ndarray

    @cached_property
    def inner(self) -> np.ndarray:
        """Indices of the edges between two cells, each once: that in the cell with the lower number."""
        return np.flatnonzero(np.arange(self.mate.size) < self.mate)

    @cached_property
    def outer(self) -> np.ndarray:
        """Indices of the edges on the boundary."""
        return np.flatnonzero(self.mate == NO_NEIGHBOUR)

    def pieces(self, cells: int) -> np.ndarray:
        """Number of the part to which each cell belongs, connected by shared faces : int64[cells]."""
        return connected_components(self.graph(cells), directed=False)[1].astype(np.int64)

    def order(self, cells: int) -> np.ndarray:
        """Order of the cells in which neighbours are close together (reverse Cuthill-McKee) : int64[cells]."""
        graph = self.graph(cells)
        return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True).astype(
            np.int64
        )

    def graph(self, cells: int) -> coo_array:
        """Adjacency matrix : int8[cells, cells], 1 at (lower number, higher number) of two cells that share a face."""
        pair = self.cell[self.inner], self.cell[self.mate[self.inner]]
        return coo_array((np.ones(self.inner.size, np.int8), pair), shape=(cells, cells))


def edges_of(cells: np.ndarray, points: int) -> Edges:
    """Edges of cells.

    cells : int64[n, 4]  corners of cells, anticlockwise, -1 last in a triangle; points : number of points
    """
    stop = np.roll(cells, -1, axis=1)
    triangle = cells[:, 3] < 0
    stop[triangle, 2] = cells[triangle, 0]
    real = (cells >= 0).ravel()
    cell = np.repeat(np.arange(len(cells)), 4)[real]
    start, stop = cells.ravel()[real], stop.ravel()[real]
    key = np.minimum(start, stop) * points + np.maximum(start, stop)
    return Edges(cell, start, stop, key, _mates(key, start))


def _mates(key: np.ndarray, start: np.ndarray) -> np.ndarray:
    order = np.argsort(key, kind="stable")
    runs = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(runs, append=key.size)
    mate = np.full(key.size, CROWDED)
    mate[order[runs[count == 1]]] = NO_NEIGHBOUR
    pairs = runs[count == 2]
    first, second = order[pairs], order[pairs + 1]
    opposite = start[first] != start[second]
    first, second = first[opposite], second[opposite]
    mate[first], mate[second] = second, first
    return mate


def key_of(ends: np.ndarray, points: int) -> np.ndarray:
    """Keys of pairs of points, as in `Edges` : int64[k]. ends : int64[k, 2]; points : number of points"""
    return ends.min(axis=1) * points + ends.max(axis=1)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product a_x b_y - a_y b_x of plane vectors over the last axis."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def area_and_centre(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed areas and centroids of cells, exact for rectangles : float64[n], float64[n, 2].

    With corners p0 to p3, and the areas a1, a2 on both sides of the diagonal p0 p2, A = a1 + a2:
    centroid = (p0 + p1 + p2 + p3) / 4 - ((p1 + p3) - (p0 + p2)) / 12 - (a1 - a2) (p3 - p1) / (6 A).
    A triangle is a quadrilateral whose p3 is p0.
    """
    p0, p1, p2 = (points[cells[:, k]] for k in range(3))
    p3 = points[np.where(cells[:, 3] < 0, cells[:, 0], cells[:, 3])]
    area = 0.5 * cross(p2 - p0, p3 - p1)
    difference = 0.5 * (cross(p1 - p0, p2 - p0) - cross(p2 - p0, p3 - p0))
    even, odd = p0 + p2, p1 + p3
    safe = np.where(area == 0.0, 1.0, area)
    return area, 0.25 * (even + odd) - (odd - even) / 12.0 - (difference / (6.0 * safe))[
        :, None
    ] * (p3 - p1)


def corners(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(cross product, scalar product, length) for the corners of cells : three float64[n, 4].

    The products are those of the side into a corner and the side out of it; the length is that of the side out of it.
    In a triangle the fourth corner is the first again.
    """
    out = np.empty((3, len(cells), 4))
    for selected, count in ((cells[:, 3] < 0, 3), (cells[:, 3] >= 0, 4)):
        at = points[cells[selected, :count]]
        outgoing = np.roll(at, -1, axis=1) - at
        incoming = np.roll(outgoing, 1, axis=1)
        along = np.sum(incoming * outgoing, axis=2)
        values = np.stack(
            [cross(incoming, outgoing), along, np.hypot(outgoing[..., 0], outgoing[..., 1])]
        )
        out[:, selected, :count] = values
        out[:, selected, 3] = values[:, :, 0 if count == 3 else 3]
    return out[0], out[1], out[2]


def assemble(
    points: np.ndarray,
    cells: np.ndarray,
    edges: Edges,
    patches: Sequence[str],
    patch: np.ndarray,
    grid: Grid | None = None,
    notes: Sequence[str] = (),
) -> Mesh:
    """Mesh of valid, anticlockwise cells.

    points, cells, grid, notes : as in `Mesh`; patches : names of the patches
    patch : int64[outer]  number of the patch of each boundary edge
    """
    area, centre = area_and_centre(points, cells)
    order = np.argsort(patch, kind="stable")
    chosen = np.concatenate([edges.inner, edges.outer[order]])
    right = np.concatenate([edges.cell[edges.mate[edges.inner]], -1 - patch[order]])
    ends = np.stack([edges.start[chosen], edges.stop[chosen]], axis=1)
    a, b = points[ends[:, 0]], points[ends[:, 1]]
    along = b - a
    length = np.hypot(along[:, 0], along[:, 1])
    # 0 - x avoids negative zeros
    normal = np.stack([along[:, 1], 0.0 - along[:, 0]], axis=1) / length[:, None]
    left, middle = edges.cell[chosen], 0.5 * (a + b)
    return Mesh(
        points,
        cells,
        area,
        centre,
        left,
        right,
        normal,
        length,
        middle,
        ends,
        tuple(patches),
        grid,
        tuple(notes),
    )


@dataclass(frozen=True)
class Quality:
    """Quality measures of a mesh.

    smallest, largest : least and greatest area of a cell [m2]
    angle : least angle at a corner [rad]; sharpest : cell with this angle
    ratio : greatest ratio of the areas of two neighbours [-]; steepest : face between them
    A mesh without inner faces has ratio 1 and steepest -1.
    """

    smallest: float
    largest: float
    angle: float
    sharpest: int
    ratio: float
    steepest: int


def quality(mesh: Mesh) -> Quality:
    """Compute the quality measures of a mesh."""
    turn, straight, _ = corners(mesh.points, mesh.cells)
    angle = np.arctan2(turn, -straight).min(axis=1)
    sharpest = int(np.argmin(angle))
    left, right = mesh.area[mesh.left[: mesh.inner]], mesh.area[mesh.right[: mesh.inner]]
    ratio = np.maximum(left, right) / np.minimum(left, right)
    steepest = int(np.argmax(ratio)) if ratio.size else -1
    return Quality(
        smallest=float(mesh.area.min()),
        largest=float(mesh.area.max()),
        angle=float(angle[sharpest]),
        sharpest=sharpest,
        ratio=float(ratio[steepest]) if ratio.size else 1.0,
        steepest=steepest,
    )


OUTLINE_TOLERANCE = 1e-9  # of the mesh's extent: points this close to its outline count as inside
CANDIDATES = 16  # cells with the nearest centres, tried before all cells
RINGS = 2  # greatest number of rings of neighbours
WEIGHT_TOLERANCE = 1e-9  # of a cell's size: error of exact weights
# weight of the sum of weights over that of their point, for points beyond all centres
SUM_WEIGHT = 1e4
TINY = 1e-300  # least squared length
INWARD_FRACTION = 1e-3  # of the distance from the outline to the centre of its cell


class MeshPoints:
    """Search for points in a mesh: cell that contains a point, and interpolation weights there."""

    def __init__(self, mesh: Mesh) -> None:
        from scipy.spatial import cKDTree

        self.mesh, self.near = mesh, OUTLINE_TOLERANCE * float(np.ptp(mesh.points, axis=0).max())
        self.low, self.high = (
            mesh.points.min(axis=0) - self.near,
            mesh.points.max(axis=0) + self.near,
        )
        self.tree = cKDTree(mesh.centre)
        order = np.argsort(mesh.cells, axis=None, kind="stable")
        first = np.searchsorted(mesh.cells.ravel()[order], np.arange(len(mesh.points) + 1))
        # cells at point p: cells_of_points[first[p] : first[p + 1]]
        self.cells_of_points, self.first = order // 4, first

    def cell(self, x: float, y: float) -> int:
        """Number of the cell that contains the point (x, y) [m]; the lowest number on an edge, -1 outside all cells."""
        n = len(self.mesh.cells)
        # far points, whose distances overflow, and NaN
        if not np.all((self.low <= (x, y)) & ((x, y) <= self.high)):
            return -1
        nearest = np.sort(np.ravel(self.tree.query((x, y), min(CANDIDATES, n))[1]))
        for cells in (nearest, np.arange(n)):
            inside = self._inside(cells, x, y)
            if inside.any():
                return int(cells[np.argmax(inside)])
        return -1

    def _inside(self, cells: np.ndarray, x: float, y: float) -> np.ndarray:
        corners = self.mesh.cells[cells]
        # a triangle's fourth side has no length
        corners = np.where(corners < 0, corners[:, :1], corners)
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
        share = np.clip(
            ((point - a) * along).sum(1) / np.maximum((along * along).sum(1), TINY), 0.0, 1.0
        )
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
            (i, p), (j, q) = (
                _neighbour_columns(lines, value) for lines, value in ((grid.x, x), (grid.y, y))
            )
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
            points = {int(p) for c in cells for p in self.mesh.cells[c] if p >= 0}
            near = {
                int(c)
                for p in points
                for c in self.cells_of_points[self.first[p] : self.first[p + 1]]
            }
            cells += sorted(near - set(cells))
            away = (self.mesh.centre[cells] - (x, y)) / np.sqrt(self.mesh.area[cell])
            weights, residual = nnls(
                np.vstack([np.full(len(cells), SUM_WEIGHT), away.T]),
                np.array([SUM_WEIGHT, 0.0, 0.0]),
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
