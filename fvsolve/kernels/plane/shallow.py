"""Shallow water on a grid of rectangles: rates of depth and flow. Knows rows of cells; knows no patch and no network.

h_t + (q_x)_x + (q_y)_y = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed). Depth h, surface e = h + bed and
velocities are reconstructed with limited slopes; both sides of a face see its higher bed (hydrostatic reconstruction,
Audusse et al. 2004), so that a lake at rest stays at rest, with dry islands too, and no depth falls below zero. Flux of
Harten, Lax and van Leer. Rows of `plan`, float64[PLANS, n], are what is fixed: the profile's depth, its surface less
the level, and the rates that the scheme makes of the profile, rounding, which are taken off.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.limiters import slope_minmod, slope_monotonized_central, slope_van_leer
from fvsolve.kernels.records import MINMOD, VAN_LEER

DEPTH, SURFACE, PLANS = 0, 1, 5
THIN = 1e-6  # depth below which velocities fade [m]
TINY = 1e-300
NO_SLOPE = -1  # in place of a limiter: first order


@njit
def put_primitives(depth0, surface0, dh, qx, qy, h, e, u, v):
    """Depth, surface and both velocities of a row."""
    for i in range(dh.size):
        depth = max(depth0[i] + dh[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet)
        h[i], e[i] = depth, surface0[i] + dh[i]
        u[i], v[i] = qx[i] * part, qy[i] * part


@njit
def half_slopes(limiter, low, here, high, slope):
    """Half the limited slopes of a row, from the values before and after."""
    if limiter == NO_SLOPE:
        for i in range(slope.size):
            slope[i] = 0.0
    elif limiter == MINMOD:
        for i in range(slope.size):
            slope[i] = 0.5 * slope_minmod(here[i] - low[i], high[i] - here[i])
    elif limiter == VAN_LEER:
        for i in range(slope.size):
            slope[i] = 0.5 * slope_van_leer(here[i] - low[i], high[i] - here[i])
    else:
        for i in range(slope.size):
            slope[i] = 0.5 * slope_monotonized_central(here[i] - low[i], high[i] - here[i])


@njit
def fluxes(g, h_l, e_l, n_l, t_l, sh_l, se_l, sn_l, st_l, h_r, e_r, n_r, t_r, sh_r, se_r, sn_r, st_r, f0, fl, fr, ft):
    """Through a row of faces, from cells and half slopes on either side: depth, normal flow by side, other.

    h, e, n, t : depth, surface, velocities normal to the faces and along them
    """
    half = 0.5 * g
    for i in range(f0.size):
        hl, el, ul, tl = h_l[i] + sh_l[i], e_l[i] + se_l[i], n_l[i] + sn_l[i], t_l[i] + st_l[i]
        hr, er, ur, tr = h_r[i] - sh_r[i], e_r[i] - se_r[i], n_r[i] - sn_r[i], t_r[i] - st_r[i]
        bed = max(el - hl, er - hr)
        a, b = max(0.0, el - bed), max(0.0, er - bed)
        ca, cb = sqrt(g * a), sqrt(g * b)
        low, high = min(min(ul - ca, ur - cb), 0.0), max(max(ul + ca, ur + cb), 0.0)
        both = 1.0 / (high - low + TINY)
        qa, qb = a * ul, b * ur
        mass = both * (high * qa - low * qb + high * low * (b - a))
        pa, pb = half * a * a, half * b * b
        flow = both * (high * (qa * ul + pa) - low * (qb * ur + pb) + high * low * (qb - qa))
        f0[i] = mass
        fl[i], fr[i] = flow + (half * hl * hl - pa), flow + (half * hr * hr - pb)
        ft[i] = mass * (tl if mass > 0.0 else tr)


@njit
def settle_row(g, k, h, sh, se, f0, fl, fr, ft, dh, dn, dt):
    """Rates of a row of cells from faces i and i + 1: k times what comes in less what goes out, and the bed's push."""
    f0b, flb, ftb = f0[1:], fl[1:], ft[1:]
    for i in range(dh.size):
        dh[i] = k * (f0[i] - f0b[i])
        dn[i] = k * ((fr[i] - flb[i]) - 2.0 * g * h[i] * (se[i] - sh[i]))
        dt[i] = k * (ft[i] - ftb[i])


@njit
def settle_column(g, k, h, sh, se, f0a, fra, fta, f0b, flb, ftb, dh, dn, dt):
    """The same, added, of a row of cells between two rows of faces."""
    for i in range(dh.size):
        dh[i] += k * (f0a[i] - f0b[i])
        dn[i] += k * ((fra[i] - flb[i]) - 2.0 * g * h[i] * (se[i] - sh[i]))
        dt[i] += k * (fta[i] - ftb[i])


@njit
def quickest(g, kx, ky, h, u, v, top):
    """Let top[i] be the greatest (|u| + c) kx + (|v| + c) ky of its column so far."""
    for i in range(top.size):
        c = sqrt(g * h[i])
        rate = (abs(u[i]) + c) * kx + (abs(v[i]) + c) * ky
        top[i] = rate if rate > top[i] else top[i]


@njit
def work_size(nx, ny):
    """Floats that `grid_rates` works in."""
    return 4 * nx * (ny + 4) + 8 * (nx + 4) + 4 * (nx + 1) + 16 * nx + nx


@njit
def mirrored(a, n, turn):
    """Fill two values beyond either end of a[2 : n + 2] as a wall reflects them."""
    a[1], a[0] = turn * a[2], turn * a[3 if n > 1 else 2]
    a[n + 2], a[n + 3] = turn * a[n + 1], turn * a[n if n > 1 else n + 1]


@njit
def grid_rates(g, limiter, nx, ny, kx, ky, plan, dh, qx, qy, work, rate_h, rate_x, rate_y):
    """Rates of all cells of a basin with walls around; returns its greatest rate (|u| + c) kx + (|v| + c) ky [1/s].

    kx, ky : cells per length [1/m]; plan : float64[PLANS, n]; work : float64[work_size(nx, ny)]
    """
    size, wide = nx * (ny + 4), nx + 4
    h, e, u, v = work[:size], work[size : 2 * size], work[2 * size : 3 * size], work[3 * size : 4 * size]
    rest = work[4 * size :]
    top = rest[:nx]
    rest = rest[nx:]
    for i in range(nx):
        top[i] = 0.0
    for j in range(ny):
        a, b, at = j * nx, (j + 1) * nx, (j + 2) * nx
        to = at + nx
        put_primitives(
            plan[DEPTH, a:b], plan[SURFACE, a:b], dh[a:b], qx[a:b], qy[a:b], h[at:to], e[at:to], u[at:to], v[at:to]
        )
        quickest(g, kx, ky, h[at:to], u[at:to], v[at:to], top)
    for side in range(2):  # rows beyond the walls
        for k in range(2):
            to = (1 - k) * nx if side == 0 else (ny + 2 + k) * nx
            of = (2 + min(k, ny - 1)) * nx if side == 0 else (ny + 1 - min(k, ny - 1)) * nx
            for i in range(nx):
                h[to + i], e[to + i], u[to + i], v[to + i] = h[of + i], e[of + i], u[of + i], -v[of + i]
    # along rows
    hp, ep, up, vp = rest[:wide], rest[wide : 2 * wide], rest[2 * wide : 3 * wide], rest[3 * wide : 4 * wide]
    rest = rest[4 * wide :]
    sh, se, su, sv = rest[:wide], rest[wide : 2 * wide], rest[2 * wide : 3 * wide], rest[3 * wide : 4 * wide]
    rest = rest[4 * wide :]
    f = nx + 1
    f0, fl, fr, ft = rest[:f], rest[f : 2 * f], rest[2 * f : 3 * f], rest[3 * f : 4 * f]
    rest = rest[4 * f :]
    for j in range(ny):
        a, b, at = j * nx, (j + 1) * nx, (j + 2) * nx
        for i in range(nx):
            hp[i + 2], ep[i + 2], up[i + 2], vp[i + 2] = h[at + i], e[at + i], u[at + i], v[at + i]
        mirrored(hp, nx, 1.0)
        mirrored(ep, nx, 1.0)
        mirrored(up, nx, -1.0)
        mirrored(vp, nx, 1.0)
        for p, s in ((hp, sh), (ep, se), (up, su), (vp, sv)):
            half_slopes(limiter, p[: nx + 2], p[1 : nx + 3], p[2:], s[1 : nx + 3])
        m, n = nx + 2, nx + 3
        fluxes(g, hp[1:m], ep[1:m], up[1:m], vp[1:m], sh[1:m], se[1:m], su[1:m], sv[1:m],
               hp[2:n], ep[2:n], up[2:n], vp[2:n], sh[2:n], se[2:n], su[2:n], sv[2:n], f0, fl, fr, ft)  # fmt: skip
        settle_row(g, kx, hp[2:m], sh[2:m], se[2:m], f0, fl, fr, ft, rate_h[a:b], rate_x[a:b], rate_y[a:b])
    # across rows: slopes and faces of two rows at a time, in turn
    for j in range(-1, ny + 1):  # row of cells; its faces are those towards row j - 1
        at, now, before = (j + 2) * nx, (j + 1) % 2, j % 2
        s, o = rest[4 * nx * now : 4 * nx * (now + 1)], rest[4 * nx * before : 4 * nx * (before + 1)]
        q, r = rest[8 * nx + 4 * nx * now :], rest[8 * nx + 4 * nx * before :]
        for k in range(4):
            p = work[k * size : (k + 1) * size]
            half_slopes(limiter, p[at - nx : at], p[at : at + nx], p[at + nx : at + 2 * nx], s[k * nx : (k + 1) * nx])
        if j < 0:
            continue
        b, c, d = at - nx, at, at + nx
        fluxes(g, h[b:c], e[b:c], v[b:c], u[b:c], o[:nx], o[nx : 2 * nx], o[3 * nx : 4 * nx], o[2 * nx : 3 * nx],
               h[c:d], e[c:d], v[c:d], u[c:d], s[:nx], s[nx : 2 * nx], s[3 * nx : 4 * nx], s[2 * nx : 3 * nx],
               q[:nx], q[nx : 2 * nx], q[2 * nx : 3 * nx], q[3 * nx : 4 * nx])  # fmt: skip
        if j > 0:
            a, z = (j - 1) * nx, j * nx
            settle_column(
                g, ky, h[b:c], o[:nx], o[nx : 2 * nx], r[:nx], r[2 * nx : 3 * nx], r[3 * nx : 4 * nx],
                q[:nx], q[nx : 2 * nx], q[3 * nx : 4 * nx], rate_h[a:z], rate_y[a:z], rate_x[a:z],
            )  # fmt: skip
    for i in range(dh.size):
        rate_h[i] -= plan[2, i]
        rate_x[i] -= plan[3, i]
        rate_y[i] -= plan[4, i]
    most = 0.0
    for i in range(nx):
        most = max(most, top[i])
    return most
