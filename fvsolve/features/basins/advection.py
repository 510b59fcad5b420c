"""Advection and diffusion of scalars over a grid of rectangles by given flows, of first and second order; decay.

s_t + div(F c) = div(D depth grad c) - decay (s - depth ambient), with c the value of a scalar, s = depth c its amount
per area, F the flow per width [m2/s], D the diffusivity [m2/s], decay [1/s] and ambient the value to which c decays.

The rate of a cell by advection is kx ky times the sum of F (q - c) over its faces, F inward and q the value at the
face, minus c times the divergence of F. So the rate of a uniform c is minus c times the divergence, to the last bit.
The slope of an upwind cell uses the differences across the face and across the opposite face of that cell.

The Courant number is the step times the greatest rate of `put_row_rates`. In flows without divergence, Euler steps keep
every value within the range of its neighbours up to these Courant numbers: upwind 1; muscl 1/2, next to an inlet 1/3;
muscl with minmod 2/3, next to an inlet 1/2. Up to 1/2, weno5 keeps all values between `least` and `most`; upwind5 has
no bounds (`fifth_order`). SSP methods keep these bounds up to their SSP coefficient times these numbers.

Arguments of all functions
    scheme, limiter : MUSCL with the limiter, else UPWIND; nx, ny : numbers of columns and rows
    depth : float64[nx ny]  depths of cells [m]; empty for depth 1, with s = c
    s, c, rate : float64[nx ny]  amounts per area, values, and rates of the amounts; work : float64[:]  scratch
    b, c, d, e : values of four cells in line, or of rows of cells; faces are between c and d
    face_value, limiter : of the functions that `by_scheme` calls: functions of values at faces, and of slopes
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import MUSCL, UPWIND
from fvsolve.core.kernels.reconstruction import by_limiter, minmod, slope
from fvsolve.jit import inline, njit

# least depth in rates, which limit the step: flows through thinner films are far below those of waves [m]
THIN = 1e-6
# depth below which values fade to zero [m]: there the rounding of amounts and depths decides them
DRY = 1e-14


class AdvectionGrid(NamedTuple):
    """Grid of nx columns and ny rows, of which the rows `begin` to `stop` - 1 are computed.

    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]
    """

    nx: int
    ny: int
    begin: int
    stop: int
    kx: np.ndarray
    ky: np.ndarray


class GridFlows(NamedTuple):
    """Flows through the faces of a grid, all times `factor`, which may have either sign.

    x : float64[ny (nx + 1)], y : float64[(ny + 1) nx]  flows along x and y, row by row: velocity [m/s] times depth, in
    [m2/s], or without the depth [m/s] if the array of depths is empty
    outside : float64[2 (nx + ny)]  values of the inflow at boundary faces: west (ny), east (ny), south (nx), north (nx)
    """

    factor: float
    x: np.ndarray
    y: np.ndarray
    outside: np.ndarray


@njit
def put_values(s, depth, c):
    """Write the values c = s / depth of cells, with a depth of at least DRY."""
    for i in range(c.size):
        c[i] = s[i] / max(depth[i], DRY)


@njit
def stencil_values(grid, s, depth, c):
    """Write the values c = s / depth of the cells of the rows of a grid, and of three rows on either side."""
    a, z = grid.nx * max(grid.begin - 3, 0), grid.nx * min(grid.stop + 3, grid.ny)
    put_values(s[a:z], depth[a:z], c[a:z])


@inline
def put_row_rates(factor, kx, ky, flows, depth, rates):
    """Write the rates |u| kx + |v| ky of the cells of a row of a grid [1/s].

    u, v : velocities along x and y [m/s], each from the greater flow through two opposite faces of the cell
    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]
    flows : through the western, eastern, southern and northern faces
    """
    fw, fe, fs, fn = flows
    for i in range(rates.size):
        rate = kx[i] * ky * (max(abs(fw[i]), abs(fe[i])) + max(abs(fs[i]), abs(fn[i])))
        rates[i] = abs(factor) * rate / max(depth[i], THIN)


def second_order_work(nx, ny):
    """Length of the work array of `second_order_rates`."""
    return 7 * nx + 4


def advection_work(nx, ny):
    """Length of the work array of `grid_advection`."""
    return nx * ny + second_order_work(nx, ny)


@njit
def grid_advection(scheme, limiter, grid, flows, depth, s, work, rate):
    """Write the rates of change of the amounts `s` of a scalar by advection, with muscl or (any other scheme) upwind.

    Two rows on either side of the rows of the grid are read too, and the rates of the row before them may be
    overwritten with wrong values. work : float64[advection_work(nx, ny)]
    """
    n, c = grid.nx * grid.ny, s
    if depth.size > 0:
        stencil_values(grid, s, depth, work)
        c = work[:n]
    first = scheme if scheme == MUSCL else UPWIND
    second_order_rates(first, limiter, grid, grid.begin, grid.stop, flows, c, work[n:], rate)


@njit
def limited_value(limiter, forward, b, c, d, e):
    """Value at the face between cells c and d, with a limited slope, from c if the flow is forward, else from d."""
    half = 0.5 * slope(limiter, c - b if forward else e - d, d - c)
    return c + half if forward else d - half


@njit
def upwind_value(limiter, forward, b, c, d, e):
    """Value at the face between cells c and d: c if the flow is forward, else d."""
    return c if forward else d


@inline
def by_scheme(work, scheme, limiter, *given):
    """Call `work` with a limiter function and the function of values at faces of a scheme; see `by_limiter`.

    given : further arguments of `work`
    """
    if scheme == UPWIND:
        return work(minmod, upwind_value, *given)
    return by_limiter(work, limiter, limited_value, *given)


@njit
def cell_rate(scale, own, fw, fe, fs, fn, qw, qe, qs, qn):
    """Rate of a cell from the flows f and values q at its four faces: w, e, s, n for west, east, south, north.

    scale : 1 / area of the cell, times the factor on flows; own : value of the cell
    """
    x = fw * (qw - own) - fe * (qe - own)
    y = fs * (qs - own) - fn * (qn - own)
    return scale * ((x + y) - own * ((fe - fw) + (fn - fs)))


@inline
def put_face_values(limiter, face_value, factor, flow, b, c, d, e, q):
    """Write the values q at faces between cells c and d, from the upwind side of factor times flow."""
    for i in range(q.size):
        q[i] = face_value(limiter, factor * flow[i] > 0.0, b[i], c[i], d[i], e[i])


@njit
def single_face_value(limiter, face_value, forward, b, c, d, e):
    """Value at a single face between cells c and d, from c if the flow is forward, else from d."""
    return face_value(limiter, forward, b, c, d, e)


@inline
def row_values(scheme, limiter, nx, factor, flow, c, west, east, q):
    """Write the values q at the nx + 1 faces of a row of cells c; west and east are the values outside.

    flow : flows through these faces
    The loop continues into the next row, where there is one, so that it fills whole vectors.
    """
    if nx > 3:
        inner = q[2 : min(c.size, nx + 3) - 1]
        by_scheme(put_face_values, scheme, limiter, factor, flow[2:], c, c[1:], c[2:], c[3:], inner)
    before = west if factor * flow[0] > 0.0 else c[0]
    after = east if factor * flow[nx] < 0.0 else c[nx - 1]
    q[0], q[nx] = before, after
    if nx > 1:
        e = c[2] if nx > 2 else 2.0 * after - c[1]
        cells = 2.0 * before - c[0], c[0], c[1], e
        q[1] = by_scheme(single_face_value, scheme, limiter, factor * flow[1] > 0.0, *cells)
    if nx > 2:
        cells = c[nx - 3], c[nx - 2], c[nx - 1], 2.0 * after - c[nx - 1]
        q[nx - 1] = by_scheme(
            single_face_value, scheme, limiter, factor * flow[nx - 1] > 0.0, *cells
        )


@inline
def north_values_and_rates(limiter, face_value, factor, kx, ky, cells, flows, values, rate):
    """Write the values at the northern faces of a row of cells, and the rates of the row.

    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]
    cells : values of the row before, of this row, and of one and two rows after it
    flows, values : flows and values at the faces along the row, at the southern and at the northern faces
    """
    (b, c, d, e), (fx, fs, fn), (qx, qs, qn) = cells, flows, values
    fe, qe = fx[1:], qx[1:]
    for i in range(rate.size):
        q = face_value(limiter, factor * fn[i] > 0.0, b[i], c[i], d[i], e[i])
        qn[i] = q
        rate[i] = cell_rate(
            factor * (kx[i] * ky), c[i], fx[i], fe[i], fs[i], fn[i], qx[i], qe[i], qs[i], q
        )


@njit
def second_order_rates(scheme, limiter, grid, begin, until, flows, c, work, rate):
    """Write the rates of rows `begin` to `until` - 1 of cell values c; work : float64[second_order_work(nx, ny)].

    Calls for the rows of the grid, from `grid.begin` to `grid.stop` - 1, may follow one another: each begins where the
    last one ended, with the same work array, whose results are then used again. The first call overwrites the rates of
    the row before with wrong values.
    """
    nx, ny, _, stop, kx, ky = grid
    factor, flow_x, flow_y, outside = flows
    fresh = begin == grid.begin
    below = work[:nx]
    above = work[nx : 2 * nx]
    north = work[2 * nx : 3 * nx]
    rows, rest = work[3 * nx : 5 * nx], work[5 * nx :]
    last = (ny - 1) * nx
    for i in range(nx if fresh else 0):
        rows[i] = outside[2 * ny + i] if factor * flow_y[i] > 0.0 else c[i]
        north[i] = outside[2 * ny + nx + i] if factor * flow_y[last + nx + i] < 0.0 else c[last + i]
        below[i], above[i] = 2.0 * rows[i] - c[i], 2.0 * north[i] - c[last + i]
    # only for values at its northern faces; its rate may be wrong
    first = max(begin - 1, 0) if fresh else begin
    # values along a row are computed one row ahead
    for j in range(first - 1 if fresh else begin, until):
        if j < stop - 1:
            k = j + 1
            fx, qx = flow_x[k * (nx + 1) :], rest[(k % 2) * (nx + 2) :]
            row_values(
                scheme, limiter, nx, factor, fx, c[k * nx :], outside[k], outside[ny + k], qx
            )
        if j >= first:
            a, z = j * nx, (j + 1) * nx
            b = c[a - nx : a] if j > 0 else below
            d = c[z : z + nx] if j < ny - 1 else north
            e = c[z + nx : z + 2 * nx] if j < ny - 2 else above if j < ny - 1 else north
            fx, qx = flow_x[j * (nx + 1) :], rest[(j % 2) * (nx + 2) :]
            qs, qn = rows[(j % 2) * nx :], rows[((j + 1) % 2) * nx :]
            cells = (b, c[a:], d, e)
            around = (fx, flow_y[a:], flow_y[z:])
            values = (qx, qs, qn)
            row = rate[a:z]
            by_scheme(
                north_values_and_rates,
                scheme,
                limiter,
                factor,
                kx,
                ky[j],
                cells,
                around,
                values,
                row,
            )


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

    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]
    p : values of the row, with one beyond either end; south, north : values of the rows next to it
    wx, ws, wn : conductances of faces across x, and of the southern and northern faces
    top : greatest rate of each column so far [1/s], updated here
    """
    w = p
    e = p[2:]
    ww = wx
    we = wx[1:]
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
def grid_diffusion(grid, diffusivity, flows, depth, s, work, rate):
    """Add the rates of diffusion to the rows of a grid; return the greatest rate of a cell [1/s].

    Inside a grid of equal cells of equal depth this rate is 2 D (kx^2 + ky^2). The boundary has no flux, except where
    `factor` times a given velocity (without depths) enters: there the value on the face is `outside`. With depths there
    is no such exception, because the flow of water may change its sign at the boundary, and the flux would jump.
    diffusivity : D [m2/s]; work : float64[diffusion_work(nx, ny)]
    """
    nx, ny, begin, stop, kx, ky = grid
    factor, flow_x, flow_y, outside = flows
    c, rest = s, work[nx * ny :]
    if depth.size > 0:
        stencil_values(grid, s, depth, work)
        c = work[: nx * ny]
    p = rest[: nx + 2]
    wx = rest[nx + 2 : 2 * nx + 3]
    rest = rest[2 * nx + 3 :]
    rows = rest[: 2 * nx]
    beyond = rest[2 * nx : 4 * nx]
    top = rest[4 * nx : 5 * nx]
    below = beyond[:nx]
    above = beyond[nx:]
    most = 0.0
    inflow_factor = 2.0 * diffusivity if depth.size == 0 else 0.0
    for i in range(nx):
        below[i], rows[i] = (
            outside[2 * ny + i],
            ky[0] * inflow_factor if factor * flow_y[i] > 0.0 else 0.0,
        )
        above[i], top[i] = outside[2 * ny + nx + i], 0.0
    for j in range(max(begin - 1, 0), stop):
        a = j * nx
        z = (j + 1) * nx
        f = j * (nx + 1)
        h, hn = depth[a:], depth[z:]
        inner_p = p[1:]
        row = c[a:]
        inner_w = wx[1:nx]
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
    """
    for i in range(s.size):
        rate[i] -= decay * (s[i] - (depth[i] if depth.size > 0 else 1.0) * ambient)
