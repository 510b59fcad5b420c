"""Diffusion and decay of scalars on a grid, added to rates.

s_t = div(D depth grad c) - decay (s - depth ambient), with c the value of a scalar, s = depth c its amount per area, D
the diffusivity [m2/s], decay [1/s] and ambient the value to which c decays.
"""

from fvsolve.basins.advection import THIN, stencil_values
from fvsolve.jit import inline, njit


@njit
def harmonic_mean(a, b):
    """Harmonic mean of two depths, or of the reciprocal sizes of two cells; 0 if both are 0."""
    return 2.0 * a * b / (a + b) if a + b > 0.0 else 0.0


@inline
def put_conductances(across, a, b, to):
    """Write conductances of a row of faces: `across` times the harmonic mean of the depths a and b on both sides.

    Empty arrays a and b stand for depth 1. to : the conductances
    """
    if a.size == 0:
        for i in range(to.size):
            to[i] = across
    else:
        for i in range(to.size):
            to[i] = across * harmonic_mean(max(a[i], 0.0), max(b[i], 0.0))


@inline
def add_row_diffusion(kx, ky, p, wx, south, ws, here, north, wn, depth, rate, top):
    """Add diffusion to the rates of a row of cells with values `here`.

    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]; depth : depths of the cells, empty for depth 1
    p : values of the row, with one beyond either end; south, north : values of the rows next to it
    wx, ws, wn : conductances of faces across x, and of the southern and northern faces
    top : greatest rate of each column so far [1/s], updated here
    """
    w, e, ww, we = p, p[2:], wx, wx[1:]
    for i in range(rate.size):
        x = kx[i] * (we[i] * (e[i] - here[i]) - ww[i] * (here[i] - w[i]))
        y = ky * (wn[i] * (north[i] - here[i]) - ws[i] * (here[i] - south[i]))
        rate[i] += x + y
        quick = kx[i] * (ww[i] + we[i]) + ky * (ws[i] + wn[i])
        quick = quick / max(depth[i], THIN) if depth.size > 0 else quick
        top[i] = quick if quick > top[i] else top[i]


def diffusion_work(nx, ny):
    """Length of the work array of `grid_diffusion`."""
    return nx * ny + 8 * nx + 3


@njit
def grid_diffusion(nx, ny, begin, stop, kx, ky, diffusivity, factor, flow_x, flow_y, depth, outside, s, work, rate):
    """Add the rates of diffusion to rows `begin` to `stop` - 1 of a grid; return the greatest rate of a cell [1/s].

    Inside a grid of equal cells of equal depth this rate is 2 D (kx^2 + ky^2). The boundary has no flux, except where
    `factor` times a given velocity (without depths) enters: there the value on the face is `outside`. With depths there
    is no such exception, because the flow of water may change its sign at the boundary, and the flux would jump.

    diffusivity : D [m2/s]; work : float64[diffusion_work(nx, ny)]; other arguments as for `advection.grid_advection`
    """
    c, rest = s, work[nx * ny :]
    if depth.size > 0:
        stencil_values(nx, ny, begin, stop, s, depth, work)
        c = work[: nx * ny]
    p, wx, rest = rest[: nx + 2], rest[nx + 2 : 2 * nx + 3], rest[2 * nx + 3 :]
    rows, beyond, top = rest[: 2 * nx], rest[2 * nx : 4 * nx], rest[4 * nx : 5 * nx]
    below, above, most = beyond[:nx], beyond[nx:], 0.0
    inflow_factor = 2.0 * diffusivity if depth.size == 0 else 0.0
    for i in range(nx):
        below[i], rows[i] = outside[2 * ny + i], ky[0] * inflow_factor if factor * flow_y[i] > 0.0 else 0.0
        above[i], top[i] = outside[2 * ny + nx + i], 0.0
    for j in range(max(begin - 1, 0), stop):
        a, z, f = j * nx, (j + 1) * nx, j * (nx + 1)
        h, hn = depth[a:], depth[z:]
        inner_p, row, inner_w = p[1:], c[a:], wx[1:nx]
        for i in range(nx):
            inner_p[i] = row[i]
        p[0], p[nx + 1] = outside[j], outside[ny + j]
        put_conductances(1.0, h, h[1:], inner_w)
        for i in range(nx - 1):
            inner_w[i] *= diffusivity * harmonic_mean(kx[i], kx[i + 1])
        wx[0] = kx[0] * inflow_factor if factor * flow_x[f] > 0.0 else 0.0
        wx[nx] = kx[nx - 1] * inflow_factor if factor * flow_x[f + nx] < 0.0 else 0.0
        ws, wn = rows[(j % 2) * nx :], rows[((j + 1) % 2) * nx : ((j + 1) % 2 + 1) * nx]
        south, north = c[a - nx : a] if j > 0 else below, c[z : z + nx] if j < ny - 1 else above
        if j < ny - 1:
            put_conductances(diffusivity * harmonic_mean(ky[j], ky[j + 1]), h, hn, wn)
        else:
            for i in range(nx):
                wn[i] = ky[j] * inflow_factor if factor * flow_y[z + i] < 0.0 else 0.0
        if j >= begin:
            add_row_diffusion(kx, ky[j], p, wx, south, ws, row, north, wn, h, rate[a:z], top)
    for i in range(nx):
        most = max(most, top[i])
    return most


@njit
def add_decay(decay, ambient, depth, s, rate):
    """Add the decay of the amounts s per area towards an ambient value to their rates.

    decay : decay rate [1/s]; ambient : value of the scalar to which it decays
    depth : depths of the cells, empty for depth 1
    """
    for i in range(s.size):
        rate[i] -= decay * (s[i] - (depth[i] if depth.size > 0 else 1.0) * ambient)
