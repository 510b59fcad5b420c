"""Advection of values over a grid, of second or first order.

F is the flow through a face [m2/s], q the value at the face, c the value of the cell; kx and ky are 1 / width and
1 / height of the cell [1/m]. The rate of a cell is kx ky times the sum of F (q - c) over its faces, F inward, minus c
times the divergence of F. So the rate of a uniform value is minus the value times the divergence, to the last bit. The
slope of an upwind cell uses the differences across the face and across the opposite face of that cell.

Arguments: factor : factor on all flows; b, c, d, e : values of four cells in line, faces are between c and d.
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import UPWIND
from fvsolve.kernels.reconstruction import by_limiter, limited, slope


@njit
def limited_value(limiter, forward, b, c, d, e):
    """Value at the face between cells c and d, with a limited slope, from c if the flow is forward, else from d.

    b, c, d, e : values of four cells in line
    """
    half = 0.5 * slope(limiter, c - b if forward else e - d, d - c)
    return c + half if forward else d - half


@inline
def put_face_values_limited(limiter, factor, flow, b, c, d, e, q):
    """Write the values q at faces between cells c and d as `put_face_values` does, with a limiter function."""
    for i in range(q.size):
        q[i] = limited_value(limiter, factor * flow[i] > 0.0, b[i], c[i], d[i], e[i])


@njit
def cell_rate(scale, own, fw, fe, fs, fn, qw, qe, qs, qn):
    """Rate of a cell from the flows f and values q at its four faces: w, e, s, n for west, east, south, north.

    scale : 1 / area of the cell, times the factor on flows; own : value of the cell
    """
    x = fw * (qw - own) - fe * (qe - own)
    y = fs * (qs - own) - fn * (qn - own)
    return scale * ((x + y) - own * ((fe - fw) + (fn - fs)))


@inline
def put_face_values(scheme, limiter, factor, flow, b, c, d, e, q):
    """Write the values q at faces between cells c and d, from the upwind side of factor times flow.

    scheme : UPWIND, else with slopes by the limiter; b, c, d, e : values of four cells in line
    """
    if scheme == UPWIND:
        for i in range(q.size):
            low, high = c[i], d[i]  # read both first, so that the choice compiles without a branch
            q[i] = low if factor * flow[i] > 0.0 else high
    else:
        by_limiter(put_face_values_limited, limiter, factor, flow, b, c, d, e, q)


@njit
def single_face_value(scheme, limiter, forward, b, c, d, e):
    """Value at a single face between cells c and d, from c if the flow is forward, else from d.

    scheme : UPWIND, else with a slope by the limiter; b, c, d, e : values of four cells in line
    """
    if scheme == UPWIND:
        return c if forward else d
    half = 0.5 * limited(limiter, c - b if forward else e - d, d - c)
    return c + half if forward else d - half


@inline
def row_values(scheme, limiter, nx, factor, flow, c, west, east, q):
    """Write the values q at the nx + 1 faces of a row of cells c; west and east are the values outside.

    flow : flows through these faces; other arguments as for `put_face_values`
    The loop continues into the next row, where there is one, so that it fills whole vectors.
    """
    if nx > 3:
        put_face_values(scheme, limiter, factor, flow[2:], c, c[1:], c[2:], c[3:], q[2 : min(c.size, nx + 3) - 1])
    before = west if factor * flow[0] > 0.0 else c[0]
    after = east if factor * flow[nx] < 0.0 else c[nx - 1]
    q[0], q[nx] = before, after
    if nx > 1:
        e = c[2] if nx > 2 else 2.0 * after - c[1]
        q[1] = single_face_value(scheme, limiter, factor * flow[1] > 0.0, 2.0 * before - c[0], c[0], c[1], e)
    if nx > 2:
        e = 2.0 * after - c[nx - 1]
        q[nx - 1] = single_face_value(scheme, limiter, factor * flow[nx - 1] > 0.0, c[nx - 3], c[nx - 2], c[nx - 1], e)


@inline
def north_values_and_rates_limited(limiter, factor, ky, b, c, d, e, fx, qx, fs, qs, fn, kx, qn, rate):
    """Write values and rates as `north_values_and_rates` does, with a limiter function."""
    fe, qe = fx[1:], qx[1:]
    for i in range(rate.size):
        q = limited_value(limiter, factor * fn[i] > 0.0, b[i], c[i], d[i], e[i])
        qn[i] = q
        rate[i] = cell_rate(factor * (kx[i] * ky), c[i], fx[i], fe[i], fs[i], fn[i], qx[i], qe[i], qs[i], q)


@inline
def north_values_and_rates(scheme, limiter, factor, ky, b, c, d, e, fx, qx, fs, qs, fn, kx, qn, rate):
    """Write the values qn at the northern faces of a row of cells c, and the rates of the row.

    b, c, d, e : values of the row before, of this row, and of one and two rows after it
    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]; scheme, limiter, factor : as for `put_face_values`
    fx, fs, fn : flows through the faces along the row, the southern and the northern faces
    qx, qs : values at the faces along the row and at the southern faces
    """
    if scheme == UPWIND:
        fe, qe = fx[1:], qx[1:]
        for i in range(rate.size):
            low, high = c[i], d[i]
            q = low if factor * fn[i] > 0.0 else high
            qn[i] = q
            rate[i] = cell_rate(factor * (kx[i] * ky), c[i], fx[i], fe[i], fs[i], fn[i], qx[i], qe[i], qs[i], q)
    else:
        by_limiter(north_values_and_rates_limited, limiter, factor, ky, b, c, d, e, fx, qx, fs, qs, fn, kx, qn, rate)


def second_order_work(nx, ny):
    """Length of the work array of `second_order_rates`."""
    return 7 * nx + 4


@njit
def second_order_rates(
    scheme, limiter, nx, ny, begin, until, stop, fresh, kx, ky, factor, flow_x, flow_y, outside, c, work, rate
):  # fmt: skip
    """Write the rates of rows `begin` to `until` - 1 of cell values c, by upwind or muscl, for flows times `factor`.

    fresh : False if the last call ended at `begin` with the same work array, whose results are then used again
    stop : first row after those of all calls; other arguments as for `advection.grid_advection`
    If fresh, the rates of row `begin` - 1 are overwritten with wrong values.
    """
    below, above, north = work[:nx], work[nx : 2 * nx], work[2 * nx : 3 * nx]
    rows, rest = work[3 * nx : 5 * nx], work[5 * nx :]
    last = (ny - 1) * nx
    for i in range(nx if fresh else 0):
        rows[i] = outside[2 * ny + i] if factor * flow_y[i] > 0.0 else c[i]
        north[i] = outside[2 * ny + nx + i] if factor * flow_y[last + nx + i] < 0.0 else c[last + i]
        below[i], above[i] = 2.0 * rows[i] - c[i], 2.0 * north[i] - c[last + i]
    first = max(begin - 1, 0) if fresh else begin  # only for values at its northern faces; its rate may be wrong
    for j in range(first - 1 if fresh else begin, until):  # values along a row are computed one row ahead
        if j < stop - 1:
            k = j + 1
            fx, qx = flow_x[k * (nx + 1) :], rest[(k % 2) * (nx + 2) :]
            row_values(scheme, limiter, nx, factor, fx, c[k * nx :], outside[k], outside[ny + k], qx)
        if j >= first:
            a, z = j * nx, (j + 1) * nx
            b = c[a - nx : a] if j > 0 else below
            d = c[z : z + nx] if j < ny - 1 else north
            e = c[z + nx : z + 2 * nx] if j < ny - 2 else above if j < ny - 1 else north
            fx, qx = flow_x[j * (nx + 1) :], rest[(j % 2) * (nx + 2) :]
            qs, qn = rows[(j % 2) * nx :], rows[((j + 1) % 2) * nx :]
            fs, fn = flow_y[a:], flow_y[z:]
            north_values_and_rates(
                scheme, limiter, factor, ky[j], b, c[a:], d, e, fx, qx, fs, qs, fn, kx, qn, rate[a:z]
            )
