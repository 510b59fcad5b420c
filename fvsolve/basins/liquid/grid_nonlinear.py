"""Pressure waves of a liquid on a rectangular grid, density laws `log` and `table`, with the full momentum flux.

r_t + div m = 0, m_t + div(m m / rho) + grad p = 0: deviation of density r = rho - rho0 [kg/m3] and mass-flow densities
m [kg/(m2 s)]. Law `log` is p = rho0 c0^2 ln(rho / rho0), c = c0 sqrt(rho0 / rho), with density rho0 and wave speed c0
at rest. With w = 2 (c0 - c) and velocity u, u - w is constant along dx/dt = u - c and u + w along dx/dt = u + c
(Riemann invariants). The waves (w + u) / 2 and (w - u) / 2 are reconstructed upwind. The state that both give at a face
solves the Riemann problem with two simple waves (Osher and Solomon 1982), for subsonic flow. The velocity along a face
is reconstructed from the upwind side of the flow. Fifth order is that of the waves: products of averages are of second
order, with an error proportional to the Mach number. Sides and the ring buffer of rows: see `grid_linear`.

Under `table`, p, c and w = integral of c / rho d rho are read from a table (see `riemann_invariants`). A table of None
is known at compile time, so that each law compiles and runs only its own code.
"""

from math import sqrt

from fvsolve.basins.basin_patches import put_inward
from fvsolve.basins.cell_stretching import stretch_row_rates
from fvsolve.basins.liquid.grid_linear import (
    CLOSURE_CELLS,
    RING,
    SIDE_WORK,
    WALLS,
    close_row,
    close_side,
    faces,
    is_reversed,
    mirror,
    mirrored_cell,
    put_waves,
    reflect_waves,
    scheme_for,
    side_kind,
    value_upwind5,
)
from fvsolve.basins.liquid.moving_wall_waves import (
    GHOSTS,
    correct_mirror_row,
    mirror_at_walls,
    put_wall_flux,
    reflect_at_wall,
)
from fvsolve.basins.liquid.riemann_invariants import invariant, invariant_at_potential, state
from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import LINEAR, UPWIND, WENO5
from fvsolve.kernels.reconstruction import by_limiter, slope, value_weno5


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
    r, mx, my : states of the row; c0, rho, table, kx, ky : as in `grid_rates`, with ky of this row
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

    In a liquid at rest the invariants are uniform afterwards. c0, rho, table : as in `grid_rates`
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
    c0, rho, table : as in `grid_rates`
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
    c0, rho, table : as in `grid_rates`; k : 1 / spacing of the cells [1/m], read at every `step`-th place
    r : deviations of density; phi, low, high : potential [J/kg] of the cells and of the faces before and after them
    """
    for i in range(rate.size):
        per, bulk = stiffness(c0, rho, table, r[i])
        rate[i] += k[step * i] * bulk * (log1p_small(per * (low[i] - phi[i])) - log1p_small(per * (high[i] - phi[i])))


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
            first, low, here = a[i] if on else g[i], b[i] if on else e[i], c[i] if on else d[i]
            f[i] = value_upwind5(first, low, here, d[i] if on else c[i], e[i] if on else b[i])
    elif scheme == WENO5:
        for i in range(f.size):
            on = forward[i] > backward[i]
            first, low, here = a[i] if on else g[i], b[i] if on else e[i], c[i] if on else d[i]
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
    c0, rho, table : as in `grid_rates`
    """
    if table is not None:
        for i in range(forward.size):
            w = forward[i] + backward[i]
            r, p = state(table, w if phi is None else invariant_at_potential(c0, rho, table, w, phi[i]))
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
            forward[i], backward[i], along[i] = mass, mass * u - bulk * log1p_vector(z), mass * along[i]
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
    m, p, t = mass[1:], push[1:], along[1:]
    for i in range(rate_r.size):
        rate_r[i] = k[i] * (mass[i] - m[i])
        rate_m[i] = k[i] * (push[i] - p[i])
        rate_t[i] = k[i] * (along[i] - t[i])


@inline
def add_column_rates(k, m0, p0, t0, m1, p1, t1, rate_r, rate_m, rate_t):
    """Add to the rates of a row of cells the fluxes through the rows of faces before (0) and after it (1).

    k : 1 / height of the row [1/m]; m, p, t : fluxes of mass and of momentum normal to and along the faces
    rate_r, rate_m, rate_t : rates of density, and of flows across and along the row
    """
    for i in range(rate_r.size):
        rate_r[i] += k * (m0[i] - m1[i])
        rate_m[i] += k * (p0[i] - p1[i])
        rate_t[i] += k * (t0[i] - t1[i])


@njit
def work_size(nx, ny):
    """Length of the work array of `grid_rates` for nx columns and ny rows."""
    return (3 * RING + 6 + 3) * nx + 3 * (nx + 2 * GHOSTS) + 3 * (nx + 1) + SIDE_WORK


@njit
def grid_rates(
    c0, rho, table, small, scheme, limiter, nx, ny, begin, stop, kx, ky, reflect, r, mx, my, through, work, rate_r,
    rate_x, rate_y, moves, phi,
):  # fmt: skip
    """Write the rates of cells of rows `begin` to `stop` - 1; return the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    c0, rho : wave speed [m/s] and density [kg/m3] at rest
    table : table of `riemann_invariants`, or None for the law `log`; small : square of a negligible velocity [m2/s2]
    work : float64[work_size(nx, ny)], longer by nx + 1 if lines move
    phi : None, or the potential [J/kg] of cells, of faces between columns and of faces between rows, three arrays
    Other arguments as for `grid_linear.grid_rates`
    """
    wide, f, size = nx + 2 * GHOSTS, nx + 1, RING * nx
    up, down, aside, work = work[:size], work[size : 2 * size], work[2 * size : 3 * size], work[3 * size :]
    between, work = work[: 6 * nx], work[6 * nx :]
    w, v, top, work = work[:nx], work[nx : 2 * nx], work[2 * nx : 3 * nx], work[3 * nx :]
    east, west, over, work = work[:wide], work[wide : 2 * wide], work[2 * wide : 3 * wide], work[3 * wide :]
    fe, fw, ft, spare = work[:f], work[f : 2 * f], work[2 * f : 3 * f], work[3 * f :]
    rows = max(min(begin - GHOSTS, ny - CLOSURE_CELLS), 0)
    south, north = reflect[2 * ny : 2 * ny + nx], reflect[2 * ny + nx :]
    to_w, to_e, to_s, to_n = (
        side_kind(reflect[:ny]),
        side_kind(reflect[ny : 2 * ny]),
        side_kind(south),
        side_kind(north),
    )
    along, across = scheme_for(scheme, nx, to_w, to_e), scheme_for(scheme, ny, to_s, to_n)
    for i in range(nx):
        top[i] = 0.0
    for j in range(begin, stop + 1):  # faces between rows j - 1 and j
        while rows < min(max(j + GHOSTS, CLOSURE_CELLS), ny):
            a, z, at = rows * nx, (rows + 1) * nx, (rows % RING) * nx
            u, v = aside[at : at + nx], over[GHOSTS : nx + GHOSTS]
            put_primitives(c0, rho, table, kx, ky[rows], r[a:z], mx[a:z], my[a:z], w, u, v, top)
            if phi is not None:
                subtract_potential(c0, rho, table, phi[0][a:z], w)
            put_waves(0.5, w, v, up[at : at + nx], down[at : at + nx])
            if rows < begin or rows >= stop:
                rows += 1
                continue
            put_waves(0.5, w, u, east[GHOSTS : nx + GHOSTS], west[GHOSTS : nx + GHOSTS])
            if moves is None or moves[0].size == 0:
                mirror(nx, east, west)
            else:
                mirror_at_walls(True, c0, rho, nx, moves[0][0], moves[0][nx], east, west)
            mirror(nx, over, over)
            if to_w != WALLS:
                close_side(to_w, along, limiter, small, reflect[rows], nx, east, west, GHOSTS, 1, spare)
            if to_e != WALLS:
                last = nx + GHOSTS - 1
                close_side(to_e, along, limiter, small, reflect[ny + rows], nx, west, east, last, -1, spare)
            faces(along, limiter, small, east, east[1:], east[2:], east[3:], east[4:], fe)
            faces(along, limiter, small, west[5:], west[4:], west[3:], west[2:], west[1:], fw)
            if moves is not None and moves[0].size > 0:
                reflect_at_wall(True, c0, rho, -moves[0][0], fw, fe, 1)
                reflect_at_wall(True, c0, rho, moves[0][nx], fe[nx:], fw[nx:], 1)
            if to_w != WALLS:
                fe[0] = reflect[rows] * fw[0]
            if to_e != WALLS:
                fw[nx] = reflect[ny + rows] * fe[nx]
            if moves is None or moves[0].size == 0:
                faces_upwind(along, limiter, small, fe, fw, over, over[1:], over[2:], over[3:], over[4:], over[5:], ft)
                over_faces = None if phi is None else phi[1][rows * f : (rows + 1) * f]
                put_fluxes(c0, rho, table, fe, fw, ft, None, 0, over_faces)
            else:
                seen = spare[SIDE_WORK : SIDE_WORK + f]
                relative_waves(moves[0], 1, fe, seen)
                faces_upwind(
                    along, limiter, small, seen, fw, over, over[1:], over[2:], over[3:], over[4:], over[5:], ft
                )
                put_fluxes(c0, rho, table, fe, fw, ft, moves[0], 1, None)
                if to_w == WALLS:
                    put_wall_flux(fw, 1, moves[2][rows:], fe, ft)
                if to_e == WALLS:
                    put_wall_flux(fw[nx:], 1, moves[2][ny + rows :], fe[nx:], ft[nx:])
            if through.size > 0:
                through[rows], through[ny + rows] = fe[0] / ky[rows], -fe[nx] / ky[rows]
            put_row_rates(kx, fe, fw, ft, rate_r[a:z], rate_x[a:z], rate_y[a:z])
            if phi is not None:
                at = rows * f
                low, high = phi[1][at : at + nx], phi[1][at + 1 : at + f]
                balance_row(c0, rho, table, kx, 1, r[a:z], phi[0][a:z], low, high, rate_x[a:z])
            rows += 1
        for side in range(2):  # rows beyond the southern and the northern side
            first = j == begin and begin < GHOSTS if side == 0 else j == max(ny - GHOSTS + 1, begin)
            if not first:
                continue
            for k in range(GHOSTS):
                row = ny + k if side == 1 else -1 - k
                q, at = mirrored_cell(row, ny), (row % RING) * nx
                a, z, u = q * nx, (q + 1) * nx, aside[at : at + nx]
                ahead, back = (down, up) if is_reversed(row, ny) else (up, down)
                put_primitives(c0, rho, table, kx, ky[q], r[a:z], mx[a:z], my[a:z], w, u, v, top)
                if phi is not None:
                    subtract_potential(c0, rho, table, phi[0][a:z], w)
                put_waves(0.5, w, v, ahead[at : at + nx], back[at : at + nx])
                if moves is not None and moves[1].size > 0 and is_reversed(row, ny):
                    out = -moves[1][0] if side == 0 else moves[1][ny]
                    correct_mirror_row(
                        True, c0, rho, out, (down if side == 1 else up)[at:], (up if side == 1 else down)[at:], nx
                    )
            if side == 0 and to_s != WALLS:
                close_row(to_s, across, limiter, small, south, ny, up, down, 0, 1, spare)
            if side == 1 and to_n != WALLS:
                close_row(to_n, across, limiter, small, north, ny, down, up, ny - 1, -1, spare)
        now, before = 3 * nx * (j % 2), 3 * nx * (1 - j % 2)
        gu, gd, gt = between[now : now + nx], between[now + nx : now + 2 * nx], between[now + 2 * nx : now + 3 * nx]
        a, b, d = ((j - 3) % RING) * nx, ((j - 2) % RING) * nx, ((j - 1) % RING) * nx
        e, g, h = (j % RING) * nx, ((j + 1) % RING) * nx, ((j + 2) % RING) * nx
        faces(across, limiter, small, up[a:], up[b:], up[d:], up[e:], up[g:], gu)
        faces(across, limiter, small, down[h:], down[g:], down[e:], down[d:], down[b:], gd)
        if moves is not None and moves[1].size > 0:
            if j == 0:
                reflect_at_wall(True, c0, rho, -moves[1][0], gd, gu, nx)
            if j == ny:
                reflect_at_wall(True, c0, rho, moves[1][ny], gu, gd, nx)
        if j == 0 and to_s != WALLS:
            reflect_waves(south, gd, gu)
        if j == ny and to_n != WALLS:
            reflect_waves(north, gu, gd)
        if moves is None or moves[1].size == 0:
            faces_upwind(
                across, limiter, small, gu, gd, aside[a:], aside[b:], aside[d:], aside[e:], aside[g:], aside[h:], gt
            )
            put_fluxes(c0, rho, table, gu, gd, gt, None, 0, None if phi is None else phi[2][j * nx : (j + 1) * nx])
        else:
            seen = spare[SIDE_WORK : SIDE_WORK + nx]
            relative_waves(moves[1][j:], 0, gu, seen)
            faces_upwind(
                across, limiter, small, seen, gd, aside[a:], aside[b:], aside[d:], aside[e:], aside[g:], aside[h:], gt
            )
            put_fluxes(c0, rho, table, gu, gd, gt, moves[1][j:], 0, None)
            if (j == 0 and to_s == WALLS) or (j == ny and to_n == WALLS):
                put_wall_flux(gd, nx, moves[2][2 * ny + (nx if j > 0 else 0) :], gu, gt)
        if through.size > 0 and j == 0:
            put_inward(1.0, kx, gu, through[2 * ny : 2 * ny + nx])
        if through.size > 0 and j == ny:
            put_inward(-1.0, kx, gu, through[2 * ny + nx :])
        if j > begin:
            a, z = (j - 1) * nx, j * nx
            add_column_rates(
                ky[j - 1], between[before:], between[before + nx :], between[before + 2 * nx :], gu, gd, gt,
                rate_r[a:z], rate_y[a:z], rate_x[a:z],
            )  # fmt: skip
            if moves is not None:
                stretch_row_rates(moves[0].size > 0, moves[4], 0, j - 1, rate_r[a:z], rate_x[a:z], rate_y[a:z])
            if phi is not None:
                low, high = phi[2][a:z], phi[2][j * nx : (j + 1) * nx]
                balance_row(c0, rho, table, ky[j - 1 :], 0, r[a:z], phi[0][a:z], low, high, rate_y[a:z])
    most = 0.0
    for i in range(nx):
        most = max(most, top[i])
    return most
