"""Flat arrays of a mesh for loops over the sides of cells, in the layout of `fvsolve.basins.cell_sides`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fvsolve.basins import cell_sides, moving_meshes
from fvsolve.basins.cell_sides import BLOCK

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh


def lower_mesh(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """(float64[:] floats, int64[:] integers) with geometry and neighbours of the cells of a mesh, see `cell_sides`.

    Cells and faces keep their numbers.
    """
    n, f, inner = len(mesh.area), len(mesh.left), mesh.inner
    slots, face, own, side = _sides(mesh)
    block, lane, count = own // BLOCK, own % BLOCK, -(-n // BLOCK)
    slot, at = (4 * block + side) * BLOCK + lane, (slots * block + side) * BLOCK + lane
    other = np.concatenate([f + np.arange(inner), np.arange(inner, f), np.arange(inner)])  # the side beyond, or itself
    step = np.abs(block[other] - block)
    ring = 1 << int(3 * step.max()).bit_length()
    need = np.zeros(count, np.int64)
    np.maximum.at(need, block, block[other] + 1)
    indices = np.zeros((cell_sides.INDICES, count * slots * BLOCK), np.int64)
    k, i = np.divmod(np.arange(indices.shape[1]), BLOCK)
    j, k = np.divmod(k, slots)
    indices[cell_sides.CELL] = (j % ring) * BLOCK + i  # missing side of a cell: the cell itself
    indices[cell_sides.SIDE] = (4 * (j % ring) + k) * BLOCK + i
    indices[:, at] = indices[:, at[other]]
    face_of = np.full(indices.shape[1], ~0)
    face_of[at] = face
    measures = np.zeros((cell_sides.MEASURES + cell_sides.DISTANCES, indices.shape[1]))
    measures[cell_sides.NX] = 1.0
    measures[:, at] = _measures(mesh, face, own, n)
    rank = np.argsort(slot[inner:f])
    measures, distances = np.split(measures, [cell_sides.MEASURES])
    floats = [_by_block(measures), mesh.normal[inner + rank].T.ravel(), mesh.length, _by_block(distances)]
    need = np.maximum.accumulate(need)
    places = _by_block(indices).astype(np.int32).view(np.int64)
    integers = [[slots, n, f, f - inner, ring], places, need, slot[inner + rank], rank, face_of]
    return np.concatenate(floats), np.concatenate(integers).astype(np.int64)


def lower_ends(mesh: Mesh, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(blocks : int64[blocks], ends : int64[:]): blocks of cells that move, and corners of cells and of their sides.

    A block has the value 1 if a corner of its cells or of cells next to these moves, else 0.
    For the order in `ends` see `moving_meshes`. moves : bool[corners]  True if a corner moves
    """
    n, inner = len(mesh.area), mesh.inner
    slots, face, own, side = _sides(mesh)
    at, count = (slots * (own // BLOCK) + side) * BLOCK + own % BLOCK, -(-n // BLOCK)
    number, left = np.where(face >= 0, face, ~face), face >= 0
    ends = np.zeros((moving_meshes.ENDS, count * slots * BLOCK), np.int64)
    ends[:, at] = [
        mesh.ends[number, np.where(left, 0, 1)], mesh.ends[number, np.where(left, 1, 0)],
        np.maximum(np.where(left, mesh.right[number], mesh.left[number]), -1),
    ]  # fmt: skip
    corners = np.where(mesh.cells < 0, mesh.cells[:, :1], mesh.cells)
    has_moving_corner = moves[corners].any(axis=1)
    is_affected = has_moving_corner.copy()
    np.logical_or.at(is_affected, mesh.left[:inner], has_moving_corner[mesh.right[:inner]])
    np.logical_or.at(is_affected, mesh.right[:inner], has_moving_corner[mesh.left[:inner]])
    moving_blocks = np.bincount(np.arange(n) // BLOCK, is_affected, count) > 0.0
    pairs = [table.ravel().astype(np.int32).view(np.int64) for table in (corners, _by_block(ends))]
    return moving_blocks.astype(np.int64), np.concatenate(pairs)


def _sides(mesh: Mesh) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """(slots, face, own, side): 3 or 4 sides per cell, then for each side its face, its cell, its number in the cell.

    The entry of `face` is ~f where the cell is to the right of face f.
    """
    n, f, inner = len(mesh.area), len(mesh.left), mesh.inner
    slots = 4 if (mesh.cells[:, 3] >= 0).any() else 3
    face = np.concatenate([np.arange(f), ~np.arange(inner)])  # ~f where the cell is on the right of it
    own = np.concatenate([mesh.left, mesh.right[:inner]])
    normal = np.where(face[:, None] >= 0, 1.0, -1.0) * mesh.normal[np.where(face >= 0, face, ~face)]
    # angle of the outward normal plus pi: sides of rectangles in the order west, south, east, north
    direction = np.round(np.arctan2(-normal[:, 1], -normal[:, 0]), 9) % round(2.0 * np.pi, 9)
    sort = np.lexsort((direction, own))
    first = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=n))[:-1]])
    side = np.empty(own.size, np.int64)
    side[sort] = np.arange(own.size) - first[own[sort]]
    return slots, face, own, side


def _by_block(table: np.ndarray) -> np.ndarray:
    """Flatten a table to the order in memory of `cell_sides`: by block, side number, row of the table, cell.

    table : [rows, sides], its sides ordered by block, side number and cell, with BLOCK cells in every block
    """
    return table.reshape(len(table), -1, BLOCK).swapaxes(0, 1).ravel()


def _measures(mesh: Mesh, face: np.ndarray, own: np.ndarray, n: int) -> np.ndarray:
    """Measures of every side : float64[MEASURES + DISTANCES, sides], see `cell_sides`.

    face, own : face (~f if the cell is to its right) and cell of each side; n : number of cells
    """
    number = np.where(face >= 0, face, ~face)
    normal = np.where(face[:, None] >= 0, 1.0, -1.0) * mesh.normal[number]
    to_side = mesh.middle[number] - mesh.centre[own]
    beyond = np.where(face >= 0, mesh.right[number], mesh.left[number])
    across = 2.0 * np.sum(to_side * normal, axis=1, keepdims=True) * normal  # to the mirror image
    across = np.where(beyond[:, None] >= 0, mesh.centre[beyond] - mesh.centre[own], across)
    weight = 1.0 / np.sum(across**2, axis=1)
    square = [np.bincount(own, weight * across[:, a] * across[:, b], n) for a, b in ((0, 0), (0, 1), (1, 1))]
    xx, xy, yy = (s[own] for s in square)
    scale = weight / (xx * yy - xy * xy)
    slope = scale * (yy * across[:, 0] - xy * across[:, 1]), scale * (xx * across[:, 1] - xy * across[:, 0])
    gap = 1.0 / np.sum(across * normal, axis=1)
    offset = normal - across * gap[:, None]
    share = 1.0 / mesh.area[own]
    return np.stack([*normal.T, mesh.length[number] * share, *to_side.T, *slope, share, gap, *offset.T])
