"""Shallow water on a grid of rectangles: rates of depth and flow. Knows rows of cells; knows no patch and no network.

h_t + (q_x)_x + (q_y)_y = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed). Depth h, surface e = h + bed and
velocities are reconstructed; both sides of a face see its higher bed (hydrostatic reconstruction, Audusse et al. 2004).
The pressure of a cell on its faces and the push of its bed are one term, g h (rise of e), so a lake at rest stays at
rest to the bit, with dry islands too. Flux of Harten, Lax and van Leer with the contact (HLLC, Toro 2001): what moves
along a face goes with the mass. The speeds that bound its waves are those of the cells on either side, between which
limited values lie, so that no depth falls below zero.

Fifth order (`LINEAR`, `WENO5`) reconstructs unit flows in place of velocities, wherever the shallowest of five cells
has half the depth of the deepest, and limited values elsewhere. It is of that order along one direction and on even
cells; in the plane of second order, since a flux of mean values is not the mean flux.
"""

from fvsolve.basins.free_surface.rows import (
    AFTER,
    ALONG,
    EAST,
    FIELDS,
    FLOW_EAST,
    FLUXES,
    GHOSTS,
    HIGH,
    MOST,
    NORTH,
    PUSH,
    SIDES,
    STRIDE,
    drive_beyond,
    drive_end,
    put_beyond,
    put_cells,
    put_end,
    put_flows,
    put_fluxes,
    put_limited,
    put_rates,
)
from fvsolve.basins.free_surface.smooth import put_smooth
from fvsolve.basins.patches import put_inward
from fvsolve.basins.stretch import fill
from fvsolve.jit import njit
from fvsolve.kernels.records import LINEAR, WENO5

__all__ = ["PLANS", "WORK", "grid_rates"]

PLANS = 2  # rows of `plan`: depth and surface of the profile
RING = 8  # rows of cells at hand
REACH = 3  # rows beside a cell that its rates look at, at most
BLOCK, SIDE, FLUX = FIELDS * STRIDE, SIDES * STRIDE, FLUXES * STRIDE
WORK = RING * BLOCK + 3 * SIDE + 3 * FLUX + 2 * STRIDE  # floats that `grid_rates` works in
MOVING = WORK + 3 * STRIDE


@njit
def copy(source, target):
    """target = source[: target.size]."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def place(j, i):
    """Where cell i of row j is in the ring."""
    return (j & (RING - 1)) * BLOCK + GHOSTS + i


@njit
def factors_of(j, left, right, moves, room):
    """(wide, narrow) of columns of row j, see `basins.stretch`."""
    wide, narrow = moves[3], moves[4]
    if moves[0].size > 0:
        return wide[left:right], narrow[left:right]
    one, other = room[: right - left], room[STRIDE : STRIDE + right - left]
    fill(wide[j], one)
    fill(narrow[j], other)
    return one, other


@njit
def put_row(g, j, fifth, nx, ny, first, last, kx, ky, reflect, plan, dh, qx, qy, work, top, moves):
    """Columns `first` to `last` of row j of cells and their ghosts; also one beyond the grid, from those before it."""
    ring = work[: RING * BLOCK]
    fields, left, right = FIELDS if fifth else FLOW_EAST // STRIDE, max(first - GHOSTS, 0), min(last + GHOSTS, nx)
    cells, walls = ring[place(j, left - first) :], reflect.size > 0
    if 0 <= j < ny:
        a, b = j * nx + left, j * nx + right
        h, x, y, highest = dh[a:b], qx[a:b], qy[a:b], top[GHOSTS + left - first :]
        if moves is None:
            put_cells(g, plan[0, a:b], plan[1, a:b], h, x, y, kx[left:right], ky[j], None, cells, highest)
            if fifth:
                put_flows(x, y, None, cells)
        else:
            factors = factors_of(j, left, right, moves, work[WORK + STRIDE :])
            put_cells(g, plan[0, a:b], plan[1, a:b], h, x, y, kx[left:right], ky[j], factors, cells, highest)
            if fifth:
                put_flows(x, y, factors, cells)
        block = ring[place(j, -GHOSTS) :]
        if left == 0:
            put_end(fields, 3 if fifth else 2, reflect[j] if walls else 1.0, block, GHOSTS, -1, nx)
            if moves is not None and moves[0].size > 0:
                drive_end(fields, 3 if fifth else 2, moves[0][0], block, GHOSTS, -1)
        if right == nx:
            put_end(fields, 3 if fifth else 2, reflect[ny + j] if walls else 1.0, block, GHOSTS + nx - 1 - first, 1, nx)
            if moves is not None and moves[0].size > 0:
                drive_end(fields, 3 if fifth else 2, moves[0][nx], block, GHOSTS + nx - 1 - first, 1)
        return
    edge = 0 if j < 0 else ny - 1
    mirror = min(-1 - j, ny - 1) if j < 0 else max(2 * ny - 1 - j, 0)
    at = 2 * ny + first if j < 0 else 2 * ny + nx + first
    put_beyond(
        last - first, fields, reflect[at : at + last - first] if walls else reflect,
        ring[place(edge, 0) :], ring[place(mirror, 0) :], ring[place(j, 0) :],
    )  # fmt: skip
    if moves is not None and moves[1].size > 0:
        drive_beyond(last - first, fields, moves[1][0 if j < 0 else ny], ring[place(j, 0) :])


@njit
def push_walls(g, speed, rest, side, f, thrust):
    """Let nothing pass a row of faces of the boundary that moves; thrust less that of the depth at rest there."""
    for i in range(thrust.size):
        if speed != 0.0:
            f[i], f[i + ALONG] = 0.0, 0.0
        thrust[i] = f[i + AFTER] + 0.5 * g * ((side[i] - rest[i]) * (side[i] + rest[i]))


@njit
def grid_rates(
    g, scheme, limiter, nx, ny, begin, stop, kx, ky, reflect, plan, dh, qx, qy, flow_x, flow_y, through, work, rate_h,
    rate_x, rate_y, moves,
):  # fmt: skip
    """Rates of the cells of rows `begin` to `stop`; returns the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    Rows are those of the whole grid, whose neighbours as far as the scheme reaches are looked at too.
    scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5
    kx float64[nx], ky float64[ny] : 1 / widths of columns and rows [1/m]
    reflect : float64[2 (nx + ny)], 1 a wall and 0 open, west, east, south, north; or empty, walls all around
    plan : float64[PLANS, n], depth of the profile at rest and its surface less the level [m]
    dh, qx, qy : float64[n] depth less the profile's [m], unit flows [m2/s]; where lines move what cells contain of both
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx] flows of depth through faces [m2/s], or empty
    through : float64[2 (nx + ny)]  flows inward through faces of the boundary [m3/s], in the order of reflect, or empty
    work : float64[WORK], fastest where it begins at a cache line; float64[MOVING] where lines move
    moves : None, or speeds of lines along x and along y [m/s], float64[nx + 9] and float64[ny + 9], empty where they
    stand still, what they find: thrust on faces of the boundary less that at rest, over density [m2/s2],
    float64[2 (nx + ny)]; and of columns or rows that stretch `wide` and `narrow`, see `basins.stretch`
    """
    most = 0.0
    for first in range(0, nx, MOST):
        last = min(first + MOST, nx)
        rate = column_rates(
            g, scheme, limiter, nx, ny, begin, stop, True, first, last, kx, ky, reflect, plan, dh, qx, qy, flow_x,
            flow_y, through, work, rate_h, rate_x, rate_y, moves,
        )  # fmt: skip
        most = max(most, rate)
    return most


@njit
def column_rates(
    g, scheme, limiter, nx, ny, begin, stop, fresh, first, last, kx, ky, reflect, plan, dh, qx, qy, flow_x, flow_y,
    through, work, rate_h, rate_x, rate_y, moves,
):  # fmt: skip
    """The same of columns `first` to `last`, no more than MOST of them, row by row.

    fresh : whether it does not go on where it has ended last, at `begin`
    """
    n, fifth = last - first, scheme == LINEAR or scheme == WENO5
    ring, at = work[: RING * BLOCK], RING * BLOCK
    sides, at = work[at : at + 3 * SIDE], at + 3 * SIDE
    fluxes, deep, top = work[at : at + 3 * FLUX], work[at + 3 * FLUX :], work[at + 3 * FLUX + STRIDE :]
    ends, along = sides[2 * SIDE :], fluxes[2 * FLUX :]  # of a row, from one cell before it on
    reach = 3 if fifth else 2
    ahead = begin + reach
    if fresh:
        for i in range(STRIDE):
            top[i] = 0.0
        ahead = min(ahead, ny)
        for j in range(max(begin - reach, 0), ahead):
            put_row(g, j, fifth, nx, ny, first, last, kx, ky, reflect, plan, dh, qx, qy, work, top, moves)
        for j in range(-1, begin - 1 - reach, -1):
            put_row(g, j, fifth, nx, ny, first, last, kx, ky, reflect, plan, dh, qx, qy, work, top, moves)
    for j in range(begin - 1 if fresh else begin + 1, stop + 1):
        while ahead < j + reach:
            put_row(g, ahead, fifth, nx, ny, first, last, kx, ky, reflect, plan, dh, qx, qy, work, top, moves)
            ahead += 1
        # values of row j at its southern and northern faces
        now, was = j & 1, (j - 1) & 1
        here, before = ring[place(j, 0) :], ring[place(j - 1, 0) :]
        low = sides[now * SIDE :]
        put_limited(scheme, limiter, n, before, here, ring[place(j + 1, 0) :], low)
        if fifth:
            put_smooth(
                g, scheme, ring[place(j - 2, 0) :], before, here, ring[place(j + 1, 0) :], ring[place(j + 2, 0) :],
                low, deep[:n],
            )  # fmt: skip
        if j < begin:
            continue
        # faces between rows j - 1 and j
        south, north, under = fluxes[was * FLUX :], fluxes[now * FLUX :], sides[was * SIDE + HIGH :]
        l, r = (under, low) if fifth else (before, here)  # where speeds are looked at
        if moves is None or moves[1].size == 0:
            put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, None)
        else:
            even = work[WORK : WORK + STRIDE]
            for i in range(n):
                even[i] = moves[1][j]
            put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, even)
            if j == 0 or j == ny:
                at = 2 * ny + first + (nx if j > 0 else 0)
                rest = plan[0, (0 if j == 0 else (ny - 1) * nx) + first :]
                push_walls(g, moves[1][j], rest, low if j == 0 else under, north, moves[2][at : at + n])
        if flow_y.size > 0:
            copy(north, flow_y[j * nx + first : j * nx + last])
        if through.size > 0 and (j == 0 or j == ny):
            at = 2 * ny + first + (nx if j > 0 else 0)
            put_inward(-1.0 if j > 0 else 1.0, kx[first:last], north, through[at : at + n])
        if j == begin:
            continue
        # row j - 1 : faces along it, and its rates
        whole = (n + 9) // 8 * 8  # more than is looked at, so that nothing is left over of a vector
        cell = ring[place(j - 1, -1) :]
        put_limited(scheme, limiter, whole, ring[place(j - 1, -2) :], cell, before, ends)
        if fifth:
            put_smooth(
                g, scheme, ring[place(j - 1, -3) :], ring[place(j - 1, -2) :], cell, before, ring[place(j - 1, 1) :],
                ends, deep[:whole],
            )  # fmt: skip
        left, right = ends[HIGH:], ends[1:]
        l, r = (left, right) if fifth else (cell, before)
        if moves is None or moves[0].size == 0:
            put_fluxes(g, (n + 8) // 8 * 8, EAST, NORTH, left, right, l, r, along, None)
        else:
            put_fluxes(g, (n + 8) // 8 * 8, EAST, NORTH, left, right, l, r, along, moves[0][first:])
            rest = plan[0, (j - 1) * nx :]
            if first == 0:
                push_walls(g, moves[0][0], rest, right, along, moves[2][j - 1 : j])
            if last == nx:
                push_walls(g, moves[0][nx], rest[nx - 1 :], left[n:], along[n:], moves[2][ny + j - 1 : ny + j])
        if flow_x.size > 0:
            at = (j - 1) * (nx + 1)
            copy(along, flow_x[at + first : at + last + 1])
        if through.size > 0 and first == 0:
            through[j - 1] = along[0] / ky[j - 1]
        if through.size > 0 and last == nx:
            through[ny + j - 1] = -along[n] / ky[j - 1]
        a, z = (j - 1) * nx + first, (j - 1) * nx + last
        one, other = kx[first:last], ky[j - 1]
        push_x, push_y = ends[PUSH + 1 :], sides[was * SIDE + PUSH :]
        to_h, to_x, to_y = rate_h[a:z], rate_x[a:z], rate_y[a:z]
        if moves is None:
            put_rates(g, one, other, push_x, push_y, along, south, north, None, to_h, to_x, to_y)
        else:
            wide, _ = factors_of(j - 1, first, last, moves, work[WORK + STRIDE :])
            put_rates(g, one, other, push_x, push_y, along, south, north, wide, to_h, to_x, to_y)
    most = 0.0
    for i in range(STRIDE):
        most = max(most, top[i])
    return most
