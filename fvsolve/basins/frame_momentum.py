"""Momentum terms of the accelerated frame of a basin on a body (`basin_frames`), added to rates of flow."""

from fvsolve.basins.basin_frames import CELL_POSITIONS
from fvsolve.jit import inline, njit


@njit
def accelerate_flow(plane, basin, y, rates, first, own, twice, east, north, turn):
    """Add twice (q_y, -q_x) + depth (east + turn Y, north - turn X) to the rates of the flow (q_x, q_y) of all cells.

    depth : depth of water [m], or density of a liquid [kg/m3]; (X, Y) : position of the cell [m]; y : state vector
    first : index in `rates` of the first rate of the basin
    own : 1 to include the deviation of depth from rest, 0 for the depth at rest
    twice : 2 W_z [1/s]; east, north : uniform acceleration [m/s2]; turn : Euler term [1/s2]
    """
    n, o, p, places = basin["n"], basin["y"], basin["plan"], int(plane[basin["frame"] + CELL_POSITIONS])
    for row in range(basin["ny"]):
        accelerate_row(plane, basin, y, rates, first, row, own, twice, east, north, turn)
    for i in range(n if basin["nx"] == 0 else 0):
        depth = max(plane[p + i] + own * y[o + i], 0.0)
        rates[first + n + i] += twice * y[o + 2 * n + i] + depth * (east + turn * plane[places + n + i])
        rates[first + 2 * n + i] += depth * (north - turn * plane[places + i]) - twice * y[o + n + i]


@njit
def accelerate_row(plane, basin, y, rates, first, row, own, twice, east, north, turn):
    """Add the terms of `accelerate_flow` to the rates of row `row` of the cells of a grid; other arguments as there."""
    n, nx, places = basin["n"], basin["nx"], int(plane[basin["frame"] + CELL_POSITIONS])
    at, level = row * nx, plane[places + nx + row]
    a, p, to = basin["y"] + at, basin["plan"] + at, first + n + at
    accelerate_arrays(
        plane[places : places + nx], plane[p : p + nx], y[a : a + nx], y[a + n : a + n + nx],
        y[a + 2 * n : a + 2 * n + nx], own, twice, east + turn * level, north, turn, rates[to : to + nx],
        rates[to + n : to + n + nx],
    )  # fmt: skip


@inline
def accelerate_arrays(x, rest, dh, qx, qy, own, twice, east, north, turn, rate_x, rate_y):
    """Add the terms of `accelerate_flow` to the rates rate_x, rate_y of a row of cells, given by its arrays.

    x : positions; rest, dh : depths at rest and deviations from them; qx, qy : flows
    east : uniform acceleration plus turn y of the row; other arguments as for `accelerate_flow`
    """
    for i in range(rate_x.size):
        depth = max(rest[i] + own * dh[i], 0.0)
        rate_x[i] += twice * qy[i] + depth * east
        rate_y[i] += depth * (north - turn * x[i]) - twice * qx[i]
