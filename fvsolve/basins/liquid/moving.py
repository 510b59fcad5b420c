"""A liquid between moving walls: rates of cells, and its energy as areas change."""

from fvsolve.basins import moving_meshes, walls
from fvsolve.basins.energy import at_rest, row_of
from fvsolve.basins.liquid.rates import MINE, any_mesh, full_grid, linear_grid
from fvsolve.basins.walls import speed_of, widening
from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def is_moving(basin):
    """True for a liquid between moving walls."""
    return basin["kind"] == MINE and basin["walls"] > 0


@njit(forceinline=True)
def on_grid(basin):
    """True for a liquid between moving walls on a rectangle."""
    return is_moving(basin) and basin["nx"] > 0


@njit(forceinline=True)
def on_mesh(basin):
    """True for a liquid between moving walls on any other mesh."""
    return is_moving(basin) and basin["nx"] == 0


@njit(forceinline=True)
def lines_of(tables, basin):
    """Motion of grid lines in the form for kernels of liquids."""
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
    """Rates under law table on grids."""
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
    """Rates under law table on meshes."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]):
            table = tables.plane[tables.basins[b]["table"] :]
            any_mesh(tables, b, table, y, dydt, out, moving_meshes.moves_of(tables, tables.basins[b]), None, None)


@njit
def lifted(tables, wall):
    """Outward force of the potential other than pressure in the volume swept by a wall: rho g z of the contents [N]."""
    basin, length = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        length += tables.plane[wall["lengths"] + m]
    return wall["outward"] * (at_rest(tables.settings[0], basin) * basin["thickness"] * length - wall["rest"])


@njit
def add_power(t, y, dydt, out, handle, power):
    """Correct the rate of storage for changing areas: in less space the same mass has a higher density."""
    tables = open_tables(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin, total = tables.basins[b], 0.0
        n, o, rest, square = basin["n"], basin["y"], at_rest(st, basin), basin["speed"] * basin["speed"]
        for i in range(n if is_moving(basin) else 0):
            r, m2 = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            content_energy = basin["density"] * (rest + square * r) + 0.5 * (square * r * r + m2)
            total += plane[basin["drawn"] + i] * widening(t, tables, basin, y, i) * content_energy
        if is_moving(basin):
            power[row_of(tables, power, b) + 3] -= basin["thickness"] / st["rho"] * total
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            power[row_of(tables, power, wall["basin"]) + 3] += lifted(tables, wall) * speed_of(t, tables, wall, y)


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the potential energy of the mass displaced by walls."""
    tables = open_tables(handle)
    first = stored.size - tables.basins.size
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            stored[first + wall["basin"]] += lifted(tables, wall) * y[wall["y"]]
