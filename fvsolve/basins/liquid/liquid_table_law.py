"""Liquids under the density law `table`: rates, pressures at patches, probes."""

from fvsolve.basins.basin_patches import needs_rates
from fvsolve.basins.boundary_cells import patch_area
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.basins.liquid.liquid_cell_rates import mesh_rates, nonlinear_grid_rates, on_grid, on_mesh
from fvsolve.basins.liquid.liquid_patches import mean_deviation
from fvsolve.basins.liquid.liquid_probes import PRESSURE
from fvsolve.basins.liquid.riemann_invariants import pressure
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CELL_FIELD
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)


@njit
def rates_on_grids(t, y, dydt, out, handle):
    """Write the rates of liquids for which `liquid_cell_rates.on_grid` is True, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if on_grid(basin) and needs_rates(basin, dydt):
            nonlinear_grid_rates(tables, b, tables.plane[basin["table"] :], y, dydt, out, None, None)


@njit
def rates_on_meshes(t, y, dydt, out, handle):
    """Write the rates of liquids for which `liquid_cell_rates.on_mesh` is True, under the density law `table`."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if on_mesh(basin) and needs_rates(basin, dydt):
            mesh_rates(tables, b, tables.plane[basin["table"] :], y, dydt, out, None, None, None)


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Write the pressure at every patch of a liquid and its slope to the node in `out`, under the density law `table`.

    The pressure is the deviation from the steady start [Pa]; the slope is per mass in the cells next to the patch
    [Pa/kg].
    """
    tables = open_tables(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        if basin["kind"] != OWN_CODE:
            continue
        table = tables.plane[basin["table"] :]
        deviation, slope = pressure(
            table, basin["density"], mean_deviation(tables, patch, deviations_of(basin, tables.seen, y))
        )
        out[layout["pressure"] + patch["node"]] = deviation
        out[layout["stiffness"] + node["row"]] = slope / (basin["thickness"] * patch_area(tables, patch))


@njit
def observe_pressures(t, y, out, handle, values):
    """Write the values of pressure probes in cells of liquids [Pa], under the density law `table`."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        if (
            probe["kind"] != CELL_FIELD
            or tables.basins[probe["index"]]["kind"] != OWN_CODE
            or probe["side"] != PRESSURE
        ):
            continue
        basin, total = tables.basins[probe["index"]], 0.0
        table = tables.plane[basin["table"] :]
        for m in range(probe["count"]):
            r = y[basin["y"] + tables.integers[probe["cell"] + m]]
            total += tables.floats[probe["weights"] + m] * pressure(table, basin["density"], r)[0]
        values[k] = total + probe["offset"]
