"""Patches of a liquid: what the network finds there, and what it brings or takes. Knows the tables."""

from math import log1p

from fvsolve.basins.behind import area_of, length_of
from fvsolve.basins.kinds import kind_of
from fvsolve.basins.patches import give_way
from fvsolve.basins.stretch import seen_of, stretched
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import LAW_LOG

MINE = kind_of(__package__)


@njit
def mean_deviation(tables, patch, y):
    """Of what is stored in the cells behind a patch, per area of these."""
    basin, total = tables.basins[patch["basin"]], 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += tables.plane[basin["area"] + i] * y[basin["y"] + i]
    return total / area_of(tables, patch)


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Deviations of the pressure at every patch from the profile's, and its rise with mass [Pa/kg]."""
    tables = open_tables(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        if basin["kind"] != MINE:
            continue
        stored, slope = mean_deviation(tables, patch, seen_of(basin, tables.seen, y)), basin["speed"] * basin["speed"]
        pressure = slope * stored
        if tables.settings[0]["law"] == LAW_LOG:
            strain = stored / basin["density"]
            pressure, slope = slope * basin["density"] * log1p(strain), slope / (1.0 + strain)
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["had"] + node["row"]] = 1.0
        out[layout["stiffness"] + node["row"]] = slope / (basin["thickness"] * area_of(tables, patch))


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add what the patches bring or take to the rates of the cells behind them."""
    tables = open_tables(handle)
    for k in range(tables.patches.size if dydt.size > 0 else 0):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != MINE:
            continue
        asked = out[tables.layout[0]["net"] + patch["node"]]
        n, flow = basin["n"], asked / (basin["thickness"] * area_of(tables, patch))
        for m in range(patch["count"]):
            i = tables.integers[patch["first"] + m]
            dydt[basin["y"] + i] += flow * stretched(tables.plane, basin, i)
        for m in range(patch["faces"]):
            i = basin["y"] + tables.integers[patch["ring"] + patch["faces"] + m]
            push = -basin["speed"] * asked / (basin["thickness"] * length_of(tables, patch))
            give_way(tables.plane, patch, m, push, dydt, i + n, i + 2 * n)
