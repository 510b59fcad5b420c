"""Sides of the cells of shallow water on a mesh of any cells, for `mesh_blocks`.

The scheme is the same as on a grid (`surface_grid`), but with least-squares gradients and a common limiter for all
sides of a cell. Pressures at sides are relative to the pressure in the cell, and the force of the bed to the surface
of the cell. So every term is zero where the surface is level: a lake at rest stays at rest, with dry islands too.
With `muscl` the flux of tangential momentum over an uneven bed has a term for its jump: without it, vortices of the
size of cells, which HLLC does not damp in water at rest, are coupled with waves by the differences of depth, and grow.
Cells have depth, surface, both velocities, wave speed and bed; depths at sides are limited surface minus limited bed.
At a kerb, where neighbours are farther from a common plane than a quarter of the depth of a film, bed and surface are
nearly level within the cell: their limited slopes differ by more than the film, which would pulse. The bed of a bowl is
no kerb: films on its shore would drain too slowly.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import UPWIND
from fvsolve.features.basins import cell_sides as side
from fvsolve.features.basins.cell_sides import (
    BLOCK,
    HUGE,
    INDICES,
    MEASURES,
    TINY,
    gather,
    limited_sides,
    ring_place,
)
from fvsolve.features.basins.free_surface.marked_faces import (
    MarkedFaces,
    flatten_cells,
    flux_over_wall,
    save_sums,
)
from fvsolve.features.basins.free_surface.patch_closures import (
    BEYOND,
    FLOW,
    MOMENTUM,
    SPEED,
    DrivenFaces,
)
from fvsolve.features.basins.free_surface.patch_closures import SURFACE as DRIVEN_SURFACE
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.hll_flux import hll_flux
from fvsolve.features.basins.mesh_blocks import own_sides
from fvsolve.jit import inline, njit

# Greatest `wide_by`: with 2, exact for linear fields, ripples on a lake over a rough bed gain energy.
MOST_OVERSHOOT = 1.5
# part of the rise to a neighbour that the bend of a smooth bed may reach, which is no kerb
SMOOTH = 1.0 / 16.0
DEPTH, SURFACE = 0, 1  # rows of plan: depth of the profile, its surface above the level
FIELDS, ROWS_OF_CELLS, SHOWN = 4, 6, 2  # see `mesh_blocks`

# Rows of BLOCK in the scratch of a block: values beyond, rates, sums for the step, flow through the side.
_E, _U, _V, _C, _RH, _RX, _RY, _FAST, _OUTFLOW, MASS = (k * BLOCK for k in range(1, 11))
_NX = side.NX * BLOCK
_NY = side.NY * BLOCK
_REACH = side.REACH * BLOCK
# greatest rates; allowed differences of the surface, see `put_shores`
TOP, _SHORE = 11 * BLOCK, 12 * BLOCK
_PUSH = 13 * BLOCK  # of moving sides: thrust minus that of the cell's own depth
ROWS = 14
SUMS = _RH, _RX, _RY, _FAST, _OUTFLOW


class MeshWater(NamedTuple):
    """Water on a mesh, and the scheme of its rates.

    g : gravity normal to the basin [m/s2]; scheme : UPWIND or MUSCL
    wide_by : factor on the range of the neighbours that limits values at sides; with 1 they stay within that range
    plan : float64[2, n]  depth at rest and surface at rest above the level [m]
    kerbs : float64[BLOCK blocks]  for each cell the depth below which its bed is a kerb [m], see `kerbs_of`
    faces : None, or the `DrivenFaces` of driven patches; marks : None, or the `MarkedFaces` of walls and sections
    """

    g: float
    scheme: int
    wide_by: float
    plan: np.ndarray
    kerbs: np.ndarray
    faces: DrivenFaces | None
    marks: MarkedFaces | None = None


@inline
def begin(w):
    """Set the greatest rates to zero."""
    for i in range(BLOCK):
        w[TOP + i] = 0.0


@inline
def put_cells(water, mesh, j, states, cells, phi):
    """Write depth, surface, velocities and wave speed of block j of cells."""
    a, z, o, (dh, qx, qy), plan = (
        j * BLOCK,
        min((j + 1) * BLOCK, mesh.n),
        (j % mesh.ring) * BLOCK,
        states,
        water.plan,
    )
    h = cells[0, o:]
    e = cells[1, o:]
    u = cells[2, o:]
    v = cells[3, o:]
    c = cells[4, o:]
    put_primitives(
        water.g, plan[DEPTH, a:z], plan[SURFACE, a:z], dh[a:z], qx[a:z], qy[a:z], h, e, u, v, c
    )
    for i in range(z - a):
        cells[5, o + i] = plan[SURFACE, a + i] - plan[DEPTH, a + i]


def kerbs_of(mesh, bed):
    """`MeshWater.kerbs` of a bed : float64[n].

    It is four times the greatest distance of the bed in neighbours from the plane that fits them and the cell best,
    beyond that of a smooth bed.
    """
    inner, n = mesh.right >= 0, bed.size
    left, right = mesh.left[inner], mesh.right[inner]
    across, rise = mesh.centre[right] - mesh.centre[left], bed[right] - bed[left]
    own = np.append(left, right)
    across = np.append(across, -across, axis=0)
    rise = np.append(rise, -rise)
    weight = 1.0 / np.sum(across**2, axis=1)
    # what is added determines the plane of cells whose neighbours lie in a line
    squares, products = np.tile(1e-9 * np.eye(2), (n, 1, 1)), np.zeros((n, 2, 1))
    np.add.at(squares, own, weight[:, None, None] * across[:, :, None] * across[:, None, :])
    np.add.at(products[..., 0], own, (weight * rise)[:, None] * across)
    on_plane = np.sum(across * np.linalg.solve(squares, products)[own, :, 0], axis=1)
    distances, rises = np.zeros((2, -(-n // BLOCK) * BLOCK))
    np.maximum.at(distances, own, np.abs(rise - on_plane))
    np.maximum.at(rises, own, np.abs(on_plane))
    return 4.0 * np.maximum(distances - SMOOTH * rises, 0.0)


@njit
def put_primitives(g, depth0, surface0, dh, qx, qy, h, e, u, v, c):
    """Write depth h, surface e, velocities u, v and wave speed c of cells.

    g : gravity [m/s2]; depth0, surface0 : depth and surface at rest [m]
    dh, qx, qy : deviation of depth from rest [m], unit flows [m2/s]
    """
    for i in range(dh.size):
        depth = max(depth0[i] + dh[i], 0.0)
        wet = max(depth, THIN)
        part = 2.0 * depth / (depth * depth + wet * wet)
        h[i], e[i], c[i] = depth, surface0[i] + dh[i], sqrt(g * depth)
        u[i], v[i] = qx[i] * part, qy[i] * part


@inline
def put_sides(water, mesh, j, first, last, reflect, cells, sides, shown, w, moves):
    """Write the limited values at the sides of the cells of block j."""
    floats = mesh.floats
    integers = mesh.integers
    wide_by = water.wide_by
    edges, b = mesh.edges[first:last], mesh.edges.size
    o = (j % mesh.ring) * BLOCK
    shore = w[_SHORE:]
    su = shown[first:]
    sv = shown[b + first :]
    h = cells[0]
    e = cells[1]
    c = cells[4, o:]
    for q in range(first, last):
        i = ring_place(mesh.edges[q], mesh.ring)
        shown[q], shown[b + q] = cells[5, i], e[i]
    put_beyond(water.faces, moves, mesh, first, last, BEYOND, shown)
    put_shores(water.kerbs[j * BLOCK :], h[o:], shore)
    limited_sides(j, floats, integers, cells[5], wide_by, shore, su, edges, w[_C:], sides[0])
    side.gather_beyond(j, integers, e, w)
    lower_shores(mesh.slots, h[o:], e[o:], w)
    side.limit_gathered(j, floats, integers, e, wide_by, shore, sv, edges, w, sides[1])
    for q in range(first, last):
        i = ring_place(mesh.edges[q], mesh.ring)
        shown[q], shown[b + q] = mirrored_velocity(
            mesh, q, reflect, cells[2, i], cells[3, i], moves
        )
    put_beyond(water.faces, moves, mesh, first, last, BEYOND + 2, shown)
    put_depths(mesh.slots, h[o:], sides[0, 4 * o :], sides[1, 4 * o :])
    # Velocities differ by no more than the wave speed: next to a thin fast cell, a linear field would reverse the flow.
    limited_sides(j, floats, integers, cells[2], wide_by, c, su, edges, w, sides[2])
    limited_sides(j, floats, integers, cells[3], wide_by, c, sv, edges, w, sides[3])
    flatten_cells(water.marks, mesh, j, cells, sides)


@njit
def lower_shores(slots, h, e, w):
    """Reduce the rise of the surface to neighbours with less than half the depth of a cell, by their depth.

    The rise stays at least as great as the greatest fall to another neighbour. Otherwise the surface at the other sides
    follows dry banks, and water beside them never comes to rest.
    h, e : depths and surfaces of a block; w : surfaces of its neighbours, and from _C on their beds
    """
    for i in range(BLOCK):
        w[_FAST + i], w[_OUTFLOW + i] = 2.0 / (h[i] + TINY), 0.0
    for k in range(slots):
        for i in range(BLOCK):
            w[_OUTFLOW + i] = max(w[_OUTFLOW + i], e[i] - w[k * BLOCK + i])
    for k in range(slots):
        surface, bed = w[k * BLOCK :], w[_C + k * BLOCK :]
        for i in range(BLOCK):
            rise, share = surface[i] - e[i], max((surface[i] - bed[i]) * w[_FAST + i], 0.0)
            most = max(share * rise, w[_OUTFLOW + i])
            surface[i] = e[i] + most if rise > most else surface[i]


@njit
def put_beyond(faces, moves, mesh, first, last, row, shown):
    """Write the rows `row` and `row` + 1 of driven faces to `shown`, for boundary sides `first` to `last` - 1."""
    if faces is not None:
        if moves is None:
            driven = faces.values
            for q in range(first, last):
                k = mesh.number[q]
                if driven[SPEED, k] != 0.0:
                    shown[q], shown[mesh.edges.size + q] = driven[row, k], driven[row + 1, k]


@njit(forceinline=True)
def mirrored_velocity(mesh, q, reflect, u, v, moves):
    """Velocity beyond boundary side q, from the velocity (u, v) inside; both components.

    At a wall that moves outward at the speed w, the normal velocity n becomes 2 w - n.
    """
    nx = mesh.nx[q]
    ny = mesh.ny[q]
    r = reflect[mesh.number[q]] if reflect.size > 0 else 1.0
    across = u * nx + v * ny
    if moves is not None:
        across -= moves.speeds[mesh.edges[q]]
    change = 2.0 * r * across
    return u - change * nx, v - change * ny


@inline
def begin_block(water, mesh, j, states, w, phi):
    """Set the rates of a block of cells, and their sums for the limit of the time step, to zero."""
    for i in range(BLOCK):
        w[_RH + i], w[_RX + i], w[_RY + i], w[_FAST + i], w[_OUTFLOW + i] = 0.0, 0.0, 0.0, 0.0, 0.0


@inline
def add_side(water, mesh, j, k, first, last, reflect, cells, sides, w, moves, phi):
    """Subtract the outflow through side k of each cell of block j from the rates in `w`."""
    slot = j * mesh.slots + k
    o = (j % mesh.ring) * BLOCK
    own = own_sides(water, mesh, j, k)
    geo = mesh.floats[slot * MEASURES * BLOCK :]
    inside = sides[0, own:], sides[1, own:], sides[2, own:], sides[3, own:]
    gather(cells[4], mesh.places[slot * INDICES * BLOCK :], w[_C:])
    for q in range(first, last):
        i = mesh.edges[q] % BLOCK
        w[_U + i], w[_V + i] = mirrored_velocity(
            mesh, q, reflect, sides[2, own + i], sides[3, own + i], moves
        )
    centre = cells[0, o:], cells[1, o:], cells[4, o:]
    edges, number = mesh.edges[first:last], mesh.number[first:last]
    save_sums(water.marks, 4 * j + k, w, SUMS)
    damping = 0.0 if water.scheme == UPWIND else 0.5  # with upwind no vortex grows
    if moves is None:
        add_side_fluxes(water.g, damping, centre, inside, geo, w, None)
    else:
        add_side_fluxes(
            water.g, damping, centre, inside, geo, w, moves.speeds[(4 * j + k) * BLOCK :]
        )
        rest = water.plan[DEPTH, j * BLOCK :]
        close_walls(water.g, edges, number, reflect, rest, cells[0, o:], geo, w, moves.thrust)
    close_driven(water.g, water.faces, edges, number, inside, cells[4, o:], geo, w)
    close_marked(water.g, water.marks, 4 * j + k, centre, inside, geo, w)


@njit
def add_side_fluxes(g, damping, cells, inside, geo, w, speeds):
    """Subtract the outflow through one side of each cell of a block (HLLC flux) from the rates in `w`.

    Tangential momentum is carried with the mass, and a jump of the tangential velocity is damped: `damping` times
    |difference of wave speeds of the cells| times depth at the face times the jump is subtracted from its flux.
    The flow through the side and the sums for the limit of the time step are written to `w` too.
    g : gravity [m/s2]; damping : see above [-]; cells : depth, surface and wave speed of the cells
    inside : depth, surface and velocities at the side from inside; `w` contains the values from beyond
    geo : measures of the side, see `cell_sides`
    speeds : None, or speeds of moving sides along their outward normals [m/s]; the flux is then relative to the side
    """
    half, (h0, e0, c0), (hl, el, ul, vl) = 0.5 * g, cells, inside
    for i in range(BLOCK):
        nx = geo[_NX + i]
        ny = geo[_NY + i]
        reach = geo[_REACH + i]
        bed = max(el[i] - hl[i], w[_E + i] - w[i])
        a = max(0.0, el[i] - bed)
        b = max(0.0, w[_E + i] - bed)
        c = max(c0[i], w[_C + i])
        na, nb = ul[i] * nx + vl[i] * ny, w[_U + i] * nx + w[_V + i] * ny
        ta, tb = vl[i] * nx - ul[i] * ny, w[_V + i] * nx - w[_U + i] * ny
        if speeds is not None:
            na, nb = na - speeds[i], nb - speeds[i]
        low, high = min(min(na, nb) - c, 0.0), max(max(na, nb) + c, 0.0)
        qa, qb = a * na, b * nb
        push = half * ((b - a) * (b + a))
        mass, flow, _ = hll_flux(low, high, a, b, qa, qb, qa * na, qb * nb, push)
        flow += half * (hl[i] + h0[i]) * (el[i] - e0[i])
        if speeds is not None:
            flow += speeds[i] * mass
            w[_PUSH + i] = flow
        along = mass * (ta if mass > 0.0 else tb)
        # damps vortices of the size of cells
        along -= damping * abs(c0[i] - w[_C + i]) * min(a, b) * (tb - ta)
        w[_RH + i] -= reach * mass
        w[_RX + i] -= reach * (flow * nx - along * ny)
        w[_RY + i] -= reach * (flow * ny + along * nx)
        w[_FAST + i] += reach * max(high, -low)
        w[_OUTFLOW + i] += reach * (high * (na - low) * (1.0 / (high - low + TINY)))
        w[MASS + i] = mass


@njit
def close_walls(g, edges, number, reflect, rest, h0, geo, w, thrust):
    """Set the mass flow through walls to zero; write the thrust on boundary sides minus that of the depth at rest.

    edges, number : boundary sides, and numbers of their boundary faces
    rest, h0 : depths at rest and present depths of the cells; thrust : of all boundary faces; geo : as above
    """
    for q in range(edges.size):
        i = edges[q] % BLOCK
        thrust[number[q]] = w[_PUSH + i] + 0.5 * g * ((h0[i] - rest[i]) * (h0[i] + rest[i]))
        if reflect.size == 0 or reflect[number[q]] == 1.0:
            w[_RH + i] += geo[_REACH + i] * w[MASS + i]
            w[MASS + i] = 0.0


@njit
def close_driven(g, faces, edges, number, inside, waves, geo, w):
    """Replace the fluxes through boundary sides of driven patches, which were computed for an open boundary.

    Through an open side flow depth times velocity and its momentum, as inside.
    faces : see `MeshWater`; waves : wave speeds of the cells; other arguments as for `close_walls` and
    `add_side_fluxes`
    """
    h, e, u, v = inside
    if faces is not None:
        driven = faces.values
        for q in range(edges.size):
            i, k = edges[q] % BLOCK, number[q]
            if driven[SPEED, k] != 0.0:
                nx = geo[_NX + i]
                ny = geo[_NY + i]
                reach = geo[_REACH + i]
                flow = -driven[FLOW, k]
                across, along = u[i] * nx + v[i] * ny, v[i] * nx - u[i] * ny
                depth = max(h[i] + (driven[DRIVEN_SURFACE, k] - e[i]), 0.0)
                push = (
                    driven[MOMENTUM, k]
                    + 0.5 * g * ((depth - h[i]) * (depth + h[i]))
                    - w[MASS + i] * across
                )
                drift = (max(flow, 0.0) - w[MASS + i]) * along
                w[_RH + i] -= reach * (flow - w[MASS + i])
                w[_RX + i] -= reach * (push * nx - drift * ny)
                w[_RY + i] -= reach * (push * ny + drift * nx)
                w[_FAST + i] += reach * max(driven[SPEED, k] - (abs(across) + waves[i]), 0.0)
                w[MASS + i] = flow


@njit
def close_marked(g, marks, row, centre, inside, geo, w):
    """Replace the fluxes through walls on one side of the cells of a block, and write the flows through marked faces.

    row : row of sides of `marks`; centre : depth, surface and wave speed of cells; other arguments as for
    `add_side_fluxes`
    """
    if marks is None:
        return
    (h0, e0, c0), (h, e, u, v) = centre, inside
    for m in range(marks.first[row], marks.first[row + 1]):
        i, k = marks.place[m], max(marks.number[m], ~marks.number[m])
        if marks.height[k] > 0.0:
            for q in range(len(SUMS)):
                w[SUMS[q] + i] = marks.spare[q * BLOCK + m - marks.first[row]]
            nx = geo[_NX + i]
            ny = geo[_NY + i]
            reach = geo[_REACH + i]
            before = h[i], e[i], u[i] * nx + v[i] * ny, v[i] * nx - u[i] * ny, c0[i]
            beyond, along = w[_U + i] * nx + w[_V + i] * ny, w[_V + i] * nx - w[_U + i] * ny
            after = w[i], w[_E + i], beyond, along, w[_C + i]
            c = max(c0[i], w[_C + i])
            low, high = min(min(before[2], beyond) - c, 0.0), max(max(before[2], beyond) + c, 0.0)
            (mass, push, _, drift, _), speed = flux_over_wall(
                g,
                marks.crest[k],
                marks.height[k],
                marks.size[k],
                marks.cosine[k],
                marks.sine[k],
                before,
                after,
                low,
                high,
            )
            push += 0.5 * g * (h[i] + h0[i]) * (e[i] - e0[i])
            w[_RH + i] -= reach * mass
            w[_RX + i] -= reach * (push * nx - drift * ny)
            w[_RY + i] -= reach * (push * ny + drift * nx)
            w[_FAST + i] += reach * max(max(high, -low), speed)
            w[_OUTFLOW + i] += reach * (high * (before[2] - low) / (high - low + TINY))
            w[MASS + i] = mass
        if marks.number[m] >= 0:
            marks.flows[k] = w[MASS + i]


@njit
def put_depths(slots, h, depth, surface):
    """Replace the bed at the sides of a block by the depth there: from zero to twice the depth h of the cell."""
    for k in range(slots):
        d, e = depth[k * BLOCK :], surface[k * BLOCK :]
        for i in range(BLOCK):
            d[i] = min(max(e[i] - d[i], 0.0), 2.0 * h[i])


@njit
def put_shores(kerbs, h, shore):
    """Write the allowed differences of bed and surface between a cell and its sides: 0 for dry cells, else HUGE.

    In a film at a kerb, of a depth h below the depth k of the kerb, they are h^2 / (8 (k - h)).
    kerbs : k, see `MeshWater`; h : depths of a block of cells; shore : the allowed differences
    """
    for i in range(BLOCK):
        film = h[i] * h[i] / (8.0 * max(kerbs[i] - h[i], TINY)) if h[i] < kerbs[i] else HUGE
        shore[i] = film if h[i] > 0.0 else 0.0


@inline
def put_rates(w, rate_h, rate_x, rate_y):
    """Copy the rates of a block of cells from the scratch `w`, and raise the greatest rates there.

    The rate that limits the step [1/s] is the greatest of two values: the sum of L (|u| + c) / (2 A) over the sides of
    the cell, and the outflow from the cell over its volume. L is the length of a side and A the area of the cell. The
    normal velocity u, relative to a moving side, and the wave speed c are the greatest of both cells at a side.
    Explicit Euler steps up to 1 / (2 rate) leave no depth below zero.
    """
    for i in range(BLOCK):
        w[TOP + i] = max(w[TOP + i], max(0.5 * w[_FAST + i], w[_OUTFLOW + i]))
    for i in range(rate_h.size):
        rate_h[i], rate_x[i], rate_y[i] = w[_RH + i], w[_RX + i], w[_RY + i]
