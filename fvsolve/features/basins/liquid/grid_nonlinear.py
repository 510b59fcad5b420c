"""Rows of a liquid on a rectangular grid under the density laws `log` and `table`: waves, fluxes, rates.

r_t + div m = 0, m_t + div(m m / rho) + grad p = 0: deviation of density r = rho - rho0 [kg/m3] and mass-flow densities
m [kg/(m2 s)]. Law `log` is p = rho0 c0^2 ln(rho / rho0), c = c0 sqrt(rho0 / rho), with density rho0 and wave speed c0
at rest. With w = 2 (c0 - c) and velocity u, u - w is constant along dx/dt = u - c and u + w along dx/dt = u + c
(Riemann invariants). The waves (w + u) / 2 and (w - u) / 2 are reconstructed upwind. The state that both give at a face
solves the Riemann problem with two simple waves (Osher and Solomon 1982), for subsonic flow. The velocity along a face
is reconstructed from the upwind side of the flow. Fifth order is that of the waves: products of averages are of second
order, with an error proportional to the Mach number. For the arguments of the first functions see `liquid_grid`.

Under `table`, p, c and w = integral of c / rho d rho are read from a table (see `riemann_invariants`). A table of None
is known at compile time, so that each law compiles and runs only its own code.
"""

from math import sqrt

from fvsolve.core.kernels.dtypes import LINEAR, UPWIND, WENO5
from fvsolve.core.kernels.reconstruction import by_limiter, slope, value_weno5
from fvsolve.features.basins.basin_patches import put_inward
from fvsolve.features.basins.liquid import liquid_sides as sides
from fvsolve.features.basins.liquid.liquid_sides import GHOSTS, WALLS, ring_offset, value_upwind5
from fvsolve.features.basins.liquid.riemann_invariants import (
    invariant,
    invariant_at_potential,
    state,
)
from fvsolve.jit import inline, njit


@inline
def put_row(liquid, grid, j, states, work, phi, up, down, aside):
    """Write the waves across row j to up, down, and the velocities along it to `aside`."""
    c, rho, table, nx, (r, mx, my) = liquid.c, liquid.rho, liquid.table, grid.nx, states
    a = j * nx
    z = (j + 1) * nx
    v = work.over[GHOSTS : nx + GHOSTS]
    put_primitives(
        c, rho, table, grid.kx, grid.ky[j], r[a:z], mx[a:z], my[a:z], work.w, aside, v, work.top
    )
    if phi is not None:
        subtract_potential(c, rho, table, phi.cells[a:z], work.w)
    sides.put_waves(0.5, work.w, v, up, down)


@inline
def put_rates_along(liquid, grid, j, states, work, aside, through, rates, moves, phi):
    """Write the rates of row j by the fluxes along it."""
    nx = grid.nx
    ny = grid.ny
    k = grid.ky[j]
    a = j * grid.nx
    z = (j + 1) * grid.nx
    f = grid.nx + 1
    mass = work.forward
    push = work.backward
    along = work.along
    over = work.over
    sides.put_waves(
        0.5, work.w, aside, work.east[GHOSTS : nx + GHOSTS], work.west[GHOSTS : nx + GHOSTS]
    )
    sides.mirror(nx, over, over)
    sides.put_faces_along(liquid, grid, j, work, moves)
    scheme = sides.scheme_for(liquid.scheme, nx, grid.sides[0], grid.sides[1])
    flux = (mass, push, along)
    cells = over, over[1:], over[2:], over[3:], over[4:], over[5:]
    if moves is None or moves.speed_x.size == 0:
        at_faces = None if phi is None else phi.columns[j * f : (j + 1) * f]
        put_upwind_fluxes(liquid, scheme, cells, None, 0, at_faces, work.seen, flux)
    else:
        put_upwind_fluxes(liquid, scheme, cells, moves.speed_x, 1, None, work.seen, flux)
        if grid.sides[0] == WALLS:
            put_wall_flux(push, 1, moves.thrust[j:], mass, along)
        if grid.sides[1] == WALLS:
            put_wall_flux(push[nx:], 1, moves.thrust[ny + j :], mass[nx:], along[nx:])
    if through.size > 0:
        through[j], through[ny + j] = mass[0] / k, -mass[nx] / k
    put_row_rates(grid.kx, mass, push, along, rates[0][a:z], rates[1][a:z], rates[2][a:z])
    if phi is not None:
        r = states[0][a:z]
        at_cells = phi.cells[a:z]
        low = phi.columns[j * f :]
        high = phi.columns[j * f + 1 :]
        balance_row(
            liquid.c, liquid.rho, liquid.table, grid.kx, 1, r, at_cells, low, high, rates[1][a:z]
        )


@inline
def put_fluxes_across(liquid, grid, j, states, work, flux, through, moves, phi):
    """Convert the waves at the faces before row j to fluxes, and write flows and pressures at the sides."""
    nx, ny, (mass, push, along) = grid.nx, grid.ny, flux
    scheme = sides.scheme_for(liquid.scheme, ny, grid.sides[2], grid.sides[3])
    at = 2 * ny + (nx if j > 0 else 0)
    aside = work.aside
    a = aside[ring_offset(j - 3, nx) :]
    b = aside[ring_offset(j - 2, nx) :]
    c = aside[ring_offset(j - 1, nx) :]
    d = aside[ring_offset(j, nx) :]
    e = aside[ring_offset(j + 1, nx) :]
    g = aside[ring_offset(j + 2, nx) :]
    if moves is None or moves.speed_y.size == 0:
        at_faces = None if phi is None else phi.rows[j * nx : (j + 1) * nx]
        put_upwind_fluxes(liquid, scheme, (a, b, c, d, e, g), None, 0, at_faces, work.seen, flux)
    else:
        put_upwind_fluxes(
            liquid, scheme, (a, b, c, d, e, g), moves.speed_y[j:], 0, None, work.seen[:nx], flux
        )
        if (j == 0 and grid.sides[2] == WALLS) or (j == ny and grid.sides[3] == WALLS):
            put_wall_flux(push, nx, moves.thrust[at:], mass, along)
    if through.size > 0 and (j == 0 or j == ny):
        put_inward(1.0 if j == 0 else -1.0, grid.kx, mass, through[at : at + nx])


@inline
def add_rates_across(liquid, grid, j, states, before, after, rates, moves, phi):
    """Add to the rates of row j the fluxes through the faces before and after it."""
    nx, a, z, (rate_r, rate_x, rate_y) = grid.nx, j * grid.nx, (j + 1) * grid.nx, rates
    add_column_rates(grid.ky[j], before, after, rate_r[a:z], rate_y[a:z], rate_x[a:z])
    if phi is not None:
        r = states[0][a:z]
        at_cells = phi.cells[a:z]
        low = phi.rows[a:z]
        high = phi.rows[z : z + nx]
        balance_row(
            liquid.c, liquid.rho, liquid.table, grid.ky[j:], 0, r, at_cells, low, high, rate_y[a:z]
        )


@inline
def put_upwind_fluxes(liquid, scheme, cells, speeds, step, phi, seen, flux):
    """Write the velocities along faces, reconstructed from the upwind side of the flow, and convert all to fluxes.

    scheme : scheme between the sides of the grid; cells : velocities in six consecutive cells, six arrays
    seen : work array for moving faces; flux : waves and velocity along the face, three arrays, then the fluxes
    speeds, step, phi : as for `put_fluxes`
    """
    forward, backward, along = flux
    a, b, c, d, e, g = cells
    if speeds is None:
        faces_upwind(
            scheme, liquid.limiter, liquid.small, forward, backward, a, b, c, d, e, g, along
        )
    else:
        relative_waves(speeds, step, forward, seen)
        faces_upwind(scheme, liquid.limiter, liquid.small, seen, backward, a, b, c, d, e, g, along)
    put_fluxes(liquid.c, liquid.rho, liquid.table, forward, backward, along, speeds, step, phi)


@njit(forceinline=True)
def log1p_vector(y):
    """ln(1 + y) to round-off, for y from -1/2 to 1: 8 artanh((x - 1) / (x + 1)), x the fourth root of 1 + y.

    It calls no library function, so that loops vectorise.
    """
    s = sqrt(1.0 + y)
    q = 1.0 + sqrt(s)
    t = y / ((1.0 + s) * (q * q))
    z = t * t
    p = 1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0))
    p = 1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * p))
    return 8.0 * t * (1.0 + z * (1.0 / 3.0 + z * p))


@inline
def put_primitives(c0, rho, table, kx, ky, r, mx, my, w, u, v, top):
    """Write the invariant w and both velocities u, v of a row of cells [m/s], and update `top`.

    top : float64[nx]  greatest (|u| + c) kx + (|v| + c) ky so far in each column [1/s]
    r, mx, my : states of the row; kx, ky : 1 / widths of the columns, 1 / height of the row [1/m]
    c0, rho, table : see `LiquidScheme`
    """
    if table is not None:
        for i in range(w.size):
            w[i], slope = invariant(table, r[i])
            c, volume = (rho + r[i]) * slope, 1.0 / (rho + r[i])
            a, b = volume * mx[i], volume * my[i]
            rate = (abs(a) + c) * kx[i] + (abs(b) + c) * ky
            u[i], v[i] = a, b
            top[i] = rate if rate > top[i] else top[i]
        return
    per, twice = 1.0 / rho, 2.0 * c0
    for i in range(w.size):
        x = per * r[i]
        s = sqrt(1.0 + x)
        change, volume = twice * (x / (s * (1.0 + s))), per / (s * s)
        a, b = volume * mx[i], volume * my[i]
        c = c0 - 0.5 * change
        rate = (abs(a) + c) * kx[i] + (abs(b) + c) * ky
        w[i], u[i], v[i] = change, a, b
        top[i] = rate if rate > top[i] else top[i]


@inline
def subtract_potential(c0, rho, table, phi, w):
    """Subtract the effect of a potential phi [J/kg] from the invariants w of a row of cells.

    In a liquid at rest the invariants are uniform afterwards. c0, rho, table : see `LiquidScheme`
    """
    for i in range(w.size):
        w[i] = invariant_at_potential(c0, rho, table, w[i], -phi[i])


@njit(forceinline=True)
def log1p_small(q):
    """ln(1 + q) by its series to -q^8 / 8, for small q such as the change of a potential within a cell over c^2."""
    high = 1.0 / 5.0 - q * (1.0 / 6.0 - q * (1.0 / 7.0 - q * (1.0 / 8.0)))
    return q * (1.0 - q * (1.0 / 2.0 - q * (1.0 / 3.0 - q * (1.0 / 4.0 - q * high))))


@njit(forceinline=True)
def stiffness(c0, rho, table, r):
    """(1 / c^2, density times c^2) of a cell with the deviation of density r and the wave speed c.

    In a liquid at rest, pressure falls by about density times c^2 ln(1 + phi / c^2) where a potential rises by phi.
    c0, rho, table : see `LiquidScheme`
    """
    if table is None:
        bulk = rho * c0 * c0
        return (rho + r) / bulk, bulk
    c = (rho + r) * invariant(table, r)[1]
    return 1.0 / (c * c), (rho + r) * c * c


@inline
def balance_row(c0, rho, table, k, step, r, phi, low, high, rate):
    """Subtract from the momentum rates of a row of cells the rates that face pressures of a liquid at rest cause.

    So the rates of a liquid at rest in the potential phi are zero.
    c0, rho, table : see `LiquidScheme`; k : 1 / spacing of the cells [1/m], read at every `step`-th place
    r : deviations of density; phi, low, high : potential [J/kg] of the cells and of the faces before and after them
    """
    for i in range(rate.size):
        per, bulk = stiffness(c0, rho, table, r[i])
        rate[i] += (
            k[step * i]
            * bulk
            * (log1p_small(per * (low[i] - phi[i])) - log1p_small(per * (high[i] - phi[i])))
        )


@inline
def faces_upwind_limited(limiter, forward, backward, b, c, d, e, f):
    """Write the values at faces as `faces_upwind` does, with limited slopes by a limiter function."""
    for i in range(f.size):
        on, jump = forward[i] > backward[i], d[i] - c[i]
        rise = c[i] - b[i] if on else e[i] - d[i]
        s = 0.5 * slope(limiter, rise, jump)
        f[i] = c[i] + s if on else d[i] - s


@njit
def faces_upwind(scheme, limiter, small, forward, backward, a, b, c, d, e, g, f):
    """Write to f the values at faces between cells c and d, reconstructed from the upwind side of the flow.

    forward, backward : waves at the faces, whose difference is the velocity; small : see `value_weno5`
    a, b, c, d, e, g : averages of six consecutive cells
    """
    if scheme == UPWIND:
        for i in range(f.size):
            f[i] = c[i] if forward[i] > backward[i] else d[i]
    elif scheme == LINEAR:
        for i in range(f.size):
            on = forward[i] > backward[i]
            first = a[i] if on else g[i]
            low = b[i] if on else e[i]
            here = c[i] if on else d[i]
            f[i] = value_upwind5(first, low, here, d[i] if on else c[i], e[i] if on else b[i])
    elif scheme == WENO5:
        for i in range(f.size):
            on = forward[i] > backward[i]
            first = a[i] if on else g[i]
            low = b[i] if on else e[i]
            here = c[i] if on else d[i]
            f[i] = value_weno5(first, low, here, d[i] if on else c[i], e[i] if on else b[i], small)
    else:
        by_limiter(faces_upwind_limited, limiter, forward, backward, b, c, d, e, f)


@inline
def put_fluxes(c0, rho, table, forward, backward, along, speeds, step, phi):
    """Convert values at faces to fluxes, in place.

    forward, backward, along : waves and velocity along the face; afterwards fluxes of mass and of momentum normal to
    and along the face
    speeds : None, or speeds of moving faces, read at every `step`-th place; the flux is then relative to the face
    phi : None, or the potential at the faces [J/kg], whose effect was subtracted from the waves and is added again
    c0, rho, table : see `LiquidScheme`
    """
    if table is not None:
        for i in range(forward.size):
            w = forward[i] + backward[i]
            r, p = state(
                table, w if phi is None else invariant_at_potential(c0, rho, table, w, phi[i])
            )
            u = forward[i] - backward[i]
            mass = (rho + r) * (u if speeds is None else u - speeds[step * i])
            forward[i], backward[i], along[i] = mass, mass * u + p, mass * along[i]
        return
    bulk, per = rho * c0 * c0, 0.5 / c0
    if phi is not None:
        for i in range(forward.size):
            y, u = -per * (forward[i] + backward[i]), forward[i] - backward[i]
            z = y * (2.0 + y) + phi[i] / (c0 * c0)
            mass = rho * u / (1.0 + z)
            forward[i], backward[i], along[i] = (
                mass,
                mass * u - bulk * log1p_vector(z),
                mass * along[i],
            )
        return
    for i in range(forward.size):
        y, u = -per * (forward[i] + backward[i]), forward[i] - backward[i]  # c = c0 (1 + y)
        mass = rho * (u if speeds is None else u - speeds[step * i]) / ((1.0 + y) * (1.0 + y))
        forward[i], backward[i] = mass, mass * u - 2.0 * bulk * log1p_vector(y)
        along[i] = mass * along[i]


@inline
def relative_waves(speeds, step, forward, seen):
    """Write the forward waves minus the speeds of moving faces to `seen`.

    The result minus the backward waves is the velocity relative to the face, which defines the upwind side.
    speeds : speeds of the faces [m/s], read at every `step`-th place
    """
    for i in range(seen.size):
        seen[i] = forward[i] - speeds[step * i]


@inline
def put_row_rates(k, mass, push, along, rate_r, rate_m, rate_t):
    """Write the rates of a row of cells from the fluxes at the faces along it; cell i is between faces i and i + 1.

    k : 1 / widths of the cells [1/m]; mass, push, along : fluxes of mass and of momentum normal to and along the faces
    rate_r, rate_m, rate_t : rates of density, and of flows along and across the row
    """
    m = mass[1:]
    p = push[1:]
    t = along[1:]
    for i in range(rate_r.size):
        rate_r[i] = k[i] * (mass[i] - m[i])
        rate_m[i] = k[i] * (push[i] - p[i])
        rate_t[i] = k[i] * (along[i] - t[i])


@inline
def add_column_rates(k, before, after, rate_r, rate_m, rate_t):
    """Add to the rates of a row of cells the fluxes through the rows of faces before and after it.

    k : 1 / height of the row [1/m]; before, after : fluxes of mass and of momentum normal to and along the faces
    rate_r, rate_m, rate_t : rates of density, and of flows across and along the row
    """
    (m0, p0, t0), (m1, p1, t1) = before, after
    for i in range(rate_r.size):
        rate_r[i] += k * (m0[i] - m1[i])
        rate_m[i] += k * (p0[i] - p1[i])
        rate_t[i] += k * (t0[i] - t1[i])


@njit
def put_wall_flux(push, n, thrust, mass, along):
    """Write the pressures on n faces of a wall, and set the fluxes other than the momentum flux to 0.

    No mass passes a wall, so its momentum flux `push` is the pressure. thrust : the pressures
    mass, along : fluxes of mass and of momentum along the wall
    """
    for i in range(n):
        thrust[i], mass[i], along[i] = push[i], 0.0, 0.0
