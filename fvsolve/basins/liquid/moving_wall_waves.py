"""Waves of a liquid at moving walls, and fluxes through moving faces.

A wall that moves outward at `speed` reflects waves so that the velocity at the wall is its own. Under law `linear` the
mass flow is m = speed (rho + r), so that no mass passes. Waves are c r and m, or w and u if `full`, see `grid_linear`.
"""

from fvsolve.jit import inline, njit

GHOSTS = 3  # number of ghost cells beyond a side


@njit(forceinline=True)
def wall_flow(full, c, rho, speed, arriving):
    """m, or u if `full`, at a moving wall. arriving : c r + m, or w + u, across the wall from inside"""
    return speed if full else speed * (arriving + rho * c) / (c + speed)


@njit
def mirror_at_walls(full, c, rho, n, first, last, forward, backward):
    """Fill three values beyond either end of [3 : n + 3] of two waves. first, last : speeds of the walls there"""
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
    """Correct a mirrored row beyond a side for the speed of a wall that moves outward."""
    for i in range(n):
        m = wall_flow(full, c, rho, speed, 2.0 * entering[i])
        entering[i], leaving[i] = entering[i] - m, leaving[i] + m


@njit
def reflect_at_wall(full, c, rho, speed, leaving, entering, n):
    """Waves reflected at faces of a moving wall."""
    for i in range(n):
        entering[i] = leaving[i] - wall_flow(full, c, rho, speed, 2.0 * leaving[i])


@njit
def put_wall_pressure(c, speed, forward, backward, along, n, thrust, loss):
    """Pressure on faces of a wall under law `linear`, and the energy lost there; see `liquid_mesh`."""
    for i in range(n):
        x, m = forward[i] + backward[i], forward[i] - backward[i]
        thrust[i], loss[i] = c * x, speed * (x * x - m * m - along[i] * along[i])


@njit
def put_wall_flux(push, n, thrust, mass, along):
    """Pressure on faces of a wall with the full momentum flux, which is the flux because no mass passes."""
    for i in range(n):
        thrust[i], mass[i], along[i] = push[i], 0.0, 0.0


@inline
def put_moving_fluxes(c, rho, speeds, step, forward, backward):
    """Fluxes of mass and momentum from waves at faces, minus the content swept by the faces.

    speeds : every `step`-th value is that of a face
    """
    per = 1.0 / c
    for i in range(forward.size):
        m, x, speed = forward[i] - backward[i], forward[i] + backward[i], speeds[step * i]
        forward[i], backward[i] = m - speed * (rho + per * x), c * x - speed * m


@inline
def put_row_rates(k, speeds, mass, push, along, rate_r, rate_m, rate_t):
    """Rates of a row of cells from faces i and i + 1; momentum along faces is not carried by moving faces."""
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
    """Add the rates of a row of cells between two rows of faces.

    before, here, after : momentum along the faces in three rows
    """
    for i in range(rate_r.size):
        rate_r[i] += k * (m0[i] - m1[i])
        rate_m[i] += k * (p0[i] - p1[i])
        rate_t[i] += 0.5 * k * (s1 * (here[i] + after[i]) - s0 * (before[i] + here[i]))
