"""Shallow water on a grid of rectangles: rates of depth and flow.

h_t + (q_x)_x + (q_y)_y = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed). Depth h, surface e = h + bed and
velocities are reconstructed; both sides of a face use the higher bed (hydrostatic reconstruction, Audusse et al. 2004).
The pressure of a cell on its faces and the force of its bed are combined in g h (rise of e). So a lake at rest stays at
rest to the bit, with dry islands too. The flux is the HLLC flux (Harten, Lax and van Leer, with contact wave, Toro
2001): tangential momentum is carried with the mass. The bounds of wave speeds are those of the cells on either side,
which bound limited values too, so that no depth falls below zero.

Fifth order (`LINEAR`, `WENO5`) reconstructs unit flows instead of velocities where the shallowest of five cells has
half the depth of the deepest, and uses limited values elsewhere. It has that order along one direction on uniform
cells; in two dimensions it is of second order, because the flux of mean values is not the mean flux.
"""

from fvsolve.basins.basin_patches import put_inward
from fvsolve.basins.cell_stretching import fill
from fvsolve.basins.free_surface.surface_fifth_order import put_smooth
from fvsolve.basins.free_surface.surface_rows import (
    AFTER,
    ALONG,
    EAST,
    FIELDS,
    FLOW_EAST,
    FLUXES,
    GHOSTS,
    HIGH,
    MAX_COLUMNS,
    NORTH,
    PUSH,
    SIDES,
    STRIDE,
    correct_ghost_end,
    correct_ghost_row,
    put_cells,
    put_flows,
    put_fluxes,
    put_ghost_end,
    put_ghost_row,
    put_limited,
    put_rates,
)
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LINEAR, WENO5

__all__ = ["PLANS", "WORK", "grid_rates"]

PLANS = 2  # rows of `plan`: depth and surface of the profile
RING = 8  # stored rows of cells
REACH = 3  # greatest stencil radius of the rates, in rows
BLOCK, SIDE, FLUX = FIELDS * STRIDE, SIDES * STRIDE, FLUXES * STRIDE
WORK = RING * BLOCK + 3 * SIDE + 3 * FLUX + 2 * STRIDE  # length of the work array of `grid_rates`
MOVING = WORK + 3 * STRIDE


@njit
def copy(source, target):
    """Copy the first target.size values of `source` to `target`."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def ring_offset(j, i):
    """Offset of cell i of row j in the ring buffer of rows."""
    return (j & (RING - 1)) * BLOCK + GHOSTS + i


@njit
def factors_of(j, left, right, moves, scratch):
    """(area over undeformed area, its reciprocal) of columns `left` to `right` - 1 of row j: two arrays.

    moves : as in `grid_rates`; scratch : work array
    """
    wide, narrow = moves[3], moves[4]
    if moves[0].size > 0:
        return wide[left:right], narrow[left:right]
    row_wide, row_narrow = scratch[: right - left], scratch[STRIDE : STRIDE + right - left]
    fill(wide[j], row_wide)
    fill(narrow[j], row_narrow)
    return row_wide, row_narrow


@njit
def put_row(g, j, fifth, nx, ny, first, last, kx, ky, reflect, plan, dh, qx, qy, work, top, moves):
    """Write columns `first` to `last` - 1 of row j of cells, with ghost cells, to the ring buffer in `work`.

    A row beyond the grid is computed from the rows inside, which must be in the buffer. fifth : True for fifth order
    top : greatest rate of each column so far [1/s], updated here; other arguments as in `grid_rates`
    """
    ring = work[: RING * BLOCK]
    fields, left, right = FIELDS if fifth else FLOW_EAST // STRIDE, max(first - GHOSTS, 0), min(last + GHOSTS, nx)
    cells, walls = ring[ring_offset(j, left - first) :], reflect.size > 0
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
        block = ring[ring_offset(j, -GHOSTS) :]
        if left == 0:
            put_ghost_end(fields, 3 if fifth else 2, reflect[j] if walls else 1.0, block, GHOSTS, -1, nx)
            if moves is not None and moves[0].size > 0:
                correct_ghost_end(fields, 3 if fifth else 2, moves[0][0], block, GHOSTS, -1)
        if right == nx:
            put_ghost_end(
                fields, 3 if fifth else 2, reflect[ny + j] if walls else 1.0, block, GHOSTS + nx - 1 - first, 1, nx
            )
            if moves is not None and moves[0].size > 0:
                correct_ghost_end(fields, 3 if fifth else 2, moves[0][nx], block, GHOSTS + nx - 1 - first, 1)
        return
    edge = 0 if j < 0 else ny - 1
    mirror = min(-1 - j, ny - 1) if j < 0 else max(2 * ny - 1 - j, 0)
    at = 2 * ny + first if j < 0 else 2 * ny + nx + first
    put_ghost_row(
        last - first, fields, reflect[at : at + last - first] if walls else reflect,
        ring[ring_offset(edge, 0) :], ring[ring_offset(mirror, 0) :], ring[ring_offset(j, 0) :],
    )  # fmt: skip
    if moves is not None and moves[1].size > 0:
        correct_ghost_row(last - first, fields, moves[1][0 if j < 0 else ny], ring[ring_offset(j, 0) :])


@njit
def close_walls(g, speed, rest, side, f, thrust):
    """Set the mass flow through a row of boundary faces of a moving wall to zero, and write the thrust on these faces.

    speed : speed of the faces [m/s]; if it is 0, the flow is unchanged; rest : depths at rest of the cells
    side : depths at the faces; f : fluxes
    thrust : thrust minus that of the depth at rest, over density and length [m3/s2]
    """
    for i in range(thrust.size):
        if speed != 0.0:
            f[i], f[i + ALONG] = 0.0, 0.0
        thrust[i] = f[i + AFTER] + 0.5 * g * ((side[i] - rest[i]) * (side[i] + rest[i]))


@njit
def close_fixed_walls(walls, f, count):
    """Set the mass flow through a row of boundary faces of walls at rest to zero, with the momentum that it carries.

    In a grid of one or two cells across, ghost cells are not exact mirror images, so in fifth order this flow is not 0.
    walls : float64[count]  1 for a wall and 0 for open, empty for walls only; f : fluxes; count : number of faces
    """
    for i in range(count):
        if walls.size == 0 or walls[i] == 1.0:
            f[i], f[i + ALONG] = 0.0, 0.0


@njit
def grid_rates(
    g, scheme, limiter, nx, ny, begin, stop, kx, ky, reflect, plan, dh, qx, qy, flow_x, flow_y, through, work, rate_h,
    rate_x, rate_y, moves,
):  # fmt: skip
    """Write the rates of cells of rows `begin` to `stop` - 1; return the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    Rows are counted over the whole grid; neighbours within the stencil of the scheme are read too.
    g : gravity normal to the basin [m/s2]; scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5; limiter : of MUSCL
    nx, ny : numbers of columns and rows
    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]
    reflect : float64[2 (nx + ny)]  1 for a wall and 0 for open, in the order west, east, south, north; empty: all walls
    plan : float64[PLANS, n]  depth at rest and surface at rest above the level [m]
    dh, qx, qy : float64[n]  deviation of depth from rest [m], unit flows [m2/s]; with moving walls, the changes of
    their amounts over undeformed areas, see `basins.cell_stretching`
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx]  volume flows per width through faces [m2/s], or empty
    through : float64[2 (nx + ny)]  inward flows through boundary faces [m3/s], in the order of `reflect`, or empty
    work : float64[WORK], fastest if aligned to a cache line; float64[MOVING] if lines move
    rate_h, rate_x, rate_y : float64[n]  rates of dh, qx, qy
    moves : None without moving walls, else a tuple of
        speeds of the grid lines x = constant [m/s], float64[nx + 9], empty if at rest
        speeds of the grid lines y = constant [m/s], float64[ny + 9], empty if at rest
        float64[2 (nx + ny)]  thrust on boundary faces minus that at rest, over density and length [m3/s2]
        `wide` : area over undeformed area of columns or rows, and its reciprocal `narrow`, see `basins.cell_stretching`
    """
    most = 0.0
    for first in range(0, nx, MAX_COLUMNS):
        last = min(first + MAX_COLUMNS, nx)
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
    """Write the rates of columns `first` to `last` - 1, at most MAX_COLUMNS; return their greatest rate [1/s].

    fresh : False if the last call ended at row `begin` with the same `work`; then its results are used again
    Other arguments as in `grid_rates`
    """
    n, fifth = last - first, scheme == LINEAR or scheme == WENO5
    ring, at = work[: RING * BLOCK], RING * BLOCK
    sides, at = work[at : at + 3 * SIDE], at + 3 * SIDE
    fluxes, deep, top = work[at : at + 3 * FLUX], work[at + 3 * FLUX :], work[at + 3 * FLUX + STRIDE :]
    ends, along = sides[2 * SIDE :], fluxes[2 * FLUX :]  # of a row, starting one cell before it
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
        here, before = ring[ring_offset(j, 0) :], ring[ring_offset(j - 1, 0) :]
        low = sides[now * SIDE :]
        put_limited(scheme, limiter, n, before, here, ring[ring_offset(j + 1, 0) :], low)
        if fifth:
            put_smooth(
                g,
                scheme,
                ring[ring_offset(j - 2, 0) :],
                before,
                here,
                ring[ring_offset(j + 1, 0) :],
                ring[ring_offset(j + 2, 0) :],
                low,
                deep[:n],
            )
        if j < begin:
            continue
        # faces between rows j - 1 and j
        south, north, under = fluxes[was * FLUX :], fluxes[now * FLUX :], sides[was * SIDE + HIGH :]
        l, r = (under, low) if fifth else (before, here)  # cells that bound wave speeds
        if moves is None or moves[1].size == 0:
            put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, None)
        else:
            uniform_speed = work[WORK : WORK + STRIDE]
            for i in range(n):
                uniform_speed[i] = moves[1][j]
            put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, uniform_speed)
            if j == 0 or j == ny:
                at = 2 * ny + first + (nx if j > 0 else 0)
                rest = plan[0, (0 if j == 0 else (ny - 1) * nx) + first :]
                close_walls(g, moves[1][j], rest, low if j == 0 else under, north, moves[2][at : at + n])
        if fifth and ny < REACH and (j == 0 or j == ny):
            at = 2 * ny + first + (nx if j > 0 else 0)
            close_fixed_walls(reflect[at : at + n], north, n)
        if flow_y.size > 0:
            copy(north, flow_y[j * nx + first : j * nx + last])
        if through.size > 0 and (j == 0 or j == ny):
            at = 2 * ny + first + (nx if j > 0 else 0)
            put_inward(-1.0 if j > 0 else 1.0, kx[first:last], north, through[at : at + n])
        if j == begin:
            continue
        # row j - 1 : faces along it, and its rates
        padded_count = (n + 9) // 8 * 8  # padded to whole vectors
        cell = ring[ring_offset(j - 1, -1) :]
        put_limited(scheme, limiter, padded_count, ring[ring_offset(j - 1, -2) :], cell, before, ends)
        if fifth:
            put_smooth(
                g,
                scheme,
                ring[ring_offset(j - 1, -3) :],
                ring[ring_offset(j - 1, -2) :],
                cell,
                before,
                ring[ring_offset(j - 1, 1) :],
                ends,
                deep[:padded_count],
            )
        left, right = ends[HIGH:], ends[1:]
        l, r = (left, right) if fifth else (cell, before)
        if moves is None or moves[0].size == 0:
            put_fluxes(g, (n + 8) // 8 * 8, EAST, NORTH, left, right, l, r, along, None)
        else:
            put_fluxes(g, (n + 8) // 8 * 8, EAST, NORTH, left, right, l, r, along, moves[0][first:])
            rest = plan[0, (j - 1) * nx :]
            if first == 0:
                close_walls(g, moves[0][0], rest, right, along, moves[2][j - 1 : j])
            if last == nx:
                close_walls(g, moves[0][nx], rest[nx - 1 :], left[n:], along[n:], moves[2][ny + j - 1 : ny + j])
        if fifth and nx < REACH:
            close_fixed_walls(reflect[j - 1 : j], along, 1)
            close_fixed_walls(reflect[ny + j - 1 : ny + j], along[n:], 1)
        if flow_x.size > 0:
            at = (j - 1) * (nx + 1)
            copy(along, flow_x[at + first : at + last + 1])
        if through.size > 0 and first == 0:
            through[j - 1] = along[0] / ky[j - 1]
        if through.size > 0 and last == nx:
            through[ny + j - 1] = -along[n] / ky[j - 1]
        a, z = (j - 1) * nx + first, (j - 1) * nx + last
        spacing_x, spacing_y = kx[first:last], ky[j - 1]
        push_x, push_y = ends[PUSH + 1 :], sides[was * SIDE + PUSH :]
        to_h, to_x, to_y = rate_h[a:z], rate_x[a:z], rate_y[a:z]
        if moves is None:
            put_rates(g, spacing_x, spacing_y, push_x, push_y, along, south, north, None, to_h, to_x, to_y)
        else:
            wide, _ = factors_of(j - 1, first, last, moves, work[WORK + STRIDE :])
            put_rates(g, spacing_x, spacing_y, push_x, push_y, along, south, north, wide, to_h, to_x, to_y)
    most = 0.0
    for i in range(STRIDE):
        most = max(most, top[i])
    return most
