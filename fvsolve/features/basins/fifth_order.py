"""Fifth-order advection over a grid, as the difference from upwind rates, with fluxes that keep bounds.

Values at faces are linear (upwind5) or WENO-Z (Borges et al. 2008), written in differences, so that a uniform value
stays uniform. The mean of a product over a face is the product of the means plus two terms. These are 1/12 and 1/180 of
the products of the first and of the second Legendre coefficients along the face.

The flux through a face minus the upwind flux is an excess, without `factor`; the sign of factor times flow gives the
direction of the flow. Excesses of weno5 are limited so that an Euler step keeps values within bounds (flux-corrected
transport, Zalesak 1979): the result of upwind is within the bounds, and each cell accepts excesses only up to its
distance from the bounds.

Arguments as in `advection`; c : values of cells; scheme : LINEAR (upwind5) or WENO5; bounds : (least, most) value that
weno5 keeps, infinite for none; ax, ay : excesses, ordered as the flows along x and y.
"""

from fvsolve.core.kernels.dtypes import WENO5
from fvsolve.features.basins.advection import put_row_rates, put_values
from fvsolve.jit import inline, njit

INFINITE = float("inf")
WENO_COURANT = 0.5  # Courant number up to which weno5 keeps its bounds
SMALL = 1e-30  # prevents a division by zero between squares of differences
GHOSTS = 3
LEAST_CELLS = 5  # with fewer cells, values beyond a side are those of its last cells


def fifth_order_work(nx, ny):
    """Length of the work array of `add_fifth_order`."""
    most = max(grid_excesses_work(nx, ny), limit_excesses_work(nx, ny))
    return nx * ny + (nx + 1) * ny + nx * (ny + 1) + most


@njit
def add_fifth_order(scheme, grid, flows, depth, bounds, fastest, s, work, rate):
    """Add the rates by upwind5 or weno5, minus the rates by upwind, to `rate`, which contains the rates by upwind.

    Fluxes of weno5 are limited so that an Euler step of Courant number WENO_COURANT keeps the bounds.
    fastest : greatest rate of flow through a cell [1/s], for depth 1; work : float64[fifth_order_work(nx, ny)]
    """
    nx = grid.nx
    ny = grid.ny
    factor = flows.factor
    c = s
    rest = work[nx * ny :]
    mx = (nx + 1) * ny
    my = nx * (ny + 1)
    if depth.size > 0:
        put_values(s, depth, work[: nx * ny])
        c = work[: nx * ny]
    ax = rest[:mx]
    ay = rest[mx : mx + my]
    rest = rest[mx + my :]
    grid_excesses(scheme, grid, flows, c, rest, ax, ay)
    if scheme == WENO5 and (bounds[0] > -INFINITE or bounds[1] < INFINITE):
        limit_excesses(grid, flows, depth, bounds, abs(factor) * fastest, s, rate, ax, ay, rest)
    add_excesses(grid, factor, ax, ay, rate)


@njit
def ghost_means(known, o, a, b, c, d, e):
    """(mean of the nearest ghost cell, of the next ghost cell) beyond a side of the grid, by a polynomial of degree 4.

    a, b, c, d, e : means of the five cells inside that determine the polynomial, the nearest first
    known : True if o, the value at the side, is used in place of e
    """
    p = a - b
    q = b - c
    r = c - d
    s = d - e
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
    t = (b0 - b2) ** 2
    b0 = b0 * b0
    b1 = b1 * b1
    b2 = b2 * b2
    w0 = 0.1 * (b0 + t) * (b1 * b2)
    w1 = 0.6 * (b1 + t) * (b0 * b2)
    w2 = 0.3 * (b2 + t) * (b0 * b1)
    return (w0 * (5.0 * q - 2.0 * p) + w1 * (q + 2.0 * r) + w2 * (4.0 * r - s)) / (
        6.0 * (w0 + w1 + w2)
    )


@inline
def put_excesses(face_difference, factor, flow, cells, q, excess):
    """Write values and excesses as `face_excesses` does, with the function `face_difference` of a scheme."""
    a, b, c, d, e, g = cells
    for i in range(q.size):
        forward = factor * flow[i] > 0.0
        p, s = b[i] - a[i], g[i] - e[i]
        m = c[i] - b[i]
        r = d[i] - c[i]
        n = e[i] - d[i]
        difference = face_difference(
            p if forward else s, m if forward else n, r, n if forward else m
        )
        q[i] = c[i] + difference if forward else d[i] - difference
        excess[i] = flow[i] * (difference if forward else -difference)


@njit
def face_excesses(scheme, factor, flow, cells, q, excess):
    """Write the values q at a row of faces, and the flux minus the upwind flux through them to `excess`.

    flow : flows through the faces; cells : means of six cells in line, three on either side of each face
    """
    if scheme == WENO5:
        put_excesses(face_difference_weno, factor, flow, cells, q, excess)
    else:
        put_excesses(face_difference_linear, factor, flow, cells, q, excess)


@njit
def pad_sides(grid, flows, c, v):
    """Copy the cell means c to v, and write three ghost cells beyond each side of the grid.

    The two nearest ghost cells are those of `ghost_values`; the third is equal to the second.
    v : float64[ny + 6, nx + 6] as one array
    """
    nx = grid.nx
    ny = grid.ny
    factor = flows.factor
    flow_x = flows.x
    flow_y = flows.y
    outside = flows.outside
    wide = nx + 2 * GHOSTS
    for j in range(ny):
        to, fx = v[(j + GHOSTS) * wide :], flow_x[j * (nx + 1) :]
        inner, row = to[GHOSTS:], c[j * nx :]
        for i in range(nx):
            inner[i] = row[i]
        to[2], to[1] = ghost_values(nx, factor * fx[0] > 0.0, outside[j], to, GHOSTS, 1)
        to[nx + 3], to[nx + 4] = ghost_values(
            nx, factor * fx[nx] < 0.0, outside[ny + j], to, nx + 2, -1
        )
        to[0], to[nx + 5] = to[1], to[nx + 4]
    south = outside[2 * ny :]
    north = outside[2 * ny + nx :]
    last = ny * nx
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
    return ghost_means(
        known, o, v[at], v[at + step], v[at + 2 * step], v[at + 3 * step], v[at + 4 * step]
    )


@inline
def add_products(flows, values, excess):
    """Add the mean of products of flow and value over faces, minus the product of their means, to `excess`.

    flows, values : at five faces in line along the side; the third is the face itself
    """
    (fa, fb, fc, fd, fe), (qa, qb, qc, qd, qe) = flows, values
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
        v[last + wide + i], v[last + 2 * wide + i] = ghost_values(
            rows, False, 0.0, v, last + i, -wide
        )


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
def grid_excesses(scheme, grid, flows, c, work, ax, ay):
    """Write the excesses through all faces to ax and ay; work : float64[grid_excesses_work(nx, ny)]."""
    nx = grid.nx
    ny = grid.ny
    factor = flows.factor
    flow_x = flows.x
    flow_y = flows.y
    outside = flows.outside
    wide, m = nx + 2 * GHOSTS, nx + 1
    mx, my = m * (ny + 4), nx * (ny + 1)
    v, rest = work[: wide * (ny + 6)], work[wide * (ny + 6) :]
    fx = rest[:mx]
    qx = rest[mx : 2 * mx]
    rest = rest[2 * mx :]
    qy = rest[:my]
    f = rest[my : my + nx + 4]
    q = rest[my + nx + 4 :]
    pad_sides(grid, flows, c, v)
    for j in range(ny):
        p = v[(j + GHOSTS) * wide :]
        qj = qx[(j + 2) * m : (j + 3) * m]
        a = ax[j * m : (j + 1) * m]
        fj, flow = fx[(j + 2) * m :], flow_x[j * m :]
        for i in range(m):
            fj[i] = flow[i]
        face_excesses(scheme, factor, flow, (p, p[1:], p[2:], p[3:], p[4:], p[5:]), qj, a)
        west, east = factor * flow[0], factor * flow[nx]
        if west >= 0.0:
            qj[0], a[0] = outside[j] if west > 0.0 else p[GHOSTS], 0.0
        if east <= 0.0:
            qj[nx], a[nx] = outside[ny + j] if east < 0.0 else p[nx + 2], 0.0
    for j in range(ny + 1):
        p = v[j * wide + GHOSTS :]
        qj = qy[j * nx : (j + 1) * nx]
        a = ay[j * nx : (j + 1) * nx]
        fy = flow_y[j * nx :]
        b = p[wide:]
        d = p[3 * wide :]
        e = p[4 * wide :]
        face_excesses(scheme, factor, fy, (p, b, p[2 * wide :], d, e, p[5 * wide :]), qj, a)
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
        five = (r, r[m:], r[2 * m :], r[3 * m :], r[4 * m :])
        values = (o, o[m:], o[2 * m :], o[3 * m :], o[4 * m :])
        add_products(five, values, ax[j * m : (j + 1) * m])
    for j in range(ny + 1):
        pad_line(flow_y[j * nx :], nx, f)
        pad_line(qy[j * nx :], nx, q)
        five, values = (f, f[1:], f[2:], f[3:], f[4:]), (q, q[1:], q[2:], q[3:], q[4:])
        add_products(five, values, ay[j * nx : (j + 1) * nx])


@njit
def add_excesses(grid, factor, ax, ay, rate):
    """Add the excesses through the faces of each cell to the rates of all cells."""
    nx = grid.nx
    ny = grid.ny
    kx = grid.kx
    ky = grid.ky
    for j in range(ny):
        k, to = ky[j], rate[j * nx : (j + 1) * nx]
        aw = ax[j * (nx + 1) :]
        ae = ax[j * (nx + 1) + 1 :]
        south = ay[j * nx :]
        north = ay[(j + 1) * nx :]
        for i in range(nx):
            to[i] += (factor * (kx[i] * k)) * ((aw[i] - ae[i]) + (south[i] - north[i]))


@njit
def accepted_fraction(available, need):
    """Fraction of a need that is available, from 0 to 1."""
    available = available if available > 0.0 else 0.0
    return available / need if need > available else 1.0


@njit
def sum_of_positive(a, b, c, d):
    """Sum of the positive values among a, b, c and d."""
    a, b = a if a > 0.0 else 0.0, b if b > 0.0 else 0.0
    c, d = c if c > 0.0 else 0.0, d if d > 0.0 else 0.0
    return (a + b) + (c + d)


@inline
def row_fractions(paces, factor, kx, ky, flows, excesses, depth, bounds, s, rate, up, down):
    """Write the fractions of excess inflow (`up`) and outflow (`down`) with which each cell of a row keeps the bounds.

    Fractions are at most 1. kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]
    paces : rates of flow through the cells [1/s]; a cell keeps the bounds in an Euler step of WENO_COURANT / rate
    flows, excesses : through the western, eastern, southern and northern faces
    """
    (fw, fe, fs, fn), (aw, ae, south, north), (least, most) = flows, excesses, bounds
    for i in range(s.size):
        step = WENO_COURANT / (paces[i] + SMALL)
        scale = step * (factor * (kx[i] * ky))
        then = s[i] + step * rate[i]
        deep = (depth[i] if depth.size > 0 else 1.0) - scale * ((fe[i] - fw[i]) + (fn[i] - fs[i]))
        a = scale * aw[i]
        b = -scale * ae[i]
        c = scale * south[i]
        d = -scale * north[i]
        up[i] = accepted_fraction(most * deep - then, sum_of_positive(a, b, c, d))
        down[i] = accepted_fraction(then - least * deep, sum_of_positive(-a, -b, -c, -d))


@inline
def limit_faces(factor, up, down, up_then, down_then, excess):
    """Multiply the excess fluxes through a row of faces by the fraction that the cells on both sides of a face allow.

    up, down : fractions of the cells before the faces, see `row_fractions`; up_then, down_then : behind the faces
    """
    for i in range(excess.size):
        forth = down[i] if down[i] < up_then[i] else up_then[i]
        back = up[i] if up[i] < down_then[i] else down_then[i]
        excess[i] *= forth if factor * excess[i] > 0.0 else back


def limit_excesses_work(nx, ny):
    """Length of the work array of `limit_excesses`."""
    return 2 * (nx + 2) * (ny + 2) + nx


@njit
def limit_excesses(grid, flows, depth, bounds, fastest, s, rate, ax, ay, work):
    """Limit the excesses so that the values of a scalar after an Euler step are within their bounds.

    After the step, s + step times the corrected rates lies between least and most times the depth. The step has the
    Courant number WENO_COURANT for the greatest rate `fastest` [1/s] of a given flow. With depths it has this number in
    each cell, where it is no shorter than in the fastest cell, so that no rate depends on states far away.
    rate : float64[n]  rates by upwind; work : float64[limit_excesses_work(nx, ny)]
    """
    nx = grid.nx
    ny = grid.ny
    kx = grid.kx
    ky = grid.ky
    factor = flows.factor
    flow_x = flows.x
    flow_y = flows.y
    wide = nx + 2
    up = work[: wide * (ny + 2)]
    down = work[wide * (ny + 2) :]
    paces = work[2 * wide * (ny + 2) :][:nx]
    for i in range(wide * (ny + 2)):
        up[i], down[i] = 1.0, 1.0  # beyond the boundary this remains
    for i in range(nx):
        paces[i] = fastest
    for j in range(ny):
        a = j * nx
        z = (j + 1) * nx
        w = j * (nx + 1)
        to = (j + 1) * wide + 1
        around = flow_x[w:], flow_x[w + 1 :], flow_y[a:], flow_y[z:]
        beyond = ax[w:], ax[w + 1 :], ay[a:], ay[z:]
        if depth.size > 0:
            put_row_rates(factor, kx, ky[j], around, depth[a:], paces)
        row_fractions(
            paces,
            factor,
            kx,
            ky[j],
            around,
            beyond,
            depth[a:],
            bounds,
            s[a:z],
            rate[a:],
            up[to:],
            down[to:],
        )
    for j in range(ny):
        at = (j + 1) * wide
        limit_faces(
            factor,
            up[at:],
            down[at:],
            up[at + 1 :],
            down[at + 1 :],
            ax[j * (nx + 1) : (j + 1) * (nx + 1)],
        )
    for j in range(ny + 1):
        at, to = j * wide + 1, (j + 1) * wide + 1
        limit_faces(factor, up[at:], down[at:], up[to:], down[to:], ay[j * nx : (j + 1) * nx])
