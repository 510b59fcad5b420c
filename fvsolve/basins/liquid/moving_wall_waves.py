"""Waves of a liquid at moving walls, and fluxes through moving faces.

A wall that moves outward at `speed` reflects waves so that the velocity at the wall is `speed`. Under the density law
`linear` the mass flow is m = speed (rho + r), so that no mass passes. Waves are (c r + m) / 2 and (c r - m) / 2 under
that law, and (w + u) / 2 and (w - u) / 2 if `full` (full momentum flux), see `grid_linear` and `grid_nonlinear`.

c : wave speed [m/s]; rho : density at rest [kg/m3]; r : deviation of density
"""

from fvsolve.jit import inline, njit

GHOSTS = 3  # number of ghost cells beyond a side


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


@njit
def put_wall_pressure(c, speed, forward, backward, along, n, thrust, loss):
    """Write the pressures on n faces of a moving wall and terms of the power lost there, density law `linear`.

    c : wave speed; speed : outward speed of the wall [m/s]; forward, backward : waves at the faces
    along : mass-flow densities along the wall; thrust, loss : see `moves` of `liquid_mesh.liquid_rates`
    """
    for i in range(n):
        x, m = forward[i] + backward[i], forward[i] - backward[i]
        thrust[i], loss[i] = c * x, speed * (x * x - m * m - along[i] * along[i])


@njit
def put_wall_flux(push, n, thrust, mass, along):
    """Write the pressures on n faces of a wall with the full momentum flux, and set the other fluxes to 0.

    No mass passes a wall, so its momentum flux `push` is the pressure. thrust : the pressures
    mass, along : fluxes of mass and of momentum along the wall
    """
    for i in range(n):
        thrust[i], mass[i], along[i] = push[i], 0.0, 0.0


@inline
def put_moving_fluxes(c, rho, speeds, step, forward, backward):
    """Convert waves at moving faces to fluxes of mass and momentum relative to the faces, density law `linear`.

    c, rho : wave speed [m/s] and density [kg/m3] at rest
    forward, backward : waves; afterwards fluxes of mass and of momentum
    speeds : speeds of the faces [m/s], read at every `step`-th place
    """
    per = 1.0 / c
    for i in range(forward.size):
        m, x, speed = forward[i] - backward[i], forward[i] + backward[i], speeds[step * i]
        forward[i], backward[i] = m - speed * (rho + per * x), c * x - speed * m


@inline
def put_row_rates(k, speeds, mass, push, along, rate_r, rate_m, rate_t):
    """Write the rates of a row of cells from the fluxes at the moving faces along it, density law `linear`.

    Cell i is between faces i and i + 1. The faces sweep over the momentum along them, so its flux is -speed times its
    mean over both cells.
    k : 1 / widths of the cells [1/m]; speeds : speeds of the faces [m/s]
    mass, push : fluxes of mass and of momentum normal to the faces; along : momentum along the faces in each cell
    rate_r, rate_m, rate_t : as for `grid_linear.put_row_rates`
    """
    m, p, last = mass[1:], push[1:], rate_r.size - 1
    for i in range(rate_r.size):
        rate_r[i] = k[i] * (mass[i] - m[i])
        rate_m[i] = k[i] * (push[i] - p[i])
    beyond, wide, before, after, interior = along[1:], k[1:], speeds[1:], speeds[2:], rate_t[1:]
    for i in range(last - 1):  # cells with a neighbour on either side
        low, high = along[i] + beyond[i], beyond[i] + along[i + 2]
        interior[i] = 0.5 * wide[i] * (after[i] * high - before[i] * low)
    for i in (0, last):
        low, high = along[max(i - 1, 0)] + along[i], along[i] + along[min(i + 1, last)]
        rate_t[i] = 0.5 * k[i] * (speeds[i + 1] * high - speeds[i] * low)


@inline
def add_column_rates(k, s0, s1, m0, p0, m1, p1, before, here, after, rate_r, rate_m, rate_t):
    """Add to the rates of a row of cells the fluxes through the rows of moving faces before (0) and after it (1).

    k : 1 / height of the row [1/m]; s, m, p : speeds of the faces, and fluxes of mass and normal momentum
    before, here, after : momentum along the faces in the row before, in this row and in the row after
    rate_r, rate_m, rate_t : rates of density, and of flows across and along the row
    """
    for i in range(rate_r.size):
        rate_r[i] += k * (m0[i] - m1[i])
        rate_m[i] += k * (p0[i] - p1[i])
        rate_t[i] += 0.5 * k * (s1 * (here[i] + after[i]) - s0 * (before[i] + here[i]))
