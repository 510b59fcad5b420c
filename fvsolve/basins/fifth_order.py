"""Fifth-order advection over a grid, as the difference from upwind rates.

Values at faces are linear (upwind5) or WENO-Z (Borges et al. 2008), written in differences, so that a uniform value
stays uniform. The mean of a product over a face is the product of the means plus two terms. These are 1/12 and 1/180 of
the products of the first and of the second Legendre coefficients along the face. The flux through a face minus the
upwind flux is an excess, which `limit_excesses` may reduce. Arguments as for `advection.grid_advection`; c : values of
cells.
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import WENO5

SMALL = 1e-30  # prevents a division by zero between squares of differences
GHOSTS = 3
LEAST_CELLS = 5  # with fewer cells, values beyond a side are those of its last cells


@njit
def ghost_means(known, o, a, b, c, d, e):
    """(mean of the nearest ghost cell, of the next ghost cell) beyond a side of the grid, by a polynomial of degree 4.

    a, b, c, d, e : means of the five cells inside that determine the polynomial, the nearest first
    known : True if o, the value at the side, is used in place of e
    """
    p, q, r, s = a - b, b - c, c - d, d - e
    if known:
        nearest = (60.0 * (o - a) - 29.0 * p + 14.0 * q - 3.0 * r) / 12.0
        return a + nearest, a + (300.0 * (o - a) - 217.0 * p + 118.0 * q - 27.0 * r) / 12.0
    return a + (4.0 * p - 6.0 * q + 4.0 * r - s), a + (14.0 * p - 26.0 * q + 19.0 * r - 5.0 * s)


@njit
def face_difference_linear(p, q, r, s):
    """Value at the face after a cell minus the mean of the cell, by the linear scheme of fifth order (upwind5).

    p, q, r, s : successive differences of five cells in line, in the direction of the flow; the cell is the third
    """
    return (24.0 * r + 11.0 * q - 2.0 * p - 3.0 * s) / 60.0


@njit
def face_difference_weno(p, q, r, s):
    """Value at the face after a cell minus the mean of the cell, by WENO-Z with a common denominator of all weights.

    p, q, r, s : successive differences of five cells in line, in the direction of the flow; the cell is the third
    """
    b0 = 13.0 / 12.0 * (q - p) ** 2 + 0.25 * (3.0 * q - p) ** 2 + SMALL
    b1 = 13.0 / 12.0 * (r - q) ** 2 + 0.25 * (r + q) ** 2 + SMALL
    b2 = 13.0 / 12.0 * (s - r) ** 2 + 0.25 * (s - 3.0 * r) ** 2 + SMALL
    t, b0, b1, b2 = (b0 - b2) ** 2, b0 * b0, b1 * b1, b2 * b2
    w0, w1, w2 = 0.1 * (b0 + t) * (b1 * b2), 0.6 * (b1 + t) * (b0 * b2), 0.3 * (b2 + t) * (b0 * b1)
    return (w0 * (5.0 * q - 2.0 * p) + w1 * (q + 2.0 * r) + w2 * (4.0 * r - s)) / (6.0 * (w0 + w1 + w2))


@njit
def face_excesses(scheme, factor, flow, a, b, c, d, e, g, q, excess):
    """Write the values q at faces between cells c and d, and the flux minus the upwind flux through them to `excess`.

    A flux is the flow times the value, without `factor`; the sign of factor times flow gives the direction of the flow.
    scheme : WENO5 or LINEAR (upwind5); flow : flows through the faces
    a, b, c, d, e, g : means of six cells in line, three on either side of each face
    """
    if scheme == WENO5:
        for i in range(q.size):
            forward = factor * flow[i] > 0.0
            p, s = b[i] - a[i], g[i] - e[i]
            m, r, n = c[i] - b[i], d[i] - c[i], e[i] - d[i]
            difference = face_difference_weno(p if forward else s, m if forward else n, r, n if forward else m)
            q[i] = c[i] + difference if forward else d[i] - difference
            excess[i] = flow[i] * (difference if forward else -difference)
    else:
        for i in range(q.size):
            forward = factor * flow[i] > 0.0
            p, s = b[i] - a[i], g[i] - e[i]
            m, r, n = c[i] - b[i], d[i] - c[i], e[i] - d[i]
            difference = face_difference_linear(p if forward else s, m if forward else n, r, n if forward else m)
            q[i] = c[i] + difference if forward else d[i] - difference
            excess[i] = flow[i] * (difference if forward else -difference)


@njit
def pad_sides(nx, ny, factor, flow_x, flow_y, outside, c, v):
    """Copy the cell means c to v, and write three ghost cells beyond each side of the grid.

    The two nearest ghost cells are those of `ghost_values`; the third is equal to the second.
    v : float64[ny + 6, nx + 6] as one array; other arguments as for `advection.grid_advection`
    """
    wide = nx + 2 * GHOSTS
    for j in range(ny):
        to, fx = v[(j + GHOSTS) * wide :], flow_x[j * (nx + 1) :]
        inner, row = to[GHOSTS:], c[j * nx :]
        for i in range(nx):
            inner[i] = row[i]
        to[2], to[1] = ghost_values(nx, factor * fx[0] > 0.0, outside[j], to, GHOSTS, 1)
        to[nx + 3], to[nx + 4] = ghost_values(nx, factor * fx[nx] < 0.0, outside[ny + j], to, nx + 2, -1)
        to[0], to[nx + 5] = to[1], to[nx + 4]
    south, north, last = outside[2 * ny :], outside[2 * ny + nx :], ny * nx
    for i in range(nx):
        at, end = GHOSTS * wide + GHOSTS + i, (ny + 2) * wide + GHOSTS + i
        low, lower = ghost_values(ny, factor * flow_y[i] > 0.0, south[i], v, at, wide)
        high, higher = ghost_values(ny, factor * flow_y[last + i] < 0.0, north[i], v, end, -wide)
        v[at - wide], v[at - 2 * wide], v[at - 3 * wide] = low, lower, lower
        v[end + wide], v[end + 2 * wide], v[end + 3 * wide] = high, higher, higher


@njit
def ghost_values(n, known, o, v, at, step):
    """(mean of the nearest ghost cell, of the next ghost cell) beyond a side, from the cells v[at], v[at + step], ...

    n : number of cells in line; with fewer than LEAST_CELLS, both means are the value o, or the nearest cell if not
    `known`; with more they are those of `ghost_means`
    known, o : as for `ghost_means`
    """
    if n < LEAST_CELLS:
        return (o, o) if known else (v[at], v[at])
    return ghost_means(known, o, v[at], v[at + step], v[at + 2 * step], v[at + 3 * step], v[at + 4 * step])


@inline
def add_products(fa, fb, fc, fd, fe, qa, qb, qc, qd, qe, excess):
    """Add the mean of products f q over faces, minus the product of the means of f and q, to `excess`.

    fa .. fe, qa .. qe : flows and values at five faces in line along the side; c is the face itself
    """
    for i in range(excess.size):
        f1 = (82.0 * (fd[i] - fb[i]) - 11.0 * (fe[i] - fa[i])) / 120.0
        q1 = (82.0 * (qd[i] - qb[i]) - 11.0 * (qe[i] - qa[i])) / 120.0
        f2 = 0.5 * ((fb[i] + fd[i]) - 2.0 * fc[i])
        q2 = 0.5 * ((qb[i] + qd[i]) - 2.0 * qc[i])
        excess[i] += f1 * q1 / 12.0 + f2 * q2 / 180.0


@njit
def extrapolate_rows(v, wide, rows):
    """Write two extrapolated rows before the `rows` rows of v, which begin at row 2, and two after them.

    wide : length of a row
    """
    first, last = 2 * wide, (rows + 1) * wide
    for i in range(wide):
        v[wide + i], v[i] = ghost_values(rows, False, 0.0, v, first + i, wide)
        v[last + wide + i], v[last + 2 * wide + i] = ghost_values(rows, False, 0.0, v, last + i, -wide)


@njit
def pad_line(v, n, to):
    """Copy v to the middle of `to`, float64[n + 4], and extrapolate two values beyond either end."""
    middle = to[2:]
    for i in range(n):
        middle[i] = v[i]
    to[1], to[0] = ghost_values(n, False, 0.0, to, 2, 1)
    to[n + 2], to[n + 3] = ghost_values(n, False, 0.0, to, n + 1, -1)


def grid_excesses_work(nx, ny):
    """Length of the work array of `grid_excesses`."""
    return (nx + 6) * (ny + 6) + 2 * (nx + 1) * (ny + 4) + nx * (ny + 1) + 2 * (nx + 4)


@njit
def grid_excesses(scheme, nx, ny, factor, flow_x, flow_y, outside, c, work, ax, ay):
    """Write the fluxes through faces minus the upwind fluxes to ax, ordered as flow_x, and ay, ordered as flow_y.

    scheme : LINEAR (upwind5) or WENO5; c : values of the cells; work : float64[grid_excesses_work(nx, ny)]
    Fluxes are flows times values, without `factor`. Other arguments as for `advection.grid_advection`
    """
    wide, m = nx + 2 * GHOSTS, nx + 1
    mx, my = m * (ny + 4), nx * (ny + 1)
    v, rest = work[: wide * (ny + 6)], work[wide * (ny + 6) :]
    fx, qx, rest = rest[:mx], rest[mx : 2 * mx], rest[2 * mx :]
    qy, f, q = rest[:my], rest[my : my + nx + 4], rest[my + nx + 4 :]
    pad_sides(nx, ny, factor, flow_x, flow_y, outside, c, v)
    for j in range(ny):
        p, qj, a = v[(j + GHOSTS) * wide :], qx[(j + 2) * m : (j + 3) * m], ax[j * m : (j + 1) * m]
        fj, flow = fx[(j + 2) * m :], flow_x[j * m :]
        for i in range(m):
            fj[i] = flow[i]
        face_excesses(scheme, factor, flow, p, p[1:], p[2:], p[3:], p[4:], p[5:], qj, a)
        west, east = factor * flow[0], factor * flow[nx]
        if west >= 0.0:
            qj[0], a[0] = outside[j] if west > 0.0 else p[GHOSTS], 0.0
        if east <= 0.0:
            qj[nx], a[nx] = outside[ny + j] if east < 0.0 else p[nx + 2], 0.0
    for j in range(ny + 1):
        p, qj, a = v[j * wide + GHOSTS :], qy[j * nx : (j + 1) * nx], ay[j * nx : (j + 1) * nx]
        fy, b, d, e = flow_y[j * nx :], p[wide:], p[3 * wide :], p[4 * wide :]
        face_excesses(scheme, factor, fy, p, b, p[2 * wide :], d, e, p[5 * wide :], qj, a)
        if j == 0 or j == ny:
            side, turn = (outside[2 * ny :], 1.0) if j == 0 else (outside[2 * ny + nx :], -1.0)
            own = d if j == 0 else p[2 * wide :]
            for i in range(nx):
                inflow = turn * factor * fy[i]
                if inflow >= 0.0:
                    qj[i], a[i] = side[i] if inflow > 0.0 else own[i], 0.0
    extrapolate_rows(fx, m, ny)
    extrapolate_rows(qx, m, ny)
    for j in range(ny):
        r, o = fx[j * m :], qx[j * m :]
        fb, fc, fd, fe, qb, qc = r[m:], r[2 * m :], r[3 * m :], r[4 * m :], o[m:], o[2 * m :]
        add_products(r, fb, fc, fd, fe, o, qb, qc, o[3 * m :], o[4 * m :], ax[j * m : (j + 1) * m])
    for j in range(ny + 1):
        pad_line(flow_y[j * nx :], nx, f)
        pad_line(qy[j * nx :], nx, q)
        add_products(f, f[1:], f[2:], f[3:], f[4:], q, q[1:], q[2:], q[3:], q[4:], ay[j * nx : (j + 1) * nx])


@njit
def add_excesses(nx, ny, kx, ky, factor, ax, ay, rate):
    """Add the excess fluxes ax, ay of `grid_excesses` through the faces of each cell to the rates of all cells.

    Other arguments as for `advection.grid_advection`
    """
    for j in range(ny):
        k, to = ky[j], rate[j * nx : (j + 1) * nx]
        aw, ae, south, north = ax[j * (nx + 1) :], ax[j * (nx + 1) + 1 :], ay[j * nx :], ay[(j + 1) * nx :]
        for i in range(nx):
            to[i] += (factor * (kx[i] * k)) * ((aw[i] - ae[i]) + (south[i] - north[i]))
