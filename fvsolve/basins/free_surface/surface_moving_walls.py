"""Water with a free surface between moving walls: rates of cells, and its energy as areas change."""

from fvsolve.basins import moving_meshes
from fvsolve.basins.basin_energy import basin_first_row, rest_potential
from fvsolve.basins.free_surface.surface_cell_rates import OWN_CODE, on_grid, on_mesh
from fvsolve.basins.moving_walls import area_growth_rate, grid_motion
from fvsolve.jit import njit
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def is_moving(basin):
    """True for a basin of water with a free surface and moving walls."""
    return basin["kind"] == OWN_CODE and basin["walls"] > 0


@njit
def rates_on_moving_grids(t, y, dydt, out, handle):
    """Write the rates of all basins of water that have a grid and moving walls."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if is_moving(tables.basins[b]) and tables.basins[b]["nx"] > 0:
            on_grid(tables, b, y, dydt, out, grid_motion(tables, tables.basins[b]))


@njit
def rates_on_moving_meshes(t, y, dydt, out, handle):
    """Write the rates of all basins of water that have a mesh other than a grid and moving walls."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        if is_moving(tables.basins[b]) and tables.basins[b]["nx"] == 0:
            on_mesh(tables, b, y, dydt, out, moving_meshes.mesh_motion(tables, tables.basins[b]))


@njit
def add_power(t, y, dydt, out, handle, power):
    """Correct the rate of storage in `power` for changing cell areas A: subtract rho g h^2 / 2 dA/dt [W] of cells."""
    tables = open_tables(handle)
    st, plane = tables.settings[0], tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        for i in range(basin["n"] if is_moving(basin) else 0):
            depth = max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
            spent = 0.5 * st["rho"] * st["gravity"] * depth * depth * area_growth_rate(t, tables, basin, y, i)
            power[basin_first_row(tables, power, b) + 3] -= plane[basin["drawn"] + i] * spent


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the energy of water at rest [J] on the area that cells have gained by the motion of walls to `stored`."""
    tables = open_tables(handle)
    st, plane, first = tables.settings[0], tables.plane, stored.size - tables.basins.size
    weight = st["rho"] * st["gravity"]
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        for i in range(basin["n"] if is_moving(basin) else 0):
            depth, surface = plane[basin["plan"] + i], plane[basin["plan"] + basin["n"] + i]
            rest_energy = depth * (rest_potential(st, basin) + weight * (surface - 0.5 * depth))
            stored[first + b] += (plane[basin["area"] + i] - plane[basin["drawn"] + i]) * rest_energy
