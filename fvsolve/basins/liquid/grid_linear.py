"""Pressure waves of a liquid on a rectangular grid of cells, under the density law `linear`.

r_t + div m = 0, m_t + c^2 grad r = 0: deviation of density r [kg/m3], whose pressure is c^2 r, wave speed c [m/s], and
mass-flow densities m [kg/(m2 s)]. Along each direction the waves (c r + m) / 2 and (c r - m) / 2 are reconstructed
upwind, which is Godunov's flux. The system is linear, so one direction at a time has the full order of the scheme. A
row of cells is read once: for its own faces, then for those towards the rows before it; the waves of rows are stored in
a ring buffer of `RING` rows.
"""

from fvsolve.basins.cell_stretching import stretch_row_rates
from fvsolve.basins.liquid import moving_wall_waves
from fvsolve.basins.liquid.moving_wall_waves import (
    GHOSTS,
    correct_mirror_row,
    mirror_at_walls,
    put_moving_fluxes,
    put_wall_pressure,
    reflect_at_wall,
)
from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import LINEAR, MUSCL, UPWIND, WENO5
from fvsolve.kernels.ghost_cells import entering_ghosts, leaving_ghosts
from fvsolve.kernels.reconstruction import by_limiter, slope, value_muscl, value_weno5

WALLS, MIRRORS, OPEN = 0, 1, 2  # kinds of sides
RING = 8  # stored rows of waves: the six of the stencil of a row of faces, and space for all three beyond a side
CLOSURE_CELLS = 5  # cells read by the closure of a side
SIDE_VALUES = GHOSTS + CLOSURE_CELLS
SIDE_WORK = 2 * SIDE_VALUES + 2 * CLOSURE_CELLS + GHOSTS  # length of the work array of a side


@njit
def value_upwind5(a, b, c, d, e):
    """Fifth-order upwind value at the face between c and d, from the averages a to e of five consecutive cells."""
    return ((2.0 * a - 13.0 * b) + (47.0 * c + 27.0 * d) - 3.0 * e) * (1.0 / 60.0)


@inline
def faces_limited(limiter, b, c, d, f):
    """Write to f the values at the faces between cells c and d, from cell c with a limited slope (MUSCL).

    b, c, d : averages of three consecutive cells
    """
    for i in range(f.size):
        f[i] = c[i] + 0.5 * slope(limiter, c[i] - b[i], d[i] - c[i])


@njit
def faces(scheme, limiter, small, a, b, c, d, e, f):
    """Write to f the values at the faces between cells c and d, from the side of c (upwind).

    a, b, c, d, e : averages of five consecutive cells; small : see `value_weno5`
    """
    if scheme == UPWIND:
        for i in range(f.size):
            f[i] = c[i]
    elif scheme == LINEAR:
        for i in range(f.size):
            f[i] = value_upwind5(a[i], b[i], c[i], d[i], e[i])
    elif scheme == WENO5:
        for i in range(f.size):
            f[i] = value_weno5(a[i], b[i], c[i], d[i], e[i], small)
    else:
        by_limiter(faces_limited, limiter, b, c, d, f)


@njit
def scheme_for(scheme, n, first, second):
    """Scheme for a row of n cells between two sides of the kinds `first` and `second`, see `side_kind`.

    It is MUSCL for fewer than five cells, except between walls or under `UPWIND`.
    """
    return scheme if (first == WALLS and second == WALLS) or n >= CLOSURE_CELLS or scheme == UPWIND else MUSCL


@njit
def side_kind(reflect):
    """Kind of a side by the reflection coefficients of its faces.

    WALLS if all are 1, MIRRORS if all are 1 or -1, else OPEN.
    """
    kind = WALLS
    for k in range(reflect.size):
        if abs(reflect[k]) != 1.0:
            return OPEN
        if reflect[k] != 1.0:
            kind = MIRRORS
    return kind


@njit
def mirrored_cell(j, n):
    """Index of the cell whose mirror image is at index j, with mirrors before cell 0 and after cell n - 1."""
    q = j % (2 * n)
    return q if q < n else 2 * n - 1 - q


@njit
def is_reversed(j, n):
    """True if the image of `mirrored_cell` at index j is reversed, so that forward and backward wave change places."""
    return j % (2 * n) >= n


@inline
def mirror(n, forward, backward):
    """Fill the three ghost cells beyond both ends of a row of n cells between walls.

    They are mirror images of the cells, with forward and backward wave exchanged.
    forward, backward : float64[n + 6]  waves; the cells are at [3 : n + 3]
    """
    for k in range(GHOSTS):
        forward[2 - k], backward[2 - k] = backward[3 + k], forward[3 + k]
        forward[n + 3 + k], backward[n + 3 + k] = backward[n + 2 - k], forward[n + 2 - k]


@njit
def close_side(kind, scheme, limiter, small, reflect, n, entering, leaving, first, step, spare):
    """Fill the three ghost cells of both waves beyond an end of a row of n cells, where the side is not a wall.

    At MIRRORS they are mirror images times the reflection coefficient. At OPEN sides the outgoing wave is extrapolated
    by a polynomial; so is the incoming wave, with its value at the side as an additional datum, as at the ends of
    pipes. All faces of a side have one kind: with different kinds on one side, solutions of `upwind5` would grow by
    1e-4 per cell travel time.

    kind : MIRRORS or OPEN; reflect : reflection coefficient of the side; small : see `value_weno5`
    entering, leaving : incoming and outgoing wave; spare : work array
    first : index of the cell next to the side; step : 1 or -1, from each cell to the next
    """
    incoming, outgoing, ghosts = (
        spare[:CLOSURE_CELLS],
        spare[CLOSURE_CELLS : 2 * CLOSURE_CELLS],
        spare[2 * CLOSURE_CELLS : 2 * CLOSURE_CELLS + GHOSTS],
    )
    for k in range(CLOSURE_CELLS):
        at = first + step * min(k, n - 1)
        incoming[k], outgoing[k] = entering[at], leaving[at]
    if kind == MIRRORS:
        for k in range(GHOSTS):
            at = first - step * (k + 1)
            entering[at], leaving[at] = reflect * outgoing[k], reflect * incoming[k]
        return
    degree = 0 if scheme == UPWIND else 4
    a, b, c = outgoing[2], outgoing[1], outgoing[0]
    leaving_ghosts(outgoing, n, scheme, degree, limiter, small, ghosts)
    for k in range(GHOSTS):
        leaving[first - step * (k + 1)] = ghosts[k]
    datum = c
    if scheme == LINEAR:
        datum = value_upwind5(a, b, c, ghosts[0], ghosts[1])
    elif scheme == WENO5:
        datum = value_weno5(a, b, c, ghosts[0], ghosts[1], small)
    elif scheme == MUSCL:
        datum = value_muscl(limiter, b, c, ghosts[0])
    entering_ghosts(incoming, n, scheme, degree, reflect * datum, small, ghosts)
    for k in range(GHOSTS):
        entering[first - step * (k + 1)] = ghosts[k]


@njit
def close_row(kind, scheme, limiter, small, reflect, n, entering, leaving, first, step, spare):
    """Fill the three rows of ghost cells beyond the southern or northern side of a grid of n rows, in the ring buffer.

    reflect : reflection coefficient of the side in each column; first : row next to the side
    step : 1 or -1, direction into the grid; other arguments as in `close_side`
    """
    incoming, outgoing, rest = spare[:SIDE_VALUES], spare[SIDE_VALUES : 2 * SIDE_VALUES], spare[2 * SIDE_VALUES :]
    wide = reflect.size
    for i in range(wide):
        for k in range(min(n, CLOSURE_CELLS)):
            at = ((first + step * k) % RING) * wide + i
            incoming[GHOSTS + k], outgoing[GHOSTS + k] = entering[at], leaving[at]
        close_side(kind, scheme, limiter, small, reflect[i], n, incoming, outgoing, GHOSTS, 1, rest)
        for k in range(GHOSTS):
            at = ((first - step * (k + 1)) % RING) * wide + i
            entering[at], leaving[at] = incoming[GHOSTS - 1 - k], outgoing[GHOSTS - 1 - k]


@inline
def reflect_waves(reflect, leaving, entering):
    """Write the incoming waves `entering` at faces of a side: outgoing waves `leaving` times coefficients `reflect`."""
    for i in range(entering.size):
        entering[i] = reflect[i] * leaving[i]


@inline
def put_inward(k, entering, leaving, inward):
    """Write the inward mass flows per thickness through the faces of a side [kg/(m s)] to `inward`.

    k : 1 / lengths of the faces [1/m]; entering, leaving : incoming and outgoing waves at the faces
    """
    for i in range(inward.size):
        inward[i] = (entering[i] - leaving[i]) / k[i]


@inline
def put_waves(half, r, m, forward, backward):
    """Write the waves (c r + m) / 2 and (c r - m) / 2 of a row of cells. half : c / 2"""
    for i in range(r.size):
        a, b = half * r[i], 0.5 * m[i]
        forward[i], backward[i] = a + b, a - b


@inline
def put_row_rates(c, k, forward, backward, rate_r, rate_m, rate_t):
    """Write the rates of a row of cells from the waves at the faces along it; cell i is between faces i and i + 1.

    c : wave speed [m/s]; k : 1 / widths of the cells [1/m]
    rate_r, rate_m, rate_t : rates of density, and of flows along and across the row; rate_t is set to 0
    """
    f, b = forward[1:], backward[1:]
    for i in range(rate_r.size):
        rate_r[i] = k[i] * ((forward[i] - backward[i]) - (f[i] - b[i]))
        rate_m[i] = c * k[i] * ((forward[i] + backward[i]) - (f[i] + b[i]))
        rate_t[i] = 0.0


@inline
def add_column_rates(c, k, f0, b0, f1, b1, rate_r, rate_m):
    """Add to the rates of a row of cells the fluxes through the rows of faces before and after it.

    c : wave speed [m/s]; k : 1 / height of the row [1/m]
    f0, b0 : forward and backward waves at the faces before the row; f1, b1 : at the faces after it
    rate_r, rate_m : rates of density and of the flow across the row
    """
    ck = c * k
    for i in range(rate_r.size):
        rate_r[i] += k * ((f0[i] - b0[i]) - (f1[i] - b1[i]))
        rate_m[i] += ck * ((f0[i] + b0[i]) - (f1[i] + b1[i]))


@njit
def max_spacing_rate(kx, ky):
    """Greatest sum 1 / width + 1 / height over the cells [1/m]. kx, ky : 1 / widths of columns, 1 / heights of rows"""
    x, y = 0.0, 0.0
    for i in range(kx.size):
        x = max(x, kx[i])
    for j in range(ky.size):
        y = max(y, ky[j])
    return x + y


@njit
def first_row_read(begin, ny):
    """First row of cells that is read for the faces of a band that begins at row `begin` of ny."""
    return max(min(begin - GHOSTS, ny - CLOSURE_CELLS), 0)


@njit
def row_needed(j, ny):
    """Number of rows of cells, from row 0, that must be read before the faces between rows j - 1 and j are computed."""
    return min(max(j + GHOSTS, CLOSURE_CELLS), ny)


@njit
def work_size(nx, ny):
    """Length of the work array of `grid_rates` for nx columns and ny rows."""
    return (2 * RING + 4) * nx + 2 * (nx + 2 * GHOSTS) + 2 * (nx + 1) + SIDE_WORK


@njit
def put_moving_row(c, ny, j, up, down, along, moves):
    """Convert the waves `up` and `down` at the moving faces between rows j - 1 and j to mass and momentum fluxes.

    At the sides of the grid the pressures on the faces and terms of the power lost there are written to `moves` too.
    along : mass-flow densities along the faces, of all cells of the grid; moves : as in `grid_rates`
    """
    nx, count = up.size, moves[2].size // 2
    if j == 0 or j == ny:
        at, speed = 2 * ny + (nx if j > 0 else 0), moves[1][j]
        tangential = along[(ny - 1) * nx if j > 0 else 0 :]
        put_wall_pressure(
            c, speed if j > 0 else -speed, up, down, tangential, nx, moves[2][at:], moves[2][count + at :]
        )
    put_moving_fluxes(c, moves[3], moves[1][j:], 0, up, down)


@njit
def grid_rates(
    c, small, scheme, limiter, nx, ny, begin, stop, kx, ky, reflect, r, mx, my, through, work, rate_r, rate_x, rate_y,
    moves,
):  # fmt: skip
    """Write the rates of the cells of rows `begin` to `stop` - 1; return the greatest c (kx + ky) of all cells [1/s].

    Rows are counted over the whole grid; up to three rows beyond the band are read too, and more next to open sides.
    c : wave speed [m/s]; small : square of a negligible flow density [kg2/(m4 s2)]
    scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5; limiter : of MUSCL
    nx, ny : numbers of columns and rows
    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]
    reflect : float64[2 (nx + ny)]  reflection coefficients of the faces of the sides west, east, south, north; 1 for
    walls, empty if all are walls
    r, mx, my : float64[nx ny]  deviation of density [kg/m3], mass-flow densities along x and y [kg/(m2 s)]
    through : float64[2 (nx + ny)]  inward flows through boundary faces [kg/(m s)], in the order of `reflect`, or empty
    work : float64[work_size(nx, ny)]
    rate_r, rate_x, rate_y : float64[nx ny]  rates of r, mx, my
    moves : None without moving walls, else a tuple of
        speeds of the grid lines x = constant [m/s], float64[nx + 1], empty if at rest
        speeds of the grid lines y = constant [m/s], float64[ny + 1], empty if at rest
        array for pressures on boundary faces and terms of the power lost there, as in `liquid_mesh.liquid_rates`
        density at rest [kg/m3]
        `wide` : area over undeformed area of columns or rows, see `basins.cell_stretching`
    """
    row_rates(
        c,
        small,
        scheme,
        limiter,
        nx,
        ny,
        begin,
        stop,
        begin,
        stop,
        kx,
        ky,
        reflect,
        side_kinds_of(reflect, nx, ny),
        r,
        mx,
        my,
        through,
        work,
        rate_r,
        rate_x,
        rate_y,
        moves,
    )
    return c * max_spacing_rate(kx, ky)


@njit
def side_kinds_of(reflect, nx, ny):
    """Kinds (WALLS, MIRRORS or OPEN) of the western, eastern, southern and northern side, see `side_kind`."""
    south, north = reflect[2 * ny : 2 * ny + nx], reflect[2 * ny + nx :]
    return side_kind(reflect[:ny]), side_kind(reflect[ny : 2 * ny]), side_kind(south), side_kind(north)


@njit
def row_rates(
    c, small, scheme, limiter, nx, ny, begin, stop, row, until, kx, ky, reflect, side_kinds, r, mx, my, through, work,
    rate_r, rate_x, rate_y, moves,
):  # fmt: skip
    """Write the rates of rows `row` to `until` - 1 of a band; calls must follow in the order of rows, without gaps.

    begin, stop : first row of the band, and first row after it
    Rates of rows from `until` on may be written incompletely; the next call completes them.
    side_kinds : see `side_kinds_of`; other arguments as in `grid_rates`
    """
    wide, f = nx + 2 * GHOSTS, nx + 1
    up, down, work = work[: RING * nx], work[RING * nx : 2 * RING * nx], work[2 * RING * nx :]
    between, work = work[: 4 * nx], work[4 * nx :]
    east, west, work = work[:wide], work[wide : 2 * wide], work[2 * wide :]
    fe, fw, spare = work[:f], work[f : 2 * f], work[2 * f :]
    half, rows = 0.5 * c, first_row_read(begin, ny)
    if row > begin:
        rows = max(rows, row_needed(row, ny))
    south, north = reflect[2 * ny : 2 * ny + nx], reflect[2 * ny + nx :]
    to_w, to_e, to_s, to_n = side_kinds
    along, across = scheme_for(scheme, nx, to_w, to_e), scheme_for(scheme, ny, to_s, to_n)
    for j in range(row if row == begin else row + 1, until + 1):  # faces between rows j - 1 and j
        while rows < row_needed(j, ny):
            a, z, at = rows * nx, (rows + 1) * nx, (rows % RING) * nx
            put_waves(half, r[a:z], my[a:z], up[at : at + nx], down[at : at + nx])
            if rows < begin or rows >= stop:
                rows += 1
                continue
            put_waves(half, r[a:z], mx[a:z], east[GHOSTS : nx + GHOSTS], west[GHOSTS : nx + GHOSTS])
            if moves is None or moves[0].size == 0:
                mirror(nx, east, west)
            else:
                mirror_at_walls(False, c, moves[3], nx, moves[0][0], moves[0][nx], east, west)
            if to_w != WALLS:
                close_side(to_w, along, limiter, small, reflect[rows], nx, east, west, GHOSTS, 1, spare)
            if to_e != WALLS:
                last = nx + GHOSTS - 1
                close_side(to_e, along, limiter, small, reflect[ny + rows], nx, west, east, last, -1, spare)
            faces(along, limiter, small, east, east[1:], east[2:], east[3:], east[4:], fe)
            faces(along, limiter, small, west[5:], west[4:], west[3:], west[2:], west[1:], fw)
            if moves is not None and moves[0].size > 0:
                reflect_at_wall(False, c, moves[3], -moves[0][0], fw, fe, 1)
                reflect_at_wall(False, c, moves[3], moves[0][nx], fe[nx:], fw[nx:], 1)
            if to_w != WALLS:
                fe[0] = reflect[rows] * fw[0]
            if to_e != WALLS:
                fw[nx] = reflect[ny + rows] * fe[nx]
            if through.size > 0:
                through[rows], through[ny + rows] = (fe[0] - fw[0]) / ky[rows], (fw[nx] - fe[nx]) / ky[rows]
            if moves is None or moves[0].size == 0:
                put_row_rates(c, kx, fe, fw, rate_r[a:z], rate_x[a:z], rate_y[a:z])
            else:
                speeds, count = moves[0], moves[2].size // 2
                put_wall_pressure(c, -speeds[0], fe, fw, my[a:], 1, moves[2][rows:], moves[2][count + rows :])
                put_wall_pressure(
                    c,
                    speeds[nx],
                    fe[nx:],
                    fw[nx:],
                    my[z - 1 :],
                    1,
                    moves[2][ny + rows :],
                    moves[2][count + ny + rows :],
                )
                put_moving_fluxes(c, moves[3], speeds, 1, fe, fw)
                fe[0], fe[nx] = 0.0 if to_w == WALLS else fe[0], 0.0 if to_e == WALLS else fe[nx]
                if through.size > 0:
                    through[rows], through[ny + rows] = fe[0] / ky[rows], -fe[nx] / ky[rows]
                moving_wall_waves.put_row_rates(kx, speeds, fe, fw, my[a:z], rate_r[a:z], rate_x[a:z], rate_y[a:z])
            rows += 1
        for side in range(2):  # rows beyond the southern and the northern side
            first = j == begin and begin < GHOSTS if side == 0 else j == max(ny - GHOSTS + 1, begin)
            if not first:
                continue
            for k in range(GHOSTS):
                beyond = ny + k if side == 1 else -1 - k
                a, at = mirrored_cell(beyond, ny) * nx, (beyond % RING) * nx
                ahead, back = (down, up) if is_reversed(beyond, ny) else (up, down)
                put_waves(half, r[a : a + nx], my[a : a + nx], ahead[at : at + nx], back[at : at + nx])
                if moves is not None and moves[1].size > 0 and is_reversed(beyond, ny):
                    out = -moves[1][0] if side == 0 else moves[1][ny]
                    correct_mirror_row(
                        False, c, moves[3], out, (down if side == 1 else up)[at:], (up if side == 1 else down)[at:], nx
                    )
            if side == 0 and to_s != WALLS:
                close_row(to_s, across, limiter, small, south, ny, up, down, 0, 1, spare)
            if side == 1 and to_n != WALLS:
                close_row(to_n, across, limiter, small, north, ny, down, up, ny - 1, -1, spare)
        now, before = 2 * nx * (j % 2), 2 * nx * (1 - j % 2)
        fu, fd = between[now : now + nx], between[now + nx : now + 2 * nx]
        a, b, d = ((j - 3) % RING) * nx, ((j - 2) % RING) * nx, ((j - 1) % RING) * nx
        e, g, h = (j % RING) * nx, ((j + 1) % RING) * nx, ((j + 2) % RING) * nx
        faces(across, limiter, small, up[a:], up[b:], up[d:], up[e:], up[g:], fu)
        faces(across, limiter, small, down[h:], down[g:], down[e:], down[d:], down[b:], fd)
        if moves is not None and moves[1].size > 0:
            if j == 0:
                reflect_at_wall(False, c, moves[3], -moves[1][0], fd, fu, nx)
            if j == ny:
                reflect_at_wall(False, c, moves[3], moves[1][ny], fu, fd, nx)
        if j == 0 and to_s != WALLS:
            reflect_waves(south, fd, fu)
        if j == ny and to_n != WALLS:
            reflect_waves(north, fu, fd)
        if through.size > 0 and j == 0:
            put_inward(kx, fu, fd, through[2 * ny : 2 * ny + nx])
        if through.size > 0 and j == ny:
            put_inward(kx, fd, fu, through[2 * ny + nx :])
        a, z = (j - 1) * nx, j * nx
        if moves is not None and moves[1].size > 0:
            put_moving_row(c, ny, j, fu, fd, mx, moves)
            if (j == 0 and to_s == WALLS) or (j == ny and to_n == WALLS):
                for i in range(nx):
                    fu[i] = 0.0
                if through.size > 0:
                    at = 2 * ny + (nx if j > 0 else 0)
                    for i in range(nx):
                        through[at + i] = 0.0
            if j > begin:
                moving_wall_waves.add_column_rates(
                    ky[j - 1], moves[1][j - 1], moves[1][j], between[before:], between[before + nx :], fu, fd,
                    mx[max(j - 2, 0) * nx :], mx[a:], mx[min(j, ny - 1) * nx :],
                    rate_r[a:z], rate_y[a:z], rate_x[a:z],
                )  # fmt: skip
        elif j > begin:
            add_column_rates(c, ky[j - 1], between[before:], between[before + nx :], fu, fd, rate_r[a:z], rate_y[a:z])
        if moves is not None and j > begin:
            stretch_row_rates(moves[0].size > 0, moves[4], 0, j - 1, rate_r[a:z], rate_x[a:z], rate_y[a:z])
