"""Patches as a room of a scene: their pressures, and what the network brings into the cells behind them."""

from math import log1p

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import (
    I_BASINS,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_PATCHES,
    I_PLANE,
    I_SETTINGS,
    LAW_LOG,
    RATE,
    SHALLOW_FACES,
)

SHALLOW = 1e-3  # depth at a patch below which no more than a share of what is asked can leave [m]


@njit
def mean_deviation(tables, patch, y):
    """Of what is stored in the cells behind a patch, per area of these."""
    basin, total = tables[I_BASINS][patch["basin"]], 0.0
    for m in range(patch["count"]):
        i = tables[I_INTEGERS][patch["first"] + m]
        total += tables[I_PLANE][basin["area"] + i] * y[basin["y"] + i]
    return total / patch["area"]


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Deviations of the pressure at every patch from the profile's, and its rise with mass [Pa/kg]."""
    tables = open_tables(handle)
    st, layout = tables[I_SETTINGS][0], tables[I_LAYOUT][0]
    for k in range(tables[I_PATCHES].size):
        patch = tables[I_PATCHES][k]
        basin, node = tables[I_BASINS][patch["basin"]], tables[I_NODES][patch["node"]]
        stored = mean_deviation(tables, patch, y)
        if basin["kind"] <= SHALLOW_FACES:
            slope, content = st["rho"] * st["gravity"], st["rho"] * patch["area"]
        else:
            slope, content = basin["speed"] * basin["speed"], basin["thickness"] * patch["area"]
        pressure = slope * stored
        if st["law"] == LAW_LOG and basin["density"] > 0.0:
            strain = stored / basin["density"]
            pressure, slope = slope * basin["density"] * log1p(strain), slope / (1.0 + strain)
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["stiffness"] + node["row"]] = slope / content


@njit
def book_open(tables, basin, per, dydt, out):
    """What passes the open boundary of a basin is what its contents gain before links bring any."""
    if basin["open"] >= 0:
        n, gained = basin["n"], 0.0
        area, rate = tables[I_PLANE][basin["area"] : basin["area"] + n], dydt[basin["y"] : basin["y"] + n]
        for i in range(n):
            gained += area[i] * rate[i]
        out[tables[I_LAYOUT][0]["supply"] + basin["open"]] += per * gained


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add what the patches bring or take to the rates of the cells behind them."""
    tables = open_tables(handle)
    layout = tables[I_LAYOUT][0]
    for k in range(tables[I_PATCHES].size):
        patch = tables[I_PATCHES][k]
        asked = out[layout["net"] + patch["node"]]
        if tables[I_BASINS][patch["basin"]]["kind"] <= SHALLOW_FACES:
            shallow_patch(tables, patch, asked, y, dydt, out)
        elif dydt.size > 0:
            basin = tables[I_BASINS][patch["basin"]]
            flow = asked / (basin["thickness"] * patch["area"])
            for m in range(patch["count"]):
                dydt[basin["y"] + tables[I_INTEGERS][patch["first"] + m]] += flow


@njit
def shallow_patch(tables, patch, asked, y, dydt, out):
    """What a patch brings or takes of water with a free surface; where it is thin, what is asked may not be had."""
    rho, layout, integers = tables[I_SETTINGS][0]["rho"], tables[I_LAYOUT][0], tables[I_INTEGERS]
    basin, plane = tables[I_BASINS][patch["basin"]], tables[I_PLANE]
    n, o, first = basin["n"], basin["y"], patch["first"]
    depth, share = mean_deviation(tables, patch, y), 1.0
    for m in range(patch["count"]):
        i = integers[first + m]
        depth += plane[basin["area"] + i] * plane[basin["plan"] + i] / patch["area"]
    if asked < 0.0:  # 1.5, the steepest slope of the share
        out[RATE] = max(out[RATE], -1.5 * asked / (rho * patch["area"] * max(depth, SHALLOW)))
    if asked < 0.0 and depth < SHALLOW:  # less and less of it can still be had, the rest comes from outside
        s = max(depth, 0.0) / SHALLOW
        share = s * s * (3.0 - 2.0 * s)
    supply = (share - 1.0) * asked
    out[layout["supply"] + patch["node"]] += supply
    flow = (asked + supply) / (rho * patch["area"])  # [m/s] of depth
    for m in range(patch["count"] if dydt.size > 0 else 0):
        i = o + integers[first + m]
        dydt[i] += flow
        if flow < 0.0 and depth > 0.0:  # water that leaves takes its momentum along
            dydt[i + n] += flow * y[i + n] / depth
            dydt[i + 2 * n] += flow * y[i + 2 * n] / depth
