"""Rows of shallow water: cells with ghost cells, limited values at faces, fluxes, rates.

Quantities of a row of cells are stored as rows of one array at the constant distance STRIDE, so that the compiler knows
that they do not overlap. Cells have depth, surface, both velocities, wave speed and unit flows. Sides have the first
five quantities at the faces before and after a cell, and depth times the rise of the surface across the cell [m2].
There are fluxes of depth, of normal momentum minus the pressure on the side before and on the side after, and of
tangential momentum.

In fifth order, where the water is deep enough, bed, surface e and unit flows are reconstructed from cell means; the
depth h is surface minus bed, and velocities are unit flows over depth. The integral of h de/dx over a cell is exact for
cubics: that of the parabolas through both face values and the mean, plus the products of third differences with second
differences.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import UPWIND, WENO5
from fvsolve.core.kernels.reconstruction import by_limiter, half_slopes, slope, value_weno5
from fvsolve.features.basins.hll_flux import hll_flux
from fvsolve.jit import inline, njit

THIN = 1e-6  # depth below which velocities fade to zero [m]
HUGE = 1e300
MAX_COLUMNS = 1024  # greatest number of cells of a row in one pass
GHOSTS = 8  # three are needed; with eight the cells of a row begin at a cache line
STRIDE = 1048  # an odd number of cache lines, so that rows do not evict each other from the cache
DEPTH, SURFACE, EAST, NORTH, WAVE, FLOW_EAST, FLOW_NORTH = (k * STRIDE for k in range(7))
LOW, HIGH, PUSH = (k * STRIDE for k in (0, 5, 10))
MASS, BEFORE, AFTER, ALONG = (k * STRIDE for k in range(4))
FIELDS, SIDES, FLUXES = 7, 11, 4  # rows of a block
# squares of differences below which WENO's weights are its linear weights [m2, m4/s2]
SMALL = 1e-20
# shallowest of five depths over the deepest, below which values are limited
LEAST_DEPTH_RATIO = 0.5


@inline
def put_cells(g, depth0, surface0, dh, qx, qy, kx, ky, factors, cells, top):
    """Write depth, surface, velocities and wave speed of a row of cells to `cells`, and update `top`.

    Velocity is q / h, replaced by 2 h q / (h^2 + THIN^2) at depths h below THIN.
    g : gravity [m/s2]; depth0, surface0 : depth and surface at rest [m]
    dh, qx, qy : deviation of depth from rest [m], unit flows [m2/s]
    kx, ky : 1 / widths of the columns, 1 / height of the row [1/m]
    factors : None, or (wide, narrow) of stretching cells, see `basins.cell_sides`; dh, qx and qy then refer to
    undeformed areas
    top : float64[n]  greatest rate (|u| + c) kx + (|v| + c) ky of each column so far [1/s]
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
        u = qx[i] * part
        v = qy[i] * part
        c = sqrt(g * depth)
        rate = (abs(u) + c) * kx[i] + (abs(v) + c) * ky
        cells[i], cells[i + SURFACE], cells[i + EAST] = depth, surface0[i] + rise, u
        cells[i + NORTH], cells[i + WAVE] = v, c
        top[i] = rate if rate > top[i] else top[i]


@njit
def put_flows(qx, qy, factors, cells):
    """Write the unit flows of a row of cells [m2/s] to `cells`. qx, qy, factors : as in `put_cells`"""
    for i in range(qx.size):
        per = 1.0 if factors is None else factors[1][i]
        cells[i + FLOW_EAST], cells[i + FLOW_NORTH] = qx[i] * per, qy[i] * per


@njit
def put_ghost_end(fields, reach, wall, cells, first, step, cell_count):
    """Write `reach` ghost cells beyond cell `first` of a row, in direction `step` (1 or -1).

    fields : number of quantities in the block `cells`; wall : 1 for mirror images, 0 for copies of cell `first`
    cell_count : number of cells that can be mirrored
    """
    for f in range(fields):
        at = f * STRIDE + first
        sign = -1.0 if f * STRIDE == EAST or f * STRIDE == FLOW_EAST else 1.0
        for k in range(reach):
            image = cells[at - step * min(k, cell_count - 1)]
            cells[at + step * (k + 1)] = wall * sign * image + (1.0 - wall) * cells[at]


@njit
def correct_ghost_end(fields, reach, speed, cells, first, step):
    """Correct ghost cells beyond cell `first` for a wall that moves along the row at `speed`: u becomes u + 2 speed.

    u is the velocity along the row after reflection at a wall at rest. Other arguments as for `put_ghost_end`
    """
    for k in range(reach):
        at = first + step * (k + 1)
        cells[at + EAST] += 2.0 * speed
        if fields * STRIDE > FLOW_EAST:
            cells[at + FLOW_EAST] += 2.0 * speed * cells[at + DEPTH]


@njit
def correct_ghost_row(n, fields, speed, cells):
    """Correct n cells of a ghost row for a wall that moves across the row at `speed`: v becomes v + 2 speed.

    v is the velocity across the row after reflection at a wall at rest. fields : number of quantities in `cells`
    """
    for i in range(n):
        cells[i + NORTH] += 2.0 * speed
        if fields * STRIDE > FLOW_NORTH:
            cells[i + FLOW_NORTH] += 2.0 * speed * cells[i + DEPTH]


@njit
def extrapolate_ghosts(fields, reach, cells, at, step):
    """Replace `reach` ghost cells beyond cell `at` by linear extrapolation, if this cell and the next inside are wet.

    step : distance in `cells` from a cell to the next outward; the depth stays at 0 or above
    """
    if not (cells[at] > 0.0 and cells[at - step] > 0.0):
        return
    for f in range(fields):
        here = at + f * STRIDE
        slope = cells[here] - cells[here - step]
        for k in range(1, reach + 1):
            value = cells[here] + k * slope
            cells[here + k * step] = max(value, 0.0) if f * STRIDE == DEPTH else value


@njit
def extrapolate_across(fields, i, beyond, here, inside, cells):
    """Replace cell i of a ghost row by linear extrapolation across the rows, if both cells inside are wet.

    beyond : number of rows from the last row `here` to the ghost row; inside : row next to the last
    """
    if here[i] > 0.0 and inside[i] > 0.0:
        for f in range(fields):
            at = f * STRIDE + i
            value = here[at] + beyond * (here[at] - inside[at])
            cells[at] = max(value, 0.0) if f * STRIDE == DEPTH else value


@njit
def put_ghost_row(n, fields, walls, last, mirror, cells):
    """Write a row of n ghost cells beyond the grid to `cells`.

    last : outermost row of the grid; mirror : row to be mirrored; fields : number of quantities
    walls : float64[n]  1 for mirror images of `mirror`, 0 for copies of `last`; empty for walls only
    """
    for f in range(fields):
        at = f * STRIDE
        a = last[at:]
        b = mirror[at:]
        p = cells[at:]
        sign = -1.0 if at == NORTH or at == FLOW_NORTH else 1.0
        if walls.size == 0:
            for i in range(n):
                p[i] = sign * b[i]
        else:
            for i in range(n):
                p[i] = walls[i] * sign * b[i] + (1.0 - walls[i]) * a[i]


@inline
def put_side(i, hl, el, ul, vl, hr, er, ur, vr, push, sides):
    """Write the values at both faces of cell i, and depth times the rise of the surface across the cell (push) [m2].

    hl, el, ul, vl : depth, surface and velocities at the face before; hr, er, ur, vr : at the face after
    """
    sides[i], sides[i + SURFACE], sides[i + EAST], sides[i + NORTH] = hl, el, ul, vl
    (
        sides[i + HIGH],
        sides[i + (HIGH + SURFACE)],
        sides[i + (HIGH + EAST)],
        sides[i + (HIGH + NORTH)],
    ) = hr, er, ur, vr
    sides[i + PUSH] = push


@inline
def put_with_velocities(limiter, i, a, b, before, here, after, sides):
    """Write the values at both faces of cell i, and its push, see `put_side`.

    a, b : changes of depth and surface from the cell to the face after it; other arguments as for `put_limited`
    """
    h = here[i]
    e = here[i + SURFACE]
    u = here[i + EAST]
    v = here[i + NORTH]
    c, d = half_slopes(
        limiter,
        u - before[i + EAST],
        after[i + EAST] - u,
        v - before[i + NORTH],
        after[i + NORTH] - v,
    )
    put_side(i, h - a, e - b, u - c, v - d, h + a, e + b, u + c, v + d, h * (2.0 * b), sides)


@inline
def put_sloped(limiter, n, before, here, after, sides):
    """Write the values at both faces of n cells with slopes by a limiter function; arguments as for `put_limited`.

    The change of the depth to a side is that of the surface minus that of the bed, up to h / 16; from h / 8 on it is
    that of the limited depths, and in between it lies between both.
    """
    for i in range(n):
        h, e = here[i], here[i + SURFACE]
        below = h - before[i]
        above = after[i] - h
        low = e - before[i + SURFACE]
        high = after[i + SURFACE] - e
        bed, b = half_slopes(limiter, low - below, high - above, low, high)
        own, change = 0.5 * slope(limiter, below, above), b - bed
        most = max(0.5 * h - 4.0 * abs(change), 0.0)
        put_with_velocities(
            limiter, i, own + min(max(change - own, -most), most), b, before, here, after, sides
        )


@inline
def put_sloped_at_kerbs(limiter, n, before, here, after, sides):
    """Write the values at both faces of n cells as `put_sloped` does, but with smaller slopes at kerbs.

    At a kerb, where the second difference of the bed exceeds h / 4 and no cell is dry, the slope of the bed exceeds
    that by minmod by no more than the film allows. That of minmod never raises the side of a cell above the next
    side uphill, where a film would have to pond. For the same reason the change of the surface lies between zero and
    that of bed and depth there: beside a pond it would tilt the bed of a film, and beside a film on a bank a pond.
    """
    for i in range(n):
        h, e = here[i], here[i + SURFACE]
        below = h - before[i]
        above = after[i] - h
        low = e - before[i + SURFACE]
        high = after[i + SURFACE] - e
        rise = low - below
        next_rise = high - above
        least = min(h, min(before[i], after[i]))
        is_kerb = abs(next_rise - rise) > (0.25 * h if least > THIN else HUGE)
        bed, b = half_slopes(limiter, rise, next_rise, low, high)
        steepest = 0.5 * min(abs(rise), abs(next_rise)) + 0.125 * least if is_kerb else HUGE
        bed = min(max(bed, -steepest), steepest)
        own, change = 0.5 * slope(limiter, below, above), b - bed
        film = 4.0 * least - 0.5 * h if is_kerb else HUGE
        most = max(min(0.5 * h, film) - 4.0 * abs(change), 0.0)
        a = own + min(max(change - own, -most), most)
        held = min(max(bed + a, min(b, 0.0)), max(b, 0.0))
        put_with_velocities(limiter, i, a, held if is_kerb else b, before, here, after, sides)


@njit
def has_films(n, kerbs, here):
    """True if water in one of n cells is thin enough for a kerb: below the depth `kerbs`, and not dry."""
    films = 0
    for i in range(n):
        films += 1 if THIN < here[i] < kerbs else 0
    return films > 0


@njit
def put_limited(scheme, limiter, kerbs, n, before, here, after, sides):
    """Write the values at both faces of n cells to `sides`: cell values under UPWIND, else with limited slopes.

    kerbs : greatest depth of cells at kerbs [m]; before, here, after : values of the cells, and of their neighbours
    """
    if scheme == UPWIND:
        for i in range(n):
            h = here[i]
            e = here[i + SURFACE]
            u = here[i + EAST]
            v = here[i + NORTH]
            put_side(i, h, e, u, v, h, e, u, v, 0.0, sides)
    elif kerbs > THIN and has_films(n, kerbs, here):
        by_limiter(put_sloped_at_kerbs, limiter, n, before, here, after, sides)
    else:
        by_limiter(put_sloped, limiter, n, before, here, after, sides)


@njit
def value_upwind5(a, b, c, d, e):
    """Fifth-order upwind value at the face between c and d, from the averages a to e of five consecutive cells."""
    return ((2.0 * a - 13.0 * b) + (47.0 * c + 27.0 * d) - 3.0 * e) / 60.0


@njit
def put_smooth_flags(p, q, r, s, t, deep):
    """Set `deep` to 1 where fifth-order values are used, else to 0.

    The least of five depths must exceed LEAST_DEPTH_RATIO times the greatest, and the second differences of the bed,
    to both neighbours and to the cells beyond them, half of that depth together.
    p, q, r, s, t : depths in five consecutive cells, their surfaces SURFACE later
    """
    for i in range(deep.size):
        j = i + SURFACE
        least = min(min(min(p[i], q[i]), min(s[i], t[i])), r[i])
        most = max(max(max(p[i], q[i]), max(s[i], t[i])), r[i])
        a = p[j] - p[i]
        b = q[j] - q[i]
        c = r[j] - r[i]
        d = s[j] - s[i]
        e = t[j] - t[i]
        bend = 2.0 * (abs((b - c) + (d - c)) + abs((a - c) + (e - c)))
        deep[i] = 1.0 if least > max(LEAST_DEPTH_RATIO * most, bend) else 0.0


@njit
def put_fifth(scheme, p, q, r, s, t, deep, low, high):
    """Write fifth-order values at the face before (`low`) and the face after (`high`) each cell r where `deep` is 1.

    p, q, r, s, t : averages of five consecutive cells; scheme : WENO5 or LINEAR
    """
    if scheme == WENO5:
        for i in range(deep.size):
            a = value_weno5(t[i], s[i], r[i], q[i], p[i], SMALL)
            b = value_weno5(p[i], q[i], r[i], s[i], t[i], SMALL)
            low[i], high[i] = (a if deep[i] > 0.0 else low[i]), (b if deep[i] > 0.0 else high[i])
    else:
        for i in range(deep.size):
            a = value_upwind5(t[i], s[i], r[i], q[i], p[i])
            b = value_upwind5(p[i], q[i], r[i], s[i], t[i])
            low[i], high[i] = (a if deep[i] > 0.0 else low[i]), (b if deep[i] > 0.0 else high[i])


@njit
def put_depths(scheme, p, q, r, s, t, deep, low, high):
    """Write the depth at both faces where `deep` is 1: surface minus fifth-order bed; arguments as for `put_push`."""
    for i in range(deep.size):
        j = i + SURFACE
        a = p[j] - p[i]
        b = q[j] - q[i]
        c = r[j] - r[i]
        d = s[j] - s[i]
        e = t[j] - t[i]
        if scheme == WENO5:
            x, y = value_weno5(e, d, c, b, a, SMALL), value_weno5(a, b, c, d, e, SMALL)
        else:
            x, y = value_upwind5(e, d, c, b, a), value_upwind5(a, b, c, d, e)
        low[i], high[i] = (
            (low[j] - x if deep[i] > 0.0 else low[i]),
            (high[j] - y if deep[i] > 0.0 else high[i]),
        )


@njit
def put_velocities(g, deep, side):
    """Convert unit flows at faces to velocities where `deep` is 1, and write wave speeds at all faces, in place.

    side : rows of depth, surface, unit flows and wave speed at the faces, each STRIDE after the row before
    """
    for i in range(deep.size):
        depth = max(side[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet) if deep[i] > 0.0 else 1.0
        side[i + EAST], side[i + NORTH], side[i + WAVE] = (
            part * side[i + EAST],
            part * side[i + NORTH],
            sqrt(g * depth),
        )


@njit
def put_push(p, q, r, s, t, low, high, deep, push):
    """Write the integrals of h de/dx (depth h, surface e) over the cells where `deep` is 1 to `push` [m2].

    p, q, r, s, t : as for `put_smooth`; low, high : depth and surface at the faces before and after the cells
    """
    for i in range(push.size):
        h, e = r[i], r[i + SURFACE]
        h2 = 3.0 * ((low[i] + high[i]) - 2.0 * h)
        e2 = 3.0 * ((low[i + SURFACE] + high[i + SURFACE]) - 2.0 * e)
        h3 = 0.5 * ((t[i] - p[i]) - 2.0 * (s[i] - q[i]))
        e3 = 0.5 * ((t[i + SURFACE] - p[i + SURFACE]) - 2.0 * (s[i + SURFACE] - q[i + SURFACE]))
        rise = high[i + SURFACE] - low[i + SURFACE]
        integral = h * rise + (high[i] - low[i]) * e2 / 6.0 + (h2 * e3 - e2 * h3) / 360.0
        push[i] = integral if deep[i] > 0.0 else push[i]


@njit
def put_smooth(g, scheme, p, q, r, s, t, sides, deep):
    """Replace the limited values at both faces of a row of cells by fifth-order values where the water is deep enough.

    `put_smooth_flags` determines where this is so. There the integrals of `put_push` are replaced too. Wave speeds at
    the faces of all cells are written.
    p, q, r, s, t : blocks of the cells two and one before, of the cells, and one and two after; see `surface_rows`
    sides : values at both faces; deep : work array, 1 where the values are replaced; scheme : WENO5 or LINEAR
    """
    low, high = sides, sides[HIGH:]
    put_smooth_flags(p, q, r, s, t, deep)
    for at, o in ((SURFACE, SURFACE), (EAST, FLOW_EAST), (NORTH, FLOW_NORTH)):
        put_fifth(scheme, p[o:], q[o:], r[o:], s[o:], t[o:], deep, low[at:], high[at:])
    put_depths(scheme, p, q, r, s, t, deep, low, high)
    put_push(p, q, r, s, t, low, high, deep, sides[PUSH : PUSH + deep.size])
    put_velocities(g, deep, low)
    put_velocities(g, deep, high)


@inline
def put_fluxes(g, n, normal, along, left, right, l, r, f, moves):
    """Write the HLLC fluxes through a row of n faces to f; tangential momentum is carried with the mass.

    g : gravity [m/s2]; normal, along : EAST and NORTH, or the reverse
    left, right : values on either side; l, r : cells whose velocities and wave speeds bound the wave speeds at the face
    moves : None, or speeds of moving faces [m/s]; the flux is then relative to the face
    """
    half = 0.5 * g
    for i in range(n):
        hl = left[i]
        el = left[i + SURFACE]
        hr = right[i]
        er = right[i + SURFACE]
        nl = left[i + normal]
        nr = right[i + normal]
        tl = left[i + along]
        tr = right[i + along]
        bed = max(el - hl, er - hr)
        a, b = max(0.0, el - bed), max(0.0, er - bed)
        wave = max(l[i + WAVE], r[i + WAVE])
        ua = l[i + normal]
        ub = r[i + normal]
        if moves is not None:
            nl = nl - moves[i]
            nr = nr - moves[i]
            ua = ua - moves[i]
            ub = ub - moves[i]
        low, high = min(min(ua, ub) - wave, 0.0), max(max(ua, ub) + wave, 0.0)
        qa, qb = a * nl, b * nr
        push = half * ((b - a) * (b + a))
        mass, before, after = hll_flux(low, high, a, b, qa, qb, qa * nl, qb * nr, push)
        if moves is not None:
            # the water carries the momentum of the moving face too
            before += moves[i] * mass
            after += moves[i] * mass
        f[i], f[i + BEFORE], f[i + AFTER] = mass, before, after
        f[i + ALONG] = mass * (tl if mass > 0.0 else tr)


@inline
def put_rates(g, kx, ky, push_x, push_y, x, south, north, wide, dh, dx, dy):
    """Write the rates of a row of cells: inflow minus outflow, and the force of pressure and bed.

    g : gravity [m/s2]; kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]
    x, south, north : fluxes through the faces along the row, and through the faces before and after the row
    push_x, push_y : depth times rise of the surface across the cells [m2]; dh, dx, dy : rates of depth and unit flows
    wide : None, or area over undeformed area of cells, if rates refer to the undeformed area
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
