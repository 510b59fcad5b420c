"""Patches of a liquid (parts of its boundary joined to a node): pressures, and the effect of the flows of links."""

from math import log1p

from fvsolve.basins.basin_patches import add_link_momentum
from fvsolve.basins.boundary_cells import patch_area, patch_length
from fvsolve.basins.cell_stretching import deviations_of, stretch_of_cell
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import LAW_LOG
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)


@njit
def mean_deviation(tables, patch, y):
    """Mean of the deviation of density in the cells next to a patch, weighted by area [kg/m3]."""
    basin, total = tables.basins[patch["basin"]], 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += tables.plane[basin["area"] + i] * y[basin["y"] + i]
    return total / patch_area(tables, patch)


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Write the pressure at every patch of a liquid and its slope to the node of the patch in `out`.

    The pressure is the deviation from the steady start [Pa]; the slope is per mass in the cells next to the patch
    [Pa/kg]. Both are those of the density laws `linear` and `log`; under `table`, `liquid_table_law` replaces them. The
    supply of the node is set to 0, the available fraction of outflow to 1.
    """
    tables = open_tables(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        if basin["kind"] != OWN_CODE:
            continue
        stored, slope = (
            mean_deviation(tables, patch, deviations_of(basin, tables.seen, y)),
            basin["speed"] * basin["speed"],
        )
        pressure = slope * stored
        if tables.settings[0]["law"] == LAW_LOG:
            strain = stored / basin["density"]
            pressure, slope = slope * basin["density"] * log1p(strain), slope / (1.0 + strain)
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["outflow_fraction"] + node["row"]] = 1.0
        out[layout["stiffness"] + node["row"]] = slope / (basin["thickness"] * patch_area(tables, patch))


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add the mass and momentum of flows through patches of liquids to the rates of the cells next to them."""
    tables = open_tables(handle)
    for k in range(tables.patches.size if dydt.size > 0 else 0):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        inflow = out[tables.layout[0]["net"] + patch["node"]]
        n, flow = basin["n"], inflow / (basin["thickness"] * patch_area(tables, patch))
        for m in range(patch["count"]):
            i = tables.integers[patch["first"] + m]
            dydt[basin["y"] + i] += flow * stretch_of_cell(tables.plane, basin, i)
        for m in range(patch["faces"]):
            i = basin["y"] + tables.integers[patch["ring"] + patch["faces"] + m]
            push = -basin["speed"] * inflow / (basin["thickness"] * patch_length(tables, patch))
            add_link_momentum(tables.plane, patch, m, push, dydt, i + n, i + 2 * n)
