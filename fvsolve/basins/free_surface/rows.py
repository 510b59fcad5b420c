"""Rows of shallow water: cells with their ghosts, limited values at faces, fluxes, rates. Knows no grid.

A block is the view of rows that lie STRIDE apart, a constant: so the compiler sees that they do not overlap. Of cells:
depth, surface, both velocities, wave speed and unit flows; of sides the first five of these at the faces before and
after, and depth times what the surface rises across the cell [m2]; of fluxes that of depth, of normal momentum less the
pressure on the side before and after, of momentum along the faces.
"""

from math import sqrt

from fvsolve.jit import inner, njit
from fvsolve.kernels.limiters import by_limiter, halves
from fvsolve.kernels.records import UPWIND

THIN = 1e-6  # depth below which velocities fade [m]
TINY = 1e-300
MOST = 1024  # cells of a row at a time
GHOSTS = 8  # three are needed; with eight the cells of a row begin where a cache line does
STRIDE = 1048  # an odd number of cache lines, so that rows do not push each other out
DEPTH, SURFACE, EAST, NORTH, WAVE, FLOW_EAST, FLOW_NORTH = (k * STRIDE for k in range(7))
LOW, HIGH, PUSH = (k * STRIDE for k in (0, 5, 10))
MASS, BEFORE, AFTER, ALONG = (k * STRIDE for k in range(4))
FIELDS, SIDES, FLUXES = 7, 11, 4  # rows of a block


@inner
def put_cells(g, depth0, surface0, dh, qx, qy, kx, ky, factors, cells, top):
    """Depth, surface, velocities and wave speed of a row; top[i] becomes the greatest rate of its column so far.

    Velocity is q / h, which fades as 2 h q / (h^2 + THIN^2) below THIN.
    factors : None, or (wide, narrow) of cells whose contents dh, qx and qy are, see `basins.stretch`
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
    """The unit flows of a row; factors : as in `put_cells`."""
    for i in range(qx.size):
        per = 1.0 if factors is None else factors[1][i]
        cells[i + FLOW_EAST], cells[i + FLOW_NORTH] = qx[i] * per, qy[i] * per


@njit
def put_end(fields, reach, wall, cells, first, step, deep):
    """Ghosts beyond cell `first` of a row, `step` away from it: mirrored by a wall, 1, or that cell again, 0.

    deep : number of cells that a mirror finds
    """
    for f in range(fields):
        at = f * STRIDE + first
        turn = -1.0 if f * STRIDE == EAST or f * STRIDE == FLOW_EAST else 1.0
        for k in range(reach):
            image = cells[at - step * min(k, deep - 1)]
            cells[at + step * (k + 1)] = wall * turn * image + (1.0 - wall) * cells[at]


@njit
def drive_end(fields, reach, speed, cells, first, step):
    """Let ghosts beyond cell `first` be seen in a wall that moves along the row: u is mirrored to 2 speed - u."""
    for k in range(reach):
        at = first + step * (k + 1)
        cells[at + EAST] += 2.0 * speed
        if fields * STRIDE > FLOW_EAST:
            cells[at + FLOW_EAST] += 2.0 * speed * cells[at + DEPTH]


@njit
def drive_beyond(n, fields, speed, cells):
    """The same of a row of ghosts beyond a wall that moves across it."""
    for i in range(n):
        cells[i + NORTH] += 2.0 * speed
        if fields * STRIDE > FLOW_NORTH:
            cells[i + FLOW_NORTH] += 2.0 * speed * cells[i + DEPTH]


@njit
def put_beyond(n, fields, walls, last, mirror, cells):
    """A row beyond the last one, from that and its mirror image; walls : float64[n] or empty, as in `put_end`."""
    for f in range(fields):
        at = f * STRIDE
        a, b, p = last[at:], mirror[at:], cells[at:]
        turn = -1.0 if at == NORTH or at == FLOW_NORTH else 1.0
        if walls.size == 0:
            for i in range(n):
                p[i] = turn * b[i]
        else:
            for i in range(n):
                p[i] = walls[i] * turn * b[i] + (1.0 - walls[i]) * a[i]


@inner
def put_side(i, hl, el, ul, vl, hr, er, ur, vr, push, sides):
    """Values at both faces of cell i and what its surface rises."""
    sides[i], sides[i + SURFACE], sides[i + EAST], sides[i + NORTH] = hl, el, ul, vl
    sides[i + HIGH], sides[i + (HIGH + SURFACE)], sides[i + (HIGH + EAST)], sides[i + (HIGH + NORTH)] = hr, er, ur, vr
    sides[i + PUSH] = push


@inner
def put_sloped(limiter, n, before, here, after, sides):
    """`put_limited` by a limiter."""
    for i in range(n):
        h, e, u, v = here[i], here[i + SURFACE], here[i + EAST], here[i + NORTH]
        a, b = halves(limiter, h - before[i], after[i] - h, e - before[i + SURFACE], after[i + SURFACE] - e)
        c, d = halves(limiter, u - before[i + EAST], after[i + EAST] - u, v - before[i + NORTH], after[i + NORTH] - v)
        put_side(i, h - a, e - b, u - c, v - d, h + a, e + b, u + c, v + d, h * (2.0 * b), sides)


@njit
def put_limited(scheme, limiter, n, before, here, after, sides):
    """Sides of n cells, from these and their neighbours: themselves, or limited."""
    if scheme == UPWIND:
        for i in range(n):
            h, e, u, v = here[i], here[i + SURFACE], here[i + EAST], here[i + NORTH]
            put_side(i, h, e, u, v, h, e, u, v, 0.0, sides)
    else:
        by_limiter(put_sloped, limiter, n, before, here, after, sides)


@inner
def put_fluxes(g, n, normal, along, left, right, l, r, f, moves):
    """Through a row of n faces (HLLC); momentum along them goes with the mass, as the contact carries it.

    normal, along : EAST and NORTH, or the other way round
    left, right : values on either side; l, r : cells between whose velocities and wave speeds those of the face lie
    moves : speeds of the faces [m/s], None where they stand still: F(U) - w U, found in axes that move along
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
        both = 1.0 / (high - low + TINY)
        wa, wb, mix = high * both, -(low * both), high * low * both
        qa, qb = a * nl, b * nr
        mass = (wa * qa + wb * qb) + mix * (b - a)
        flow = (wa * (qa * nl) + wb * (qb * nr)) + mix * (qb - qa)
        if moves is not None:
            flow += moves[i] * mass
        rise = half * ((b - a) * (b + a))
        f[i], f[i + BEFORE], f[i + AFTER] = mass, flow + wb * rise, flow - wa * rise
        f[i + ALONG] = mass * (tl if mass > 0.0 else tr)


@inner
def put_rates(g, kx, ky, push_x, push_y, x, south, north, wide, dh, dx, dy):
    """Rates of a row: what comes in less what goes out, and the push of surface and pressure.

    wide : None, or of cells that are stretched, for rates of what these contain; see `basins.stretch`
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
