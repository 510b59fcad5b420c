"""Rows of a liquid on a rectangular grid under the density law `linear`: waves, fluxes, rates; see `liquid_grid`.

r_t + div m = 0, m_t + c^2 grad r = 0: deviation of density r [kg/m3], whose pressure is c^2 r, wave speed c [m/s], and
mass-flow densities m [kg/(m2 s)]. Along each direction the waves (c r + m) / 2 and (c r - m) / 2 are reconstructed
upwind, which is Godunov's flux. The system is linear, so one direction at a time has the full order of the scheme.
"""

from fvsolve.features.basins.liquid.liquid_sides import GHOSTS, WALLS, put_faces_along, put_waves
from fvsolve.jit import inline, njit


@inline
def put_row(liquid, grid, j, states, work, phi, up, down, aside):
    """Write the waves across row j to up, down."""
    a, z = j * grid.nx, (j + 1) * grid.nx
    put_waves(0.5 * liquid.c, states[0][a:z], states[2][a:z], up, down)


@inline
def put_rates_along(liquid, grid, j, states, work, aside, through, rates, moves, phi):
    """Write the rates of row j by the fluxes along it."""
    c = liquid.c
    nx = grid.nx
    ny = grid.ny
    k = grid.ky[j]
    a = j * grid.nx
    z = (j + 1) * grid.nx
    put_waves(
        0.5 * c,
        states[0][a:z],
        states[1][a:z],
        work.east[GHOSTS : nx + GHOSTS],
        work.west[GHOSTS : nx + GHOSTS],
    )
    put_faces_along(liquid, grid, j, work, moves)
    east, west, (rate_r, rate_x, rate_y) = work.forward, work.backward, rates
    if through.size > 0:
        through[j], through[ny + j] = (east[0] - west[0]) / k, (west[nx] - east[nx]) / k
    if moves is None or moves.speed_x.size == 0:
        put_row_rates(c, grid.kx, east, west, rate_r[a:z], rate_x[a:z], rate_y[a:z])
        return
    speeds = moves.speed_x
    along = states[2][a:z]
    thrust = moves.thrust
    loss = moves.thrust[moves.thrust.size // 2 :]
    put_wall_pressure(c, -speeds[0], east, west, along, 1, thrust[j:], loss[j:])
    put_wall_pressure(
        c, speeds[nx], east[nx:], west[nx:], along[nx - 1 :], 1, thrust[ny + j :], loss[ny + j :]
    )
    put_moving_fluxes(c, liquid.rho, speeds, 1, east, west)
    east[0] = 0.0 if grid.sides[0] == WALLS else east[0]
    east[nx] = 0.0 if grid.sides[1] == WALLS else east[nx]
    if through.size > 0:
        through[j], through[ny + j] = east[0] / k, -east[nx] / k
    put_moving_row_rates(grid.kx, speeds, east, west, along, rate_r[a:z], rate_x[a:z], rate_y[a:z])


@inline
def put_fluxes_across(liquid, grid, j, states, work, flux, through, moves, phi):
    """Convert the waves at moving faces before row j to fluxes, and write flows and pressures at the sides."""
    nx = grid.nx
    ny = grid.ny
    up = flux[0]
    down = flux[1]
    at = 2 * ny + (nx if j > 0 else 0)
    if through.size > 0 and j == 0:
        put_inward(grid.kx, up, down, through[at : at + nx])
    if through.size > 0 and j == ny:
        put_inward(grid.kx, down, up, through[at : at + nx])
    if moves is None or moves.speed_y.size == 0:
        return
    speed, is_side = moves.speed_y[j], j == 0 or j == ny
    if is_side:
        thrust, loss = moves.thrust, moves.thrust[moves.thrust.size // 2 :]
        along, outward = states[1][(ny - 1) * nx if j > 0 else 0 :], speed if j > 0 else -speed
        put_wall_pressure(liquid.c, outward, up, down, along, nx, thrust[at:], loss[at:])
    put_moving_fluxes(liquid.c, liquid.rho, moves.speed_y[j:], 0, up, down)
    if is_side and grid.sides[2 if j == 0 else 3] == WALLS:
        for i in range(nx):
            up[i] = 0.0
        for i in range(nx if through.size > 0 else 0):
            through[at + i] = 0.0


@inline
def add_rates_across(liquid, grid, j, states, before, after, rates, moves, phi):
    """Add to the rates of row j the fluxes through the faces before and after it."""
    nx, ny, a, z, (rate_r, rate_x, rate_y) = grid.nx, grid.ny, j * grid.nx, (j + 1) * grid.nx, rates
    if moves is None or moves.speed_y.size == 0:
        add_column_rates(
            liquid.c, grid.ky[j], before[0], before[1], after[0], after[1], rate_r[a:z], rate_y[a:z]
        )
        return
    flow = states[1]
    along = flow[max(j - 1, 0) * nx :], flow[a:], flow[min(j + 1, ny - 1) * nx :]
    add_moving_column_rates(
        grid.ky[j], moves.speed_y[j:], before, after, along, rate_r[a:z], rate_y[a:z], rate_x[a:z]
    )


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


@inline
def put_inward(k, entering, leaving, inward):
    """Write the inward mass flows per thickness through the faces of a side [kg/(m s)] to `inward`.

    k : 1 / lengths of the faces [1/m]; entering, leaving : incoming and outgoing waves at the faces
    """
    for i in range(inward.size):
        inward[i] = (entering[i] - leaving[i]) / k[i]


@njit
def put_wall_pressure(c, speed, forward, backward, along, n, thrust, loss):
    """Write the pressures on n faces of a moving wall and terms of the power lost there.

    c : wave speed; speed : outward speed of the wall [m/s]; forward, backward : waves at the faces
    along : mass-flow densities along the wall; thrust, loss : see `GridMotion`
    """
    for i in range(n):
        x, m = forward[i] + backward[i], forward[i] - backward[i]
        thrust[i], loss[i] = c * x, speed * (x * x - m * m - along[i] * along[i])


@inline
def put_moving_fluxes(c, rho, speeds, step, forward, backward):
    """Convert waves at moving faces to fluxes of mass and momentum relative to the faces.

    c, rho : wave speed [m/s] and density [kg/m3] at rest
    forward, backward : waves; afterwards fluxes of mass and of momentum
    speeds : speeds of the faces [m/s], read at every `step`-th place
    """
    per = 1.0 / c
    for i in range(forward.size):
        m = forward[i] - backward[i]
        x = forward[i] + backward[i]
        speed = speeds[step * i]
        forward[i], backward[i] = m - speed * (rho + per * x), c * x - speed * m


@inline
def put_moving_row_rates(k, speeds, mass, push, along, rate_r, rate_m, rate_t):
    """Write the rates of a row of cells from the fluxes at the moving faces along it.

    Cell i is between faces i and i + 1. The faces sweep over the momentum along them, so its flux is -speed times its
    mean over both cells.
    k : 1 / widths of the cells [1/m]; speeds : speeds of the faces [m/s]
    mass, push : fluxes of mass and of momentum normal to the faces; along : momentum along the faces in each cell
    rate_r, rate_m, rate_t : as for `put_row_rates`
    """
    m = mass[1:]
    p = push[1:]
    last = rate_r.size - 1
    for i in range(rate_r.size):
        rate_r[i] = k[i] * (mass[i] - m[i])
        rate_m[i] = k[i] * (push[i] - p[i])
    beyond = along[1:]
    wide = k[1:]
    before = speeds[1:]
    after = speeds[2:]
    interior = rate_t[1:]
    for i in range(last - 1):  # cells with a neighbour on either side
        low, high = along[i] + beyond[i], beyond[i] + along[i + 2]
        interior[i] = 0.5 * wide[i] * (after[i] * high - before[i] * low)
    for i in (0, last):
        low, high = along[max(i - 1, 0)] + along[i], along[i] + along[min(i + 1, last)]
        rate_t[i] = 0.5 * k[i] * (speeds[i + 1] * high - speeds[i] * low)


@inline
def add_moving_column_rates(k, speeds, fluxes_before, fluxes_after, along, rate_r, rate_m, rate_t):
    """Add to the rates of a row of cells the fluxes through the rows of moving faces before and after it.

    k : 1 / height of the row [1/m]; speeds : speeds of both rows of faces
    fluxes_before, fluxes_after : fluxes of mass and of normal momentum
    along : momentum along the faces in the row before, in this row and in the row after
    rate_r, rate_m, rate_t : rates of density, and of flows across and along the row
    """
    s0 = speeds[0]
    s1 = speeds[1]
    m0 = fluxes_before[0]
    p0 = fluxes_before[1]
    m1 = fluxes_after[0]
    p1 = fluxes_after[1]
    before, here, after = along
    for i in range(rate_r.size):
        rate_r[i] += k * (m0[i] - m1[i])
        rate_m[i] += k * (p0[i] - p1[i])
        rate_t[i] += 0.5 * k * (s1 * (here[i] + after[i]) - s0 * (before[i] + here[i]))
