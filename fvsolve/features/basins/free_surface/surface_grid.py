"""Shallow water on a grid of rectangles: rates of depth and flow.

h_t + (q_x)_x + (q_y)_y = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed). Surface e, bed and velocities are
reconstructed, and the depth is h = e - bed: a bed that is the difference of two limited fields would change with the
flow, and fast flow would never settle. Where h varies by more than an eighth from the middle of a cell to its side, h
is reconstructed instead of the bed. Both sides of a face use the higher bed (hydrostatic reconstruction, Audusse et al.
2004). The pressure of a cell on its faces and the force of its bed are combined in g h (rise of e). So a lake at rest
stays at rest to the bit, with dry islands too. The flux is the HLLC flux (Harten, Lax and van Leer, with contact wave,
Toro 2001): tangential momentum is carried with the mass. The bounds of wave speeds are those of the cells on either
side, which bound limited values too.

Fifth order (`LINEAR`, `WENO5`) reconstructs unit flows instead of velocities where the shallowest of five cells has
half the depth of the deepest, and uses limited values elsewhere. It has that order along one direction on uniform
cells; in two dimensions it is of second order, because the flux of mean values is not the mean flux.
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import LINEAR, MUSCL, WENO5
from fvsolve.features.basins.basin_patches import put_inward
from fvsolve.features.basins.cell_sides import fill
from fvsolve.features.basins.free_surface import surface_rows as rows_of
from fvsolve.features.basins.free_surface.marked_faces import (
    MarkedFaces,
    add_forces_along,
    close_marked,
    flatten_across,
    flatten_along,
)
from fvsolve.features.basins.free_surface.patch_closures import FLOW, MOMENTUM, SPEED, SURFACE
from fvsolve.features.basins.free_surface.surface_rows import (
    EAST,
    GHOSTS,
    HIGH,
    MAX_COLUMNS,
    NORTH,
    STRIDE,
)
from fvsolve.jit import inline, njit

PLANS = 2  # rows of `plan`: depth and surface of the profile
RING = 8  # stored rows of cells
REACH = 3  # greatest stencil radius of the rates, in rows
BLOCK = rows_of.FIELDS * STRIDE
SIDE = rows_of.SIDES * STRIDE
FLUX = rows_of.FLUXES * STRIDE
WORK = RING * BLOCK + 3 * SIDE + 3 * FLUX + 2 * STRIDE  # length of the work array of `grid_rates`
MOVING = WORK + 3 * STRIDE


class WaterGrid(NamedTuple):
    """Grid of nx columns and ny rows of water, and the scheme of its rates.

    g : gravity normal to the basin [m/s2]; scheme : UPWIND, MUSCL, LINEAR (upwind5) or WENO5; limiter : of MUSCL
    kerbs : float64[2 ny]  for each row the depth below which its bed has kerbs along it, then across it, see `kerbs_of`
    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]
    reflect : float64[2 (nx + ny)]  1 for a wall and 0 for open, in the order west, east, south, north; empty: all walls
    plan : float64[PLANS, n]  depth at rest and surface at rest above the level [m]
    marks : None, or the `MarkedFaces` of walls and sections
    """

    g: float
    scheme: int
    limiter: int
    nx: int
    ny: int
    kx: np.ndarray
    ky: np.ndarray
    reflect: np.ndarray
    plan: np.ndarray
    kerbs: np.ndarray
    marks: MarkedFaces | None = None


def kerbs_of(bed):
    """`WaterGrid.kerbs` of a bed : float64[ny, nx]: four times the greatest second differences."""
    bends = np.zeros((2, *bed.shape))
    bends[0, :, 1:-1], bends[1, 1:-1] = np.diff(bed, 2, axis=1), np.diff(bed, 2, axis=0)
    return 4.0 * np.abs(bends).max(axis=2).ravel()


class FaceFlows(NamedTuple):
    """Flows through faces of a grid, each array empty if it is not needed.

    x : float64[ny (nx + 1)], y : float64[(ny + 1) nx]  volume flows per width through faces [m2/s]
    through : float64[2 (nx + ny)]  inward flows through boundary faces [m3/s], in the order of `WaterGrid.reflect`
    """

    x: np.ndarray
    y: np.ndarray
    through: np.ndarray


class RowArrays(NamedTuple):
    """Work arrays for the rows of cells and of faces that are being computed.

    cells : ring buffer of RING rows of cells; sides : values at the faces of two rows, to the south and north
    fluxes : fluxes through two rows of faces; ends, along : values and fluxes at faces along a row, from one cell
    before it; deep : see `surface_rows.put_smooth`; top : greatest rate of each column so far [1/s]
    speeds, factors : speeds of a row of moving faces, and factors of stretching cells
    """

    cells: np.ndarray
    sides: np.ndarray
    fluxes: np.ndarray
    ends: np.ndarray
    along: np.ndarray
    deep: np.ndarray
    top: np.ndarray
    speeds: np.ndarray
    factors: np.ndarray


@inline
def open_work(work):
    """`RowArrays` of a work array."""
    at = RING * BLOCK
    sides, at = work[at : at + 3 * SIDE], at + 3 * SIDE
    fluxes, at = work[at : at + 3 * FLUX], at + 3 * FLUX
    deep = work[at : at + STRIDE]
    top = work[at + STRIDE : at + 2 * STRIDE]
    speeds = work[WORK : WORK + STRIDE]
    ends, along = sides[2 * SIDE :], fluxes[2 * FLUX :]
    return RowArrays(
        work[: RING * BLOCK], sides, fluxes, ends, along, deep, top, speeds, work[WORK + STRIDE :]
    )


@njit(forceinline=True)
def is_fifth_order(scheme):
    """True for a scheme of fifth order."""
    return scheme == LINEAR or scheme == WENO5


@njit
def copy(source, target):
    """Copy the first target.size values of `source` to `target`."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def ring_offset(j, i):
    """Offset of cell i of row j in the ring buffer of rows."""
    return (j & (RING - 1)) * BLOCK + GHOSTS + i


@njit
def factors_of(j, left, right, moves, scratch):
    """(area over undeformed area, its reciprocal) of columns `left` to `right` - 1 of row j: two arrays.

    moves : as in `grid_rates`; scratch : work array
    """
    wide, narrow = moves.wide, moves.narrow
    if moves.speed_x.size > 0:
        return wide[left:right], narrow[left:right]
    row_wide, row_narrow = scratch[: right - left], scratch[STRIDE : STRIDE + right - left]
    fill(wide[j], row_wide)
    fill(narrow[j], row_narrow)
    return row_wide, row_narrow


@njit
def put_row(grid, j, first, last, states, rows, moves, faces):
    """Write columns `first` to `last` - 1 of row j of cells, with ghost cells, to the ring buffer.

    A row beyond the grid is computed from the rows inside, which must be in the buffer. The greatest rates of columns
    are updated.
    """
    nx = grid.nx
    ny = grid.ny
    fifth = is_fifth_order(grid.scheme)
    fields, reach = (rows_of.FIELDS, 3) if fifth else (rows_of.FLOW_EAST // STRIDE, 2)
    left = max(first - GHOSTS, 0)
    right = min(last + GHOSTS, nx)
    walls = grid.reflect.size > 0
    if j < 0 or j >= ny:
        put_row_beyond(grid, j, first, last, fields, rows, moves, faces)
        return
    a = j * nx + left
    b = j * nx + right
    cells = rows.cells[ring_offset(j, left - first) :]
    kx = grid.kx[left:right]
    dh = states[0][a:b]
    qx = states[1][a:b]
    qy = states[2][a:b]
    depths = grid.plan[0, a:b]
    surfaces = grid.plan[1, a:b]
    top = rows.top[GHOSTS + left - first :]
    if moves is None:
        rows_of.put_cells(grid.g, depths, surfaces, dh, qx, qy, kx, grid.ky[j], None, cells, top)
        if fifth:
            rows_of.put_flows(qx, qy, None, cells)
    else:
        factors = factors_of(j, left, right, moves, rows.factors)
        rows_of.put_cells(grid.g, depths, surfaces, dh, qx, qy, kx, grid.ky[j], factors, cells, top)
        if fifth:
            rows_of.put_flows(qx, qy, factors, cells)
    block, end = rows.cells[ring_offset(j, -GHOSTS) :], GHOSTS + nx - 1 - first
    if left == 0:
        rows_of.put_ghost_end(
            fields, reach, grid.reflect[j] if walls else 1.0, block, GHOSTS, -1, nx
        )
        if moves is not None and moves.speed_x.size > 0:
            rows_of.correct_ghost_end(fields, reach, moves.speed_x[0], block, GHOSTS, -1)
        if faces is not None and faces.values[SPEED, j] != 0.0 and nx > 1:
            rows_of.extrapolate_ghosts(fields, reach, block, GHOSTS, -1)
    if right == nx:
        rows_of.put_ghost_end(
            fields, reach, grid.reflect[ny + j] if walls else 1.0, block, end, 1, nx
        )
        if moves is not None and moves.speed_x.size > 0:
            rows_of.correct_ghost_end(fields, reach, moves.speed_x[nx], block, end, 1)
        if faces is not None and faces.values[SPEED, ny + j] != 0.0 and nx > 1:
            rows_of.extrapolate_ghosts(fields, reach, block, end, 1)


@njit
def put_row_beyond(grid, j, first, last, fields, rows, moves, faces):
    """Write columns `first` to `last` - 1 of row j, which is beyond the grid, to the ring buffer, as `put_row` does.

    fields : number of quantities of a cell
    """
    nx = grid.nx
    ny = grid.ny
    n = last - first
    walls = grid.reflect
    edge = 0 if j < 0 else ny - 1
    mirror = min(-1 - j, ny - 1) if j < 0 else max(2 * ny - 1 - j, 0)
    at, cells = 2 * ny + first if j < 0 else 2 * ny + nx + first, rows.cells[ring_offset(j, 0) :]
    if walls.size > 0:
        walls = walls[at : at + n]
    rows_of.put_ghost_row(
        n,
        fields,
        walls,
        rows.cells[ring_offset(edge, 0) :],
        rows.cells[ring_offset(mirror, 0) :],
        cells,
    )
    if moves is not None and moves.speed_y.size > 0:
        rows_of.correct_ghost_row(n, fields, moves.speed_y[0 if j < 0 else ny], cells)
    if faces is not None and ny > 1:
        beyond, outer, inner = (-j, 0, 1) if j < 0 else (j - ny + 1, ny - 1, ny - 2)
        here, inside = rows.cells[ring_offset(outer, 0) :], rows.cells[ring_offset(inner, 0) :]
        for i in range(n):
            if faces.values[SPEED, at + i] != 0.0:
                rows_of.extrapolate_across(fields, i, beyond, here, inside, cells)


@njit
def close_walls(g, speed, rest, side, f, thrust):
    """Set the mass flow through a row of boundary faces of a moving wall to zero, and write the thrust on these faces.

    speed : speed of the faces [m/s]; if it is 0, the flow is unchanged; rest : depths at rest of the cells
    side : depths at the faces; f : fluxes
    thrust : thrust minus that of the depth at rest, over density and length [m3/s2]
    """
    for i in range(thrust.size):
        if speed != 0.0:
            f[i], f[i + rows_of.ALONG] = 0.0, 0.0
        thrust[i] = f[i + rows_of.AFTER] + 0.5 * g * ((side[i] - rest[i]) * (side[i] + rest[i]))


@njit
def close_fixed_walls(walls, f, count):
    """Set the mass flow through a row of boundary faces of walls at rest to zero, with the momentum that it carries.

    In a grid of one or two cells across, ghost cells are not exact mirror images, so in fifth order this flow is not 0.
    walls : float64[count]  1 for a wall and 0 for open, empty for walls only; f : fluxes; count : number of faces
    """
    for i in range(count):
        if walls.size == 0 or walls[i] == 1.0:
            f[i], f[i + rows_of.ALONG] = 0.0, 0.0


@njit
def close_driven(g, driven, turn, tangent, cells, kn, kt, side, f, top):
    """Replace the fluxes through a row of boundary faces of driven patches, and raise the greatest rates.

    driven : columns of `DrivenFaces.values` for these faces; turn : 1 if fluxes are positive inward, -1 if outward
    tangent : NORTH or EAST, velocity along the faces; cells : cells behind the faces; side : their values at the faces
    kn, kt : 1 / sizes of the cells across and along the faces [1/m], each with a value for each face, or a single one
    """
    for i in range(driven.shape[1]):
        speed, q = driven[SPEED, i], turn * driven[FLOW, i]
        if speed != 0.0:
            h, e = side[i], side[i + rows_of.SURFACE]
            depth = max(h + (driven[SURFACE, i] - e), 0.0)
            flow = driven[MOMENTUM, i] + 0.5 * g * ((depth - h) * (depth + h))
            f[i], f[i + rows_of.BEFORE], f[i + rows_of.AFTER] = q, flow, flow
            f[i + rows_of.ALONG] = q * side[i + tangent] if driven[FLOW, i] < 0.0 else 0.0
            rate = speed * kn[min(i, kn.size - 1)]
            rate += (abs(cells[i + tangent]) + cells[i + rows_of.WAVE]) * kt[min(i, kt.size - 1)]
            top[i] = max(top[i], rate)


@njit
def grid_rates(grid, begin, stop, states, flows, work, rates, moves, faces):
    """Write the rates of cells of rows `begin` to `stop` - 1; return the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    Rows are counted over the whole grid; neighbours within the stencil of the scheme are read too.
    grid, flows : `WaterGrid`, `FaceFlows`
    states : deviation of depth from rest [m] and both unit flows [m2/s], three arrays; with moving walls, the changes
    of their amounts over undeformed areas, see `basins.cell_sides`; rates : arrays for their rates
    work : float64[WORK], fastest if aligned to a cache line; float64[MOVING] if lines move
    moves : None, or the `GridMotion` of moving walls; faces : None, or the `DrivenFaces` of driven patches
    """
    most = 0.0
    for first in range(0, grid.nx, MAX_COLUMNS):
        last = min(first + MAX_COLUMNS, grid.nx)
        rate = column_rates(
            grid, begin, stop, True, first, last, states, flows, work, rates, moves, faces
        )
        most = max(most, rate)
    return most


@njit
def column_rates(grid, begin, stop, fresh, first, last, states, flows, work, rates, moves, faces):
    """Write the rates of columns `first` to `last` - 1, at most MAX_COLUMNS; return their greatest rate [1/s].

    fresh : False if the last call ended at row `begin` with the same `work`; then its results are used again
    Other arguments as in `grid_rates`
    """
    rows, reach = open_work(work), 3 if is_fifth_order(grid.scheme) else 2
    ahead, most = begin + reach, 0.0
    if fresh:
        fill(0.0, rows.top)
        ahead = min(ahead, grid.ny)
        for j in range(max(begin - reach, 0), ahead):
            put_row(grid, j, first, last, states, rows, moves, faces)
        for j in range(-1, begin - 1 - reach, -1):
            put_row(grid, j, first, last, states, rows, moves, faces)
    for j in range(begin - 1 if fresh else begin + 1, stop + 1):
        while ahead < j + reach:
            put_row(grid, ahead, first, last, states, rows, moves, faces)
            ahead += 1
        a, b = rows.cells[ring_offset(j - 2, 0) :], rows.cells[ring_offset(j - 1, 0) :]
        d, e = rows.cells[ring_offset(j + 1, 0) :], rows.cells[ring_offset(j + 2, 0) :]
        c, sides = rows.cells[ring_offset(j, 0) :], rows.sides[(j & 1) * SIDE :]
        kerbs = grid.kerbs[grid.ny + min(max(j, 0), grid.ny - 1)]
        put_values(grid, last - first, kerbs, (a, b, c, d, e), sides, rows.deep)
        if grid.scheme == MUSCL:
            flatten_across(grid.marks, grid.ny, j, first, last, b, c, d, sides)
        if j >= begin:
            put_fluxes_across(grid, j, first, last, rows, flows, moves, faces)
        if j > begin:
            put_fluxes_along(grid, j - 1, first, last, rows, flows, moves, faces)
            put_row_rates(grid, j - 1, first, last, rows, rates, moves)
    for i in range(STRIDE):
        most = max(most, rows.top[i])
    return most


@inline
def put_values(grid, n, kerbs, cells, sides, deep):
    """Write the values at both faces of n cells to `sides`.

    kerbs : entry of `grid.kerbs`; cells : neighbours two and one before the cells, the cells, neighbours one and two
    after; deep : see `surface_rows.put_smooth`
    """
    a, b, c, d, e = cells
    rows_of.put_limited(grid.scheme, grid.limiter, kerbs, n, b, c, d, sides)
    if is_fifth_order(grid.scheme):
        rows_of.put_smooth(grid.g, grid.scheme, a, b, c, d, e, sides, deep[:n])


@inline
def put_fluxes_across(grid, j, first, last, rows, flows, moves, faces):
    """Write the fluxes through the faces between rows j - 1 and j to `rows.fluxes`, and the flows through them.

    Arguments as in `column_rates`
    """
    g = grid.g
    n = last - first
    nx = grid.nx
    ny = grid.ny
    is_side = j == 0 or j == grid.ny
    fifth, at = is_fifth_order(grid.scheme), 2 * ny + first + (nx if j > 0 else 0)
    low, under = rows.sides[(j & 1) * SIDE :], rows.sides[((j - 1) & 1) * SIDE + HIGH :]
    before, here = rows.cells[ring_offset(j - 1, 0) :], rows.cells[ring_offset(j, 0) :]
    north = rows.fluxes[(j & 1) * FLUX :]
    l, r = (under, low) if fifth else (before, here)  # cells that bound wave speeds
    if moves is None or moves.speed_y.size == 0:
        rows_of.put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, None)
    else:
        for i in range(n):
            rows.speeds[i] = moves.speed_y[j]
        rows_of.put_fluxes(g, n, NORTH, EAST, under, low, l, r, north, rows.speeds)
        if is_side:
            rest = grid.plan[0, (0 if j == 0 else (ny - 1) * nx) + first :]
            close_walls(
                g,
                moves.speed_y[j],
                rest,
                low if j == 0 else under,
                north,
                moves.thrust[at : at + n],
            )
    if fifth and ny < REACH and is_side:
        close_fixed_walls(grid.reflect[at : at + n], north, n)
    if faces is not None and is_side:
        cells, side, turn = (here, low, 1.0) if j == 0 else (before, under, -1.0)
        ky = grid.ky[min(j, ny - 1) : min(j, ny - 1) + 1]
        kx = grid.kx[first:last]
        top = rows.top[GHOSTS:]
        close_driven(g, faces.values[:, at : at + n], turn, EAST, cells, ky, kx, side, north, top)
    ky, top = grid.ky[max(j - 1, 0) : j + 1], rows.top[GHOSTS - 1 :]
    close_marked(
        g, grid.marks, j, first, n, (NORTH, EAST), (under, low, l, r), north, grid.kx, ky, top
    )
    if flows.y.size > 0:
        copy(north, flows.y[j * nx + first : j * nx + last])
    if flows.through.size > 0 and is_side:
        put_inward(-1.0 if j > 0 else 1.0, grid.kx[first:last], north, flows.through[at : at + n])


@inline
def put_fluxes_along(grid, j, first, last, rows, flows, moves, faces):
    """Write the fluxes through the faces along row j to `rows.along`, and the flows through them.

    Arguments as in `column_rates`
    """
    g = grid.g
    n = last - first
    nx = grid.nx
    ny = grid.ny
    fifth = is_fifth_order(grid.scheme)
    cell, after = rows.cells[ring_offset(j, -1) :], rows.cells[ring_offset(j, 0) :]
    a = rows.cells[ring_offset(j, -3) :]
    b = rows.cells[ring_offset(j, -2) :]
    e = rows.cells[ring_offset(j, 1) :]
    count = (n + 8) // 8 * 8
    size = (n + 9) // 8 * 8  # padded to whole vectors
    put_values(grid, size, grid.kerbs[j], (a, b, cell, after, e), rows.ends, rows.deep)
    if grid.scheme == MUSCL:
        flatten_along(grid.marks, ny + 1 + j, nx, first, last, b, rows.ends)
    along = rows.along
    left = rows.ends[HIGH:]
    right = rows.ends[1:]
    l, r = (left, right) if fifth else (cell, after)  # cells that bound wave speeds
    if moves is None or moves.speed_x.size == 0:
        rows_of.put_fluxes(g, count, EAST, NORTH, left, right, l, r, along, None)
    else:
        rows_of.put_fluxes(g, count, EAST, NORTH, left, right, l, r, along, moves.speed_x[first:])
        rest, thrust = grid.plan[0, j * nx :], moves.thrust
        if first == 0:
            close_walls(g, moves.speed_x[0], rest, right, along, thrust[j : j + 1])
        if last == nx:
            close_walls(
                g,
                moves.speed_x[nx],
                rest[nx - 1 :],
                left[n:],
                along[n:],
                thrust[ny + j : ny + j + 1],
            )
    if fifth and nx < REACH:
        close_fixed_walls(grid.reflect[j : j + 1], along, 1)
        close_fixed_walls(grid.reflect[ny + j : ny + j + 1], along[n:], 1)
    if faces is not None:
        kx = grid.kx
        ky = grid.ky[j : j + 1]
        top = rows.top[GHOSTS:]
        if first == 0 and faces.values[SPEED, j] != 0.0:
            close_driven(
                g, faces.values[:, j : j + 1], 1.0, NORTH, after, kx[:1], ky, right, along, top
            )
        if last == nx and faces.values[SPEED, ny + j] != 0.0:
            east, end = faces.values[:, ny + j : ny + j + 1], n - 1
            close_driven(
                g, east, -1.0, NORTH, after[end:], kx[nx - 1 :], ky, left[n:], along[n:], top[end:]
            )
    ky, top = grid.ky[j : j + 1], rows.top[GHOSTS - 1 :]
    close_marked(
        g,
        grid.marks,
        ny + 1 + j,
        first,
        n + 1,
        (EAST, NORTH),
        (left, right, l, r),
        along,
        grid.kx,
        ky,
        top,
    )
    if flows.x.size > 0:
        copy(along, flows.x[j * (nx + 1) + first : j * (nx + 1) + last + 1])
    if flows.through.size > 0 and first == 0:
        flows.through[j] = along[0] / grid.ky[j]
    if flows.through.size > 0 and last == nx:
        flows.through[ny + j] = -along[n] / grid.ky[j]


@inline
def put_row_rates(grid, j, first, last, rows, rates, moves):
    """Write the rates of row j from the fluxes through its faces; arguments as in `column_rates`."""
    a = j * grid.nx + first
    z = j * grid.nx + last
    kx = grid.kx[first:last]
    ky = grid.ky[j]
    was = j & 1
    south, north = rows.fluxes[was * FLUX :], rows.fluxes[(1 - was) * FLUX :]
    push_x, push_y = rows.ends[rows_of.PUSH + 1 :], rows.sides[was * SIDE + rows_of.PUSH :]
    to_h = rates[0][a:z]
    to_x = rates[1][a:z]
    to_y = rates[2][a:z]
    if moves is None:
        rows_of.put_rates(
            grid.g, kx, ky, push_x, push_y, rows.along, south, north, None, to_h, to_x, to_y
        )
    else:
        wide, _ = factors_of(j, first, last, moves, rows.factors)
        rows_of.put_rates(
            grid.g, kx, ky, push_x, push_y, rows.along, south, north, wide, to_h, to_x, to_y
        )
    add_forces_along(grid.marks, j, first, last, grid.ky[j : j + 1], to_x)
    add_forces_along(grid.marks, grid.ny + 1 + j, first, last, kx, to_y)
