"""Meshes of any cells between moving walls: measures of their sides at the present positions of corners.

Corners move along one axis. So areas, and lengths times normals of sides, are linear in the travels of walls for cells
of any shape. A side sweeps its length times the mean speed of its two corners, so a uniform state stays uniform
(`moving_walls`). The measures of `cell_sides` are computed again for each state, in blocks where corners move.

places : float64[:]  x and y of corners, and their undeformed coordinate along the axis of motion; x and y of centres of
    cells; scratch
ends : int64[:]  number of blocks, and for each 1 if corners move there; four corners of each cell, two int32 in an
    int64, the first corner of a triangle again as fourth; then for each block, side and row of BLOCK cells, in such
    pairs too: corners where the side begins and ends (equal for a missing side), cell beyond, -1 for none

x, y, cx, cy : positions of corners, centres of cells; scratch : values of the current side of each cell of a block, see
the names of its rows; geo, far : first and last group of measures of that side, see `cell_sides`
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import RATE
from fvsolve.features.basins import cell_sides as side
from fvsolve.features.basins.cell_sides import (
    BLOCK,
    DISTANCES,
    MEASURES,
    TINY,
    blocks,
    gradient_share,
    side_numbers,
)
from fvsolve.features.basins.moving_walls import size_patch
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit

START, STOP, BEYOND, ENDS = range(4)
# Rows of BLOCK in the scratch of a block: sums over sides, 1 / area, centre; of the current side its ends, the centre
# beyond, 1 where there is a cell, length; then the other sums of `cell_sides.gradient_share`.
_XX, _XY, _YY, _SHARE, _CX, _CY, _XA, _YA, _XB, _YB, _OX, _OY, _INSIDE, _LENGTH = (
    k * BLOCK for k in range(14)
)
_SIDES_XX, _SIDES_XY, _SIDES_YY, _WEIGHTED_XX, _WEIGHTED_XY, _WEIGHTED_YY = (
    k * BLOCK for k in range(14, 20)
)
SCRATCH = 20 * BLOCK
# groups of `cell_sides`, in its order
_NX, _NY, _REACH, _DX, _DY, _WX, _WY = (k * BLOCK for k in range(7))


@njit(forceinline=True)
def on_moving_mesh(basin):
    """True if the basin has moving walls and a mesh other than a grid."""
    return basin["walls"] > 0 and basin["nx"] == 0


@njit(forceinline=True)
def mesh_positions(plane, basin):
    """(x, y, undeformed coordinate of corners; x, y of centres of cells; scratch) of a mesh: the parts of `places`."""
    at = basin["places"]
    p = basin["corners"]
    n = basin["n"]
    x = plane[at : at + p]
    y = plane[at + p : at + 2 * p]
    drawn = plane[at + 2 * p : at + 3 * p]
    at += 3 * p
    return (
        x,
        y,
        drawn,
        plane[at : at + n],
        plane[at + n : at + 2 * n],
        plane[at + 2 * n : at + 2 * n + SCRATCH],
    )


@njit(forceinline=True)
def ends_of(integers, basin):
    """(flags of blocks where corners move, corners of cells, ends of sides): parts of `ends`, see `moving_meshes`."""
    ends = integers[basin["ends"] :]
    count = ends[0]
    return (
        ends[1 : 1 + count],
        ends[1 + count :].view(np.int32),
        ends[1 + count + 2 * basin["n"] :].view(np.int32),
    )


@njit
def update_meshes(t, y, seen, out, handle):
    """Compute corners, centres, sides and patches of all meshes (not grids) between moving walls at the states y."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        if on_moving_mesh(tables.basins[b]):
            move_corners(tables, tables.basins[b], y)
            update_sides(tables, tables.basins[b])
            for p in range(tables.patches.size):
                if tables.patches[p]["basin"] == b:
                    size_patch(tables, tables.basins[b], tables.patches[p])


@njit
def move_corners(tables, basin, y):
    """Write the coordinates of the corners of a mesh along the motion of its walls [m], at the travels in y.

    They are written to the array x or y of `mesh_positions`.
    """
    plane, walls = tables.plane, tables.walls
    x, north, drawn, _, _, _ = mesh_positions(plane, basin)
    along = north if basin["turn"] == 1 else x
    for i in range(along.size):
        along[i] = drawn[i]
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        for i in range(along.size):
            along[i] += y[walls[k]["y"]] * plane[walls[k]["weights"] + i]


@njit
def put_centres(first, last, corners, x, y, cx, cy):
    """Write the centroids (cx, cy) of the cells `first` to `last` - 1; for the formula see `mesh.area_and_centre`.

    corners : four corners of each cell
    """
    for i in range(first, last):
        own = corners[4 * i : 4 * i + 4]
        a = own[0]
        b = own[1]
        c = own[2]
        d = own[3]
        ax = x[c] - x[a]
        ay = y[c] - y[a]
        bx = x[b] - x[a]
        by = y[b] - y[a]
        dx = x[d] - x[a]
        dy = y[d] - y[a]
        # twice the areas on both sides of a diagonal
        area_1, area_2 = bx * ay - by * ax, ax * dy - ay * dx
        offset = (area_1 - area_2) / (6.0 * (area_1 + area_2))
        x_1 = x[a] + x[c]
        x_2 = x[b] + x[d]
        y_1 = y[a] + y[c]
        y_2 = y[b] + y[d]
        cx[i] = 0.25 * (x_1 + x_2) - (x_2 - x_1) / 12.0 - offset * (x[d] - x[b])
        cy[i] = 0.25 * (y_1 + y_2) - (y_2 - y_1) / 12.0 - offset * (y[d] - y[b])


@njit
def gather_cells(area, cx, cy, scratch):
    """Write 1 / areas and centres of a block of cells to `scratch`, and set the sums over their sides there to zero."""
    for i in range(BLOCK):
        scratch[i], scratch[_XY + i], scratch[_YY + i], scratch[_SHARE + i] = 0.0, 0.0, 0.0, 0.0
        scratch[_SIDES_XX + i], scratch[_SIDES_XY + i], scratch[_SIDES_YY + i] = 0.0, 0.0, 0.0
        scratch[_WEIGHTED_XX + i], scratch[_WEIGHTED_XY + i], scratch[_WEIGHTED_YY + i] = (
            0.0,
            0.0,
            0.0,
        )
    for i in range(area.size):
        scratch[_SHARE + i], scratch[_CX + i], scratch[_CY + i] = 1.0 / area[i], cx[i], cy[i]


@njit
def gather_ends(start, stop, beyond, x, y, cx, cy, scratch):
    """Write the ends of one side of each cell of a block, and the centre of the cell beyond it, to `scratch`.

    start, stop : corners where the side begins and ends; beyond : cell beyond the side, -1 at the boundary
    """
    for i in range(BLOCK):
        a = start[i]
        b = stop[i]
        other = max(beyond[i], 0)
        scratch[_XA + i], scratch[_YA + i], scratch[_XB + i], scratch[_YB + i] = (
            x[a],
            y[a],
            x[b],
            y[b],
        )
        scratch[_OX + i], scratch[_OY + i], scratch[_INSIDE + i] = (
            cx[other],
            cy[other],
            1.0 if beyond[i] >= 0 else 0.0,
        )


@njit
def put_side(scratch, geo):
    """Write the measures of one side of each cell of a block to `geo`, and add to the sums over sides in `scratch`.

    Weights of the least-squares gradient are final after `put_weights`.
    """
    for i in range(BLOCK):
        xa = scratch[_XA + i]
        ya = scratch[_YA + i]
        xb = scratch[_XB + i]
        yb = scratch[_YB + i]
        cx = scratch[_CX + i]
        cy = scratch[_CY + i]
        dx, dy = xb - xa, yb - ya
        length = sqrt(dx * dx + dy * dy)
        exists = length > 0.0  # else a missing side of the cell
        per = 1.0 / (length + TINY)
        nx, ny = per * dy if exists else 1.0, 0.0 - per * dx
        to_x = 0.5 * (xa + xb) - cx if exists else 0.0
        to_y = 0.5 * (ya + yb) - cy if exists else 0.0
        mirror_distance = 2.0 * (to_x * nx + to_y * ny)  # to the mirror image
        inside = scratch[_INSIDE + i] > 0.0
        ax = scratch[_OX + i] - cx if inside else mirror_distance * nx
        ay = scratch[_OY + i] - cy if inside else mirror_distance * ny
        weight = 1.0 / (ax * ax + ay * ay) if exists else 0.0
        scratch[_LENGTH + i] = length
        geo[_NX + i], geo[_NY + i], geo[_REACH + i] = nx, ny, length * scratch[_SHARE + i]
        geo[_DX + i], geo[_DY + i] = to_x, to_y
        geo[_WX + i], geo[_WY + i] = weight * ax, weight * ay
        scratch[i] += weight * ax * ax
        scratch[_XY + i] += weight * ax * ay
        scratch[_YY + i] += weight * ay * ay
        scratch[_SIDES_XX + i] += to_x * to_x
        scratch[_SIDES_XY + i] += to_x * to_y
        scratch[_SIDES_YY + i] += to_y * to_y
        scratch[_WEIGHTED_XX + i] += weight * weight * ax * ax
        scratch[_WEIGHTED_XY + i] += weight * weight * ax * ay
        scratch[_WEIGHTED_YY + i] += weight * weight * ay * ay


@njit
def put_distance(scratch, geo, far):
    """Write to `far` those measures of one side of each cell of a block that only scalars need.

    They are 1 / area, 1 / distance to the next centre and obliqueness.
    """
    for i in range(BLOCK):
        nx, ny = geo[_NX + i], geo[_NY + i]
        mirror_distance = 2.0 * (geo[_DX + i] * nx + geo[_DY + i] * ny)
        inside, exists = scratch[_INSIDE + i] > 0.0, scratch[_LENGTH + i] > 0.0
        ax = scratch[_OX + i] - scratch[_CX + i] if inside else mirror_distance * nx
        ay = scratch[_OY + i] - scratch[_CY + i] if inside else mirror_distance * ny
        gap = 1.0 / (ax * nx + ay * ny) if exists else 0.0
        far[side.PER_AREA * BLOCK + i], far[side.PER_DISTANCE * BLOCK + i] = (
            scratch[_SHARE + i] if exists else 0.0,
            gap,
        )
        far[side.OBLIQUE_X * BLOCK + i] = nx - ax * gap if exists else 0.0
        far[side.OBLIQUE_Y * BLOCK + i] = ny - ay * gap if exists else 0.0


@njit
def invert(scratch, steepest):
    """Invert the least-squares matrix of each cell of a block in `scratch`, in place.

    The inverse times sums over the sides gives the gradient. It is multiplied by `cell_sides.gradient_share`, see there
    for `steepest`.
    """
    for i in range(BLOCK):
        xx = scratch[i]
        xy = scratch[_XY + i]
        yy = scratch[_YY + i]
        sides = scratch[_SIDES_XX + i], scratch[_SIDES_XY + i], scratch[_SIDES_YY + i]
        weighted = scratch[_WEIGHTED_XX + i], scratch[_WEIGHTED_XY + i], scratch[_WEIGHTED_YY + i]
        # 1 in padding
        share = gradient_share(sides, (xx, xy, yy), weighted, steepest) if xx > 0.0 else 1.0
        scale = share / max(xx * yy - xy * xy, TINY)
        scratch[i], scratch[_XY + i], scratch[_YY + i] = scale * yy, scale * xy, scale * xx


@njit
def put_weights(scratch, geo):
    """Write the weights of the difference across one side in the gradient, for each cell of a block, to `geo`."""
    for i in range(BLOCK):
        wx = geo[_WX + i]
        wy = geo[_WY + i]
        cross = scratch[_XY + i]
        geo[_WX + i], geo[_WY + i] = (
            scratch[i] * wx - cross * wy,
            scratch[_YY + i] * wy - cross * wx,
        )


@njit
def update_sides(tables, basin):
    """Write the measures of `cell_sides` in blocks where corners move, and the centres of cells there.

    The last group is written only for a basin with scalars; lengths of inner faces only where flows are needed.
    """
    floats, integers = tables.plane[basin["mesh"] :], tables.integers[basin["links"] :]
    x, y, _, cx, cy, scratch = mesh_positions(tables.plane, basin)
    area = tables.plane[basin["area"] :]
    moving_blocks, corners, ends = ends_of(tables.integers, basin)
    slots = integers[0]
    n = integers[1]
    f = integers[2]
    b = integers[3]
    m = moving_blocks.size * slots * BLOCK
    _, edges, number, face = side_numbers(integers)
    lengths, distances = floats[MEASURES * m + 2 * b :], floats[MEASURES * m + 2 * b + f :]
    for j in range(moving_blocks.size):
        if moving_blocks[j] == 1:
            put_centres(j * BLOCK, min((j + 1) * BLOCK, n), corners, x, y, cx, cy)
    for j in range(moving_blocks.size):
        if moving_blocks[j] == 0:
            continue
        first, last = j * BLOCK, min((j + 1) * BLOCK, n)
        gather_cells(area[first:last], cx[first:last], cy[first:last], scratch)
        for slot in range(j * slots, (j + 1) * slots):
            own, geo = ends[slot * ENDS * BLOCK :], floats[slot * MEASURES * BLOCK :]
            gather_ends(own, own[STOP * BLOCK :], own[BEYOND * BLOCK :], x, y, cx, cy, scratch)
            put_side(scratch, geo)
            if basin["carried"] >= 0:
                put_distance(scratch, geo, distances[slot * DISTANCES * BLOCK :])
            if basin["flows"] >= 0:
                put_lengths(face[slot * BLOCK :], scratch[_LENGTH:], lengths)
        invert(scratch, basin["steepest"])
        for slot in range(j * slots, (j + 1) * slots):
            put_weights(scratch, floats[slot * MEASURES * BLOCK :])
    for q in range(b):
        j = edges[q] // BLOCK // 4
        k = edges[q] // BLOCK % 4
        i = edges[q] % BLOCK
        geo = floats[(j * slots + k) * MEASURES * BLOCK + i :]
        floats[MEASURES * m + q], floats[MEASURES * m + b + q] = geo[_NX], geo[_NY]
        lengths[f - b + number[q]] = geo[_REACH] * area[j * BLOCK + i]


@njit
def put_lengths(face, side_lengths, lengths):
    """Write the lengths of faces to `lengths`, read from the cells on their left, at one side of each cell.

    face : face of each side, negative for the cell on the right; side_lengths : lengths of these sides
    """
    for i in range(BLOCK):
        if face[i] >= 0:
            lengths[face[i]] = side_lengths[i]


@njit
def set_side_speeds(t, y, dydt, out, handle):
    """Write the speeds of all sides of moving meshes along their normals [m/s]; raise out[RATE] to limit the step."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        if on_moving_mesh(tables.basins[b]):
            out[RATE] = max(out[RATE], put_speeds(tables, tables.basins[b]))


@njit
def put_speeds(tables, basin):
    """Write the speeds of sides along their normals from the speeds of corners; return the greatest swept rate [1/s].

    This rate is the fraction of a cell that a side sweeps per time.
    """
    plane = tables.plane
    slots = tables.integers[basin["links"]]
    most = 0.0
    v, across = plane[basin["lines"] :], _NY if basin["turn"] == 1 else _NX
    moving_blocks, _, ends = ends_of(tables.integers, basin)
    for slot in range(moving_blocks.size * slots):
        if moving_blocks[slot // slots] == 0:
            continue
        start, stop = ends[slot * ENDS * BLOCK :], ends[(slot * ENDS + STOP) * BLOCK :]
        geo = plane[basin["mesh"] + slot * MEASURES * BLOCK :]
        speeds = plane[basin["sides"] + (slot // slots * 4 + slot % slots) * BLOCK :]
        for i in range(BLOCK):
            speeds[i] = 0.5 * (v[start[i]] + v[stop[i]]) * geo[across + i]
            most = max(most, abs(speeds[i]) * geo[_REACH + i])
    return most


class MeshMotion(NamedTuple):
    """Motion of a mesh between moving walls: speeds of sides, forces, and ratios of areas.

    speeds : speeds of sides along their outward normals [m/s]
    thrust : values on boundary faces. For a liquid they are pressures above that at rest [Pa], then, under the density
    law `linear`, speed (c^2 r^2 - |m|^2) there [kg^2/(m3 s3)]; divided by 2 rho, this is the power lost per area.
    For water they are thrusts minus those at rest, over density and length [m3/s2]
    wide : areas of cells over undeformed areas, see `basins.cell_sides`
    """

    speeds: np.ndarray
    thrust: np.ndarray
    wide: np.ndarray


@njit(forceinline=True)
def mesh_motion(tables, basin):
    """`MeshMotion` of a basin with moving walls, whose mesh is not a grid."""
    sides = basin["sides"]
    thrust = basin["thrust"]
    rows = basin["stretch"]
    count = 4 * BLOCK * blocks(tables.integers[basin["links"] :])
    plane, thrust_array = tables.plane, tables.work[thrust : thrust + 2 * basin["outer"]]
    return MeshMotion(plane[sides : sides + count], thrust_array, plane[rows : rows + basin["n"]])
