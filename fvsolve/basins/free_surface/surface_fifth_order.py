"""Fifth-order values of shallow water at faces, where the water is deep enough.

Depth h, surface e and unit flows are reconstructed from cell means; velocities are unit flows over depth. The integral
of h de/dx over a cell is exact for cubics: that of the parabolas through both face values and the mean, plus the
products of third differences with second differences.
"""

from math import sqrt

from fvsolve.basins.free_surface.surface_rows import EAST, FLOW_EAST, HIGH, NORTH, PUSH, STRIDE, SURFACE, THIN, WAVE
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import WENO5
from fvsolve.kernels.reconstruction import value_weno5

SMALL = 1e-20  # squares of differences below which WENO's weights are its linear weights [m2, m4/s2]
LEAST_DEPTH_RATIO = 0.5  # shallowest of five depths over the deepest, below which values are limited


@njit
def value_upwind5(a, b, c, d, e):
    """Fifth-order upwind value at the face between c and d, from the averages a to e of five consecutive cells."""
    return ((2.0 * a - 13.0 * b) + (47.0 * c + 27.0 * d) - 3.0 * e) / 60.0


@njit
def put_smooth_flags(p, q, r, s, t, deep):
    """Set `deep` to 1 where the least of five depths exceeds LEAST_DEPTH_RATIO times the greatest, else to 0.

    p, q, r, s, t : depths in five consecutive cells
    """
    for i in range(deep.size):
        least = min(min(min(p[i], q[i]), min(s[i], t[i])), r[i])
        most = max(max(max(p[i], q[i]), max(s[i], t[i])), r[i])
        deep[i] = 1.0 if least > LEAST_DEPTH_RATIO * most else 0.0


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
def put_velocities(g, deep, side):
    """Convert unit flows at faces to velocities where `deep` is 1, and write wave speeds at all faces, in place.

    side : rows of depth, surface, unit flows and wave speed at the faces, each STRIDE after the row before
    """
    for i in range(deep.size):
        depth = max(side[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet) if deep[i] > 0.0 else 1.0
        side[i + EAST], side[i + NORTH], side[i + WAVE] = part * side[i + EAST], part * side[i + NORTH], sqrt(g * depth)


@njit
def put_push(h, deep, hl, hr, el, er, ph, qh, sh, th, pe, qe, re, se, te, push):
    """Write the integrals of h de/dx (depth h, surface e) over the cells where `deep` is 1 to `push` [m2].

    h, re : mean depth and surface of a cell; hl, hr, el, er : depth and surface at the faces before and after it
    ph, qh, sh, th : mean depths two cells before, one before, one after and two after; pe, qe, se, te : surfaces there
    """
    for i in range(push.size):
        h2, e2 = 3.0 * ((hl[i] + hr[i]) - 2.0 * h[i]), 3.0 * ((el[i] + er[i]) - 2.0 * re[i])
        h3, e3 = 0.5 * ((th[i] - ph[i]) - 2.0 * (sh[i] - qh[i])), 0.5 * ((te[i] - pe[i]) - 2.0 * (se[i] - qe[i]))
        integral = h[i] * (er[i] - el[i]) + (hr[i] - hl[i]) * e2 / 6.0 + (h2 * e3 - e2 * h3) / 360.0
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
    for f in range(4):
        at = f * STRIDE
        o = at if at < EAST else at - EAST + FLOW_EAST
        put_fifth(scheme, p[o:], q[o:], r[o:], s[o:], t[o:], deep, low[at:], high[at:])
    e = SURFACE
    put_push(
        r, deep, low, high, low[e:], high[e:], p, q, s, t, p[e:], q[e:], r[e:], s[e:], t[e:],
        sides[PUSH : PUSH + deep.size],
    )  # fmt: skip
    put_velocities(g, deep, low)
    put_velocities(g, deep, high)
