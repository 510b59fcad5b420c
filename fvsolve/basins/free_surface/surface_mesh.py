"""Shallow water on a mesh of any cells: rates of depth and flow.

The scheme is the same as on a grid (`surface_grid`), but with least-squares gradients and a common limiter for all
sides of a cell. Pressures at sides are relative to the pressure in the cell, and the force of the bed to the surface
of the cell. So every term is zero where the surface is level: a lake at rest stays at rest, with dry islands too.
"""

from math import sqrt

import numpy as np

from fvsolve.basins.cell_sides import (
    BLOCK,
    HEAD,
    HUGE,
    INDICES,
    MEASURES,
    NX,
    NY,
    REACH,
    SIDE,
    TINY,
    blocks,
    edges_before,
    gather,
    limited_sides,
    put_inward,
    ring_place,
)
from fvsolve.basins.cell_stretching import stretch_rates
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import UPWIND

DEPTH, SURFACE, PLANS = 0, 1, 2  # rows of plan: depth of the profile, its surface above the level
THIN = 1e-6  # depth below which velocities fade to zero [m]

# Rows of BLOCK in the scratch of `add_side_fluxes`: values beyond, rates, sums for the step, flow through the side.
_E, _U, _V, _C, _RH, _RX, _RY, _FAST, _OUTFLOW, _MASS = (k * BLOCK for k in range(1, 11))
_NX, _NY, _REACH = NX * BLOCK, NY * BLOCK, REACH * BLOCK
_PUSH = 13 * BLOCK  # of moving sides: thrust minus that of the cell's own depth
ROWS = 14


@njit
def put_primitives(g, depth0, surface0, dh, qx, qy, h, e, u, v, c):
    """Write depth h, surface e, velocities u, v and wave speed c of cells.

    g : gravity [m/s2]; depth0, surface0 : depth and surface at rest [m]
    dh, qx, qy : deviation of depth from rest [m], unit flows [m2/s]
    """
    for i in range(dh.size):
        depth = max(depth0[i] + dh[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet)
        h[i], e[i], c[i] = depth, surface0[i] + dh[i], sqrt(g * depth)
        u[i], v[i] = qx[i] * part, qy[i] * part


@njit
def put_mirror_velocities(edges, ring, nx, ny, number, reflect, u, v, shown_u, shown_v, moves):
    """Write mirrored velocities beyond boundary sides, from which gradients in cells are computed.

    At a wall that moves outward at the speed w, the normal velocity u becomes 2 w - u.
    edges, number : boundary sides, and numbers of their boundary faces; ring : see `cell_sides`
    nx, ny : outward normals; reflect : 1 for walls, 0 for open faces, empty for walls only
    u, v : velocities of cells; shown_u, shown_v : velocities beyond; moves : as in `shallow_rates`
    """
    for q in range(edges.size):
        i = ring_place(edges[q], ring)
        r = reflect[number[q]] if reflect.size > 0 else 1.0
        across = u[i] * nx[q] + v[i] * ny[q]
        if moves is not None:
            across -= moves[0][edges[q]]
        change = 2.0 * r * across
        shown_u[q], shown_v[q] = u[i] - change * nx[q], v[i] - change * ny[q]


@njit
def put_mirror_sides(edges, nx, ny, number, reflect, ul, vl, w, moves):
    """Write mirrored velocities beyond boundary sides to `w`, from the velocities ul, vl at the sides inside.

    w : scratch, see `add_side_fluxes`; other arguments as for `put_mirror_velocities`
    """
    for q in range(edges.size):
        i = edges[q] % BLOCK
        r = reflect[number[q]] if reflect.size > 0 else 1.0
        across = ul[i] * nx[q] + vl[i] * ny[q]
        if moves is not None:
            across -= moves[0][edges[q]]
        change = 2.0 * r * across
        w[_U + i], w[_V + i] = ul[i] - change * nx[q], vl[i] - change * ny[q]


@njit
def add_side_fluxes(g, h0, e0, c0, hl, el, ul, vl, geo, w, speeds):
    """Subtract the outflow through one side of each cell of a block (HLLC flux) from the rates in `w`.

    The flow through the side and the sums for the limit of the time step are written to `w` too.
    g : gravity [m/s2]; h0, e0, c0 : depth, surface and wave speed of the cells
    hl, el, ul, vl : depth, surface and velocities at the side from inside; `w` contains the values from beyond
    geo : measures of the side, see `cell_sides`
    speeds : None, or speeds of moving sides along their outward normals [m/s]; the flux is then relative to the side
    """
    half = 0.5 * g
    for i in range(BLOCK):
        nx, ny, reach = geo[_NX + i], geo[_NY + i], geo[_REACH + i]
        bed = max(el[i] - hl[i], w[_E + i] - w[i])
        a, b, c = max(0.0, el[i] - bed), max(0.0, w[_E + i] - bed), max(c0[i], w[_C + i])
        na, nb = ul[i] * nx + vl[i] * ny, w[_U + i] * nx + w[_V + i] * ny
        ta, tb = vl[i] * nx - ul[i] * ny, w[_V + i] * nx - w[_U + i] * ny
        if speeds is not None:
            na, nb = na - speeds[i], nb - speeds[i]
        low, high = min(min(na, nb) - c, 0.0), max(max(na, nb) + c, 0.0)
        per_width = 1.0 / (high - low + TINY)
        qa, qb = a * na, b * nb
        mass = per_width * (high * qa - low * qb + high * low * (b - a))
        flow = per_width * (high * (qa * na) - low * (qb * nb + half * (b - a) * (b + a)) + high * low * (qb - qa))
        flow += half * (hl[i] + h0[i]) * (el[i] - e0[i])
        if speeds is not None:
            flow += speeds[i] * mass
            w[_PUSH + i] = flow
        along = mass * (ta if mass > 0.0 else tb)
        w[_RH + i] -= reach * mass
        w[_RX + i] -= reach * (flow * nx - along * ny)
        w[_RY + i] -= reach * (flow * ny + along * nx)
        w[_FAST + i] += reach * max(high, -low)
        w[_OUTFLOW + i] += reach * (high * (na - low) * per_width)
        w[_MASS + i] = mass


@njit
def close_walls(g, edges, number, reflect, rest, h0, geo, w, thrust):
    """Set the mass flow through walls to zero; write the thrust on boundary sides minus that of the depth at rest.

    rest : depths at rest; thrust : of all boundary faces, as in `shallow_rates`
    g, h0, geo, w : as for `add_side_fluxes`; edges, number, reflect : as for `put_mirror_velocities`
    """
    for q in range(edges.size):
        i = edges[q] % BLOCK
        thrust[number[q]] = w[_PUSH + i] + 0.5 * g * ((h0[i] - rest[i]) * (h0[i] + rest[i]))
        if reflect.size == 0 or reflect[number[q]] == 1.0:
            w[_RH + i] += geo[_REACH + i] * w[_MASS + i]
            w[_MASS + i] = 0.0


@njit
def clear(w):
    """Set the rates of a block of cells in its scratch w, and their sums for the limit of the time step, to zero."""
    for i in range(BLOCK):
        w[_RH + i], w[_RX + i], w[_RY + i], w[_FAST + i], w[_OUTFLOW + i] = 0.0, 0.0, 0.0, 0.0, 0.0


@njit
def put_shores(h, shore):
    """Write the allowed difference of the surface between a cell and its sides: 0 for dry cells, else HUGE.

    h : depths of a block of cells; shore : the allowed differences
    """
    for i in range(BLOCK):
        shore[i] = HUGE if h[i] > 0.0 else 0.0


@njit
def put_max_rate(w, top):
    """Raise each entry of `top`, one for each place in a block, to the rate of the cell there that limits the step.

    This rate [1/s] is the greatest of the two values that `shallow_rates` describes.
    """
    for i in range(BLOCK):
        top[i] = max(top[i], max(0.5 * w[_FAST + i], w[_OUTFLOW + i]))


@njit
def put_rates(w, rate_h, rate_x, rate_y):
    """Copy the rates of a block of cells from the scratch `w` to rate_h, rate_x, rate_y."""
    for i in range(rate_h.size):
        rate_h[i], rate_x[i], rate_y[i] = w[_RH + i], w[_RX + i], w[_RY + i]


@njit
def put_flow(where, w, length, flow):
    """Write the flows [m3/s] through one side of each cell of a block to `flow`, by the numbers of faces.

    Sides at which the normal of the face points into the cell are left out. where : face of each side, negative there
    w : scratch with the flows per length; length : lengths of all faces [m]
    """
    for i in range(BLOCK):
        if where[i] >= 0:
            flow[where[i]] = w[_MASS + i] * length[where[i]]


@njit
def work_size(integers):
    """Length of the work array of `shallow_rates`. integers : mesh, see `cell_sides`"""
    return 21 * integers[4] * BLOCK + 2 * integers[3] + ROWS * BLOCK


@njit
def shallow_rates(
    g, scheme, wide_by, floats, integers, reflect, plan, dh, qx, qy, flow, through, work, rate_h, rate_x, rate_y,
    moves,
):  # fmt: skip
    """Write the rates of all cells of a mesh; return the greatest rate that limits the time step [1/s].

    It is the greatest of two values over all cells: the sum of L (|u| + c) / (2 A) over the sides of the cell, and the
    outflow from the cell over its volume. L is the length of a side and A the area of the cell. The normal velocity u,
    relative to a moving side, and the wave speed c are the greatest of both cells at a side. Explicit Euler steps up to
    1 / (2 rate) leave no depth below zero.
    g : gravity normal to the basin [m/s2]; scheme : UPWIND or MUSCL
    wide_by : factor on the range of the neighbours that limits values at sides; with 1 they stay within that range
    floats, integers : geometry and neighbours, see `basins.cell_sides`; n cells, f faces, b boundary faces
    reflect : float64[b]  1 for walls, 0 for open faces, empty if all are walls
    plan : float64[PLANS, n]  depth at rest and surface at rest above the level [m]
    dh, qx, qy : float64[n]  deviation of depth from rest [m], unit flows [m2/s]
    flow : float64[f]  volume flows through faces, left to right [m3/s], or empty; work : float64[work_size(integers)]
    through : float64[b]  inward volume flows through the boundary [m3/s], or empty
    rate_h, rate_x, rate_y : float64[n]  rates of dh, qx, qy
    moves : None without moving walls, else a tuple of
        speeds of sides along their outward normals [m/s], see `moving_meshes`
        float64[b]  thrust on boundary faces minus that at rest, over density and length [m3/s2]
        `wide` : areas of cells over undeformed areas, see `basins.cell_stretching`
    """
    slots, n, f, b, ring = integers[0], integers[1], integers[2], integers[3], integers[4]
    count, first_order = blocks(integers), scheme == UPWIND
    m = count * slots * BLOCK
    at, to = HEAD + INDICES * m // 2, MEASURES * m
    need, edges, number = integers[at : at + count], integers[at + count :][:b], integers[at + count + b :][:b]
    faces = integers[at + count + 2 * b :]
    bx, by, lengths = floats[to : to + b], floats[to + b : to + 2 * b], floats[to + 2 * b :][:f]
    places = integers[HEAD:].view(np.int32)
    near, wide = ring * BLOCK, 4 * ring * BLOCK
    h, e, u, v = work[:near], work[near : 2 * near], work[2 * near : 3 * near], work[3 * near : 4 * near]
    c, rest = work[4 * near : 5 * near], work[5 * near :]
    hs, es, us, vs = rest[:wide], rest[wide : 2 * wide], rest[2 * wide : 3 * wide], rest[3 * wide : 4 * wide]
    if first_order:
        hs, es, us, vs = h, e, u, v
    shown, w = rest[4 * wide : 4 * wide + 2 * b], rest[4 * wide + 2 * b :]
    top, shore = w[11 * BLOCK :], w[12 * BLOCK :]
    for i in range(BLOCK):
        top[i] = 0.0
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
                put_primitives(g, plan[DEPTH, i:k], plan[SURFACE, i:k], dh[i:k], qx[i:k], qy[i:k],
                               h[o:], e[o:], u[o:], v[o:], c[o:])  # fmt: skip
                cells_done += 1
            if not first_order:
                k, wall = wall, edges_before(edges, wall, 4 * (sides_done + 1) * BLOCK)
                here, su, sv = edges[k:wall], shown[k:wall], shown[b + k : b + wall]
                put_mirror_velocities(here, ring, bx[k:wall], by[k:wall], number[k:wall], reflect, u, v, su, sv, moves)
                o = (sides_done % ring) * BLOCK
                limited_sides(
                    sides_done, floats, integers, h, wide_by, h[o:], su, edges[:0], w, hs
                )  # limits: zero to twice the depth
                put_shores(h[o:], shore)
                limited_sides(sides_done, floats, integers, e, wide_by, shore, su, edges[:0], w, es)
                # Velocities differ by no more than the wave speed: next to a thin fast cell, a linear field would
                # reverse the flow.
                limited_sides(sides_done, floats, integers, u, wide_by, c[o:], su, here, w, us)
                limited_sides(sides_done, floats, integers, v, wide_by, c[o:], sv, here, w, vs)
            sides_done += 1
        clear(w)
        first, last, o = j * BLOCK, min((j + 1) * BLOCK, n), (j % ring) * BLOCK
        for k in range(slots):
            slot = j * slots + k
            where, geo = places[slot * INDICES * BLOCK :], floats[slot * MEASURES * BLOCK :]
            beyond, own = (where, o) if first_order else (where[SIDE * BLOCK :], 4 * o + k * BLOCK)
            gather(hs, beyond, w)
            gather(es, beyond, w[_E:])
            gather(us, beyond, w[_U:])
            gather(vs, beyond, w[_V:])
            gather(c, where, w[_C:])
            i, edge = edge, edges_before(edges, edge, (4 * j + k + 1) * BLOCK)
            put_mirror_sides(
                edges[i:edge], bx[i:edge], by[i:edge], number[i:edge], reflect, us[own:], vs[own:], w, moves
            )
            if moves is None:
                add_side_fluxes(g, h[o:], e[o:], c[o:], hs[own:], es[own:], us[own:], vs[own:], geo, w, None)
            else:
                speeds = moves[0][(4 * j + k) * BLOCK :]
                add_side_fluxes(g, h[o:], e[o:], c[o:], hs[own:], es[own:], us[own:], vs[own:], geo, w, speeds)
                close_walls(g, edges[i:edge], number[i:edge], reflect, plan[DEPTH, first:last], h[o:], geo, w, moves[1])
            if flow.size > 0:
                put_flow(faces[slot * BLOCK :], w, lengths, flow)
            if through.size > 0:
                put_inward(edges[i:edge], number[i:edge], w[_MASS:], lengths[f - b :], through)
        put_max_rate(w, top)
        put_rates(w, rate_h[first:last], rate_x[first:last], rate_y[first:last])
        if moves is not None:
            stretch_rates(moves[2][first:last], rate_h[first:last], rate_x[first:last], rate_y[first:last])
    most = 0.0
    for i in range(BLOCK):
        most = max(most, top[i])
    return most
