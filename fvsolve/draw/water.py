"""Basins as surfaces: water up to its shore, the bed, houses. Knows meshes of PyVista; knows no camera."""

from __future__ import annotations

from typing import Any

import numpy as np

WET = 1e-4  # depth from which there is water to be seen [m]
STEEP = 1.0  # slope from which a bed is a wall
INSET = 1e-3  # of a house, that its walls do not lie in those of the water


def water(mesh: Any, rise: float, fields: tuple[str, ...], least: float = WET) -> Any:
    """The water of a basin at its surface, cut where that meets the bed; `height` [m] over the bed at its points.

    The surface of wet cells is carried on over the dry ones beside them; where that lies above their bed too, as at a
    front on level ground, the shore lies half way into them. From a depth of `least` there is water. Fields at points
    are means over wet cells.
    """
    cells, wet = _cells(mesh), mesh.cell_data["depth"] > least
    up = upright(mesh)
    bed = mesh.points @ up
    if "normal" in mesh.cell_data:  # levels are told in axes of what it rides on
        bed += np.mean(mesh.cell_data["bed"] - mesh.cell_centers().points @ up)
    at = _at_points(cells, wet, mesh.cell_data["surface"], mesh.n_points)
    known = np.isfinite(at)
    beyond = _carried(cells, ~wet, at, mesh.n_points)
    height = np.where(known, at, beyond) - bed
    height = np.where(known, height, -np.abs(height))
    height = np.where(np.isfinite(height), height, -1.0)
    made = mesh.copy()
    made.clear_data()
    made.point_data["height"] = height
    for name in fields:
        if name in mesh.cell_data:
            values = _at_points(cells, wet, mesh.cell_data[name], mesh.n_points)
            made.point_data[name] = np.nan_to_num(np.where(known, values, _carried(cells, ~wet, values, mesh.n_points)))
    lift = np.where(known, at, np.where(np.isfinite(beyond), beyond, bed)) - bed
    made.points = (mesh.points + lift[:, None] * up) * (1.0, 1.0, rise)
    return made.clip_scalar(scalars="height", value=0.0, invert=False)


def sides(surface: Any, up: np.ndarray) -> Any:
    """What upright walls see of water: from its rim down to the bed; up : float64[3], heights as they are drawn."""
    import pyvista

    rim = edges(surface)
    low = rim.points - np.maximum(rim.point_data["height"], 0.0)[:, None] * up
    ends = rim.lines.reshape(-1, 3)[:, 1:]
    faces = np.column_stack([np.full(len(ends), 4), ends, ends[:, ::-1] + rim.n_points])
    return pyvista.PolyData(np.vstack([rim.points, low]), faces.ravel())


def upright(mesh: Any) -> np.ndarray:
    """Along which depths of a basin count, upwards or what it rides on has there : float64[3]."""
    return mesh.cell_data["normal"].mean(axis=0) if "normal" in mesh.cell_data else np.array([0.0, 0.0, 1.0])


def houses(mesh: Any, top: float) -> list[Any]:
    """What is cut out of a basin, from the bed up to `top`: closed boundaries within the outer one."""
    import pyvista

    found = []
    for loop in loops(mesh)[1:]:
        middle = loop.mean(axis=0)
        foot = middle + (1.0 - INSET) * (loop - middle)
        n = len(foot)
        head = np.column_stack([foot[:, :2], np.full(n, max(top, foot[:, 2].max()))])
        walls = [[4, k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
        found.append(pyvista.PolyData(np.vstack([foot, head]), np.hstack(walls)))
        found.append(pyvista.PolyData(head, [n, *range(n)]).triangulate())
    return found


def loops(mesh: Any) -> list[np.ndarray]:
    """Closed boundaries of a basin float64[k, 3], the longest first."""
    rim = edges(mesh)
    follow: dict[int, list[int]] = {}
    for a, b in rim.lines.reshape(-1, 3)[:, 1:]:
        follow.setdefault(int(a), []).append(int(b))
        follow.setdefault(int(b), []).append(int(a))
    found, left = [], set(follow)
    while left:
        walk = [left.pop()]
        while ahead := [one for one in follow[walk[-1]] if one in left]:
            walk.append(ahead[0])
            left.discard(ahead[0])
        found.append(np.asarray(rim.points)[walk])
    return sorted(found, key=lambda one: -float(np.linalg.norm(np.ptp(one, axis=0))))


def blocks(mesh: Any) -> np.ndarray:
    """Cells of a bed that rises like a house: behind walls steeper than STEEP all round, and above them : bool[n]."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    cells, z = _cells(mesh), mesh.points[:, 2]
    low, high, size = (np.full(mesh.n_cells, np.nan) for _ in range(3))
    for rows, corners in cells:
        low[rows], high[rows] = z[corners].min(axis=1), z[corners].max(axis=1)
        size[rows] = np.linalg.norm(mesh.points[corners[:, 0], :2] - mesh.points[corners[:, 2], :2], axis=1)
    steep = high - low > STEEP * size
    if not steep.any():
        return steep
    rows = np.concatenate([np.repeat(rows, corners.shape[1]) for rows, corners in cells])
    columns = np.concatenate([corners.ravel() for _, corners in cells])
    touch = coo_matrix((np.ones(len(rows)), (rows, columns)), (mesh.n_cells, mesh.n_points)).tocsr()
    flat = np.flatnonzero(~steep)
    beside = (touch[flat] @ touch[flat].T) >= 2  # cells that share a face
    _, piece = connected_components(beside, directed=False)
    main = np.bincount(piece).argmax()
    found = steep.copy()
    for k in set(piece) - {main}:
        inner = flat[piece == k]
        if low[inner].min() > low[steep].min() + 0.5 * (high[steep] - low[steep]).min():
            found[inner] = True
    return found


def _cells(mesh: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """(numbers, corners) of the cells of each shape."""
    return [(np.flatnonzero(mesh.celltypes == kind), corners) for kind, corners in mesh.cells_dict.items()]


def _at_points(cells, of: np.ndarray, values: np.ndarray, many: int) -> np.ndarray:
    """Means over the cells `of` about each point, nan where there is none."""
    total, count = np.zeros(many), np.zeros(many)
    for rows, corners in cells:
        kept = of[rows]
        np.add.at(total, corners[kept], values[rows[kept], None])
        np.add.at(count, corners[kept], 1.0)
    return np.where(count > 0.0, total / np.where(count > 0.0, count, 1.0), np.nan)


def _carried(cells, of: np.ndarray, at: np.ndarray, many: int) -> np.ndarray:
    """Means at points over the cells `of` of what is known at their corners."""
    total, count = np.zeros(many), np.zeros(many)
    for rows, corners in cells:
        mine = corners[of[rows]]
        there = np.isfinite(at[mine])
        has = there.any(axis=1)
        mean = np.where(there, at[mine], 0.0)[has].sum(axis=1) / there[has].sum(axis=1)
        np.add.at(total, mine[has], mean[:, None])
        np.add.at(count, mine[has], 1.0)
    return np.where(count > 0.0, total / np.where(count > 0.0, count, 1.0), np.nan)


def edges(mesh: Any) -> Any:
    return mesh.extract_surface(algorithm=None).extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
