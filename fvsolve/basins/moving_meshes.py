"""Meshes of any cells between walls that move: their sides as they are. Knows corners; knows no physics.

Corners go along one axis, so areas and length times normal of sides are linear in travels, whatever the cells are, and
a side sweeps its length times the mean speed of its two corners: what is even stays so (`walls`). What `faces` reads of
cells and sides is found anew for each state, where anything moves.

places : float64[:]  of corners x, y and the one of these that moves as drawn; of cells x and y of centres; room
ends : int64[:]  how many blocks, and of each whether anything moves there; four corners of cells, two int32 to an
       int64, a triangle's first one again; by block, side and row of BLOCK as such pairs: corners where the side begins
       and ends (both the same where there is none), cell beyond, -1 for none
"""

from math import sqrt

import numpy as np

from fvsolve.basins.faces import (
    BLOCK,
    DISTANCES,
    DX,
    DY,
    GAP,
    HEAD,
    INDICES,
    LEAN_X,
    LEAN_Y,
    MEASURES,
    NX,
    NY,
    REACH,
    SHARE,
    TINY,
    WX,
    WY,
    blocks,
)
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import RATE

START, STOP, BEYOND, ENDS = range(4)
# rows of BLOCK in the room of a block: sums over sides, 1 / area, centre; of one side its ends, the centre beyond, 1
# where there is a cell, length
_XX, _XY, _YY, _SHARE, _CX, _CY, _XA, _YA, _XB, _YB, _OX, _OY, _INSIDE, _LONG = (k * BLOCK for k in range(14))
ROOM = 14 * BLOCK
_NX, _NY, _REACH, _DX, _DY, _WX, _WY = (k * BLOCK for k in (NX, NY, REACH, DX, DY, WX, WY))


@njit(forceinline=True)
def on_moving_mesh(basin):
    """Whether it is a mesh of any cells between walls that move."""
    return basin["walls"] > 0 and basin["nx"] == 0


@njit(forceinline=True)
def places_of(plane, basin):
    """(x, y, the one that moves as drawn) of corners, (x, y) of centres of cells, and room."""
    at, p, n = basin["places"], basin["corners"], basin["n"]
    x, y, drawn = plane[at : at + p], plane[at + p : at + 2 * p], plane[at + 2 * p : at + 3 * p]
    at += 3 * p
    return x, y, drawn, plane[at : at + n], plane[at + n : at + 2 * n], plane[at + 2 * n : at + 2 * n + ROOM]


@njit(forceinline=True)
def ends_of(integers, basin):
    """(which blocks move, corners of cells, ends of sides)."""
    ends = integers[basin["ends"] :]
    count = ends[0]
    return ends[1 : 1 + count], ends[1 + count :].view(np.int32), ends[1 + count + 2 * basin["n"] :].view(np.int32)


@njit
def see_meshes(t, y, seen, out, handle):
    """Corners, centres, sides and patches of meshes as they are at y."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_moving_mesh(tables.basins[b]):
            move_corners(tables, tables.basins[b], y)
            move_sides(tables, tables.basins[b])
            for p in range(tables.patches.size):
                if tables.patches[p]["basin"] == b:
                    size_patch(tables, tables.basins[b], tables.patches[p])


@njit
def move_corners(tables, basin, y):
    """Corners where walls take them."""
    plane, walls = tables.plane, tables.walls
    x, north, drawn, _, _, _ = places_of(plane, basin)
    along = north if basin["turn"] == 1 else x
    for i in range(along.size):
        along[i] = drawn[i]
    for k in range(basin["wall"], basin["wall"] + basin["walls"]):
        for i in range(along.size):
            along[i] += y[walls[k]["y"]] * plane[walls[k]["weights"] + i]


@njit
def put_centres(first, last, corners, x, y, cx, cy):
    """Centroids of cells, see `mesh.shapes`."""
    for i in range(first, last):
        own = corners[4 * i : 4 * i + 4]
        a, b, c, d = own[0], own[1], own[2], own[3]
        ax, ay, bx, by, dx, dy = x[c] - x[a], y[c] - y[a], x[b] - x[a], y[b] - y[a], x[d] - x[a], y[d] - y[a]
        one, other = bx * ay - by * ax, ax * dy - ay * dx  # twice the areas on both sides of a diagonal
        lean = (one - other) / (6.0 * (one + other))
        x_one, x_other, y_one, y_other = x[a] + x[c], x[b] + x[d], y[a] + y[c], y[b] + y[d]
        cx[i] = 0.25 * (x_one + x_other) - (x_other - x_one) / 12.0 - lean * (x[d] - x[b])
        cy[i] = 0.25 * (y_one + y_other) - (y_other - y_one) / 12.0 - lean * (y[d] - y[b])


@njit
def gather_cells(area, cx, cy, room):
    """1 / areas and centres of a block of cells; sums over their sides begin."""
    for i in range(BLOCK):
        room[i], room[_XY + i], room[_YY + i], room[_SHARE + i] = 0.0, 0.0, 0.0, 0.0
    for i in range(area.size):
        room[_SHARE + i], room[_CX + i], room[_CY + i] = 1.0 / area[i], cx[i], cy[i]


@njit
def gather_ends(start, stop, beyond, x, y, cx, cy, room):
    """Where a side of each cell of a block begins and ends, the centre beyond, and whether there is a cell there."""
    for i in range(BLOCK):
        a, b, other = start[i], stop[i], max(beyond[i], 0)
        room[_XA + i], room[_YA + i], room[_XB + i], room[_YB + i] = x[a], y[a], x[b], y[b]
        room[_OX + i], room[_OY + i], room[_INSIDE + i] = cx[other], cy[other], 1.0 if beyond[i] >= 0 else 0.0


@njit
def put_side(room, geo):
    """Measures of one side of each cell of a block, and sums over sides of what a plane is fitted to."""
    for i in range(BLOCK):
        xa, ya, xb, yb, cx, cy = (
            room[_XA + i], room[_YA + i], room[_XB + i], room[_YB + i], room[_CX + i], room[_CY + i]
        )  # fmt: skip
        dx, dy = xb - xa, yb - ya
        long = sqrt(dx * dx + dy * dy)
        there = long > 0.0  # else a side that the cell has not
        per = 1.0 / (long + TINY)
        nx, ny = per * dy if there else 1.0, 0.0 - per * dx
        to_x, to_y = 0.5 * (xa + xb) - cx if there else 0.0, 0.5 * (ya + yb) - cy if there else 0.0
        back = 2.0 * (to_x * nx + to_y * ny)  # to the mirror image
        inside = room[_INSIDE + i] > 0.0
        ax, ay = room[_OX + i] - cx if inside else back * nx, room[_OY + i] - cy if inside else back * ny
        weight = 1.0 / (ax * ax + ay * ay) if there else 0.0
        room[_LONG + i] = long
        geo[_NX + i], geo[_NY + i], geo[_REACH + i] = nx, ny, long * room[_SHARE + i]
        geo[_DX + i], geo[_DY + i] = to_x, to_y
        geo[_WX + i], geo[_WY + i] = weight * ax, weight * ay
        room[i] += weight * ax * ax
        room[_XY + i] += weight * ax * ay
        room[_YY + i] += weight * ay * ay


@njit
def put_distance(room, geo, far):
    """What scalars that are carried or spread want of the same side."""
    for i in range(BLOCK):
        nx, ny = geo[_NX + i], geo[_NY + i]
        back = 2.0 * (geo[_DX + i] * nx + geo[_DY + i] * ny)
        inside, there = room[_INSIDE + i] > 0.0, room[_LONG + i] > 0.0
        ax = room[_OX + i] - room[_CX + i] if inside else back * nx
        ay = room[_OY + i] - room[_CY + i] if inside else back * ny
        gap = 1.0 / (ax * nx + ay * ny) if there else 0.0
        far[SHARE * BLOCK + i], far[GAP * BLOCK + i] = room[_SHARE + i] if there else 0.0, gap
        far[LEAN_X * BLOCK + i] = nx - ax * gap if there else 0.0
        far[LEAN_Y * BLOCK + i] = ny - ay * gap if there else 0.0


@njit
def invert(room):
    """The matrix that makes gradients of sums over sides."""
    for i in range(BLOCK):
        xx, xy, yy = room[i], room[_XY + i], room[_YY + i]
        scale = 1.0 / max(xx * yy - xy * xy, TINY)
        room[i], room[_XY + i], room[_YY + i] = scale * yy, scale * xy, scale * xx


@njit
def weigh_side(room, geo):
    """Weights of a side's difference in the gradient."""
    for i in range(BLOCK):
        wx, wy, cross = geo[_WX + i], geo[_WY + i], room[_XY + i]
        geo[_WX + i], geo[_WY + i] = room[i] * wx - cross * wy, room[_YY + i] * wy - cross * wx


@njit
def move_sides(tables, basin):
    """All that `faces` reads of sides, where anything moves."""
    floats, integers = tables.plane[basin["mesh"] :], tables.integers[basin["links"] :]
    x, y, _, cx, cy, room = places_of(tables.plane, basin)
    area = tables.plane[basin["area"] :]
    stirs, corners, ends = ends_of(tables.integers, basin)
    slots, n, f, b = integers[0], integers[1], integers[2], integers[3]
    m = stirs.size * slots * BLOCK
    lies = HEAD + INDICES * m // 2 + stirs.size
    edges, number, face = integers[lies : lies + b], integers[lies + b : lies + 2 * b], integers[lies + 2 * b :]
    lengths, distances = floats[MEASURES * m + 2 * b :], floats[MEASURES * m + 2 * b + f :]
    for j in range(stirs.size):
        if stirs[j] == 1:
            put_centres(j * BLOCK, min((j + 1) * BLOCK, n), corners, x, y, cx, cy)
    for j in range(stirs.size):
        if stirs[j] == 0:
            continue
        first, last = j * BLOCK, min((j + 1) * BLOCK, n)
        gather_cells(area[first:last], cx[first:last], cy[first:last], room)
        for slot in range(j * slots, (j + 1) * slots):
            own, geo = ends[slot * ENDS * BLOCK :], floats[slot * MEASURES * BLOCK :]
            gather_ends(own, own[STOP * BLOCK :], own[BEYOND * BLOCK :], x, y, cx, cy, room)
            put_side(room, geo)
            if basin["carried"] >= 0:
                put_distance(room, geo, distances[slot * DISTANCES * BLOCK :])
            if basin["flows"] >= 0:
                put_lengths(face[slot * BLOCK :], room[_LONG:], lengths)
        invert(room)
        for slot in range(j * slots, (j + 1) * slots):
            weigh_side(room, floats[slot * MEASURES * BLOCK :])
    for q in range(b):
        side = edges[q] // BLOCK
        geo = floats[(side // 4 * slots + side % 4) * MEASURES * BLOCK + edges[q] % BLOCK :]
        floats[MEASURES * m + q], floats[MEASURES * m + b + q] = geo[_NX], geo[_NY]
        lengths[f - b + number[q]] = geo[_REACH] * area[side // 4 * BLOCK + edges[q] % BLOCK]


@njit
def put_lengths(face, long, lengths):
    """Lengths of faces, from the cells that have them on their left."""
    for i in range(BLOCK):
        if face[i] >= 0:
            lengths[face[i]] = long[i]


@njit
def size_patch(tables, basin, patch):
    """Sizes of a patch: lengths of its faces, areas of the cells behind."""
    plane, integers, area, length = tables.plane, tables.integers, 0.0, 0.0
    links = integers[basin["links"] :]
    at = basin["mesh"] + MEASURES * blocks(links) * links[0] * BLOCK + 2 * links[3] + links[2] - links[3]
    for m in range(patch["count"]):
        area += plane[basin["area"] + integers[patch["first"] + m]]
    for m in range(patch["faces"]):
        own = plane[at + integers[patch["ring"] + m]]
        i = integers[patch["ring"] + patch["faces"] + m]
        plane[patch["normals"] + 2 * patch["faces"] + m] = own / plane[basin["drawn"] + i]
        length += own
    plane[patch["sizes"]], plane[patch["sizes"] + 1] = area, length


@njit
def drive_sides(t, y, dydt, out, handle):
    """Speeds of all sides along their normals; steps follow these too."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_moving_mesh(tables.basins[b]):
            out[RATE] = max(out[RATE], put_speeds(tables, tables.basins[b]))


@njit
def put_speeds(tables, basin):
    """Fill them from those of corners; returns the greatest share of a cell that a side sweeps [1/s]."""
    plane, slots, most = tables.plane, tables.integers[basin["links"]], 0.0
    v, across = plane[basin["lines"] :], _NY if basin["turn"] == 1 else _NX
    stirs, _, ends = ends_of(tables.integers, basin)
    for slot in range(stirs.size * slots):
        if stirs[slot // slots] == 0:
            continue
        start, stop = ends[slot * ENDS * BLOCK :], ends[(slot * ENDS + STOP) * BLOCK :]
        geo = plane[basin["mesh"] + slot * MEASURES * BLOCK :]
        speeds = plane[basin["sides"] + (slot // slots * 4 + slot % slots) * BLOCK :]
        for i in range(BLOCK):
            speeds[i] = 0.5 * (v[start[i]] + v[stop[i]]) * geo[across + i]
            most = max(most, abs(speeds[i]) * geo[_REACH + i])
    return most


@njit(forceinline=True)
def moves_of(tables, basin):
    """Speeds of sides, room for what they find: thrust on faces of the boundary, what else a law books; and wide."""
    sides, thrust, rows = basin["sides"], basin["thrust"], basin["stretch"]
    many = 4 * BLOCK * blocks(tables.integers[basin["links"] :])
    plane, found = tables.plane, tables.work[thrust : thrust + 2 * basin["outer"]]
    return plane[sides : sides + many], found, plane[rows : rows + basin["n"]]
