"""Edges of cells, and the neighbours across them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

NO_NEIGHBOUR, CROWDED = -1, -2  # no mate: a boundary edge; more than one neighbour, or a neighbour on the same side


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of all cells, by cell and corner, anticlockwise; an edge between two cells occurs twice.

    cell : int64[e]  cell of the edge; start, stop : int64[e]  points at its ends
    key : int64[e]  number of the pair of points, equal for both directions
    mate : int64[e]  index of the same edge in the neighbour, NO_NEIGHBOUR on the boundary, CROWDED where cells overlap
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
        """Number of the connected part to which each cell belongs : int64[cells].

        Cells are connected by shared faces only. cells : number of cells
        """
        return connected_components(self.graph(cells), directed=False)[1].astype(np.int64)

    def order(self, cells: int) -> np.ndarray:
        """Order of the cells in which neighbours are close together (reverse Cuthill-McKee) : int64[cells].

        cells : number of cells
        """
        graph = self.graph(cells)
        return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True).astype(np.int64)

    def graph(self, cells: int) -> coo_array:
        """Adjacency matrix : int8[cells, cells], 1 at (lower number, higher number) of two cells that share a face.

        cells : number of cells
        """
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
