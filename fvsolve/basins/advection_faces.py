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

c, d : values and depths of the cells of a block; w : scratch of a block, float64[ROWS BLOCK]; geo, far : first and last
group of measures of sides in `floats`, see `cell_sides`.
"""

import numpy as np

from fvsolve.basins.cell_sides import (
    BLOCK,
    CELL,
    DISTANCES,
    HEAD,
    INDICES,
    MEASURES,
    OBLIQUE_X,
    OBLIQUE_Y,
    PER_AREA,
    PER_DISTANCE,
    REACH,
    SIDE,
    TINY,
    WX,
    WY,
    blocks,
    edges_before,
    gather,
    limited_sides,
    ring_place,
)
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import UPWIND

THIN = 1e-6  # depth below which values fade to zero [m]

# Rows of BLOCK in the scratch of a block: four for `limited_sides`, also used for value, depth and gradients beyond;
# then value beyond the side, outward flow, rate, divergence, sum for the step.
_DEPTH, _GX, _GY, _VALUE, _FLOW, _RATE, _DIVERGENCE, _OUTFLOW, _TOP, _FREE = (k * BLOCK for k in range(1, 11))
_REACH, _WX, _WY, _PER_DISTANCE, _OBLIQUE_X, _OBLIQUE_Y = (
    REACH * BLOCK,
    WX * BLOCK,
    WY * BLOCK,
    PER_DISTANCE * BLOCK,
    OBLIQUE_X * BLOCK,
    OBLIQUE_Y * BLOCK,
)
ROWS = 11


@njit
def put_values(s, depth, c, d):
    """Write the values c = s / depth of a block of cells, with a depth of at least THIN, and their depths d.

    s : amounts of a scalar per area; if `depth` is empty, c = s and d = 1
    """
    if depth.size == 0:
        for i in range(s.size):
            c[i], d[i] = s[i], 1.0
    else:
        for i in range(s.size):
            c[i], d[i] = s[i] / max(depth[i], THIN), depth[i]


@njit
def put_gradients(j, floats, integers, values, shown, edges, w, gx, gy):
    """Write the least-squares gradients gx, gy of the values in block j of cells.

    floats, integers : mesh, see `cell_sides`
    values, gx, gy : float64[ring BLOCK], stored in the ring of blocks that `cell_sides` describes
    edges : numbers of the boundary sides of the block; shown : values beyond them; w : float64[BLOCK]  scratch
    """
    slots, at, places = integers[0], j % integers[4] * BLOCK, integers[HEAD:].view(np.int32)
    c, gx, gy = values[at:], gx[at:], gy[at:]
    for i in range(BLOCK):
        gx[i], gy[i] = 0.0, 0.0
    for k in range(slots):
        slot = j * slots + k
        gather(values, places[(slot * INDICES + CELL) * BLOCK :], w)
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
    c, d : values and depths of the cells; cl : values at the side inside the cells
    far : last group of measures of the side in `floats`, see `cell_sides`
    count : factor on the outflow in the rate that limits the step
    """
    for i in range(BLOCK):
        q = far[PER_AREA * BLOCK + i] * w[_FLOW + i]
        w[_RATE + i] -= q * ((cl[i] if q > 0.0 else w[_VALUE + i]) - c[i])
        w[_DIVERGENCE + i] += q
        w[_OUTFLOW + i] += count * max(q, 0.0) / max(d[i], THIN)


@njit
def add_diffusion(diffusivity, c, d, gx, gy, geo, far, w):
    """Add the inflow by diffusion through one side of each cell of a block to the rates in the scratch w.

    c, d, gx, gy : values, depths and gradients of the cells; those of the cells beyond the side are in w
    geo, far : first and last group of measures of the side in `floats`, see `cell_sides`
    diffusivity : [m2/s]
    """
    for i in range(BLOCK):
        a, b = d[i], w[_DEPTH + i]
        k = diffusivity * geo[_REACH + i] * (2.0 * a * b / (a + b + TINY))
        oblique = far[_OBLIQUE_X + i] * (gx[i] + w[_GX + i]) + far[_OBLIQUE_Y + i] * (gy[i] + w[_GY + i])
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

    The part c times the divergence of the flow, which `add_advection` leaves out, is subtracted here. c : cell values
    """
    for i in range(BLOCK):
        w[_TOP + i] = max(w[_TOP + i], w[_OUTFLOW + i])
    for i in range(rate.size):
        rate[i] = w[_RATE + i] - c[i] * w[_DIVERGENCE + i]


def work_size(integers):
    """Length of the work array of `advection_rates`. integers : mesh, see `cell_sides`"""
    return 8 * integers[4] * BLOCK + 2 * integers[3] + ROWS * BLOCK


@njit
def advection_rates(
    scheme, wide_by, diffusivity, factor, floats, integers, flow, depth, outside, least, most, s, work, rate
):
    """Write the rates of the amounts `s` of a scalar; return the inverse of the Euler step that keeps bounds [1/s].

    The returned rate is the greatest fraction of a cell that leaves it per time, for `muscl` twice that, and more with
    diffusion.

    scheme : UPWIND or MUSCL; wide_by : factor on the range of the neighbours that limits values at sides; with 1 they
    stay within that range
    diffusivity : [m2/s], 0 without diffusion; factor : factor on all flows
    floats, integers : mesh, see `cell_sides`; least, most : bounds of c, infinite for none
    flow : float64[faces]  flows through faces, from the left to the right cell: velocity [m/s] times length [m2/s], and
    also times the depth [m3/s] if `depth` is not empty
    depth : float64[cells]  depths [m]; empty if s contains the values c themselves
    outside : float64[boundary faces]  values of the inflow; s, rate : float64[cells]  amounts per area, and their rates
    work : float64[work_size(integers)]
    """
    slots, n, f, b, ring = integers[0], integers[1], integers[2], integers[3], integers[4]
    count, limited, diffuses = blocks(integers), scheme != UPWIND, diffusivity > 0.0
    m = count * slots * BLOCK
    at, to = HEAD + INDICES * m // 2, MEASURES * m + 2 * b + f
    need, edges, number = integers[at : at + count], integers[at + count :][:b], integers[at + count + b :][:b]
    faces, distances = integers[at + count + 2 * b :], floats[to:]
    places = integers[HEAD:].view(np.int32)
    near, wide = ring * BLOCK, 4 * ring * BLOCK
    c, d, gx, gy = work[:near], work[near : 2 * near], work[2 * near : 3 * near], work[3 * near : 4 * near]
    cs = work[4 * near : 4 * near + wide] if limited else c
    shown, w = work[4 * near + wide :][: 2 * b], work[4 * near + wide + 2 * b :]
    free = w[_FREE:]
    for i in range(BLOCK):
        w[_TOP + i] = 0.0
    twice = 2.0 if limited else 1.0
    cells_done, sides_done, wall, edge = (
        0,
        0,
        0,
        0,
    )  # blocks with computed cells and sides; boundary sides done in both loops
    for j in range(count):
        while sides_done < need[j]:
            while cells_done < need[sides_done]:
                i, k, o = cells_done * BLOCK, min((cells_done + 1) * BLOCK, n), (cells_done % ring) * BLOCK
                put_values(s[i:k], depth[i:k], c[o:], d[o:])
                cells_done += 1
            k, wall = wall, edges_before(edges, wall, 4 * (sides_done + 1) * BLOCK)
            here, bounds, ends = edges[k:wall], shown[k:], shown[b + k :]
            for q in range(k, wall):
                value, face = c[ring_place(edges[q], ring)], f - b + number[q]
                enters = factor * flow[face] < 0.0
                shown[q] = outside[number[q]] if enters else value
                shown[b + q] = 2.0 * shown[q] - value if depth.size == 0 else value
            if limited:
                put_allowed(c[sides_done % ring * BLOCK :], least, most, free)
                limited_sides(sides_done, floats, integers, c, wide_by, free, bounds, here, w, cs)
            if diffuses:
                put_gradients(sides_done, floats, integers, c, ends, here, w, gx, gy)
            sides_done += 1
        clear(w)
        first, last, o = j * BLOCK, min((j + 1) * BLOCK, n), (j % ring) * BLOCK
        for k in range(slots):
            slot = j * slots + k
            where, geo = places[slot * INDICES * BLOCK :], floats[slot * MEASURES * BLOCK :]
            far, own = distances[slot * DISTANCES * BLOCK :], 4 * o + k * BLOCK if limited else o
            gather(cs, where[SIDE * BLOCK :] if limited else where, w[_VALUE:])
            gather_flows(faces[slot * BLOCK :], factor, flow, w[_FLOW:])
            i, edge = edge, edges_before(edges, edge, (4 * j + k + 1) * BLOCK)
            for q in range(i, edge):
                w[_VALUE + edges[q] % BLOCK] = outside[number[q]]
            add_advection(twice, c[o:], d[o:], cs[own:], far, w)
            if diffuses:
                gather(c, where, w)
                gather(d, where, w[_DEPTH:])
                gather(gx, where, w[_GX:])
                gather(gy, where, w[_GY:])
                for q in range(i, edge):
                    w[edges[q] % BLOCK] = shown[b + q]
                add_diffusion(diffusivity, c[o:], d[o:], gx[o:], gy[o:], geo, far, w)
        put_rates(c[o:], w, rate[first:last])
    max_rate = 0.0
    for i in range(BLOCK):
        max_rate = max(max_rate, w[_TOP + i])
    return max_rate
