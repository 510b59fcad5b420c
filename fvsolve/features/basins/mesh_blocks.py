"""Rates of waves on a mesh of any cells: the loop over blocks of cells and their sides, for liquids and for water.

The module EQUATION (`liquid.liquid_mesh`, `free_surface.surface_mesh`) contains the functions of a block. Their
arguments, and those of the functions here, are

fluid : fluid and scheme, with fields `scheme` and `wide_by`; mesh : `BlockMesh`; j, k : block, and number of a side
states, rates : three states of all cells and arrays for their rates, float64[n] each
reflect : float64[b]  reflection coefficients of boundary faces, 1 for walls; empty if all are walls
flow : float64[f]  flows through faces, left to right, or empty; through : float64[b]  inward flows through the
boundary, or empty; n cells, f faces, b boundary faces
cells, sides : values of cells and at their sides from inside, in the ring of `cell_sides`, a row for each field;
`cells` also has a row of wave speeds, and one of the bed for water. Under UPWIND both are the same array
shown : values beyond boundary sides, from which gradients in cells are computed, b for each of EQUATION.SHOWN fields
first, last : first boundary side of a block or side, and first one after it
w : scratch of a block, rows of BLOCK; the first rows are the values beyond a side
moves : None, or the `MeshMotion` of moving walls
phi : None, or the potential [J/kg] of cells, float64[n], and of sides in the order of `cell_sides`, padded to blocks
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import UPWIND
from fvsolve.features.basins import cell_sides
from fvsolve.features.basins.cell_sides import (
    BLOCK,
    HEAD,
    INDICES,
    MEASURES,
    blocks,
    blocks_of,
    edges_before,
    stretch_rates,
)
from fvsolve.jit import inline, njit

EQUATION = None  # of the template


class BlockMesh(NamedTuple):
    """Arrays of a mesh, see `cell_sides`.

    count, slots, n, ring : numbers of blocks, of sides of a cell, of cells, and of stored blocks
    edges, number : boundary sides, and numbers of their boundary faces; nx, ny : outward normals there
    faces : face of each side; lengths : lengths of faces [m]
    places : places in the ring of neighbours
    """

    floats: np.ndarray
    integers: np.ndarray
    count: int
    slots: int
    n: int
    ring: int
    need: np.ndarray
    edges: np.ndarray
    number: np.ndarray
    faces: np.ndarray
    nx: np.ndarray
    ny: np.ndarray
    lengths: np.ndarray
    places: np.ndarray


@inline
def open_mesh(floats, integers):
    """`BlockMesh` of the arrays of a mesh, see `cell_sides`."""
    slots = integers[0]
    n = integers[1]
    f = integers[2]
    b = integers[3]
    ring = integers[4]
    count = blocks(integers)
    at, to = HEAD + INDICES * count * slots * BLOCK // 2, MEASURES * count * slots * BLOCK
    need, edges = integers[at : at + count], integers[at + count :][:b]
    number, faces = integers[at + count + b :][:b], integers[at + count + 2 * b :]
    nx = floats[to : to + b]
    ny = floats[to + b : to + 2 * b]
    lengths = floats[to + 2 * b :][:f]
    places = integers[HEAD:].view(np.int32)
    return BlockMesh(
        floats, integers, count, slots, n, ring, need, edges, number, faces, nx, ny, lengths, places
    )


def work_size(equation, integers):
    """Length of the work array of the rates on a mesh. equation : module EQUATION; integers : mesh, see `cell_sides`"""
    cells = (4 * equation.FIELDS + equation.ROWS_OF_CELLS) * integers[4] * BLOCK
    return cells + equation.SHOWN * integers[3] + equation.ROWS * BLOCK


@inline
def own_sides(fluid, mesh, j, k):
    """Index in `sides` of the values at side k of the first cell of block j."""
    at = (j % mesh.ring) * BLOCK
    return at if fluid.scheme == UPWIND else 4 * at + k * BLOCK


@njit
def first_read(need, block):
    """First block that `block` reads. need : number of the last block that each block reads plus 1, in rising order"""
    first = 0
    while need[first] <= block:
        first += 1
    return first


@inline
def put_flow(where, flux, length, flow):
    """Write the flows [m3/s] through one side of each cell of a block to `flow`, by the numbers of faces.

    Sides at which the normal of the face points into the cell are left out. where : face of each side, negative there
    flux : flows per length; length : lengths of all faces [m]
    """
    for i in range(BLOCK):
        if where[i] >= 0:
            flow[where[i]] = flux[i] * length[where[i]]


def mesh_rates(
    fluid, floats, integers, reflect, states, flow, through, work, rates, band, moves, phi
):
    """Write the rates of a range of cells of a mesh; return the greatest rate that limits the time step [1/s].

    floats, integers : geometry and neighbours, see `cell_sides`; work : float64[work_size(EQUATION, integers)]
    band : first of these cells, at the start of a block, and one beyond the last, at the end of a block
    """
    mesh = open_mesh(floats, integers)
    fields = EQUATION.FIELDS
    near = integers[4] * BLOCK
    rows = EQUATION.ROWS_OF_CELLS
    cells, rest = work[: rows * near].reshape((rows, near)), work[rows * near :]
    sides, rest = rest[: 4 * fields * near].reshape((fields, 4 * near)), rest[4 * fields * near :]
    shown, w = rest[: EQUATION.SHOWN * mesh.edges.size], rest[EQUATION.SHOWN * mesh.edges.size :]
    begin = band[0] // BLOCK
    stop = blocks_of(band[1])
    first_order = fluid.scheme == UPWIND
    most = 0.0
    sides_done = first_read(mesh.need, begin)
    cells_done = first_read(mesh.need, sides_done)
    wall = edges_before(mesh.edges, 0, 4 * sides_done * BLOCK)
    edge = edges_before(mesh.edges, wall, 4 * begin * BLOCK)
    if first_order:
        sides = cells
    EQUATION.begin(w)
    for j in range(begin, stop):
        while sides_done < mesh.need[j]:
            while cells_done < mesh.need[sides_done]:
                EQUATION.put_cells(fluid, mesh, cells_done, states, cells, phi)
                cells_done += 1
            if not first_order:
                first, wall = wall, edges_before(mesh.edges, wall, 4 * (sides_done + 1) * BLOCK)
                EQUATION.put_sides(
                    fluid, mesh, sides_done, first, wall, reflect, cells, sides, shown, w, moves
                )
            sides_done += 1
        EQUATION.begin_block(fluid, mesh, j, states, w, phi)
        for k in range(mesh.slots):
            slot = j * mesh.slots + k
            where = mesh.places[slot * INDICES * BLOCK :]
            for q in range(fields):
                cell_sides.gather(
                    sides[q],
                    where if first_order else where[cell_sides.SIDE * BLOCK :],
                    w[q * BLOCK :],
                )
            first, edge = edge, edges_before(mesh.edges, edge, (4 * j + k + 1) * BLOCK)
            EQUATION.add_side(fluid, mesh, j, k, first, edge, reflect, cells, sides, w, moves, phi)
            if flow.size > 0:
                put_flow(mesh.faces[slot * BLOCK :], w[EQUATION.MASS :], mesh.lengths, flow)
            if through.size > 0:
                lengths = mesh.lengths[mesh.lengths.size - mesh.edges.size :]
                cell_sides.put_inward(
                    mesh.edges[first:edge],
                    mesh.number[first:edge],
                    w[EQUATION.MASS :],
                    lengths,
                    through,
                )
        a, z = j * BLOCK, min((j + 1) * BLOCK, mesh.n)
        EQUATION.put_rates(w, rates[0][a:z], rates[1][a:z], rates[2][a:z])
        if moves is not None:
            stretch_rates(moves.wide[a:z], rates[0][a:z], rates[1][a:z], rates[2][a:z])
    for i in range(BLOCK):
        most = max(most, w[EQUATION.TOP + i])
    return most
