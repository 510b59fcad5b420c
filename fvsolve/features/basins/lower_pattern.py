"""Dependence of the rates of a basin on its states, for the sparsity pattern of Jacobians."""

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array, kron

from fvsolve.core.kernels import dtypes as rec
from fvsolve.features.basins import tables as records

STENCIL_RADIUS = 3  # stencil radius of the fifth order
# closures of patches through whose faces the flow of links passes
THROUGH_FACES = (records.LINKED, records.INTERIOR)


def interior_pattern(basin) -> tuple[np.ndarray, np.ndarray]:
    """(rates, states) as indices in y: each rate of each cell, paired with the states on which it depends.

    Amounts of scalars are left out, see `scalar_pattern`.
    """
    near, count = neighbours(basin), len(basin.quantities)
    pattern = kron(coo_array(np.ones((count, count), dtype=bool)), near).tocoo()
    at = int(basin.row["y"])
    return at + pattern.row.astype(np.int64), at + pattern.col.astype(np.int64)


def scalar_pattern(basin) -> tuple[np.ndarray, np.ndarray]:
    """(rates, states) as indices in y: each rate of an amount of a scalar, paired with the states on which it depends.

    These are amounts of the same scalar, and the flow states if the basin has any.
    """
    near, count = scalar_neighbours(basin), len(basin.scalars)
    own = kron(eye_array(count, dtype=bool), near).tocoo()
    by_flow = kron(coo_array(np.ones((count, len(basin.quantities)), dtype=bool)), near).tocoo()
    rows, first = np.concatenate([own.row, by_flow.row]), int(basin.row["carried"])
    columns = np.concatenate(
        [first + own.col.astype(np.int64), int(basin.row["y"]) + by_flow.col.astype(np.int64)]
    )
    return first + rows.astype(np.int64), columns


def scalar_neighbours(basin) -> csr_array:
    """Cells on which the rate of the amount in each cell depends : bool[n, n].

    On grids, schemes of fifth order also read cells beside the faces of a cell, up to four columns and four rows away.
    The flux correction of weno5 reads further cells. On other meshes, diffusion reads the gradients of both cells at a
    face.
    """
    near, scalars = neighbours(basin), basin.case.scalars
    if (
        not basin.is_grid
        and basin.reach == 1
        and any(scalars[name].diffusivity > 0.0 for name in basin.scalars)
    ):
        near = near @ near
    if basin.is_grid and basin.row["scheme"] in (rec.LINEAR, rec.WENO5):
        near = near @ near if basin.row["scheme"] == rec.WENO5 else near
        box = eye_array(basin.n, dtype=bool)
        for ring in neighbour_rings(basin):
            box = box @ ring @ ring @ ring @ ring
        near = near + box
    return csr_array(near, dtype=bool)


def amount_states(basin, q: int, cells: np.ndarray) -> np.ndarray:
    """Indices in y of the amounts of scalar q in the given cells."""
    return int(basin.row["carried"]) + q * basin.n + cells


def cells_read(near: csr_array, cells: np.ndarray) -> np.ndarray:
    """Cells on which the rates of the given cells depend, including these cells; near : result of `neighbours`."""
    return np.unique(near[np.unique(cells)].indices)


def cell_states(basin, cells: np.ndarray, quantities: int | None = None) -> np.ndarray:
    """Indices in y of the first `quantities` state quantities of the given cells; of all quantities for None."""
    count = len(basin.quantities) if quantities is None else quantities
    return (int(basin.row["y"]) + np.arange(count)[:, None] * basin.n + cells).ravel()


def all_states(basin) -> np.ndarray:
    """Indices in y of all states of a basin."""
    own = int(basin.row["y"]) + np.arange(len(basin.quantities) * basin.n)
    carried = int(basin.row["carried"]) + np.arange(len(basin.scalars) * basin.n)
    return np.concatenate([own, carried, basin.source_states])


def cells_at_faces(integers: np.ndarray, patch) -> np.ndarray:
    """Cells whose states the flow through the faces of a patch reads, besides its own; patch : its row of the table"""
    behind = int(patch["ring"] + patch["faces"])
    second = int(patch["second"])
    count = int(patch["faces"])
    around = integers[second : second + int(patch["stencil"]) * count]
    return np.unique([*integers[behind : behind + count], *around]).astype(np.int64)


def source_pattern(basin) -> tuple[np.ndarray, np.ndarray]:
    """(rates, states) as indices in y: rates of depth and of the soil, and states of both on which they depend."""
    firsts = [
        int(basin.row["y"]),
        *(int(basin.row["infiltrated"]) + k * basin.n for k in range(basin.soil_states)),
    ]
    states = np.array(firsts)[:, None] + np.arange(basin.n)
    pairs = [
        (states[i], states[j]) for i in range(len(states)) for j in range(len(states)) if i + j > 0
    ]
    return np.concatenate([i for i, _ in pairs]), np.concatenate([j for _, j in pairs])


def neighbours(basin) -> csr_array:
    """Cells on which the rates of each cell depend : bool[n, n].

    On grids they lie along both axes from the cell, on other meshes in all directions.
    """
    pattern, reach = csr_array(eye_array(basin.n, dtype=bool)), basin.reach
    edge = np.unique(basin.mesh.left[basin.mesh.inner :])
    if reach < STENCIL_RADIUS or not basin.has_wide_closure or not basin.row["outer_given"]:
        edge = edge[:0]
    driven = np.unique(basin.mesh.left[basin.mesh.inner :] if basin.extrapolates else edge[:0])
    at_edge, at_driven = (
        csr_array(coo_array((np.ones(cells.size, dtype=bool), (cells, cells)), shape=pattern.shape))
        for cells in (edge, driven)
    )
    for ring in neighbour_rings(basin):
        reached = ring
        for _ in range(reach - 1):
            reached = reached @ ring
        # outgoing waves of a liquid are extrapolated by a polynomial of five cells, water at driven faces of a mesh by
        # neighbours of neighbours, on which sides of the cells behind depend
        pattern = pattern + reached + at_edge @ reached @ ring + ring @ at_driven @ ring @ ring
    return csr_array(pattern, dtype=bool)


def neighbour_rings(basin) -> list[csr_array]:
    """Matrices bool[n, n] that are True for each cell and its next neighbours.

    For a grid there is one for neighbours along x and one for neighbours along y, else one for all neighbours.
    """
    mesh, patterns = basin.mesh, []
    left, right = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    across = np.abs(mesh.normal[: mesh.inner, 0]) > 0.5
    for group in (across, ~across) if basin.is_grid else (slice(None),):
        ones = np.ones(left[group].size, dtype=bool)
        forward = csr_array(
            coo_array((ones, (left[group], right[group])), shape=(basin.n, basin.n))
        )
        patterns.append(csr_array(forward + forward.T + eye_array(basin.n, dtype=bool), dtype=bool))
    return patterns
