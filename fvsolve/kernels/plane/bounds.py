"""Excess fluxes cut so that an Euler step keeps values within bounds (Zalesak 1979). Knows cells and faces of a grid.

What upwind leaves is within the bounds; of what its excesses would add, each cell takes no more than there is room for.
"""

from fvsolve.jit import njit


@njit
def share(room, need):
    """How much of a need there is room for, at most all of it."""
    part = max(room, 0.0) / need if need > 0.0 else 1.0
    return part if part < 1.0 else 1.0


@njit
def put_shares(nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, step, s, rate, ax, ay, up, down):
    """For every cell the shares of its rises and falls by excesses that a step of Euler leaves room for."""
    for j in range(ny):
        for i in range(nx):
            k, w, n = j * nx + i, j * (nx + 1) + i, (j + 1) * nx + i
            scale = step * factor * kx[i] * ky[j]
            depth_then = (depth[k] if depth.size > 0 else 1.0) - scale * (
                (flow_x[w + 1] - flow_x[w]) + (flow_y[n] - flow_y[k])
            )
            then = s[k] + step * rate[k]
            a, b, c, d = scale * ax[w], -scale * ax[w + 1], scale * ay[k], -scale * ay[n]
            rise = (max(a, 0.0) + max(b, 0.0)) + (max(c, 0.0) + max(d, 0.0))
            fall = (max(-a, 0.0) + max(-b, 0.0)) + (max(-c, 0.0) + max(-d, 0.0))
            up[k] = share(most * depth_then - then, rise)
            down[k] = share(then - least * depth_then, fall)


@njit
def cut(forward, before_up, before_down, after_up, after_down):
    """The share of an excess that the cells before and after its face allow."""
    return min(before_down, after_up) if forward else min(before_up, after_down)


@njit
def bound(nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, step, s, rate, ax, ay, work):
    """Cut the excesses ax, ay so that s + step times the rates with them lies between least and most.

    rate : float64[n]  of upwind; work : float64[2 n]
    """
    up, down = work[: nx * ny], work[nx * ny : 2 * nx * ny]
    put_shares(nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, step, s, rate, ax, ay, up, down)
    for j in range(ny):
        for i in range(nx + 1):
            e, f = j * nx + min(i, nx - 1), j * (nx + 1) + i
            w = j * nx + max(i - 1, 0)
            ax[f] *= cut(
                factor * ax[f] > 0.0,
                up[w] if i > 0 else 1.0, down[w] if i > 0 else 1.0,
                up[e] if i < nx else 1.0, down[e] if i < nx else 1.0,
            )  # fmt: skip
    for j in range(ny + 1):
        for i in range(nx):
            n, f = min(j, ny - 1) * nx + i, j * nx + i
            s_ = max(j - 1, 0) * nx + i
            ay[f] *= cut(
                factor * ay[f] > 0.0,
                up[s_] if j > 0 else 1.0, down[s_] if j > 0 else 1.0,
                up[n] if j < ny else 1.0, down[n] if j < ny else 1.0,
            )  # fmt: skip
