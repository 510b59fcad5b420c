"""Area, centroid, corners and faces of plane cells, and the assembly of a mesh from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fvsolve.mesh.edges import Edges
from fvsolve.mesh.mesh import Grid, Mesh


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
    return area, 0.25 * (even + odd) - (odd - even) / 12.0 - (difference / (6.0 * safe))[:, None] * (p3 - p1)


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
        values = np.stack(
            [
                cross(incoming, outgoing),
                np.sum(incoming * outgoing, axis=2),
                np.hypot(outgoing[..., 0], outgoing[..., 1]),
            ]
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
    normal = np.stack([along[:, 1], 0.0 - along[:, 0]], axis=1) / length[:, None]  # 0 - x avoids negative zeros
    left, middle = edges.cell[chosen], 0.5 * (a + b)
    return Mesh(
        points, cells, area, centre, left, right, normal, length, middle, ends, tuple(patches), grid, tuple(notes)
    )
