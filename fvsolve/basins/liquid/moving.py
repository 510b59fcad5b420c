"""A liquid between walls that move: rates of cells, and its energy as areas change. Knows the tables; knows no flux."""

from fvsolve.basins import moving_meshes, walls
from fvsolve.basins.energy import at_rest, row_of
from fvsolve.basins.liquid.rates import MINE, any_mesh, full_grid, linear_grid
from fvsolve.basins.walls import speed_of, widening
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables


@njit(forceinline=True)
def is_moving(basin):
    """Whether it is a liquid between walls that move."""
    return basin["kind"] == MINE and basin["walls"] > 0


@njit(forceinline=True)
def on_grid(basin):
    """Whether it is one in a rectangle."""
    return is_moving(basin) and basin["nx"] > 0


@njit(forceinline=True)
def on_mesh(basin):
    """Whether it is one on any other mesh."""
    return is_moving(basin) and basin["nx"] == 0


@njit(forceinline=True)
def lines_of(tables, basin):
    """What lines of a grid do, as kernels of liquids want it."""
    along, across, thrust, wide, _ = walls.moves_of(tables, basin)
    return along, across, thrust, basin["density"], wide


@njit
def waves_on_moving_grids(t, y, dydt, out, handle):
    """Rates under law linear on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            linear_grid(tables, b, y, dydt, out, lines_of(tables, tables.basins[b]), None)


@njit
def rates_on_moving_grids(t, y, dydt, out, handle):
    """Rates under law log on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            full_grid(tables, b, None, y, dydt, out, lines_of(tables, tables.basins[b]), None)


@njit
def table_on_moving_grids(t, y, dydt, out, handle):
    """The same under law table."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            table = tables.plane[tables.basins[b]["table"] :]
            full_grid(tables, b, table, y, dydt, out, lines_of(tables, tables.basins[b]), None)


@njit
def rates_on_moving_meshes(t, y, dydt, out, handle):
    """Rates under laws linear and log on meshes."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]):
            any_mesh(tables, b, None, y, dydt, out, moving_meshes.moves_of(tables, tables.basins[b]), None, None)


@njit
def table_on_moving_meshes(t, y, dydt, out, handle):
    """The same under law table."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]):
            table = tables.plane[tables.basins[b]["table"] :]
            any_mesh(tables, b, table, y, dydt, out, moving_meshes.moves_of(tables, tables.basins[b]), None, None)


@njit
def lifted(tables, wall):
    """What a wall sweeps, outward per travel, of potential that is no pressure: rho g z of what stays inside [N]."""
    basin, length = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        length += tables.plane[wall["lengths"] + m]
    return wall["outward"] * (at_rest(tables.settings[0], basin) * basin["thickness"] * length - wall["rest"])


@njit
def add_power(t, y, dydt, out, handle, power):
    """Of the rate of storage what areas that change take: with less room the same mass is denser."""
    tables = open_tables(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin, total = tables.basins[b], 0.0
        n, o, rest, square = basin["n"], basin["y"], at_rest(st, basin), basin["speed"] * basin["speed"]
        for i in range(n if is_moving(basin) else 0):
            r, m2 = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            held = basin["density"] * (rest + square * r) + 0.5 * (square * r * r + m2)
            total += plane[basin["drawn"] + i] * widening(t, tables, basin, y, i) * held
        if is_moving(basin):
            power[row_of(tables, power, b) + 3] -= basin["thickness"] / st["rho"] * total
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            power[row_of(tables, power, wall["basin"]) + 3] += lifted(tables, wall) * speed_of(t, tables, wall, y)


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Potential that stays with the mass, where areas have changed."""
    tables = open_tables(handle)
    first = stored.size - tables.basins.size
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            stored[first + wall["basin"]] += lifted(tables, wall) * y[wall["y"]]
