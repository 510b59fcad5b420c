"""Shallow water on a grid of rectangles: rates of depth and flow. Knows rows of cells; knows no patch and no network.

h_t + (q_x)_x + (q_y)_y = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed). Depth h, surface e = h + bed and
velocities are reconstructed; both sides of a face see its higher bed (hydrostatic reconstruction, Audusse et al. 2004).
The pressure of a cell on its faces and the push of its bed are one term, g h (rise of e), so a lake at rest stays at
rest to the bit, with dry islands too. Flux of Harten, Lax and van Leer with the contact (HLLC, Toro 2001): what moves
along a face goes with the mass. The speeds that bound its waves are those of the cells on either side, between which
limited values lie, so that no depth falls below zero.

Fifth order (`LINEAR`, `WENO5`) reconstructs unit flows in place of velocities, wherever the shallowest of five cells
has half the depth of the deepest, and limited values elsewhere. It is of that order along one direction and on even
cells; in the plane of second order, since a flux of mean values is not the mean flux.
"""

from fvsolve.jit import njit
from fvsolve.kernels.plane.shallow_rows import (
    EAST,
    FIELDS,
    GHOSTS,
    MASS,
    NORTH,
    put_beyond,
    put_cells,
    put_ends,
    put_flows,
    put_fluxes,
    put_limited,
    put_rates,
)
from fvsolve.kernels.plane.shallow_smooth import put_smooth
from fvsolve.kernels.records import LINEAR, WENO5

__all__ = ["PLANS", "grid_rates", "width", "work_size"]

PLANS = 2  # rows of `plan`: depth and surface of the profile
RING = 8  # rows of cells at hand


@njit
def width(nx):
    """Floats of a row with its ghosts, an odd number of cache lines, so that rows do not push each other out."""
    return 8 * ((nx + 2 * GHOSTS + 7) // 8 | 1)


@njit
def work_size(nx, ny):
    """Floats that `grid_rates` works in."""
    return (RING * FIELDS + 52) * width(nx)


@njit
def copy(source, target):
    """target = source[: target.size]."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def put_row(g, j, fifth, nx, ny, kx, ky, reflect, plan, dh, qx, qy, ring, top):
    """Row j of cells; also one beyond the first or the last, from those before it."""
    cells = ring[j & (RING - 1)]
    if 0 <= j < ny:
        a, b = j * nx, (j + 1) * nx
        put_cells(g, plan[0, a:b], plan[1, a:b], dh[a:b], qx[a:b], qy[a:b], kx, ky[j], cells, top)
        walls = reflect.size > 0
        if fifth:
            put_flows(qx[a:b], qy[a:b], cells)
        put_ends(nx, reflect[j] if walls else 1.0, reflect[ny + j] if walls else 1.0, cells)
        return
    last = 0 if j < 0 else ny - 1
    mirror = min(-1 - j, ny - 1) if j < 0 else max(2 * ny - 1 - j, 0)
    at = 2 * ny if j < 0 else 2 * ny + nx
    walls = reflect[at : at + nx] if reflect.size > 0 else reflect
    put_beyond(nx, walls, ring[last & (RING - 1)], ring[mirror & (RING - 1)], cells)


@njit
def grid_rates(
    g, scheme, limiter, nx, ny, kx, ky, reflect, plan, dh, qx, qy, flow_x, flow_y, work, rate_h, rate_x, rate_y
):
    """Rates of all cells; returns the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5
    kx float64[nx], ky float64[ny] : 1 / widths of columns and rows [1/m]
    reflect : float64[2 (nx + ny)], 1 a wall and 0 open, west, east, south, north; or empty, walls all around
    plan : float64[PLANS, n], depth of the profile at rest and its surface less the level [m]
    dh, qx, qy : float64[n] depth less the profile's [m], unit flows [m2/s]
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx] flows of depth through faces [m2/s], or empty
    work : float64[work_size(nx, ny)], fastest where it begins at a cache line
    """
    wide, fifth = width(nx), scheme == LINEAR or scheme == WENO5
    ring, at = work[: RING * FIELDS * wide].reshape((RING, FIELDS, wide)), RING * FIELDS * wide
    sides, at = work[at : at + 36 * wide].reshape((3, 2, 6, wide)), at + 36 * wide
    fluxes, at = work[at : at + 12 * wide].reshape((3, 4, wide)), at + 12 * wide
    pushes, at = work[at : at + 3 * wide].reshape((3, wide)), at + 3 * wide
    top = work[at : at + nx]
    for i in range(nx):
        top[i] = 0.0
    reach = 3 if fifth else 2
    ahead = min(reach, ny)
    for j in range(ahead):
        put_row(g, j, fifth, nx, ny, kx, ky, reflect, plan, dh, qx, qy, ring, top)
    for j in range(-1, -1 - reach, -1):
        put_row(g, j, fifth, nx, ny, kx, ky, reflect, plan, dh, qx, qy, ring, top)
    one = GHOSTS - 1  # the cell beyond the first
    for j in range(-1, ny + 1):
        while ahead < j + reach:
            put_row(g, ahead, fifth, nx, ny, kx, ky, reflect, plan, dh, qx, qy, ring, top)
            ahead += 1
        # values of row j at its southern and northern faces
        now, was, r = j & 1, (j - 1) & 1, RING - 1
        before, here, after = ring[(j - 1) & r], ring[j & r], ring[(j + 1) & r]
        low, high, push = sides[now, 0], sides[now, 1], pushes[now]
        put_limited(scheme, limiter, nx, before, GHOSTS, here, GHOSTS, after, GHOSTS, low, high, push)
        if fifth:
            put_smooth(
                g, scheme, nx, ring[(j - 2) & r], GHOSTS, before, GHOSTS, here, GHOSTS, after, GHOSTS,
                ring[(j + 2) & r], GHOSTS, low, high, push,
            )  # fmt: skip
        if j < 0:
            continue
        # faces between rows j - 1 and j
        put_fluxes(g, nx, NORTH, EAST, fifth, sides[was, 1], 0, low, 0, before, GHOSTS, here, GHOSTS, fluxes[now])
        if flow_y.size > 0:
            copy(fluxes[now, MASS], flow_y[j * nx : (j + 1) * nx])
        if j == 0:
            continue
        # row j - 1 : faces along it, and its rates
        west, east, a, z = sides[2, 0], sides[2, 1], (j - 1) * nx, j * nx
        put_limited(scheme, limiter, nx + 2, before, one - 1, before, one, before, one + 1, west, east, pushes[2])
        if fifth:
            put_smooth(
                g, scheme, nx + 2, before, one - 2, before, one - 1, before, one, before, one + 1,
                before, one + 2, west, east, pushes[2],
            )  # fmt: skip
        put_fluxes(g, nx + 1, EAST, NORTH, fifth, east, 0, west, 1, before, one, before, one + 1, fluxes[2])
        if flow_x.size > 0:
            copy(fluxes[2, MASS], flow_x[(j - 1) * (nx + 1) : j * (nx + 1)])
        put_rates(
            g, kx, ky[j - 1], pushes[2, 1:], pushes[was], fluxes[2], fluxes[was], fluxes[now],
            rate_h[a:z], rate_x[a:z], rate_y[a:z],
        )  # fmt: skip
    most = 0.0
    for i in range(nx):
        most = max(most, top[i])
    return most
