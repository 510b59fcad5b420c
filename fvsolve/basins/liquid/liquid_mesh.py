"""Pressure waves of a liquid on a mesh of any cells, under all density laws.

States, waves and fluxes are as on a grid (`grid_linear` and `grid_nonlinear`): across a side the wave
(w + u) / 2 comes from inside the cell and (w - u) / 2 from the cell beyond. Under `linear` w = c r and u = m; under
`log` u = m / rho and w = 2 (c0 - c); under `table` w is read from a table.
"""

from math import sqrt

import numpy as np

from fvsolve.basins.cell_sides import (
    BLOCK,
    HEAD,
    HUGE,
    INDICES,
    MEASURES,
    NX,
    NY,
    REACH,
    SIDE,
    blocks,
    edges_before,
    gather,
    limited_sides,
    put_inward,
    ring_place,
)
from fvsolve.basins.cell_stretching import stretch_rates
from fvsolve.basins.liquid.grid_nonlinear import log1p_small, log1p_vector, stiffness, subtract_potential
from fvsolve.basins.liquid.moving_wall_waves import wall_flow
from fvsolve.basins.liquid.riemann_invariants import invariant, invariant_at_potential, state
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LOG, UPWIND

# Rows of BLOCK in the scratch of a block: values beyond, rates, sum for the step, flow through the side.
_U, _V, _RR, _RX, _RY, _FAST, _C, _TOP, _FREE, _MASS = (k * BLOCK for k in range(1, 11))
_NX, _NY, _REACH = NX * BLOCK, NY * BLOCK, REACH * BLOCK
_PUSH, _LOSS = 11 * BLOCK, 12 * BLOCK  # of moving sides: pressure at the side, term of the power lost there
_PER, _BULK, _PHI = (k * BLOCK for k in range(13, 16))  # with a potential: see `grid_nonlinear.stiffness`
ROWS = 16


@njit
def put_primitives(law, c0, rho, table, r, mx, my, w, u, v, c):
    """Write the invariant w, both velocities u, v and the wave speed c of a block of cells [m/s].

    Under the density law `linear`, u, v are the mass-flow densities and w is c r [kg/(m2 s)].
    law, c0, rho, table, r, mx, my : as in `liquid_rates`, of the block
    """
    if table is not None:
        for i in range(r.size):
            w[i], slope = invariant(table, r[i])
            volume = 1.0 / (rho + r[i])
            u[i], v[i], c[i] = volume * mx[i], volume * my[i], (rho + r[i]) * slope
        return
    if law == LAW_LOG:
        per, twice = 1.0 / rho, 2.0 * c0
        for i in range(r.size):
            x = per * r[i]
            s = sqrt(1.0 + x)
            volume = per / (s * s)
            w[i], u[i], v[i], c[i] = twice * (x / (s * (1.0 + s))), volume * mx[i], volume * my[i], c0 / s
    else:
        for i in range(r.size):
            w[i], u[i], v[i], c[i] = c0 * r[i], mx[i], my[i], c0


@njit
def put_ghosts(law, c0, rho, table, edges, ring, nx, ny, number, reflect, w, u, v, shown_w, shown_u, shown_v, moves):
    """Write the values beyond boundary sides, from which gradients in cells are computed.

    At the reflection coefficients 1 and -1 they are mirror images; at 0 (open) they are the values of the cell.
    edges, number : boundary sides, and numbers of their boundary faces; ring : see `cell_sides`
    nx, ny : outward normals; reflect : reflection coefficients of all boundary faces; w, u, v : values of cells, see
    `put_primitives`
    shown_w, shown_u, shown_v : values beyond; law, c0, rho, table, moves : as in `liquid_rates`
    """
    for q in range(edges.size):
        i = ring_place(edges[q], ring)
        r = reflect[number[q]] if reflect.size > 0 else 1.0
        out = u[i] * nx[q] + v[i] * ny[q]
        if moves is not None:
            out -= wall_flow(table is not None or law == LAW_LOG, c0, rho, moves[0][edges[q]], w[i] + out)
        across = (min(1.0, 1.0 - 2.0 * r) - 1.0) * out
        shown_w[q], shown_u[q], shown_v[q] = (
            min(1.0, 1.0 + 2.0 * r) * w[i],
            u[i] + across * nx[q],
            v[i] + across * ny[q],
        )


@njit
def put_reflections(law, c0, rho, table, edges, nx, ny, number, reflect, wl, ul, vl, w, moves):
    """Write the values beyond boundary sides to `w`: w - u there is the reflection coefficient times w + u inside.

    u is the outward velocity. A moving wall reflects waves so that the normal velocity at the wall is the speed of the
    wall.
    wl, ul, vl : values at the sides from inside; w : scratch of the block; other arguments as in `put_ghosts`
    """
    for q in range(edges.size):
        i = edges[q] % BLOCK
        r = reflect[number[q]] if reflect.size > 0 else 1.0
        out = ul[i] * nx[q] + vl[i] * ny[q]
        if moves is not None:
            out -= wall_flow(table is not None or law == LAW_LOG, c0, rho, moves[0][edges[q]], wl[i] + out)
        across = -(1.0 + r) * out
        w[i], w[_U + i], w[_V + i] = r * wl[i], ul[i] + across * nx[q], vl[i] + across * ny[q]


@njit
def add_side_linear(c0, wl, ul, vl, geo, w):
    """Subtract the outflow through one side of each cell of a block from the rates in `w`, density law `linear`.

    c0 : wave speed [m/s]; wl, ul, vl : values at the side from inside, see `put_primitives`
    w : scratch, which contains the values from beyond; geo : first group of measures of the side, see `cell_sides`
    """
    for i in range(BLOCK):
        nx, ny, reach = geo[_NX + i], geo[_NY + i], geo[_REACH + i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        push = reach * (c0 * (forward + backward))
        w[_RR + i] -= reach * (forward - backward)
        w[_MASS + i] = forward - backward
        w[_RX + i] -= push * nx
        w[_RY + i] -= push * ny
        w[_FAST + i] += reach * c0


@njit
def add_side_linear_moving(c0, rho, wl, ul, vl, geo, w, speeds):
    """Subtract the outflow through one moving side of each cell, flux - speed * quantity, density law `linear`.

    Tangential momentum has no flux under this law, so only the sweep of the side transfers it between cells. The
    pressure at the side and speed (c^2 r^2 - |m|^2) there, see `liquid_rates`, are written to `w` too.
    rho : density at rest [kg/m3]; speeds : speeds of the sides along their outward normals [m/s]
    Other arguments as in `add_side_linear`
    """
    for i in range(BLOCK):
        nx, ny, reach, speed = geo[_NX + i], geo[_NY + i], geo[_REACH + i], speeds[i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        m, pressure = forward - backward, c0 * (forward + backward)
        mass = m - speed * (rho + (forward + backward) / c0)
        tangent = vl[i] * nx - ul[i] * ny if speed < 0.0 else w[_V + i] * nx - w[_U + i] * ny
        push, along = pressure - speed * m, -speed * tangent
        w[_RR + i] -= reach * mass
        w[_MASS + i] = mass
        w[_RX + i] -= reach * (push * nx - along * ny)
        w[_RY + i] -= reach * (push * ny + along * nx)
        w[_FAST + i] += reach * (c0 + abs(speed))
        w[_PUSH + i] = pressure
        w[_LOSS + i] = speed * (pressure * pressure / (c0 * c0) - m * m - tangent * tangent)


@njit
def add_side_nonlinear(c0, rho, table, u0, v0, c, wl, ul, vl, geo, w, speeds, phi):
    """Subtract the outflow through one side of each cell of a block from the rates in `w`, with the full momentum flux.

    u0, v0, c : velocities and wave speed of the cells, for the limit of the time step
    speeds : speeds of moving sides along their outward normals [m/s], or None
    phi : None, or the potential at the sides [J/kg], whose effect was subtracted from the waves and is added again
    rho : density at rest [kg/m3]; table : as in `liquid_rates`; other arguments as in `add_side_linear`
    """
    bulk, per = rho * c0 * c0, 0.5 / c0
    for i in range(BLOCK):
        nx, ny, reach = geo[_NX + i], geo[_NY + i], geo[_REACH + i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        u = forward - backward
        through, own, invariant_sum = u, u0[i] * nx + v0[i] * ny, forward + backward
        if phi is not None:
            invariant_sum = invariant_at_potential(c0, rho, table, invariant_sum, phi[i])
        if speeds is not None:
            through, own = u - speeds[i], own - speeds[i]
        if table is not None:
            r, p = state(table, invariant_sum)
            mass = (rho + r) * through
            push = mass * u + p
        else:
            y = -per * invariant_sum  # c = c0 (1 + y)
            mass = rho * through / ((1.0 + y) * (1.0 + y))
            p = -2.0 * bulk * log1p_vector(y)
            push = mass * u + p
        along = mass * (vl[i] * nx - ul[i] * ny if through > 0.0 else w[_V + i] * nx - w[_U + i] * ny)
        w[_RR + i] -= reach * mass
        w[_RX + i] -= reach * (push * nx - along * ny)
        w[_RY + i] -= reach * (push * ny + along * nx)
        w[_FAST + i] += reach * (abs(own) + c[i])
        w[_MASS + i] = mass
        if speeds is not None:
            w[_PUSH + i], w[_LOSS + i] = p, 0.0


@njit
def put_stiffness(c0, rho, table, r, phi, w):
    """Write 1 / c^2, density times c^2 and the potential phi [J/kg] of a block of cells to the scratch `w`.

    The function `balance_side` reads them. Other arguments as for `grid_nonlinear.stiffness`
    """
    for i in range(r.size):
        w[_PER + i], w[_BULK + i] = stiffness(c0, rho, table, r[i])
        w[_PHI + i] = phi[i]


@njit
def balance_side(phi, geo, w):
    """Subtract from the rates in `w` those that the pressure of a liquid at rest causes at one side of each cell.

    After this for all sides, the rates of a liquid at rest in the potential phi are zero.
    phi : potential at the sides [J/kg]; geo : as in `add_side_linear`; w : with the values of `put_stiffness`
    """
    for i in range(BLOCK):
        push = geo[_REACH + i] * w[_BULK + i] * log1p_small(w[_PER + i] * (phi[i] - w[_PHI + i]))
        w[_RX + i] -= push * geo[_NX + i]
        w[_RY + i] -= push * geo[_NY + i]


@njit
def close_walls(edges, number, reflect, geo, w, thrust):
    """Set the mass flow through walls to zero; write pressures on boundary sides and terms of the power lost there.

    thrust : pressures of all boundary faces, then terms of lost power, see `moves` of `liquid_rates`
    edges, number, reflect : as in `put_ghosts`; geo, w : as in `add_side_linear`
    """
    count = thrust.size // 2
    for q in range(edges.size):
        i = edges[q] % BLOCK
        thrust[number[q]], thrust[count + number[q]] = w[_PUSH + i], w[_LOSS + i]
        if reflect.size == 0 or reflect[number[q]] == 1.0:
            w[_RR + i] += geo[_REACH + i] * w[_MASS + i]
            w[_MASS + i] = 0.0


@njit
def clear(w):
    """Set the rates of a block of cells, and their sums for the limit of the time step, to zero."""
    for i in range(BLOCK):
        w[_RR + i], w[_RX + i], w[_RY + i], w[_FAST + i] = 0.0, 0.0, 0.0, 0.0


@njit
def put_rates(w, rate_r, rate_x, rate_y):
    """Copy the rates of a block of cells from the scratch `w` to rate_r, rate_x, rate_y.

    The greatest sum of wave speeds over the sides, which limits the time step [1/s], is updated in `w`.
    """
    for i in range(BLOCK):
        w[_TOP + i] = max(w[_TOP + i], w[_FAST + i])
    for i in range(rate_r.size):
        rate_r[i], rate_x[i], rate_y[i] = w[_RR + i], w[_RX + i], w[_RY + i]


@njit
def work_size(integers):
    """Length of the work array of `liquid_rates`. integers : mesh, see `cell_sides`"""
    return 16 * integers[4] * BLOCK + 3 * integers[3] + ROWS * BLOCK


@njit
def liquid_rates(
    law, c0, rho, table, scheme, wide_by, floats, integers, reflect, r, mx, my, through, work, rate_r, rate_x, rate_y,
    moves, phi,
):  # fmt: skip
    """Write the rates of all cells of a mesh; return the greatest sum of L (|u| + c) / (2 A) over the sides of a cell.

    The sum [1/s] limits the time step: length L of a side, area A of the cell, wave speed c, velocity u of the cell
    normal to the side and relative to it. Under the density law `linear`, u is only the speed of a moving side.
    law : LAW_LINEAR or LAW_LOG; c0, rho : wave speed [m/s] and density [kg/m3] at rest
    table : table of `riemann_invariants` in place of a law, or None; scheme : UPWIND or MUSCL
    wide_by : factor on the range of the neighbours that limits values at sides; with 1 they stay within that range
    floats, integers : geometry and neighbours, see `basins.cell_sides`; n cells, b boundary faces
    reflect : float64[b]  reflection coefficients, -1 to 1, empty for walls
    r : float64[n]  deviation of density [kg/m3]; mx, my : mass-flow densities [kg/(m2 s)]
    through : float64[b]  inward flows through the boundary [kg/(m s)], or empty
    work : float64[work_size(integers)]
    rate_r, rate_x, rate_y : float64[n]  rates of r, mx, my
    moves : None without moving walls, else a tuple of
        speeds of sides along their outward normals [m/s], see `moving_meshes`
        float64[2 b]  pressures on boundary faces above that at rest [Pa], then, under the density law `linear`, speed
            (c^2 r^2 - |m|^2) there [kg^2/(m3 s3)]; divided by 2 rho, this is the power lost per area
        `wide` : areas of cells over undeformed areas, see `basins.cell_stretching`
    phi : None, or under laws with the full momentum flux the potential [J/kg] of cells, float64[n], and of sides in the
        order of `cell_sides`, padded to blocks
    """
    slots, n, f, b, ring = integers[0], integers[1], integers[2], integers[3], integers[4]
    count, first_order = blocks(integers), scheme == UPWIND
    m = count * slots * BLOCK
    at, to = HEAD + INDICES * m // 2, MEASURES * m
    need, edges, number = integers[at : at + count], integers[at + count :][:b], integers[at + count + b :][:b]
    bx, by, lengths = floats[to : to + b], floats[to + b : to + 2 * b], floats[to + 2 * b :][:f]
    places = integers[HEAD:].view(np.int32)
    near, wide = ring * BLOCK, 4 * ring * BLOCK
    p, u, v, c = work[:near], work[near : 2 * near], work[2 * near : 3 * near], work[3 * near : 4 * near]
    rest = work[4 * near :]
    ps, us, vs = rest[:wide], rest[wide : 2 * wide], rest[2 * wide : 3 * wide]
    if first_order:
        ps, us, vs = p, u, v
    shown, w = rest[3 * wide : 3 * wide + 3 * b], rest[3 * wide + 3 * b :]
    free = w[_FREE:]
    for i in range(BLOCK):
        w[_TOP + i], free[i] = 0.0, HUGE
    cells_done, sides_done, wall, edge = (
        0,
        0,
        0,
        0,
    )  # blocks with computed cells and sides; boundary sides done in both loops
    for j in range(count):
        while sides_done < need[j]:
            while cells_done < need[sides_done]:
                i, k, o = cells_done * BLOCK, min((cells_done + 1) * BLOCK, n), (cells_done % ring) * BLOCK
                put_primitives(law, c0, rho, table, r[i:k], mx[i:k], my[i:k], p[o:], u[o:], v[o:], c[o:])
                if phi is not None and (table is not None or law == LAW_LOG):
                    subtract_potential(c0, rho, table, phi[0][i:k], p[o : o + k - i])
                cells_done += 1
            if not first_order:
                k, wall = wall, edges_before(edges, wall, 4 * (sides_done + 1) * BLOCK)
                here, sp, su, sv = edges[k:wall], shown[k:], shown[b + k :], shown[2 * b + k :]
                put_ghosts(
                    law, c0, rho, table, here, ring, bx[k:wall], by[k:wall], number[k:wall], reflect, p, u, v,
                    sp, su, sv, moves,
                )  # fmt: skip
                limited_sides(sides_done, floats, integers, p, wide_by, free, sp, here, w, ps)
                limited_sides(sides_done, floats, integers, u, wide_by, free, su, here, w, us)
                limited_sides(sides_done, floats, integers, v, wide_by, free, sv, here, w, vs)
            sides_done += 1
        clear(w)
        first, last, o = j * BLOCK, min((j + 1) * BLOCK, n), (j % ring) * BLOCK
        if phi is not None:
            put_stiffness(c0, rho, table, r[first:last], phi[0][first:last], w)
        for k in range(slots):
            slot = j * slots + k
            where, geo = places[slot * INDICES * BLOCK :], floats[slot * MEASURES * BLOCK :]
            beyond, own = (where, o) if first_order else (where[SIDE * BLOCK :], 4 * o + k * BLOCK)
            gather(ps, beyond, w)
            gather(us, beyond, w[_U:])
            gather(vs, beyond, w[_V:])
            i, edge = edge, edges_before(edges, edge, (4 * j + k + 1) * BLOCK)
            put_reflections(
                law, c0, rho, table, edges[i:edge], bx[i:edge], by[i:edge], number[i:edge], reflect, ps[own:], us[own:],
                vs[own:], w, moves,
            )  # fmt: skip
            full = table is not None or law == LAW_LOG
            if moves is not None:
                speeds = moves[0][(4 * j + k) * BLOCK :]
                if full:
                    add_side_nonlinear(
                        c0, rho, table, u[o:], v[o:], c[o:], ps[own:], us[own:], vs[own:], geo, w, speeds, None
                    )
                else:
                    add_side_linear_moving(c0, rho, ps[own:], us[own:], vs[own:], geo, w, speeds)
                close_walls(edges[i:edge], number[i:edge], reflect, geo, w, moves[1])
            elif full:
                raised = None if phi is None else phi[1][slot * BLOCK :]
                add_side_nonlinear(
                    c0, rho, table, u[o:], v[o:], c[o:], ps[own:], us[own:], vs[own:], geo, w, None, raised
                )
                if phi is not None:
                    balance_side(phi[1][slot * BLOCK :], geo, w)
            else:
                add_side_linear(c0, ps[own:], us[own:], vs[own:], geo, w)
            if through.size > 0:
                put_inward(edges[i:edge], number[i:edge], w[_MASS:], lengths[f - b :], through)
        put_rates(w, rate_r[first:last], rate_x[first:last], rate_y[first:last])
        if moves is not None:
            stretch_rates(moves[2][first:last], rate_r[first:last], rate_x[first:last], rate_y[first:last])
    most = 0.0
    for i in range(BLOCK):
        most = max(most, w[_TOP + i])
    return 0.5 * most
