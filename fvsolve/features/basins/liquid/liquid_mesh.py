"""Sides of the cells of a liquid on a mesh of any cells, under all density laws, for `mesh_blocks`.

States, waves and fluxes are as on a grid (`grid_linear` and `grid_nonlinear`): across a side the wave
(w + u) / 2 comes from inside the cell and (w - u) / 2 from the cell beyond. Under `linear` w = c r and u = m; under
`log` u = m / rho and w = 2 (c0 - c); under `table` w is read from a table. Cells have w, both velocities and c.
"""

from math import sqrt

from fvsolve.features.basins.cell_sides import (
    BLOCK,
    HUGE,
    MEASURES,
    NX,
    NY,
    REACH,
    limited_sides,
    ring_place,
)
from fvsolve.features.basins.liquid.grid_nonlinear import (
    log1p_small,
    log1p_vector,
    stiffness,
    subtract_potential,
)
from fvsolve.features.basins.liquid.liquid_sides import wall_flow
from fvsolve.features.basins.liquid.riemann_invariants import (
    invariant,
    invariant_at_potential,
    state,
)
from fvsolve.features.basins.mesh_blocks import own_sides
from fvsolve.jit import inline, njit

FIELDS, ROWS_OF_CELLS, SHOWN = 3, 4, 3  # see `mesh_blocks`
# Rows of BLOCK in the scratch of a block: values beyond, rates, sum for the step, flow through the side.
_U, _V, _RR, _RX, _RY, _FAST, _C, TOP, _FREE, MASS = (k * BLOCK for k in range(1, 11))
_NX = NX * BLOCK
_NY = NY * BLOCK
_REACH = REACH * BLOCK
# of moving sides: pressure at the side, term of the power lost there
_PUSH, _LOSS = 11 * BLOCK, 12 * BLOCK
# with a potential: see `grid_nonlinear.stiffness`
_PER, _BULK, _PHI = (k * BLOCK for k in range(13, 16))
ROWS = 16
# reflection coefficient that marks the faces of a patch with links: a wall, through which links pass flow
LINKED = 2.0


@inline
def begin(w):
    """Set the greatest rates to zero, and the allowed differences at sides to HUGE."""
    for i in range(BLOCK):
        w[TOP + i], w[_FREE + i] = 0.0, HUGE


@inline
def put_cells(liquid, mesh, j, states, cells, phi):
    """Write invariants, velocities and wave speeds of block j of cells."""
    a = j * BLOCK
    z = min((j + 1) * BLOCK, mesh.n)
    o = (j % mesh.ring) * BLOCK
    c0, rho, table, (r, mx, my) = liquid.c, liquid.rho, liquid.table, states
    w = cells[0, o:]
    u = cells[1, o:]
    v = cells[2, o:]
    c = cells[3, o:]
    put_primitives(liquid.full, c0, rho, table, r[a:z], mx[a:z], my[a:z], w, u, v, c)
    if phi is not None:
        subtract_potential(c0, rho, table, phi[0][a:z], w[: z - a])


@njit
def put_primitives(full, c0, rho, table, r, mx, my, w, u, v, c):
    """Write the invariant w, both velocities u, v and the wave speed c of a block of cells [m/s].

    Under the density law `linear`, u, v are the mass-flow densities and w is c r [kg/(m2 s)].
    full, c0, rho, table : see `LiquidScheme`; r, mx, my : states of the block
    """
    if table is not None:
        for i in range(r.size):
            w[i], slope = invariant(table, r[i])
            volume = 1.0 / (rho + r[i])
            u[i], v[i], c[i] = volume * mx[i], volume * my[i], (rho + r[i]) * slope
        return
    if full:
        per, twice = 1.0 / rho, 2.0 * c0
        for i in range(r.size):
            x = per * r[i]
            s = sqrt(1.0 + x)
            volume = per / (s * s)
            w[i], u[i], v[i], c[i] = (
                twice * (x / (s * (1.0 + s))),
                volume * mx[i],
                volume * my[i],
                c0 / s,
            )
    else:
        for i in range(r.size):
            w[i], u[i], v[i], c[i] = c0 * r[i], mx[i], my[i], c0


@inline
def put_sides(liquid, mesh, j, first, last, reflect, cells, sides, shown, w, moves):
    """Write the limited values at the sides of the cells of block j."""
    edges = mesh.edges[first:last]
    free = w[_FREE:]
    b = mesh.edges.size
    put_ghosts(liquid, mesh, first, last, reflect, cells, shown, moves)
    for q in range(FIELDS):
        beyond = shown[q * b + first :]
        limited_sides(
            j,
            mesh.floats,
            mesh.integers,
            cells[q],
            liquid.wide_by,
            free,
            beyond,
            edges,
            w,
            sides[q],
        )


@inline
def put_ghosts(liquid, mesh, first, last, reflect, cells, shown, moves):
    """Write the values beyond boundary sides, from which gradients in cells are computed.

    At the reflection coefficients 1 and -1 they are mirror images; at 0 (open) they are the values of the cell, and at
    patches with links too. A mirror image of the flow there would give a gradient to uniform flow, and the pressure on
    the face would do work on it.
    """
    w = cells[0]
    u = cells[1]
    v = cells[2]
    b = mesh.edges.size
    for q in range(first, last):
        i = ring_place(mesh.edges[q], mesh.ring)
        nx = mesh.nx[q]
        ny = mesh.ny[q]
        r = reflect[mesh.number[q]] if reflect.size > 0 else 1.0
        r = 0.0 if r == LINKED else r
        out = u[i] * nx + v[i] * ny
        if moves is not None:
            out -= wall_flow(
                liquid.full, liquid.c, liquid.rho, moves.speeds[mesh.edges[q]], w[i] + out
            )
        across = (min(1.0, 1.0 - 2.0 * r) - 1.0) * out
        shown[q] = min(1.0, 1.0 + 2.0 * r) * w[i]
        shown[b + q], shown[2 * b + q] = u[i] + across * nx, v[i] + across * ny


@inline
def begin_block(liquid, mesh, j, states, w, phi):
    """Set the rates of block j of cells, and their sums for the limit of the time step, to zero."""
    for i in range(BLOCK):
        w[_RR + i], w[_RX + i], w[_RY + i], w[_FAST + i] = 0.0, 0.0, 0.0, 0.0
    if phi is not None:
        a, z = j * BLOCK, min((j + 1) * BLOCK, mesh.n)
        put_stiffness(liquid.c, liquid.rho, liquid.table, states[0][a:z], phi[0][a:z], w)


@inline
def add_side(liquid, mesh, j, k, first, last, reflect, cells, sides, w, moves, phi):
    """Subtract the outflow through side k of each cell of block j from the rates in `w`."""
    slot = j * mesh.slots + k
    o = (j % mesh.ring) * BLOCK
    own = own_sides(liquid, mesh, j, k)
    wl = sides[0, own:]
    ul = sides[1, own:]
    vl = sides[2, own:]
    geo = mesh.floats[slot * MEASURES * BLOCK :]
    put_reflections(liquid, mesh, first, last, reflect, wl, ul, vl, w, moves)
    c0 = liquid.c
    rho = liquid.rho
    table = liquid.table
    u = cells[1, o:]
    v = cells[2, o:]
    c = cells[3, o:]
    if moves is not None:
        speeds = moves.speeds[(4 * j + k) * BLOCK :]
        if liquid.full:
            add_side_nonlinear(c0, rho, table, (u, v, c), (wl, ul, vl), geo, w, speeds, None)
        else:
            add_side_linear_moving(c0, rho, wl, ul, vl, geo, w, speeds)
        close_walls(mesh.edges[first:last], mesh.number[first:last], reflect, geo, w, moves.thrust)
    elif liquid.full:
        raised = None if phi is None else phi[1][slot * BLOCK :]
        add_side_nonlinear(c0, rho, table, (u, v, c), (wl, ul, vl), geo, w, None, raised)
        if phi is not None:
            balance_side(phi[1][slot * BLOCK :], geo, w)
    else:
        add_side_linear(c0, wl, ul, vl, geo, w)


@inline
def put_reflections(liquid, mesh, first, last, reflect, wl, ul, vl, w, moves):
    """Write the values beyond boundary sides to `w`: w - u there is the reflection coefficient times w + u inside.

    u is the outward velocity. A moving wall reflects waves so that the normal velocity at the wall is the speed of the
    wall.
    wl, ul, vl : values at the sides from inside
    """
    for q in range(first, last):
        i = mesh.edges[q] % BLOCK
        nx = mesh.nx[q]
        ny = mesh.ny[q]
        r = min(reflect[mesh.number[q]], 1.0) if reflect.size > 0 else 1.0
        out = ul[i] * nx + vl[i] * ny
        if moves is not None:
            out -= wall_flow(
                liquid.full, liquid.c, liquid.rho, moves.speeds[mesh.edges[q]], wl[i] + out
            )
        across = -(1.0 + r) * out
        w[i], w[_U + i], w[_V + i] = r * wl[i], ul[i] + across * nx, vl[i] + across * ny


@njit
def add_side_linear(c0, wl, ul, vl, geo, w):
    """Subtract the outflow through one side of each cell of a block from the rates in `w`, density law `linear`.

    c0 : wave speed [m/s]; wl, ul, vl : values at the side from inside, see `put_primitives`
    w : scratch, which contains the values from beyond; geo : first group of measures of the side, see `cell_sides`
    """
    for i in range(BLOCK):
        nx = geo[_NX + i]
        ny = geo[_NY + i]
        reach = geo[_REACH + i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        push = reach * (c0 * (forward + backward))
        w[_RR + i] -= reach * (forward - backward)
        w[MASS + i] = forward - backward
        w[_RX + i] -= push * nx
        w[_RY + i] -= push * ny
        w[_FAST + i] += reach * c0


@njit
def add_side_linear_moving(c0, rho, wl, ul, vl, geo, w, speeds):
    """Subtract the outflow through one moving side of each cell, flux - speed * quantity, density law `linear`.

    Tangential momentum has no flux under this law, so only the sweep of the side transfers it between cells. The
    pressure at the side and speed (c^2 r^2 - |m|^2) there, see `MeshMotion`, are written to `w` too.
    rho : density at rest [kg/m3]; speeds : speeds of the sides along their outward normals [m/s]
    Other arguments as in `add_side_linear`
    """
    for i in range(BLOCK):
        nx = geo[_NX + i]
        ny = geo[_NY + i]
        reach = geo[_REACH + i]
        speed = speeds[i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        m, pressure = forward - backward, c0 * (forward + backward)
        mass = m - speed * (rho + (forward + backward) / c0)
        tangent = vl[i] * nx - ul[i] * ny if speed < 0.0 else w[_V + i] * nx - w[_U + i] * ny
        push, along = pressure - speed * m, -speed * tangent
        w[_RR + i] -= reach * mass
        w[MASS + i] = mass
        w[_RX + i] -= reach * (push * nx - along * ny)
        w[_RY + i] -= reach * (push * ny + along * nx)
        w[_FAST + i] += reach * (c0 + abs(speed))
        w[_PUSH + i] = pressure
        w[_LOSS + i] = speed * (pressure * pressure / (c0 * c0) - m * m - tangent * tangent)


@njit
def add_side_nonlinear(c0, rho, table, cells, inside, geo, w, speeds, phi):
    """Subtract the outflow through one side of each cell of a block from the rates in `w`, with the full momentum flux.

    cells : velocities and wave speed of the cells, for the limit of the time step; inside : values at the side
    speeds : speeds of moving sides along their outward normals [m/s], or None
    phi : None, or the potential at the sides [J/kg], whose effect was subtracted from the waves and is added again
    rho : density at rest [kg/m3]; table : see `LiquidScheme`; other arguments as in `add_side_linear`
    """
    (u0, v0, c), (wl, ul, vl) = cells, inside
    bulk, per = rho * c0 * c0, 0.5 / c0
    for i in range(BLOCK):
        nx = geo[_NX + i]
        ny = geo[_NY + i]
        reach = geo[_REACH + i]
        forward = 0.5 * (wl[i] + (ul[i] * nx + vl[i] * ny))
        backward = 0.5 * (w[i] - (w[_U + i] * nx + w[_V + i] * ny))
        u = forward - backward
        through = u
        own = u0[i] * nx + v0[i] * ny
        invariant_sum = forward + backward
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
        along = mass * (
            vl[i] * nx - ul[i] * ny if through > 0.0 else w[_V + i] * nx - w[_U + i] * ny
        )
        w[_RR + i] -= reach * mass
        w[_RX + i] -= reach * (push * nx - along * ny)
        w[_RY + i] -= reach * (push * ny + along * nx)
        w[_FAST + i] += reach * (abs(own) + c[i])
        w[MASS + i] = mass
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

    thrust : pressures of all boundary faces, then terms of lost power, see `MeshMotion`
    edges, number : boundary sides, and numbers of their boundary faces; geo, w : as in `add_side_linear`
    """
    count = thrust.size // 2
    for q in range(edges.size):
        i = edges[q] % BLOCK
        thrust[number[q]], thrust[count + number[q]] = w[_PUSH + i], w[_LOSS + i]
        if reflect.size == 0 or reflect[number[q]] >= 1.0:
            w[_RR + i] += geo[_REACH + i] * w[MASS + i]
            w[MASS + i] = 0.0


@inline
def put_rates(w, rate_r, rate_x, rate_y):
    """Copy the rates of a block of cells from `w`, and raise the greatest rates there.

    The rate that limits the step is the sum of L (|u| + c) / (2 A) over the sides of a cell [1/s]: length L of a side,
    area A of the cell, wave speed c, velocity u of the cell normal to the side and relative to it. Under the density
    law `linear`, u is only the speed of a moving side.
    """
    for i in range(BLOCK):
        w[TOP + i] = max(w[TOP + i], 0.5 * w[_FAST + i])
    for i in range(rate_r.size):
        rate_r[i], rate_x[i], rate_y[i] = w[_RR + i], w[_RX + i], w[_RY + i]
