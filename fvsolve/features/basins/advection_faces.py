"""Advection and diffusion of scalars by given flows through the faces of any mesh.

s_t + div(F c) = div(D depth grad c), with c the value of a scalar, s = depth c its amount per area, F the flow per
width [m2/s] and D the diffusivity. The rate of a uniform c is -c times the divergence of F, to the last bit.

Euler steps up to the reciprocal of the returned rate keep all values between two bounds, because the value at a side of
a cell differs from the value of the cell by no more than the distance to the nearer bound. So the value of the outflow
is at most twice as far from a bound as the value of the cell. Up to two thirds of that step, `minmod` keeps values
within the range of the neighbours. Other limiters have second order on any mesh.

Diffusion uses the difference of two cells along the line between their centres. Where this line is not normal to the
face, the mean of the gradients of both cells gives the oblique part: this is of second order, but without bounds.
Diffusion has no flux through walls and where the flow leaves. Where a given velocity enters, the value outside holds at
the face.

Arguments: mesh : (floats, integers), see `cell_sides`; c, d : values and depths of the cells of a block; w : scratch of
a block, float64[ROWS BLOCK]; geo, far : first and last group of measures of sides; bounds : (least, most) value,
infinite for none; wide_by : factor on the range of the neighbours that limits values at sides (with 1 they stay within
that range), 0 for upwind.
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import UPWIND
from fvsolve.features.basins import cell_sides as side
from fvsolve.features.basins.advection import DRY, THIN
from fvsolve.features.basins.cell_sides import (
    BLOCK,
    HEAD,
    INDICES,
    MEASURES,
    TINY,
    edges_before,
    gather,
    side_numbers,
)
from fvsolve.jit import njit

# Rows of BLOCK in the scratch of a block: four for `limited_sides`, also used for value, depth and gradients beyond;
# then value beyond the side, outward flow, rate, divergence, sum for the step.
_DEPTH, _GX, _GY, _VALUE, _FLOW, _RATE, _DIVERGENCE, _OUTFLOW, _TOP, _FREE = (
    k * BLOCK for k in range(1, 11)
)
_REACH = side.REACH * BLOCK
_WX = side.WX * BLOCK
_WY = side.WY * BLOCK
_PER_AREA, _PER_DISTANCE = side.PER_AREA * BLOCK, side.PER_DISTANCE * BLOCK
_OBLIQUE_X, _OBLIQUE_Y = side.OBLIQUE_X * BLOCK, side.OBLIQUE_Y * BLOCK
ROWS = 11


class MeshFlows(NamedTuple):
    """Flows through the faces of a mesh, all times `factor`, and values of the inflow at boundary faces.

    through : float64[faces]  flows from the left to the right cell: velocity [m/s] times length [m2/s], and also times
    the depth [m3/s] if the array of depths is not empty
    outside : float64[boundary faces]
    """

    factor: float
    through: np.ndarray
    outside: np.ndarray


class MeshValues(NamedTuple):
    """Temporary values in the ring of blocks that `cell_sides` describes.

    c, d, gx, gy : values, depths and gradients of cells; at_sides : values at their sides
    beyond : float64[2 b]  values beyond the boundary sides, for the limiter, then for gradients
    w : scratch of a block
    """

    c: np.ndarray
    d: np.ndarray
    gx: np.ndarray
    gy: np.ndarray
    at_sides: np.ndarray
    beyond: np.ndarray
    w: np.ndarray


@njit
def put_values(s, depth, c, d):
    """Write the values c = s / depth of a block of cells, with a depth of at least DRY, and their depths d.

    s : amounts of a scalar per area; if `depth` is empty, c = s and d = 1
    """
    if depth.size == 0:
        for i in range(s.size):
            c[i], d[i] = s[i], 1.0
    else:
        for i in range(s.size):
            c[i], d[i] = s[i] / max(depth[i], DRY), depth[i]


@njit
def put_gradients(j, mesh, edges, shown, values):
    """Write the least-squares gradients of the values in block j of cells to the ring of `values` (`MeshValues`).

    edges : numbers of the boundary sides of the block; shown : values beyond them
    """
    floats, integers = mesh
    slots = integers[0]
    at = j % integers[4] * BLOCK
    places = integers[HEAD:].view(np.int32)
    c = values.c[at:]
    gx = values.gx[at:]
    gy = values.gy[at:]
    w = values.w
    for i in range(BLOCK):
        gx[i], gy[i] = 0.0, 0.0
    for k in range(slots):
        slot = j * slots + k
        gather(values.c, places[(slot * INDICES + side.CELL) * BLOCK :], w)
        for q in range(edges.size):
            if edges[q] // BLOCK == 4 * j + k:
                w[edges[q] % BLOCK] = shown[q]
        geo = floats[slot * MEASURES * BLOCK :]
        for i in range(BLOCK):
            gx[i] += geo[_WX + i] * (w[i] - c[i])
            gy[i] += geo[_WY + i] * (w[i] - c[i])


@njit
def gather_flows(faces, factor, flow, out):
    """Write the outward flows through one side of each cell of a block to `out`.

    faces : for each cell the number f of the face, or ~f if the normal of the face points into the cell
    flow : flows through all faces along their normals; factor : factor on the flows
    """
    for i in range(BLOCK):
        f = faces[i]
        out[i] = factor * (flow[f] if f >= 0 else -flow[~f])


@njit
def put_allowed(c, least, most, allowed):
    """Write the greatest allowed difference between the value c of each cell of a block and the values at its sides.

    It is the distance from c to the nearer bound, or 0 if c is beyond a bound.
    least, most : bounds of c; allowed : the differences
    """
    for i in range(BLOCK):
        allowed[i] = max(min(c[i] - least, most - c[i]), 0.0)


@njit
def add_advection(count, c, d, cl, far, w):
    """Subtract the outflow by advection through one side of each cell of a block from the rates in the scratch w.

    Only the outflow of the difference between the value at the side and the cell value c is subtracted; `put_rates`
    subtracts that of c for all sides. The flows, the values beyond the side and sums over the sides are in w too.
    cl : values at the side inside the cells; count : factor on the outflow in the rate that limits the step
    """
    for i in range(BLOCK):
        q = far[_PER_AREA + i] * w[_FLOW + i]
        w[_RATE + i] -= q * ((cl[i] if q > 0.0 else w[_VALUE + i]) - c[i])
        w[_DIVERGENCE + i] += q
        w[_OUTFLOW + i] += count * max(q, 0.0) / max(d[i], THIN)


@njit
def add_diffusion(diffusivity, c, d, gx, gy, geo, far, w):
    """Add the inflow by diffusion through one side of each cell of a block to the rates in the scratch w.

    gx, gy : gradients of the cells; values, depths and gradients of the cells beyond the side are in w
    """
    for i in range(BLOCK):
        a, b = d[i], w[_DEPTH + i]
        k = diffusivity * geo[_REACH + i] * (2.0 * a * b / (a + b + TINY))
        oblique = far[_OBLIQUE_X + i] * (gx[i] + w[_GX + i]) + far[_OBLIQUE_Y + i] * (
            gy[i] + w[_GY + i]
        )
        w[_RATE + i] += k * (far[_PER_DISTANCE + i] * (w[i] - c[i]) + 0.5 * oblique)
        w[_OUTFLOW + i] += k * far[_PER_DISTANCE + i] / max(a, THIN)


@njit
def clear(w):
    """Set the rates, divergences and outflows of a block in the scratch w to zero."""
    for i in range(BLOCK):
        w[_RATE + i], w[_DIVERGENCE + i], w[_OUTFLOW + i] = 0.0, 0.0, 0.0


@njit
def put_rates(c, w, rate):
    """Write the rates of a block of cells to `rate` from the scratch w, and update the greatest outflow rate in w.

    The part c times the divergence of the flow, which `add_advection` leaves out, is subtracted here.
    """
    for i in range(BLOCK):
        w[_TOP + i] = max(w[_TOP + i], w[_OUTFLOW + i])
    for i in range(rate.size):
        rate[i] = w[_RATE + i] - c[i] * w[_DIVERGENCE + i]


def work_size(integers):
    """Length of the work array of `advection_rates`. integers : mesh, see `cell_sides`"""
    return 8 * integers[4] * BLOCK + 2 * integers[3] + ROWS * BLOCK


@njit
def mesh_values(integers, limited, work):
    """`MeshValues` in a work array; without `limited` the values at sides are those of the cells."""
    near, b = integers[4] * BLOCK, integers[3]
    c = work[:near]
    sides = work[4 * near : 8 * near]
    rest = work[8 * near :]
    at_sides = sides if limited else c
    return MeshValues(
        c,
        work[near : 2 * near],
        work[2 * near : 3 * near],
        work[3 * near : 4 * near],
        at_sides,
        rest[: 2 * b],
        rest[2 * b :],
    )


@njit
def put_sides(j, first, last, wide_by, diffuses, mesh, flows, depth, bounds, values):
    """Write the values at the sides of block j and, for diffusion, its gradients to the ring of `values`.

    first, last : its boundary sides are the entries first to last - 1 of the list of boundary sides
    """
    floats, integers = mesh
    f = integers[2]
    b = integers[3]
    ring = integers[4]
    _, edges, number, _ = side_numbers(integers)
    shown = values.beyond
    free = values.w[_FREE:]
    here = edges[first:last]
    for q in range(first, last):
        value, face = values.c[side.ring_place(edges[q], ring)], f - b + number[q]
        enters = flows.factor * flows.through[face] < 0.0
        shown[q] = flows.outside[number[q]] if enters else value
        shown[b + q] = 2.0 * shown[q] - value if depth.size == 0 else value
    if wide_by > 0.0:
        put_allowed(values.c[j % ring * BLOCK :], bounds[0], bounds[1], free)
        side.limited_sides(
            j,
            floats,
            integers,
            values.c,
            wide_by,
            free,
            shown[first:],
            here,
            values.w,
            values.at_sides,
        )
    if diffuses:
        put_gradients(j, mesh, here, shown[b + first :], values)


@njit
def put_block_rates(j, edge, limited, diffusivity, mesh, flows, values, rate):
    """Write the rates of block j of cells; return the number of boundary sides of the blocks up to j.

    edge : number of boundary sides of the blocks before j
    """
    floats, integers = mesh
    slots = integers[0]
    n = integers[1]
    f = integers[2]
    b = integers[3]
    ring = integers[4]
    _, edges, number, faces = side_numbers(integers)
    places, w = integers[HEAD:].view(np.int32), values.w
    distances = floats[MEASURES * side.blocks(integers) * slots * BLOCK + 2 * b + f :]
    first = j * BLOCK
    last = min((j + 1) * BLOCK, n)
    o = (j % ring) * BLOCK
    c = values.c
    d = values.d
    gx = values.gx
    gy = values.gy
    at_sides = values.at_sides
    clear(w)
    for k in range(slots):
        slot = j * slots + k
        where, geo = places[slot * INDICES * BLOCK :], floats[slot * MEASURES * BLOCK :]
        far, own = distances[slot * side.DISTANCES * BLOCK :], 4 * o + k * BLOCK if limited else o
        gather(at_sides, where[side.SIDE * BLOCK :] if limited else where, w[_VALUE:])
        gather_flows(faces[slot * BLOCK :], flows.factor, flows.through, w[_FLOW:])
        i, edge = edge, edges_before(edges, edge, (4 * j + k + 1) * BLOCK)
        for q in range(i, edge):
            w[_VALUE + edges[q] % BLOCK] = flows.outside[number[q]]
        add_advection(2.0 if limited else 1.0, c[o:], d[o:], at_sides[own:], far, w)
        if diffusivity > 0.0:
            gather(c, where, w)
            gather(d, where, w[_DEPTH:])
            gather(gx, where, w[_GX:])
            gather(gy, where, w[_GY:])
            for q in range(i, edge):
                w[edges[q] % BLOCK] = values.beyond[b + q]
            add_diffusion(diffusivity, c[o:], d[o:], gx[o:], gy[o:], geo, far, w)
    put_rates(c[o:], w, rate[first:last])
    return edge


@njit
def advection_rates(scheme, wide_by, diffusivity, mesh, flows, depth, bounds, s, work, rate):
    """Write the rates of the amounts `s` of a scalar; return the inverse of the Euler step that keeps bounds [1/s].

    The returned rate is the greatest fraction of a cell that leaves it per time, for `muscl` twice that, and more with
    diffusion.

    scheme : UPWIND or MUSCL; wide_by : factor on the range of the neighbours, above 0
    diffusivity : [m2/s], 0 without diffusion
    depth : float64[cells]  depths [m]; empty if s contains the values c themselves
    s, rate : float64[cells]  amounts per area, and their rates; work : float64[work_size(integers)]
    """
    integers = mesh[1]
    n, ring = integers[1], integers[4]
    limited, diffuses = scheme != UPWIND, diffusivity > 0.0
    wide_by = wide_by if limited else 0.0
    need, edges, _, _ = side_numbers(integers)
    values = mesh_values(integers, limited, work)
    c = values.c
    d = values.d
    w = values.w
    for i in range(BLOCK):
        w[_TOP + i] = 0.0
    cells_done, sides_done = 0, 0  # blocks with computed cells and sides
    wall, edge = 0, 0  # boundary sides done in both loops
    for j in range(need.size):
        while sides_done < need[j]:
            while cells_done < need[sides_done]:
                i = cells_done * BLOCK
                k = min((cells_done + 1) * BLOCK, n)
                o = (cells_done % ring) * BLOCK
                put_values(s[i:k], depth[i:k], c[o:], d[o:])
                cells_done += 1
            k, wall = wall, edges_before(edges, wall, 4 * (sides_done + 1) * BLOCK)
            put_sides(sides_done, k, wall, wide_by, diffuses, mesh, flows, depth, bounds, values)
            sides_done += 1
        edge = put_block_rates(j, edge, limited, diffusivity, mesh, flows, values, rate)
    max_rate = 0.0
    for i in range(BLOCK):
        max_rate = max(max_rate, w[_TOP + i])
    return max_rate
