"""Marked faces between cells of water: walls that water may overflow, and faces of sections.

With the crest z of a wall, of the height p above the beds beside it, the depths over it are a and b, h the greater and
r h the lesser. Up to r = 0.9 the flow is that of a weir, 2/3 C sqrt(2 g) h^1.5 (1 - r^1.5)^0.385 per length (Villemonte
1947), with the levels of the cells. From r = 0.95 on it is the HLL flux over a bed at z. From r h = p on it is blended
with the flux without the wall, which it equals from r h = 1.5 p on (limits of ANUGA, Davies and Roberts 2015). Each
cell loses or gains the momentum of its own velocity u with the flow q of the weir; the wall takes the rest, with the
reflected wave (|u| + c)(depth u - q). So uniform flow has the same level up to the wall. Along the wall the momentum is
carried with the mass. Cells beside a wall are reconstructed with slopes times the share of the flux without the wall.
Walls oblique to their faces have the flow and the forces of their own normal n: a face with the normal m passes q n.m.
"""

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import SECTION_FLOW
from fvsolve.core.kernels.structures import weir_flow
from fvsolve.features.basins.cell_sides import BLOCK, CELL, INDICES
from fvsolve.features.basins.free_surface.moving_crests import write_crests
from fvsolve.features.basins.free_surface.surface_rows import (
    AFTER,
    ALONG,
    BEFORE,
    EAST,
    HIGH,
    PUSH,
    STRIDE,
    SURFACE,
    WAVE,
)
from fvsolve.features.basins.hll_flux import hll_flux
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit

WEIR_ENDS, FLUX_BEGINS = 0.9, 0.95  # lesser over greater depth above the crest
LOW_ENDS, HIGH_BEGINS = 1.0, 1.5  # lesser depth above the crest over the height of the wall
SUM_COUNT = 5  # values of a cell of a mesh before a side is added, see `save_sums`


class MarkedFaces(NamedTuple):
    """Marked faces of a basin.

    first : int64[rows + 1]  first mark of each row of faces. On a grid rows 0 to ny contain faces normal to y, rows
    ny + 1 + j faces normal to x in row j of cells; on a mesh row 4 j + k contains sides k of the cells of block j
    place : int64[marks]  column of the face; on a mesh cell of the side, within the block
    number : int64[marks]  number of the face; on a mesh ~number where the normal of the face points inwards
    crest : crests of walls above the level at rest [m]; height : of walls above the beds [m], 0 without a wall
    size : 2/3 C sqrt(2 g) [m^0.5/s]; cosine, sine : normal of the wall across the face and along it, to the left of
    the normal of the face; all float64[faces]
    flows : float64[faces]  computed flows through the faces, per length [m2/s]
    spare : work array; on a grid momentum along the faces on the side after them minus that before [m3/s2]
    """

    first: np.ndarray
    place: np.ndarray
    number: np.ndarray
    crest: np.ndarray
    height: np.ndarray
    size: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    flows: np.ndarray
    spare: np.ndarray


@njit
def marked_faces(tables, basin, t):
    """`MarkedFaces` of a basin at time t [s]."""
    rows = basin["mark_rows"]
    marks = basin["marks"]
    faces = basin["marked_faces"]
    integers = tables.integers[basin["marked"] :]
    numbers = tables.plane[basin["crests"] :]
    if basin["moving_crests"] > 0:
        write_crests(tables, basin, t)
        numbers = tables.work[basin["crests"] :]
    work = basin["marked_work"]
    return MarkedFaces(
        integers[: rows + 1],
        integers[rows + 1 :][:marks],
        integers[rows + 1 + marks :][:marks],
        numbers[:faces],
        numbers[faces : 2 * faces],
        numbers[2 * faces : 3 * faces],
        numbers[3 * faces : 4 * faces],
        numbers[4 * faces : 5 * faces],
        tables.work[work : work + faces],
        tables.work[work + faces :],
    )


@njit
def no_marks(tables, basin, t):
    """Return None: no face is marked."""


@njit
def share_between(value, low, high):
    """Share of the way from `low` to `high` that a value has passed, in [0, 1]."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


@njit
def share_without(crest, height, e, beyond):
    """Share of the flux without the wall, 1 without a wall. e, beyond : surfaces on both sides"""
    if height == 0.0:
        return 1.0
    return share_between(max(min(e, beyond) - crest, 0.0) / height, LOW_ENDS, HIGH_BEGINS)


@njit
def blend(share, first, second):
    """(1 - share) times each of five values `first`, plus share times each of `second`."""
    a, b, c, d, e = first
    f, g, h, i, j = second
    return (
        a + share * (f - a),
        b + share * (g - b),
        c + share * (h - c),
        d + share * (i - d),
        e + share * (j - e),
    )


@njit
def flux_without_law(g, bed, before, after, low, high):
    """Flux as `flux_over_wall` returns it, without the speed: HLLC flux over a bed; arguments as there."""
    (h, e, u, s, _), (k, f, v, t, _) = before, after
    bed = max(max(e - h, f - k), bed)
    a = max(0.0, e - bed)
    b = max(0.0, f - bed)
    qa = a * u
    qb = b * v
    push = 0.5 * g * ((b - a) * (b + a))
    mass, first, second = hll_flux(low, high, a, b, qa, qb, qa * u, qb * v, push)
    along = mass * (s if mass > 0.0 else t)
    return mass, first, second, along, along


@njit
def flux_of_weir(q, cosine, sine, before, after):
    """Flux as `flux_over_wall` returns it, without the speed, for a flow q per length of the wall.

    Each cell keeps its velocity across the wall, and receives the velocity along the wall with the water.
    """
    (h, _, u, s, c), (k, _, v, t, d) = before, after
    first, second = u * cosine + s * sine, v * cosine + t * sine
    # difference of the velocities along the wall
    drift = (t * cosine - v * sine) - (s * cosine - u * sine)
    mass, push = cosine * q, cosine * (first + abs(first) + c) * (h * first - q)
    pull = cosine * (second - abs(second) - d) * (k * second - q)
    change = mass * drift
    lost, gained = (0.0, -change) if q > 0.0 else (change, 0.0)
    return (
        mass,
        mass * u - lost * sine + push * cosine,
        mass * v - gained * sine + pull * cosine,
        mass * s + lost * cosine + push * sine,
        mass * t + gained * cosine + pull * sine,
    )


@njit
def flux_over_wall(g, crest, height, size, cosine, sine, before, after, low, high):
    """(flow, momentum across the face minus own pressure before and after it, along it before and after, speed).

    before, after : (depth, surface, normal velocity, velocity along the face, wave speed) on both sides
    cosine, sine : normal of the wall across and along the face; low, high : wave speeds
    speed : bound of the change of the flow by a level where laws are blended [m/s], else 0
    """
    e, f = before[1], after[1]
    top = max(e, f) - crest
    tail = min(e, f) - crest
    speed = 0.0
    without = share_without(crest, height, e, f)
    plain = flux_without_law(g, e - before[0], before, after, low, high)
    if without == 1.0:
        return plain, speed
    q = weir_flow(size, top, abs(e - f))[0]
    wall = flux_of_weir(q if e > f else -q, cosine, sine, before, after)
    level = share_between(tail / top, WEIR_ENDS, FLUX_BEGINS) if tail > 0.0 else 0.0
    if level > 0.0:
        flat = flux_without_law(g, crest, before, after, low, high)
        if level < 1.0:
            speed = abs(flat[0] - wall[0]) / ((FLUX_BEGINS - WEIR_ENDS) * top)
        wall = blend(level, wall, flat)
    if without > 0.0:
        speed += abs(plain[0] - wall[0]) / ((HIGH_BEGINS - LOW_ENDS) * height)
        wall = blend(without, wall, plain)
    return wall, speed


@njit
def flatten(share, cells, k, sides, i):
    """Multiply the slopes of a cell of a grid by `share`. cells, k : its values; sides, i : its values at both faces"""
    for at in range(0, 4 * STRIDE, STRIDE):
        here = cells[k + at]
        sides[i + at] = here + share * (sides[i + at] - here)
        sides[i + HIGH + at] = here + share * (sides[i + HIGH + at] - here)
    sides[i + PUSH] *= share


@njit
def flatten_across(marks, ny, j, first, last, before, here, after, sides):
    """Reduce the slopes across the rows in cells of row j of a grid that lie beside walls, and in their mirror images.

    first, last : columns; before, here, after : values of rows j - 1, j, j + 1; sides : values at the faces of row j
    """
    if marks is not None:
        # rows -1 and ny are mirror images
        for row in range(min(max(j, 1), ny - 1), max(min(j + 1, ny - 1), 1) + 1):
            next_row = after if (row == j + 1 and j >= 0) or j == ny else before
            for m in range(marks.first[row], marks.first[row + 1]):
                k, n = marks.place[m] - first, marks.number[m]
                if 0 <= k < last - first:
                    e, beyond = here[k + SURFACE], next_row[k + SURFACE]
                    flatten(
                        share_without(marks.crest[n], marks.height[n], e, beyond), here, k, sides, k
                    )


@njit
def flatten_along(marks, row, nx, first, last, cells, sides):
    """Reduce the slopes along a row of a grid in cells beside walls, and in their mirror images.

    row : row of faces; nx, first, last : number of columns, and columns; cells : values from two cells before column
    `first` on; sides : values at the faces of cells from one cell before on
    """
    if marks is not None:
        for m in range(marks.first[row], marks.first[row + 1]):
            i = marks.place[m]
            k = marks.place[m] - first
            n = marks.number[m]
            if -1 <= k <= last - first + 1:
                e, beyond = cells[k + 1 + SURFACE], cells[k + 2 + SURFACE]
                share = share_without(marks.crest[n], marks.height[n], e, beyond)
                if i == 1 and k == 1:
                    flatten(share, cells, k, sides, k - 1)
                if k >= 0:
                    flatten(share, cells, k + 1, sides, k)
                if k <= last - first:
                    flatten(share, cells, k + 2, sides, k + 1)
                if i == nx - 1 and last == nx:
                    flatten(share, cells, k + 3, sides, k + 2)


@njit
def close_marked(g, marks, row, first, count, axes, sides, f, kx, ky, top):
    """Replace the fluxes through marked faces of a row of faces of a grid that are walls, and write all marked flows.

    count : number of faces, the first in column `first`; kx : 1 / widths of all columns [1/m]
    ky : 1 / height of the row of cells, or of the rows on both sides of a row of faces normal to y [1/m]
    axes, sides : (normal, along) and (left, right, l, r) of `surface_rows.put_fluxes`; f : as there
    top : greatest rates, from the column before `first` on
    """
    if marks is None:
        return
    (normal, along), (left, right, l, r) = axes, sides
    turn = 1.0 if normal == EAST else -1.0  # y is to the left of x, -x to the left of y
    for m in range(marks.first[row], marks.first[row + 1]):
        i = marks.place[m]
        k = marks.place[m] - first
        n = marks.number[m]
        if not 0 <= k < count:
            continue
        if marks.height[n] > 0.0:
            wave = max(l[k + WAVE], r[k + WAVE])
            ua = l[k + normal]
            ub = r[k + normal]
            before = left[k], left[k + SURFACE], left[k + normal], left[k + along], l[k + WAVE]
            after = right[k], right[k + SURFACE], right[k + normal], right[k + along], r[k + WAVE]
            low, high = min(min(ua, ub) - wave, 0.0), max(max(ua, ub) + wave, 0.0)
            flux, speed = flux_over_wall(
                g,
                marks.crest[n],
                marks.height[n],
                marks.size[n],
                marks.cosine[n],
                turn * marks.sine[n],
                before,
                after,
                low,
                high,
            )
            f[k], f[k + BEFORE], f[k + AFTER], f[k + ALONG], beyond = flux
            marks.spare[n] = beyond - f[k + ALONG]
            if speed > 0.0:
                west, east = abs(l[k + along]) + l[k + WAVE], abs(r[k + along]) + r[k + WAVE]
                if normal == EAST:
                    top[k] = max(top[k], speed * kx[i - 1] + west * ky[0])
                    top[k + 1] = max(top[k + 1], speed * kx[i] + east * ky[0])
                else:
                    top[k + 1] = max(
                        top[k + 1], speed * max(ky[0], ky[1]) + max(west, east) * kx[i]
                    )
        marks.flows[n] = f[k]


@njit
def add_forces_along(marks, row, first, last, k, rates):
    """Add the momentum along walls on the side after a row of faces of a grid, beyond that on the side before.

    first, last : columns; k : 1 / sizes of these cells across the faces, or of the row [1/m]; rates : of the momentum
    """
    if marks is not None:
        for m in range(marks.first[row], marks.first[row + 1]):
            i, n = marks.place[m] - first, marks.number[m]
            if 0 <= i < last - first and marks.height[n] > 0.0:
                rates[i] += k[min(i, k.size - 1)] * marks.spare[n]


@njit
def flatten_cells(marks, mesh, j, cells, sides):
    """Reduce the slopes in cells of block j of a mesh that lie beside walls; arguments as in `mesh_blocks`."""
    if marks is None:
        return
    at = (j % mesh.ring) * BLOCK
    for k in range(mesh.slots):
        slot = j * mesh.slots + k
        for m in range(marks.first[4 * j + k], marks.first[4 * j + k + 1]):
            i, number = marks.place[m], max(marks.number[m], ~marks.number[m])
            beyond = cells[1, mesh.places[(slot * INDICES + CELL) * BLOCK + i]]
            share = share_without(
                marks.crest[number], marks.height[number], cells[1, at + i], beyond
            )
            for field in range(4):
                here = cells[field, at + i]
                for side in range(mesh.slots):
                    place = 4 * at + side * BLOCK + i
                    sides[field, place] = here + share * (sides[field, place] - here)


@njit
def save_sums(marks, row, w, rows):
    """Keep the sums of cells at marked sides of a row of sides of a mesh.

    w : scratch of the block; rows : offsets of the five sums there
    """
    if marks is not None:
        for m in range(marks.first[row], marks.first[row + 1]):
            for k in range(SUM_COUNT):
                marks.spare[k * BLOCK + m - marks.first[row]] = w[rows[k] + marks.place[m]]


@njit
def observe_sections(t, y, out, handle, values):
    """Write the flows through sections [m3/s]: sums of flows of marked faces times weights."""
    tables = open_basins(handle)
    for p in range(tables.probes.size):
        probe = tables.probes[p]
        if probe["kind"] == SECTION_FLOW:
            total, first = 0.0, tables.basins[probe["index"]]["marked_work"]
            for m in range(probe["count"]):
                flow = tables.work[first + tables.integers[probe["cell"] + m]]
                total += tables.floats[probe["weights"] + m] * flow
            values[p] = total
