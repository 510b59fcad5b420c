"""Rows of shallow water: cells with ghost cells, limited values at faces, fluxes, rates.

A block is a set of rows at the constant distance STRIDE, so that the compiler knows that they do not overlap. Cells
have depth, surface, both velocities, wave speed and unit flows. Sides have the first five of these at the faces before
and after a cell, and depth times the rise of the surface across the cell [m2]. Fluxes are those of depth, of normal
momentum minus the pressure on the side before and on the side after, and of tangential momentum.
"""

from math import sqrt

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import UPWIND
from fvsolve.kernels.limiters import by_limiter, half_slopes

THIN = 1e-6  # depth below which velocities fade to zero [m]
TINY = 1e-300
MAX_COLUMNS = 1024  # greatest number of cells of a row in one pass
GHOSTS = 8  # three are needed; with eight the cells of a row begin at a cache line
STRIDE = 1048  # an odd number of cache lines, so that rows do not evict each other from the cache
DEPTH, SURFACE, EAST, NORTH, WAVE, FLOW_EAST, FLOW_NORTH = (k * STRIDE for k in range(7))
LOW, HIGH, PUSH = (k * STRIDE for k in (0, 5, 10))
MASS, BEFORE, AFTER, ALONG = (k * STRIDE for k in range(4))
FIELDS, SIDES, FLUXES = 7, 11, 4  # rows of a block


@inline
def put_cells(g, depth0, surface0, dh, qx, qy, kx, ky, factors, cells, top):
    """Depth, surface, velocities and wave speed of a row; top[i] becomes the greatest rate of its column so far.

    Velocity is q / h, replaced by 2 h q / (h^2 + THIN^2) below THIN.
    factors : None, or (wide, narrow) of stretching cells, for contents dh, qx and qy; see `basins.cell_stretching`
    """
    for i in range(dh.size):
        rise = dh[i]
        if factors is not None:
            rise = (rise - depth0[i] * (factors[0][i] - 1.0)) * factors[1][i]
        depth = max(depth0[i] + rise, 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet)
        if factors is not None:
            part *= factors[1][i]
        u, v, c = qx[i] * part, qy[i] * part, sqrt(g * depth)
        rate = (abs(u) + c) * kx[i] + (abs(v) + c) * ky
        cells[i], cells[i + SURFACE], cells[i + EAST] = depth, surface0[i] + rise, u
        cells[i + NORTH], cells[i + WAVE] = v, c
        top[i] = rate if rate > top[i] else top[i]


@njit
def put_flows(qx, qy, factors, cells):
    """Unit flows of a row. factors : as in `put_cells`"""
    for i in range(qx.size):
        per = 1.0 if factors is None else factors[1][i]
        cells[i + FLOW_EAST], cells[i + FLOW_NORTH] = qx[i] * per, qy[i] * per


@njit
def put_ghost_end(fields, reach, wall, cells, first, step, cell_count):
    """Ghost cells beyond cell `first` of a row, in direction `step`.

    wall : 1 for mirror images, 0 for copies of that cell; cell_count : number of cells available to the mirror
    """
    for f in range(fields):
        at = f * STRIDE + first
        sign = -1.0 if f * STRIDE == EAST or f * STRIDE == FLOW_EAST else 1.0
        for k in range(reach):
            image = cells[at - step * min(k, cell_count - 1)]
            cells[at + step * (k + 1)] = wall * sign * image + (1.0 - wall) * cells[at]


@njit
def correct_ghost_end(fields, reach, speed, cells, first, step):
    """Correct ghost cells beyond cell `first` for a wall that moves along the row: u becomes 2 speed - u."""
    for k in range(reach):
        at = first + step * (k + 1)
        cells[at + EAST] += 2.0 * speed
        if fields * STRIDE > FLOW_EAST:
            cells[at + FLOW_EAST] += 2.0 * speed * cells[at + DEPTH]


@njit
def correct_ghost_row(n, fields, speed, cells):
    """Correct a row of ghost cells for a wall that moves across it."""
    for i in range(n):
        cells[i + NORTH] += 2.0 * speed
        if fields * STRIDE > FLOW_NORTH:
            cells[i + FLOW_NORTH] += 2.0 * speed * cells[i + DEPTH]


@njit
def put_ghost_row(n, fields, walls, last, mirror, cells):
    """Row of ghost cells, from the last row and its mirror row. walls : float64[n] or empty, as in `put_ghost_end`"""
    for f in range(fields):
        at = f * STRIDE
        a, b, p = last[at:], mirror[at:], cells[at:]
        sign = -1.0 if at == NORTH or at == FLOW_NORTH else 1.0
        if walls.size == 0:
            for i in range(n):
                p[i] = sign * b[i]
        else:
            for i in range(n):
                p[i] = walls[i] * sign * b[i] + (1.0 - walls[i]) * a[i]


@inline
def put_side(i, hl, el, ul, vl, hr, er, ur, vr, push, sides):
    """Values at both faces of cell i and depth times the rise of its surface."""
    sides[i], sides[i + SURFACE], sides[i + EAST], sides[i + NORTH] = hl, el, ul, vl
    sides[i + HIGH], sides[i + (HIGH + SURFACE)], sides[i + (HIGH + EAST)], sides[i + (HIGH + NORTH)] = hr, er, ur, vr
    sides[i + PUSH] = push


@inline
def put_sloped(limiter, n, before, here, after, sides):
    """`put_limited` with a limiter."""
    for i in range(n):
        h, e, u, v = here[i], here[i + SURFACE], here[i + EAST], here[i + NORTH]
        a, b = half_slopes(limiter, h - before[i], after[i] - h, e - before[i + SURFACE], after[i + SURFACE] - e)
        c, d = half_slopes(
            limiter, u - before[i + EAST], after[i + EAST] - u, v - before[i + NORTH], after[i + NORTH] - v
        )
        put_side(i, h - a, e - b, u - c, v - d, h + a, e + b, u + c, v + d, h * (2.0 * b), sides)


@njit
def put_limited(scheme, limiter, n, before, here, after, sides):
    """Values at the sides of n cells from these and their neighbours: cell values, or with a limiter."""
    if scheme == UPWIND:
        for i in range(n):
            h, e, u, v = here[i], here[i + SURFACE], here[i + EAST], here[i + NORTH]
            put_side(i, h, e, u, v, h, e, u, v, 0.0, sides)
    else:
        by_limiter(put_sloped, limiter, n, before, here, after, sides)


@inline
def put_fluxes(g, n, normal, along, left, right, l, r, f, moves):
    """Fluxes through a row of n faces (HLLC); tangential momentum is carried with the mass by the contact wave.

    normal, along : EAST and NORTH, or the reverse
    left, right : values on either side; l, r : cells whose velocities and wave speeds bound those of the face
    moves : speeds of the faces [m/s], None if they do not move: the flux F(U) - w U is computed in moving axes
    """
    half = 0.5 * g
    for i in range(n):
        hl, el, hr, er = left[i], left[i + SURFACE], right[i], right[i + SURFACE]
        nl, nr, tl, tr = left[i + normal], right[i + normal], left[i + along], right[i + along]
        bed = max(el - hl, er - hr)
        a, b = max(0.0, el - bed), max(0.0, er - bed)
        wave, ua, ub = max(l[i + WAVE], r[i + WAVE]), l[i + normal], r[i + normal]
        if moves is not None:
            nl, nr, ua, ub = nl - moves[i], nr - moves[i], ua - moves[i], ub - moves[i]
        low, high = min(min(ua, ub) - wave, 0.0), max(max(ua, ub) + wave, 0.0)
        per_width = 1.0 / (high - low + TINY)
        wa, wb, mix = high * per_width, -(low * per_width), high * low * per_width
        qa, qb = a * nl, b * nr
        mass = (wa * qa + wb * qb) + mix * (b - a)
        flow = (wa * (qa * nl) + wb * (qb * nr)) + mix * (qb - qa)
        if moves is not None:
            flow += moves[i] * mass
        rise = half * ((b - a) * (b + a))
        f[i], f[i + BEFORE], f[i + AFTER] = mass, flow + wb * rise, flow - wa * rise
        f[i + ALONG] = mass * (tl if mass > 0.0 else tr)


@inline
def put_rates(g, kx, ky, push_x, push_y, x, south, north, wide, dh, dx, dy):
    """Rates of a row: fluxes in minus fluxes out, and the force of surface and pressure.

    wide : None, or stretching of cells, for rates of contents; see `basins.cell_stretching`
    """
    for i in range(dh.size):
        along, across = kx[i], ky
        if wide is not None:
            along, across = along * wide[i], across * wide[i]
        dh[i] = along * (x[i] - x[i + 1]) + across * (south[i] - north[i])
        dx[i] = along * ((x[i + AFTER] - x[i + (BEFORE + 1)]) - g * push_x[i]) + across * (
            south[i + ALONG] - north[i + ALONG]
        )
        dy[i] = across * ((south[i + AFTER] - north[i + BEFORE]) - g * push_y[i]) + along * (
            x[i + ALONG] - x[i + (ALONG + 1)]
        )
