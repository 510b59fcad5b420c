"""Which states of a basin its rates can depend on. Knows neighbours; knows no values."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array, kron

from fvsolve.kernels import records as rec

WIDE = 3  # cells either way that the fifth order looks at


def inside(basin) -> tuple[np.ndarray, np.ndarray]:
    """(rates, as many states that they depend on) of all cells on those about them."""
    near, many = neighbours(basin), len(basin.quantities)
    found = kron(coo_array(np.ones((many, many), dtype=bool)), near).tocoo()
    at = int(basin.row["y"])
    return at + found.row.astype(np.int64), at + found.col.astype(np.int64)


def carried(basin) -> tuple[np.ndarray, np.ndarray]:
    """The same of amounts of scalars: each on itself, and all on what its own water does, where there is any."""
    near, many = looked_at(basin), len(basin.scalars)
    found = kron(eye_array(many, dtype=bool), near).tocoo()
    moved = kron(coo_array(np.ones((many, len(basin.quantities)), dtype=bool)), near).tocoo()
    rows, first = np.concatenate([found.row, moved.row]), int(basin.row["carried"])
    columns = np.concatenate([first + found.col.astype(np.int64), int(basin.row["y"]) + moved.col.astype(np.int64)])
    return first + rows.astype(np.int64), columns


def looked_at(basin) -> csr_array:
    """bool[n, n]: cells that the rate of an amount looks at.

    Fifth order on grids looks along its faces too, four cells from a side; what is held to bounds looks further.
    """
    near = neighbours(basin)
    if basin.is_grid and basin.row["scheme"] in (rec.LINEAR, rec.WENO5):
        near = near @ near if basin.row["scheme"] == rec.WENO5 else near
        box = eye_array(basin.n, dtype=bool)
        for ring in rings(basin):
            box = box @ ring @ ring @ ring @ ring
        near = near + box
    return csr_array(near, dtype=bool)


def amounts(basin, q: int, cells: np.ndarray) -> np.ndarray:
    """States of the amounts of scalar q in cells."""
    return int(basin.row["carried"]) + q * basin.n + cells


def about(near: csr_array, cells: np.ndarray) -> np.ndarray:
    """Cells that some cells look at, themselves among them."""
    return np.unique(near[np.unique(cells)].indices)


def of_cells(basin, cells: np.ndarray, quantities: int | None = None) -> np.ndarray:
    """States of cells, of the first quantities or all."""
    many = len(basin.quantities) if quantities is None else quantities
    return (int(basin.row["y"]) + np.arange(many)[:, None] * basin.n + cells).ravel()


def all_of(basin) -> np.ndarray:
    """All states of a basin."""
    own = int(basin.row["y"]) + np.arange(len(basin.quantities) * basin.n)
    return np.concatenate([own, int(basin.row["carried"]) + np.arange(len(basin.scalars) * basin.n)])


def neighbours(basin) -> csr_array:
    """bool[n, n]: which cells the rate of each looks at: along either axis of a grid, all around on other meshes."""
    found, reach = csr_array(eye_array(basin.n, dtype=bool)), basin.reach
    edge = np.unique(basin.mesh.left[basin.mesh.inner :])
    if reach < WIDE or not basin.far_ends or not basin.row["outer_given"]:
        edge = edge[:0]
    beside = csr_array(coo_array((np.ones(edge.size, dtype=bool), (edge, edge)), shape=found.shape))
    for ring in rings(basin):
        reached = ring
        for _ in range(reach - 1):
            reached = reached @ ring
        found = found + reached + beside @ reached @ ring  # a wave leaves a liquid on a polynomial of five cells
    return csr_array(found, dtype=bool)


def rings(basin) -> list[csr_array]:
    """bool[n, n]: each cell and those next to it, along one axis of a grid after the other, on other meshes all."""
    mesh, found = basin.mesh, []
    left, right = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    across = np.abs(mesh.normal[: mesh.inner, 0]) > 0.5
    for group in (across, ~across) if basin.is_grid else (slice(None),):
        ones = np.ones(left[group].size, dtype=bool)
        one = csr_array(coo_array((ones, (left[group], right[group])), shape=(basin.n, basin.n)))
        found.append(csr_array(one + one.T + eye_array(basin.n, dtype=bool), dtype=bool))
    return found
