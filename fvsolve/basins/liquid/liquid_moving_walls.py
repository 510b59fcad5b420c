"""A liquid between moving walls: rates of cells, and its energy as areas change."""

from fvsolve.basins import moving_meshes, moving_walls
from fvsolve.basins.basin_energy import basin_first_row, rest_potential
from fvsolve.basins.liquid.liquid_cell_rates import OWN_CODE, linear_grid_rates, mesh_rates, nonlinear_grid_rates
from fvsolve.basins.moving_walls import area_growth_rate, speed_of
from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def is_moving(basin):
    """True for a basin of liquid with moving walls."""
    return basin["kind"] == OWN_CODE and basin["walls"] > 0


@njit(forceinline=True)
def on_grid(basin):
    """True for a basin of liquid that has a rectangular grid and moving walls."""
    return is_moving(basin) and basin["nx"] > 0


@njit(forceinline=True)
def on_mesh(basin):
    """True for a basin of liquid that has a mesh other than a grid and moving walls."""
    return is_moving(basin) and basin["nx"] == 0


@njit(forceinline=True)
def line_motion(tables, basin):
    """Motion of the grid lines of a basin, as the tuple `moves` of `grid_linear.grid_rates`."""
    along, across, thrust, wide, _ = moving_walls.grid_motion(tables, basin)
    return along, across, thrust, basin["density"], wide


@njit
def waves_on_moving_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids between moving walls on rectangular grids, under the density law `linear`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            linear_grid_rates(tables, b, y, dydt, out, line_motion(tables, tables.basins[b]), None)


@njit
def rates_on_moving_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids between moving walls on rectangular grids, under the density law `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            nonlinear_grid_rates(tables, b, None, y, dydt, out, line_motion(tables, tables.basins[b]), None)


@njit
def table_on_moving_grids(t, y, dydt, out, handle):
    """Write the rates of all liquids between moving walls on rectangular grids, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_grid(tables.basins[b]):
            table = tables.plane[tables.basins[b]["table"] :]
            nonlinear_grid_rates(tables, b, table, y, dydt, out, line_motion(tables, tables.basins[b]), None)


@njit
def rates_on_moving_meshes(t, y, dydt, out, handle):
    """Write the rates of liquids between moving walls on meshes other than grids, density laws `linear` and `log`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]):
            mesh_rates(tables, b, None, y, dydt, out, moving_meshes.mesh_motion(tables, tables.basins[b]), None, None)


@njit
def table_on_moving_meshes(t, y, dydt, out, handle):
    """Write the rates of liquids between moving walls on meshes other than grids, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if on_mesh(tables.basins[b]):
            table = tables.plane[tables.basins[b]["table"] :]
            mesh_rates(tables, b, table, y, dydt, out, moving_meshes.mesh_motion(tables, tables.basins[b]), None, None)


@njit
def displaced_potential(tables, wall):
    """Gravitational energy of the volume that a wall adds to its basin, per travel of the wall along its axis [N].

    It is rho g z times the area of the wall, with the elevation z above energy datum; the sign is reversed if the axis
    points inward.
    """
    basin, length = tables.basins[wall["basin"]], 0.0
    for m in range(wall["count"]):
        length += tables.plane[wall["lengths"] + m]
    return wall["outward"] * (rest_potential(tables.settings[0], basin) * basin["thickness"] * length - wall["rest"])


@njit
def add_power(t, y, dydt, out, handle, power):
    """Correct the rate of change of the stored energy in `power` [W] for moving walls.

    In a smaller area the same mass has a higher density and energy. Moving walls also change the potential energy.
    """
    tables = open_tables(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin, total = tables.basins[b], 0.0
        n, o, rest, square = basin["n"], basin["y"], rest_potential(st, basin), basin["speed"] * basin["speed"]
        for i in range(n if is_moving(basin) else 0):
            r, m2 = y[o + i], y[o + n + i] ** 2 + y[o + 2 * n + i] ** 2
            content_energy = basin["density"] * (rest + square * r) + 0.5 * (square * r * r + m2)
            total += plane[basin["drawn"] + i] * area_growth_rate(t, tables, basin, y, i) * content_energy
        if is_moving(basin):
            power[basin_first_row(tables, power, b) + 3] -= basin["thickness"] / st["rho"] * total
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            power[basin_first_row(tables, power, wall["basin"]) + 3] += displaced_potential(tables, wall) * speed_of(
                t, tables, wall, y
            )


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the potential energy of the mass displaced by walls [J] to the stored energy of their basins."""
    tables = open_tables(handle)
    first = stored.size - tables.basins.size
    for k in range(tables.walls.size):
        wall = tables.walls[k]
        if is_moving(tables.basins[wall["basin"]]):
            stored[first + wall["basin"]] += displaced_potential(tables, wall) * y[wall["y"]]
