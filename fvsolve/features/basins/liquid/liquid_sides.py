"""Waves of a liquid on a rectangular grid: values at faces, ghost cells beyond sides, reflection at moving walls.

Waves along a direction are (c r + m) / 2 and (c r - m) / 2 under the density law `linear`, and (w + u) / 2 and
(w - u) / 2 if `full` (full momentum flux), see `grid_linear` and `grid_nonlinear`. A wall that moves outward at `speed`
reflects waves so that the velocity at the wall is `speed`; under the law `linear` the mass flow is
m = speed (rho + r), so that no mass passes.

c : wave speed [m/s]; rho : density at rest [kg/m3]; r : deviation of density
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import LINEAR, MUSCL, UPWIND, WENO5
from fvsolve.core.kernels.ghost_cells import entering_ghosts, leaving_ghosts
from fvsolve.core.kernels.reconstruction import by_limiter, slope, value_muscl, value_weno5
from fvsolve.jit import inline, njit

WALLS, MIRRORS, OPEN = 0, 1, 2  # kinds of sides
GHOSTS = 3  # number of ghost cells beyond a side
# stored rows of waves: the six of the stencil of a row of faces, and space for all three beyond a side
RING = 8
CLOSURE_CELLS = 5  # cells read by the closure of a side
SIDE_VALUES = GHOSTS + CLOSURE_CELLS
SIDE_WORK = 2 * SIDE_VALUES + 2 * CLOSURE_CELLS + GHOSTS  # length of the work array of a side


class LiquidScheme(NamedTuple):
    """Liquid at rest, and the scheme of its rates.

    c, rho : wave speed [m/s] and density [kg/m3] at rest
    table : table of `riemann_invariants` under the density law `table`, else None
    full : True with the full momentum flux, False under the density law `linear`
    scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5, on meshes other than grids UPWIND or MUSCL
    limiter : of MUSCL, on grids
    small : square of a negligible flow density [kg2/(m4 s2)] under the law `linear`, else of a velocity [m2/s2]
    wide_by : factor on the range of the neighbours that limits values at sides of a mesh; with 1 they stay within it
    """

    c: float
    rho: float
    table: np.ndarray | None
    full: bool
    scheme: int
    limiter: int
    small: float
    wide_by: float


class LiquidGrid(NamedTuple):
    """Grid of nx columns and ny rows, and the band of its rows for which rates are computed.

    begin, stop : first row of the band, and first row after it
    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]
    reflect : float64[2 (nx + ny)]  reflection coefficients of the faces of the sides west, east, south, north; 1 for
    walls, empty if all are walls
    sides : kinds of these sides, see `side_kinds`
    """

    nx: int
    ny: int
    begin: int
    stop: int
    kx: np.ndarray
    ky: np.ndarray
    reflect: np.ndarray
    sides: tuple[int, int, int, int]


class Potentials(NamedTuple):
    """Potential phi of gravity and inertial forces [J/kg] of cells, of faces between columns, and between rows."""

    cells: np.ndarray
    columns: np.ndarray
    rows: np.ndarray


class LiquidWork(NamedTuple):
    """Work arrays of a grid: a ring buffer of rows, and arrays for a row of cells.

    In the ring buffer, row j of cells is at `ring_offset`, row j of faces (between rows j - 1 and j) at 3 nx (j % 2).
    up, down : float64[RING nx]  waves across the rows; aside : velocities along the rows
    faces : float64[6 nx]  values at two rows of faces, three for each face
    east, west, over : float64[nx + 6]  waves along the row and velocities across it, with ghost cells
    forward, backward, along : float64[nx + 1]  waves at the faces along the row, and velocity along these faces
    w, top : float64[nx]  invariants, and the greatest rate of each column so far [1/s]
    seen : float64[nx + 1]  waves relative to moving faces; spare : float64[SIDE_WORK]
    """

    up: np.ndarray
    down: np.ndarray
    aside: np.ndarray
    faces: np.ndarray
    east: np.ndarray
    west: np.ndarray
    over: np.ndarray
    forward: np.ndarray
    backward: np.ndarray
    along: np.ndarray
    w: np.ndarray
    top: np.ndarray
    seen: np.ndarray
    spare: np.ndarray


@njit
def work_size(nx):
    """Length of the work array of the rates of a grid of nx columns."""
    return (3 * RING + 6 + 2) * nx + 3 * (nx + 2 * GHOSTS) + 4 * (nx + 1) + SIDE_WORK


@inline
def open_work(work, nx):
    """`LiquidWork` of a grid of nx columns in its work array."""
    ring = RING * nx
    wide = nx + 2 * GHOSTS
    f = nx + 1
    up = work[:ring]
    down = work[ring : 2 * ring]
    east = work[2 * ring :][:wide]
    west = work[2 * ring + wide :][:wide]
    rest = work[2 * ring + 2 * wide :]
    forward = rest[:f]
    backward = rest[f : 2 * f]
    faces = rest[2 * f :][: 6 * nx]
    rest = rest[2 * f + 6 * nx :]
    spare, rest = rest[:SIDE_WORK], rest[SIDE_WORK:]
    aside = rest[:ring]
    over = rest[ring:][:wide]
    rest = rest[ring + wide :]
    along = rest[:f]
    seen = rest[f : 2 * f]
    w = rest[2 * f :][:nx]
    top = rest[2 * f + nx :][:nx]
    return LiquidWork(
        up, down, aside, faces, east, west, over, forward, backward, along, w, top, seen, spare
    )


@njit(forceinline=True)
def ring_offset(j, nx):
    """Offset of row j of cells in the arrays of the ring buffer."""
    return (j % RING) * nx


@inline
def face_values(work, j, nx):
    """Three arrays with the values at row j of faces, in the ring buffer."""
    at = 3 * nx * (j % 2)
    return (
        work.faces[at : at + nx],
        work.faces[at + nx : at + 2 * nx],
        work.faces[at + 2 * nx : at + 3 * nx],
    )


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
def side_kinds(reflect, nx, ny):
    """Kinds (WALLS, MIRRORS or OPEN) of the western, eastern, southern and northern side, see `side_kind`."""
    south, north = reflect[2 * ny : 2 * ny + nx], reflect[2 * ny + nx :]
    return (
        side_kind(reflect[:ny]),
        side_kind(reflect[ny : 2 * ny]),
        side_kind(south),
        side_kind(north),
    )


@njit
def scheme_for(scheme, n, first, second):
    """Scheme for a row of n cells between two sides of the kinds `first` and `second`, see `side_kind`.

    It is MUSCL for fewer than five cells, except between walls or under `UPWIND`.
    """
    return (
        scheme
        if (first == WALLS and second == WALLS) or n >= CLOSURE_CELLS or scheme == UPWIND
        else MUSCL
    )


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


@inline
def put_waves(half, r, m, forward, backward):
    """Write the waves (c r + m) / 2 and (c r - m) / 2 of a row of cells. half : c / 2"""
    for i in range(r.size):
        a, b = half * r[i], 0.5 * m[i]
        forward[i], backward[i] = a + b, a - b


@inline
def put_faces_along(liquid, grid, j, work, moves):
    """Write the waves at the faces along row j, from its waves in `work`, whose ghost cells are filled here.

    moves : None, or the `GridMotion` of moving walls
    """
    nx, ny, reflect, (first, last, _, _) = grid.nx, grid.ny, grid.reflect, grid.sides
    scheme = scheme_for(liquid.scheme, nx, first, last)
    limiter = liquid.limiter
    small = liquid.small
    east = work.east
    west = work.west
    forward = work.forward
    backward = work.backward
    if moves is None or moves.speed_x.size == 0:
        mirror(nx, east, west)
    else:
        mirror_at_walls(
            liquid.full, liquid.c, liquid.rho, nx, moves.speed_x[0], moves.speed_x[nx], east, west
        )
    if first != WALLS:
        close_side(first, scheme, limiter, small, reflect[j], nx, east, west, GHOSTS, 1, work.spare)
    if last != WALLS:
        close_side(
            last,
            scheme,
            limiter,
            small,
            reflect[ny + j],
            nx,
            west,
            east,
            nx + GHOSTS - 1,
            -1,
            work.spare,
        )
    faces(scheme, limiter, small, east, east[1:], east[2:], east[3:], east[4:], forward)
    faces(scheme, limiter, small, west[5:], west[4:], west[3:], west[2:], west[1:], backward)
    if moves is not None and moves.speed_x.size > 0:
        reflect_at_wall(liquid.full, liquid.c, liquid.rho, -moves.speed_x[0], backward, forward, 1)
        reflect_at_wall(
            liquid.full, liquid.c, liquid.rho, moves.speed_x[nx], forward[nx:], backward[nx:], 1
        )
    if first != WALLS:
        forward[0] = reflect[j] * backward[0]
    if last != WALLS:
        backward[nx] = reflect[ny + j] * forward[nx]


@inline
def put_faces_across(liquid, grid, j, work, forward, backward, moves):
    """Write the waves at the faces between rows j - 1 and j, from the waves across the rows in the ring buffer.

    moves : None, or the `GridMotion` of moving walls
    """
    nx, ny, up, down, (_, _, first, last) = grid.nx, grid.ny, work.up, work.down, grid.sides
    scheme = scheme_for(liquid.scheme, ny, first, last)
    limiter = liquid.limiter
    small = liquid.small
    a = ring_offset(j - 3, nx)
    b = ring_offset(j - 2, nx)
    c = ring_offset(j - 1, nx)
    d = ring_offset(j, nx)
    e = ring_offset(j + 1, nx)
    g = ring_offset(j + 2, nx)
    faces(scheme, limiter, small, up[a:], up[b:], up[c:], up[d:], up[e:], forward)
    faces(scheme, limiter, small, down[g:], down[e:], down[d:], down[c:], down[b:], backward)
    if moves is not None and moves.speed_y.size > 0:
        if j == 0:
            reflect_at_wall(
                liquid.full, liquid.c, liquid.rho, -moves.speed_y[0], backward, forward, nx
            )
        if j == ny:
            reflect_at_wall(
                liquid.full, liquid.c, liquid.rho, moves.speed_y[ny], forward, backward, nx
            )
    if j == 0 and first != WALLS:
        reflect_waves(grid.reflect[2 * ny :], backward, forward)
    if j == ny and last != WALLS:
        reflect_waves(grid.reflect[2 * ny + nx :], forward, backward)


@inline
def reflect_waves(reflect, leaving, entering):
    """Write the incoming waves `entering` at faces of a side: outgoing waves `leaving` times coefficients `reflect`."""
    for i in range(entering.size):
        entering[i] = reflect[i] * leaving[i]


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
    incoming, outgoing = spare[:CLOSURE_CELLS], spare[CLOSURE_CELLS : 2 * CLOSURE_CELLS]
    ghosts = spare[2 * CLOSURE_CELLS : 2 * CLOSURE_CELLS + GHOSTS]
    for k in range(CLOSURE_CELLS):
        at = first + step * min(k, n - 1)
        incoming[k], outgoing[k] = entering[at], leaving[at]
    if kind == MIRRORS:
        for k in range(GHOSTS):
            at = first - step * (k + 1)
            entering[at], leaving[at] = reflect * outgoing[k], reflect * incoming[k]
        return
    degree = 0 if scheme == UPWIND else 4
    a = outgoing[2]
    b = outgoing[1]
    c = outgoing[0]
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
def close_rows(liquid, grid, north, work):
    """Fill the three rows of ghost cells beyond the southern or northern side, no wall, in the ring buffer."""
    nx, ny, (_, _, first, last) = grid.nx, grid.ny, grid.sides
    kind, row, step = (last, ny - 1, -1) if north else (first, 0, 1)
    entering, leaving = (work.down, work.up) if north else (work.up, work.down)
    reflect = grid.reflect[2 * ny + (nx if north else 0) :]
    scheme = scheme_for(liquid.scheme, ny, first, last)
    spare = work.spare
    incoming = spare[:SIDE_VALUES]
    outgoing = spare[SIDE_VALUES : 2 * SIDE_VALUES]
    rest = spare[2 * SIDE_VALUES :]
    for i in range(nx):
        for k in range(min(ny, CLOSURE_CELLS)):
            at = ((row + step * k) % RING) * nx + i
            incoming[GHOSTS + k], outgoing[GHOSTS + k] = entering[at], leaving[at]
        close_side(
            kind,
            scheme,
            liquid.limiter,
            liquid.small,
            reflect[i],
            ny,
            incoming,
            outgoing,
            GHOSTS,
            1,
            rest,
        )
        for k in range(GHOSTS):
            at = ((row - step * (k + 1)) % RING) * nx + i
            entering[at], leaving[at] = incoming[GHOSTS - 1 - k], outgoing[GHOSTS - 1 - k]


@njit(forceinline=True)
def wall_flow(full, c, rho, speed, arriving):
    """Outward mass-flow density m (velocity u if `full`) at a wall that moves outward at `speed` [m/s].

    full : True with the full momentum flux, False under the density law `linear`
    c, rho : wave speed [m/s] and density [kg/m3] at rest
    arriving : c r + m (w + u if `full`) from inside, twice the outgoing wave; r : deviation of density; w : invariant
    """
    return speed if full else speed * (arriving + rho * c) / (c + speed)


@njit
def mirror_at_walls(full, c, rho, n, first, last, forward, backward):
    """Fill the three ghost cells beyond both ends of a row of n cells between moving walls.

    first, last : speeds of the walls before and after the row, along the row [m/s]
    forward, backward : float64[n + 6]  waves; the cells are at [3 : n + 3]; full, c, rho : as for `wall_flow`
    """
    for k in range(GHOSTS):
        low, high = 2 - k, n + 3 + k
        a, b = backward[3 + k], forward[3 + k]
        m = wall_flow(full, c, rho, -first, 2.0 * a)
        forward[low], backward[low] = a - m, b + m
        a, b = forward[n + 2 - k], backward[n + 2 - k]
        m = wall_flow(full, c, rho, last, 2.0 * a)
        backward[high], forward[high] = a - m, b + m


@njit
def correct_mirror_row(full, c, rho, speed, entering, leaving, n):
    """Correct the n waves of a mirrored row of ghost cells for a wall that moves outward at `speed` [m/s].

    entering, leaving : waves into and out of the grid in the mirrored row; full, c, rho : as for `wall_flow`
    """
    for i in range(n):
        m = wall_flow(full, c, rho, speed, 2.0 * entering[i])
        entering[i], leaving[i] = entering[i] - m, leaving[i] + m


@njit
def reflect_at_wall(full, c, rho, speed, leaving, entering, n):
    """Write the waves reflected at n faces of a wall that moves outward at `speed` [m/s] to `entering`.

    leaving : waves that arrive at the wall; full, c, rho : as for `wall_flow`
    """
    for i in range(n):
        entering[i] = leaving[i] - wall_flow(full, c, rho, speed, 2.0 * leaving[i])
