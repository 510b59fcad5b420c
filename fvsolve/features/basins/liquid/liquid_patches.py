"""Patches and probes of a liquid: pressures, and the effect of the flows of links on the cells next to a patch."""

from math import log1p

from fvsolve.core.kernels.dtypes import CELL_FIELD, LAW_LINEAR, LAW_LOG
from fvsolve.features.basins.basin_output import FIRST_OWN, velocity_value
from fvsolve.features.basins.basin_patches import add_link_momentum, physics_code
from fvsolve.features.basins.boundary_cells import patch_area, patch_length
from fvsolve.features.basins.cell_sides import deviations_of, stretch_of_cell
from fvsolve.features.basins.liquid.riemann_invariants import pressure
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit, specialise

OWN_CODE = physics_code(__package__)
PRESSURE = FIRST_OWN


@njit(forceinline=True)
def count_shares(tables, patch):
    """Number of the shares of a patch: a face each, or a cell each in an interior patch."""
    return patch["count"] if is_interior(tables, patch) else patch["faces"]


@njit(forceinline=True)
def is_interior(tables, patch):
    """True for an interior patch, whose faces are not on the boundary."""
    return patch["faces"] > 0 and tables.integers[patch["ring"]] < 0


@njit
def share_of(tables, patch, m):
    """(cell, share of the flow of links that enters it) of share m of a patch, see `count_shares`.

    Each face passes the flow at one velocity, so that uniform flow has no loss: its share is its length over that of
    the patch, whatever the sizes of the cells behind. In an interior patch it is the area of the cell over that of the
    patch.
    """
    if is_interior(tables, patch):
        i = tables.integers[patch["first"] + m]
        return i, tables.plane[tables.basins[patch["basin"]]["area"] + i] / patch_area(
            tables, patch
        )
    i = tables.integers[patch["ring"] + patch["faces"] + m]
    per_area = tables.plane[patch["normals"] + 2 * patch["faces"] + m]
    return i, per_area * tables.plane[tables.basins[patch["basin"]]["area"] + i] / patch_length(
        tables, patch
    )


@njit
def mean_deviation(tables, patch, y):
    """Mean of the deviation of density in the cells next to a patch, weighted by their shares of its flow [kg/m3]."""
    basin, total = tables.basins[patch["basin"]], 0.0
    for m in range(count_shares(tables, patch)):
        i, share = share_of(tables, patch, m)
        total += share * y[basin["y"] + i]
    return total


@njit
def area_of_flow(tables, patch):
    """Area over which the flow through a patch spreads at once [m2]: 1 / sum of share^2 / area of the cells."""
    basin, total = tables.basins[patch["basin"]], 0.0
    for m in range(count_shares(tables, patch)):
        i, share = share_of(tables, patch, m)
        total += share * share / tables.plane[basin["area"] + i]
    return 1.0 / total


TABLED = False  # of the templates: True under the density law `table`


def _patch_pressures(t, y, dydt, out, handle):
    """Write the pressure at every patch of a liquid and its slope to the node of the patch in `out`.

    The pressure is the deviation from the steady start [Pa]; the slope is per mass in the cells next to the patch
    [Pa/kg]. The supply of the node is set to 0, the available fraction of outflow to 1.
    """
    tables = open_basins(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        if basin["kind"] != OWN_CODE:
            continue
        mean = mean_deviation(tables, patch, deviations_of(basin, tables.seen, y))
        slope = basin["speed"] * basin["speed"]
        deviation = slope * mean
        if TABLED:
            deviation, slope = pressure(tables.plane[basin["table"] :], basin["density"], mean)
        elif tables.settings[0]["law"] == LAW_LOG:
            strain = mean / basin["density"]
            deviation, slope = slope * basin["density"] * log1p(strain), slope / (1.0 + strain)
        out[layout["pressure"] + patch["node"]] = deviation
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["outflow_fraction"] + node["row"]] = 1.0
        out[layout["stiffness"] + node["row"]] = slope / (
            basin["thickness"] * area_of_flow(tables, patch)
        )


patch_pressures = specialise(_patch_pressures, "patch_pressures")
patch_pressures_table = specialise(_patch_pressures, "patch_pressures_table", TABLED=True)


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add the mass and momentum of flows through patches of liquids to the rates of the cells next to them."""
    tables = open_basins(handle)
    for k in range(tables.patches.size if dydt.size > 0 else 0):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        inflow = out[tables.layout[0]["net"] + patch["node"]]
        n, flow = basin["n"], inflow / basin["thickness"]
        for m in range(count_shares(tables, patch)):
            i, share = share_of(tables, patch, m)
            per_area = share / tables.plane[basin["area"] + i]
            dydt[basin["y"] + i] += flow * per_area * stretch_of_cell(tables.plane, basin, i)
        for m in range(patch["faces"]):
            i = basin["y"] + tables.integers[patch["ring"] + patch["faces"] + m]
            push = -basin["speed"] * inflow / (basin["thickness"] * patch_length(tables, patch))
            add_link_momentum(tables.plane, patch, m, push, dydt, i + n, i + 2 * n)


def _read_liquid(tables, probe, y):
    """(pressure term, velocity along x, along y [m/s]) at a probe: weighted sums over its cells.

    The pressure term is the deviation of density [kg/m3] under the density law `linear`, rho0 ln(rho / rho0) under
    `log`: pressure above that at rest over c0^2. Under `table` it is the pressure above that at rest [Pa].
    """
    basin = tables.basins[probe["index"]]
    law = tables.settings[0]["law"]
    total = 0.0
    u = 0.0
    v = 0.0
    n, o = basin["n"], basin["y"]
    for m in range(probe["count"]):
        i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
        value = y[o + i]
        share = 1.0 / (basin["density"] + (0.0 if law == LAW_LINEAR else value)) * weight
        if TABLED:
            value = pressure(tables.plane[basin["table"] :], basin["density"], value)[0]
        elif law == LAW_LOG:
            value = basin["density"] * log1p(value / basin["density"])
        total += weight * value
        u += share * y[o + n + i]
        v += share * y[o + 2 * n + i]
    return total, u, v


read_liquid = specialise(_read_liquid, "read_liquid")
read_liquid_table = specialise(_read_liquid, "read_liquid_table", TABLED=True)
READ = read_liquid  # of the template


def _observe_liquid(t, y, out, handle, values):
    """Write the values of probes in cells of liquids: pressures [Pa] or velocities [m/s].

    A pressure is the first result of `READ` plus `offset`, under other density laws than `table` multiplied by `scale`:
    two columns of the table of probes.
    """
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_FIELD and tables.basins[probe["index"]]["kind"] == OWN_CODE:
            value, u, v = READ(tables, probe, y)
            if probe["side"] != PRESSURE:
                values[k] = velocity_value(probe["side"], u, v)
            elif TABLED:
                values[k] = value + probe["offset"]
            else:
                values[k] = probe["scale"] * value + probe["offset"]


observe_liquid = specialise(_observe_liquid, "observe_liquid")
observe_liquid_table = specialise(
    _observe_liquid, "observe_liquid_table", READ=read_liquid_table, TABLED=True
)
