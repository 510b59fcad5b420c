"""Rows of shallow water: cells with their ghosts, limited values at faces, fluxes, rates. Knows no grid.

A block of cells is float64[FIELDS, wide], `GHOSTS` of them at either end; of face values
float64[5, wide] in the order of the first five fields, of fluxes float64[4, wide].
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.limiters import slope_minmod, slope_monotonized_central
from fvsolve.kernels.records import MINMOD, UPWIND, VAN_LEER

THIN = 1e-6  # depth below which velocities fade [m]
TINY = 1e-300
LEAST = 1e-280  # product of two differences below which a slope is none, so that four can be multiplied
GHOSTS = 8  # three are needed; with eight the cells of a row begin where a cache line does
REACH = 3
DEPTH, SURFACE, EAST, NORTH, WAVE, FLOW_EAST, FLOW_NORTH, FIELDS = 0, 1, 2, 3, 4, 5, 6, 7
MASS, BEFORE, AFTER, ALONG = 0, 1, 2, 3


@njit
def put_cells(g, depth0, surface0, dh, qx, qy, kx, ky, cells, top):
    """Depth, surface, velocities and wave speed of a row; top[i] becomes the greatest rate of its column so far.

    Velocity q / h, which fades as 2 h q / (h^2 + THIN^2) below THIN.
    """
    h, e, u, v, c = (
        cells[DEPTH, GHOSTS:],
        cells[SURFACE, GHOSTS:],
        cells[EAST, GHOSTS:],
        cells[NORTH, GHOSTS:],
        cells[WAVE, GHOSTS:],
    )
    for i in range(dh.size):
        depth = max(depth0[i] + dh[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet)
        east, north, wave = qx[i] * part, qy[i] * part, sqrt(g * depth)
        rate = (abs(east) + wave) * kx[i] + (abs(north) + wave) * ky
        h[i], e[i], u[i], v[i], c[i] = depth, surface0[i] + dh[i], east, north, wave
        top[i] = rate if rate > top[i] else top[i]


@njit
def put_flows(qx, qy, cells):
    """The unit flows of a row."""
    x, y = cells[FLOW_EAST, GHOSTS:], cells[FLOW_NORTH, GHOSTS:]
    for i in range(qx.size):
        x[i], y[i] = qx[i], qy[i]


@njit
def put_ends(n, west, east, cells):
    """Ghosts of a row of n cells: mirrored by a wall, 1, the last cell again beyond an open end, 0."""
    for f in range(FIELDS):
        p = cells[f]
        turn = -1.0 if f == EAST or f == FLOW_EAST else 1.0
        for k in range(REACH):
            m = min(k, n - 1)
            a, b = p[GHOSTS], p[GHOSTS + n - 1]
            p[GHOSTS - 1 - k] = west * turn * p[GHOSTS + m] + (1.0 - west) * a
            p[GHOSTS + n + k] = east * turn * p[GHOSTS + n - 1 - m] + (1.0 - east) * b


@njit
def put_beyond(n, walls, last, mirror, cells):
    """A row beyond the last one, from that and its mirror image; walls : float64[n] or empty, as in `put_ends`."""
    for f in range(FIELDS):
        a, b, p = last[f, GHOSTS:], mirror[f, GHOSTS:], cells[f, GHOSTS:]
        turn = -1.0 if f == NORTH or f == FLOW_NORTH else 1.0
        if walls.size == 0:
            for i in range(n):
                p[i] = turn * b[i]
        else:
            for i in range(n):
                p[i] = walls[i] * turn * b[i] + (1.0 - walls[i]) * a[i]


@njit
def van_leer_halves(a, b, c, d):
    """Half the slopes a b / (a + b) and c d / (c + d), zero where signs differ, by one division."""
    ab, cd = a * b, c * d
    one, two = ab > LEAST, cd > LEAST
    s, t = (a + b if one else 1.0), (c + d if two else 1.0)
    r = 1.0 / (s * t)
    return ab * (t * r) if one else 0.0, cd * (s * r) if two else 0.0


@njit
def put_pair(limiter, p, q, r, s, t, u, low_q, high_q, low_t, high_t):
    """Limited values at both faces of a row of cells, q of one field and t of another, from the rows beside it."""
    if limiter == MINMOD:
        for i in range(low_q.size):
            m = 0.5 * slope_minmod(q[i] - p[i], r[i] - q[i])
            n = 0.5 * slope_minmod(t[i] - s[i], u[i] - t[i])
            low_q[i], high_q[i], low_t[i], high_t[i] = q[i] - m, q[i] + m, t[i] - n, t[i] + n
    elif limiter == VAN_LEER:
        for i in range(low_q.size):
            m, n = van_leer_halves(q[i] - p[i], r[i] - q[i], t[i] - s[i], u[i] - t[i])
            low_q[i], high_q[i], low_t[i], high_t[i] = q[i] - m, q[i] + m, t[i] - n, t[i] + n
    else:
        for i in range(low_q.size):
            m = 0.5 * slope_monotonized_central(q[i] - p[i], r[i] - q[i])
            n = 0.5 * slope_monotonized_central(t[i] - s[i], u[i] - t[i])
            low_q[i], high_q[i], low_t[i], high_t[i] = q[i] - m, q[i] + m, t[i] - n, t[i] + n


@njit
def put_limited(scheme, limiter, n, before, a, here, b, after, c, low, high, push):
    """Values at both faces of n cells, from blocks and the first cell of each: themselves, or limited.

    push : float64[n]  depth times what the surface rises across the cell [m2]
    """
    if scheme == UPWIND:
        for f in range(WAVE):
            p, l, r = here[f, b:], low[f], high[f]
            for i in range(n):
                l[i] = p[i]
                r[i] = p[i]
        for i in range(n):
            push[i] = 0.0
        return
    for f in range(0, WAVE, 2):
        put_pair(
            limiter, before[f, a:], here[f, b:], after[f, c:], before[f + 1, a:], here[f + 1, b:], after[f + 1, c:],
            low[f, :n], high[f, :n], low[f + 1, :n], high[f + 1, :n],
        )  # fmt: skip
    h, l, r = here[DEPTH, b:], low[SURFACE], high[SURFACE]
    for i in range(n):
        push[i] = h[i] * (r[i] - l[i])


@njit
def put_fluxes(g, n, normal, along, fifth, left, l, right, r, before, b, after, a, f):
    """Through n faces, from the values and cells on either side, and the first of each.

    f : depth, normal momentum less the pressure on the side before and after, momentum along the faces
    """
    u, c = (left[normal, l:], left[WAVE, l:]) if fifth else (before[normal, b:], before[WAVE, b:])
    v, d = (right[normal, r:], right[WAVE, r:]) if fifth else (after[normal, a:], after[WAVE, a:])
    put_hllc(
        g, left[DEPTH, l:], left[SURFACE, l:], left[normal, l:], left[along, l:],
        right[DEPTH, r:], right[SURFACE, r:], right[normal, r:], right[along, r:], u, c, v, d,
        f[MASS, :n], f[BEFORE, :n], f[AFTER, :n], f[ALONG, :n],
    )  # fmt: skip


@njit
def put_hllc(g, hl, el, nl, tl, hr, er, nr, tr, ul, cl, ur, cr, f0, fl, fr, ft):
    """Fluxes through a row of faces; that along them goes with the mass, which is what the contact carries.

    h, e, n, t : depth, surface, velocities normal to the faces and along them, on either side
    u, c : normal velocities and wave speeds between which those of the face lie
    """
    half = 0.5 * g
    for i in range(f0.size):
        bed = max(el[i] - hl[i], er[i] - hr[i])
        a, b = max(0.0, el[i] - bed), max(0.0, er[i] - bed)
        wave, ua, ub = max(cl[i], cr[i]), ul[i], ur[i]
        low, high = min(min(ua, ub) - wave, 0.0), max(max(ua, ub) + wave, 0.0)
        both = 1.0 / (high - low + TINY)
        wa, wb, mix = high * both, -(low * both), high * low * both
        qa, qb = a * nl[i], b * nr[i]
        mass = (wa * qa + wb * qb) + mix * (b - a)
        flow = (wa * (qa * nl[i]) + wb * (qb * nr[i])) + mix * (qb - qa)
        rise = half * ((b - a) * (b + a))
        f0[i], fl[i], fr[i] = mass, flow + wb * rise, flow - wa * rise
        ft[i] = mass * (tl[i] if mass > 0.0 else tr[i])


@njit
def put_rates(g, kx, ky, push_x, push_y, x, south, north, dh, dx, dy):
    """Rates of a row: what comes in less what goes out, and the push of surface and pressure."""
    f0, ft, fr, f0b, ftb, flb = x[MASS], x[ALONG], x[AFTER], x[MASS, 1:], x[ALONG, 1:], x[BEFORE, 1:]
    s0, st, sr, n0, nt, nl = south[MASS], south[ALONG], south[AFTER], north[MASS], north[ALONG], north[BEFORE]
    for i in range(dh.size):
        dh[i] = kx[i] * (f0[i] - f0b[i]) + ky * (s0[i] - n0[i])
        dx[i] = kx[i] * ((fr[i] - flb[i]) - g * push_x[i]) + ky * (st[i] - nt[i])
        dy[i] = ky * ((sr[i] - nl[i]) - g * push_y[i]) + kx[i] * (ft[i] - ftb[i])
