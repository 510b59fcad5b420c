"""Sides of cells of any mesh: layout of their arrays, gradients, limiter; cells that stretch as grid lines move.

A cell has `slots` sides, three or four. Cells are stored in blocks of BLOCK; the last block is padded. Every cell reads
the values beyond its sides and computes its own rates. Both cells of a face compute the same flux to the last bit, so
the scheme is conservative. A missing side (a triangle among quadrilaterals) has length 0 and its own cell as neighbour.

Temporary values of cells and of their sides are stored in a ring of the last `ring` blocks, so that they stay in a near
cache: cell i of block j at (j BLOCK + i) modulo ring BLOCK, its side k at ((4 j + k) BLOCK + i) modulo 4 ring BLOCK.
The rates of block j need the sides of all blocks before need[j]. The sides of block k need the values of the cells of
all blocks before need[k]. Loops run over BLOCK cells and a few arrays at constant distances, so that the compiler knows
that they do not overlap.

integers : int64[:], in this order
    - slots, cells, faces, boundary faces, ring
    - for each block, side, and row of BLOCK cells: places in the ring of the neighbour cell and of the side of the
      neighbour at the same face (at the boundary its own); two int32 in an int64
    - need[blocks]
    - boundary sides: side before the modulo operation, then number of the boundary face
    - for each block and side: face f, or ~f where the normal of the face points inwards
floats : float64[:], in this order
    - for each block, side, and row of BLOCK cells: outward normal, length / area, vector from the centre to the middle
      of the side, weights of the difference across the side in the gradient
    - boundary sides: outward normal; faces: length
    - for each block, side, and row of BLOCK cells: 1 / area, 1 / distance to the next centre along the normal,
      normal minus the vector to the next centre over that distance

The states of basins whose cells stretch are changes of the amount in a cell over its undeformed area, (A U - A0 U0) /
A0: U is a value per area, A the area, U0 and A0 are the values at rest and undeformed (`moving_walls`). All columns of
a grid stretch alike, or all rows.

wide : A / A0; narrow : A0 / A
"""

from math import sqrt

import numpy as np

from fvsolve.jit import njit


@njit(forceinline=True)
def deviations_of(basin, seen, y):
    """Deviations of values per area from rest: the table `seen` if the basin has moving walls, else the states y."""
    if basin["walls"] > 0:
        return seen
    return y


@njit(forceinline=True)
def row_across(basin, i):
    """Index of the column or row of cell i that stretches as a whole; on a mesh other than a grid, i itself."""
    if basin["nx"] == 0:
        return i
    return i // basin["nx"] if basin["turn"] == 1 else i % basin["nx"]


@njit(forceinline=True)
def stretch_of_cell(plane, basin, i):
    """Area of cell i over its undeformed area; 1 without moving walls."""
    return plane[basin["stretch"] + row_across(basin, i)] if basin["walls"] > 0 else 1.0


@njit
def fill(value, values):
    """Set all values to `value`."""
    for i in range(values.size):
        values[i] = value


@njit
def multiply(values, factors, products):
    """Write values * factors to products; products must be another array, or the loop is not vectorised."""
    for i in range(products.size):
        products[i] = values[i] * factors[i]


@njit
def multiply_in_place(factors, values):
    """Multiply values by factors in place."""
    for i in range(values.size):
        values[i] *= factors[i]


@njit
def scale_in_place(factor, values):
    """Multiply all values by one factor in place."""
    for i in range(values.size):
        values[i] *= factor


@njit
def depth_deviations(rest, wide, narrow, content, seen):
    """Write deviations of depths from those at rest to `seen`.

    rest : depths at rest [m]; content : states, changes of the amount in a cell over its undeformed area [m]
    """
    for i in range(seen.size):
        seen[i] = (content[i] - rest[i] * (wide[i] - 1.0)) * narrow[i]


@njit
def density_deviations(rest, wide, narrow, content, seen):
    """Write deviations of densities from the density `rest` to `seen`; other arguments as for `depth_deviations`."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest * (wide[i] - 1.0)) * narrow[i]


@njit
def stretch_rates(wide, first, second, third):
    """Convert three arrays of rates per present area to rates of the states, in place."""
    multiply_in_place(wide, first)
    multiply_in_place(wide, second)
    multiply_in_place(wide, third)


@njit
def stretch_row_rates(columns, wide, first, j, rate_1, rate_2, rate_3):
    """Convert three arrays of rates of row j of a grid, from column `first` on, as `stretch_rates` does.

    wide : ratios of all columns or rows; columns : True if columns stretch, False if rows do
    """
    if columns:
        stretch_rates(wide[first:], rate_1, rate_2, rate_3)
    else:
        scale_in_place(wide[j], rate_1)
        scale_in_place(wide[j], rate_2)
        scale_in_place(wide[j], rate_3)


CELL, SIDE, INDICES = 0, 1, 2
NX, NY, REACH, DX, DY, WX, WY, MEASURES = range(8)
PER_AREA, PER_DISTANCE, OBLIQUE_X, OBLIQUE_Y, DISTANCES = range(5)
HEAD = 5
# in liquids, bound of the norm of the map from differences to neighbours to those at sides
STEEPEST = 0.75
BLOCK = 256  # cells whose geometry and neighbours stay in the nearest cache
TINY = 1e-300
HUGE = 1e300

_WX = WX * BLOCK
_WY = WY * BLOCK
_DX = DX * BLOCK
_DY = DY * BLOCK
_SIDE = MEASURES * BLOCK


@njit(forceinline=True)
def gradient_share(sides, squares, weighted, steepest):
    """Factor on the gradient of a cell, at most 1, with which the norm of extrapolation to its sides is `steepest`.

    The differences at the sides are a linear map of the differences to the neighbours. In cells with sharp or very
    blunt corners its norm is large, and waves grow there: with 0.75 (equilateral triangles) no mode grows on random
    Delaunay triangles. With a bound, linear fields are not exact; so water, which flows evenly down a plane, has none.
    The other arguments are symmetric matrices (xx, xy, yy), sums over the sides of the cell: vectors from the centre to
    the middles of sides, d d^T; vectors to the next centres, a a^T / |a|^2, and a a^T / |a|^4.
    The square of the norm is the greatest eigenvalue of sides S^-1 weighted S^-1, where S is `squares`.
    """
    sxx, sxy, syy = squares
    wxx, wxy, wyy = weighted
    dxx, dxy, dyy = sides
    per = 1.0 / (sxx * syy - sxy * sxy)
    ixx = per * syy
    ixy = -per * sxy
    iyy = per * sxx
    # A = S^-1 weighted, K = A S^-1
    axx = ixx * wxx + ixy * wxy
    axy = ixx * wxy + ixy * wyy
    ayx = ixy * wxx + iyy * wxy
    ayy = ixy * wxy + iyy * wyy
    kxx = axx * ixx + axy * ixy
    kxy = axx * ixy + axy * iyy
    kyy = ayx * ixy + ayy * iyy
    trace = dxx * kxx + 2.0 * dxy * kxy + dyy * kyy
    product = (dxx * dyy - dxy * dxy) * (kxx * kyy - kxy * kxy)
    largest = 0.5 * trace + sqrt(max(0.25 * trace * trace - product, 0.0))
    return min(1.0, steepest / sqrt(largest))


@njit
def blocks_of(cells):
    """Number of blocks of BLOCK cells that contain a number of cells."""
    return (cells + BLOCK - 1) // BLOCK


@njit
def blocks(integers):
    """Number of blocks of BLOCK cells of a mesh. integers : see `cell_sides`"""
    return blocks_of(integers[1])


@njit(forceinline=True)
def side_numbers(integers):
    """(need of blocks, boundary sides, numbers of their boundary faces, faces of all sides) of a mesh: four arrays."""
    count, b = blocks(integers), integers[3]
    at = HEAD + INDICES * count * integers[0] * BLOCK // 2
    edges = integers[at + count :]
    return integers[at : at + count], edges[:b], edges[b : 2 * b], edges[2 * b :]


@njit
def edges_before(edges, first, side):
    """Index of the first entry of the ascending array `edges`, from index `first` on, that is at least `side`."""
    while first < edges.size and edges[first] < side:
        first += 1
    return first


@njit
def ring_place(side, ring):
    """Place in the ring of `ring` blocks (see `cell_sides`) of the cell with the boundary side number `side`."""
    return (side // (4 * BLOCK)) % ring * BLOCK + side % BLOCK


@njit
def gather(values, where, out):
    """Write values[where[i]] to out[i] for the BLOCK cells i of a block."""
    for i in range(BLOCK):
        out[i] = values[where[i]]


@njit
def put_inward(edges, number, flux, length, through):
    """Write the inward flows through boundary sides of a block that have the same side number k in their cells.

    edges, number : these boundary sides, and the numbers of their boundary faces
    flux : outward flux through side k of each cell of the block; length : lengths of all boundary faces [m]
    through : inward flows through all boundary faces
    """
    for q in range(edges.size):
        through[number[q]] = -flux[edges[q] % BLOCK] * length[number[q]]


@njit
def limit_three_sides(p, wide, cap, beyond, geo, out):
    """Write the limited values at the three sides of each triangle of a block, from the values beyond the sides.

    If the neighbours differ from the cell by least <= 0 to most >= 0, the value at a side is greater than that of the
    cell by no more than wide * most, -2 * wide * least and `cap`. It is smaller by no more than -wide * least,
    2 * wide * most and `cap`. So at an extremum all values at sides equal that of the cell. With wide = 1 they lie in
    the range of the neighbours.

    p, beyond : values of cells and of neighbours; geo : first group of measures of the sides, see `cell_sides`
    wide : factor on the range of the neighbours; cap : greatest allowed deviation from the cell
    out : values at the sides
    """
    back = 2.0 * wide
    for i in range(BLOCK):
        here = p[i]
        a = beyond[i] - here
        b = beyond[BLOCK + i] - here
        c = beyond[2 * BLOCK + i] - here
        gx = geo[_WX + i] * a + geo[_SIDE + _WX + i] * b + geo[2 * _SIDE + _WX + i] * c
        gy = geo[_WY + i] * a + geo[_SIDE + _WY + i] * b + geo[2 * _SIDE + _WY + i] * c
        r = gx * geo[_DX + i] + gy * geo[_DY + i]
        s = gx * geo[_SIDE + _DX + i] + gy * geo[_SIDE + _DY + i]
        t = -(r + s)  # the middles of a triangle's sides have its centre
        most, least = max(max(a, b), max(c, 0.0)), min(min(a, b), min(c, 0.0))
        low = max(max(wide * least, -back * most), -cap[i])
        high = min(min(wide * most, -back * least), cap[i])
        out[i] = here + min(max(r, low), high)
        out[BLOCK + i] = here + min(max(s, low), high)
        out[2 * BLOCK + i] = here + min(max(t, low), high)


@njit
def limit_four_sides(p, wide, cap, beyond, geo, out):
    """Write the limited values at the four sides of each cell of a block; arguments as for `limit_three_sides`.

    In the gradient, the terms of opposite sides are added first, so that mirrored cells have mirrored values to the
    bit.
    """
    back = 2.0 * wide
    for i in range(BLOCK):
        here = p[i]
        a, b = beyond[i] - here, beyond[BLOCK + i] - here
        c, d = beyond[2 * BLOCK + i] - here, beyond[3 * BLOCK + i] - here
        gx = geo[_WX + i] * a + geo[2 * _SIDE + _WX + i] * c
        gx += geo[_SIDE + _WX + i] * b + geo[3 * _SIDE + _WX + i] * d
        gy = geo[_WY + i] * a + geo[2 * _SIDE + _WY + i] * c
        gy += geo[_SIDE + _WY + i] * b + geo[3 * _SIDE + _WY + i] * d
        r = gx * geo[_DX + i] + gy * geo[_DY + i]
        s = gx * geo[_SIDE + _DX + i] + gy * geo[_SIDE + _DY + i]
        t = gx * geo[2 * _SIDE + _DX + i] + gy * geo[2 * _SIDE + _DY + i]
        u = gx * geo[3 * _SIDE + _DX + i] + gy * geo[3 * _SIDE + _DY + i]
        most, least = max(max(a, b), max(max(c, d), 0.0)), min(min(a, b), min(min(c, d), 0.0))
        low = max(max(wide * least, -back * most), -cap[i])
        high = min(min(wide * most, -back * least), cap[i])
        out[i] = here + min(max(r, low), high)
        out[BLOCK + i] = here + min(max(s, low), high)
        out[2 * BLOCK + i] = here + min(max(t, low), high)
        out[3 * BLOCK + i] = here + min(max(u, low), high)


@njit
def gather_beyond(j, integers, values, beyond):
    """Write the values of the neighbours of all cells of block j to `beyond`; arguments as for `limited_sides`."""
    slots, places = integers[0], integers[HEAD:].view(np.int32)
    for k in range(slots):
        gather(values, places[((j * slots + k) * INDICES + CELL) * BLOCK :], beyond[k * BLOCK :])


@njit
def limited_sides(j, floats, integers, values, wide, cap, shown, edges, beyond, sides):
    """Write the limited values at the sides of all cells of block j to `sides`.

    values, sides : float64[ring BLOCK], float64[4 ring BLOCK]  values of cells and at sides, in the ring
    wide, cap : see `limit_three_sides`
    edges : int64[:]  boundary sides of the block; shown : float64[:]  values beyond them
    beyond : float64[4 BLOCK]  scratch
    """
    gather_beyond(j, integers, values, beyond)
    limit_gathered(j, floats, integers, values, wide, cap, shown, edges, beyond, sides)


@njit
def limit_gathered(j, floats, integers, values, wide, cap, shown, edges, beyond, sides):
    """Write the limited values as `limited_sides`, from the values of neighbours in `beyond`."""
    for q in range(edges.size):
        beyond[edges[q] % (4 * BLOCK)] = shown[q]
    at, slots = (j % integers[4]) * BLOCK, integers[0]
    p = values[at:]
    geo = floats[j * slots * MEASURES * BLOCK :]
    out = sides[4 * at :]
    if slots == 3:
        limit_three_sides(p, wide, cap, beyond, geo, out)
    else:
        limit_four_sides(p, wide, cap, beyond, geo, out)
