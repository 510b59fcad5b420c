"""Liquids under law `table` as rooms of a scene: rates, pressures of patches, probes. Knows no flux."""

from fvsolve.basins.liquid.waves import pressure
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.patches import mean_deviation
from fvsolve.kernels.plane.rooms import full_grid, liquid_mesh, wanted
from fvsolve.kernels.records import CELL_STATE, TABLE_FACES, TABLE_GRID


@njit
def table_grids(t, y, dydt, out, handle):
    """Rates on grids."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == TABLE_GRID and wanted(basin, dydt):
            full_grid(tables, b, tables.plane[basin["table"] :], y, dydt, out)


@njit
def table_meshes(t, y, dydt, out, handle):
    """Rates on meshes of any cells."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["kind"] == TABLE_FACES and wanted(basin, dydt):
            liquid_mesh(tables, b, tables.plane[basin["table"] :], y, dydt, out)


@njit
def table_pressures(t, y, dydt, out, handle):
    """Deviations of the pressure at every patch from the profile's, and its rise with mass [Pa/kg]."""
    tables = open_tables(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        table = tables.plane[basin["table"] :]
        found, slope = pressure(table, basin["density"], mean_deviation(tables, patch, y))
        out[layout["pressure"] + patch["node"]] = found
        out[layout["stiffness"] + node["row"]] = slope / (basin["thickness"] * patch["area"])


@njit
def observe_pressures(t, y, out, handle, values):
    """Pressures in cells [Pa]."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        if probe["kind"] != CELL_STATE or probe["side"] != 0:
            continue
        basin, total = tables.basins[probe["index"]], 0.0
        table = tables.plane[basin["table"] :]
        for m in range(probe["count"]):
            r = y[basin["y"] + tables.integers[probe["cell"] + m]]
            total += tables.floats[probe["weights"] + m] * pressure(table, basin["density"], r)[0]
        values[k] = total + probe["offset"]
