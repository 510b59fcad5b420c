"""Patches of water with a free surface: their pressures, and the flows of links in the cells next to them."""

from math import inf, sqrt

from fvsolve.basins.behind import (
    HARDLY,
    SHALLOW,
    area_of,
    counted,
    depth_behind,
    length_of,
    to_be_had,
    weight,
    weight_out,
)
from fvsolve.basins.frames import potential
from fvsolve.basins.free_surface.rows import THIN
from fvsolve.basins.kinds import kind_of
from fvsolve.basins.patches import give_way, weight_of
from fvsolve.basins.stretch import seen_of, stretched
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import GN, PATCH, RATE
from fvsolve.kernels.restrictions import head_drop
from fvsolve.kernels.table_handle import open_tables

MINE = kind_of(__package__)


@njit
def water_behind(tables, patch, y):
    """(rise of the surface, depth, volume, sum of area times weight squared) of the cells at a patch.

    The weight of a cell is its area times `outflow_weight`, so that a dry bank does not count; the volume is the sum.
    The rise is from the surface at rest (of a dry patch, from its lowest bed); in a basin on a body, from the level,
    including phi.
    """
    basin, plane = tables.basins[patch["basin"]], tables.plane
    n, plan, low, lowest = basin["n"], basin["plan"], inf, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        bed = plane[plan + n + i] - plane[plan + i]  # above the level at rest
        if bed < low:
            low, lowest = bed, plane[plan + n + i] + y[basin["y"] + i]
    rest, rise, depth, volume, squares = max(low, 0.0) if basin["frame"] < 0 else 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        h = depth_behind(plane, basin, i, y)
        part = plane[basin["area"] + i] * weight_out(h)
        volume, squares = volume + part, squares + part * weight_out(h)
        rise += part * (plane[plan + n + i] + y[basin["y"] + i] - rest)
        depth += part * h
    filling = max(HARDLY * area_of(tables, patch) - volume, 0.0)
    total = volume + filling
    return (rise + filling * (lowest - rest)) / total, depth / total, volume, squares


@njit
def weight_beyond(plane, basin, patch, rise, depth):
    """Bottom pressure over density at a patch on a body, minus that of the profile [J/kg], at rest in its frame.

    The surface is an equipotential, so its height over each position follows from phi. A dry position has no pressure.
    """
    at, (fx, fy, xx, xy, yy) = patch["sizes"] + 2, potential(plane, basin["frame"], 1.0)
    x, y, z, profile = plane[at], plane[at + 1], plane[at + 2], plane[at + 3]
    phi = x * (fx + xx * x + xy * y) + y * (fy + yy * y)
    return to_be_had(depth) * max(plane[basin["frame"] + GN] * (rise - z) - phi, 0.0) - profile


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Deviation of the pressure at every patch from the profile, and its slope with mass [Pa/kg]."""
    tables = open_tables(handle)
    st, layout = tables.settings[0], tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != MINE:
            continue
        node, seen = tables.nodes[patch["node"]], seen_of(basin, tables.seen, y)
        stored, depth, volume, squares = water_behind(tables, patch, seen)
        area = area_of(tables, patch)
        slope, content = st["rho"] * weight_of(st, tables.plane, basin), st["rho"] * area
        spread = area * squares / (volume * volume) if volume > HARDLY * area else 1.0
        pressure = slope * stored
        if basin["frame"] >= 0:
            pressure = st["rho"] * weight_beyond(tables.plane, basin, patch, stored, depth)
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["outflow_fraction"] + node["row"]] = to_be_had(depth)
        out[layout["stiffness"] + node["row"]] = slope * spread / content


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add the flows through patches to the rates of the cells next to them."""
    tables = open_tables(handle)
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] == MINE:
            inflow, seen = out[tables.layout[0]["net"] + patch["node"]], seen_of(basin, tables.seen, y)
            pass_patch(tables, patch, inflow, seen, dydt, out)


@njit
def pass_patch(tables, patch, demand, y, dydt, out):
    """Add the flow through a patch to rates; in thin water the outflow may be smaller than the demand."""
    st, layout, integers, plane = tables.settings[0], tables.layout[0], tables.integers, tables.plane
    basin, rho = tables.basins[patch["basin"]], st["rho"]
    n, o, first = basin["n"], basin["y"], patch["first"]
    _, depth, volume, _ = water_behind(tables, patch, y)
    leaves, available = demand < 0.0, 1.0
    total = counted(tables, patch, leaves, y)
    if leaves:
        available = to_be_had(depth)  # the rest comes from outside
        slope = (
            -2.0 * demand * available * min(depth / SHALLOW, 1.0) / (rho * total)
        )  # 2: more than the slope of `outflow_weight`
        out[RATE] = max(out[RATE], slope)
        out[layout["supply"] + patch["node"]] += (available * volume / total - 1.0) * demand
    flow = available * demand / (rho * total)  # of depth, over weights [1/s]
    for m in range(patch["count"] if dydt.size > 0 else 0):
        i = integers[first + m]
        dydt[o + i] += flow * weight(plane, basin, leaves, i, y) * stretched(plane, basin, i)
    per_width = -flow * area_of(tables, patch) / length_of(tables, patch)  # over weights [m/s]
    for m in range(patch["faces"] if dydt.size > 0 and flow != 0.0 else 0):
        k = integers[patch["ring"] + patch["faces"] + m]
        out_per_width = per_width * weight(plane, basin, leaves, k, y)
        h = depth_behind(plane, basin, k, y)
        i, at, count = o + k, patch["normals"], patch["faces"]
        share = 2.0 * h / (h * h + max(h, THIN) * max(h, THIN))
        along_x, along_y = plane[at + m], plane[at + count + m]
        u = share * (y[i + n] * along_x + y[i + 2 * n] * along_y)
        give_way(
            plane, patch, m, (abs(u) + sqrt(weight_of(st, plane, basin) * h)) * out_per_width, dydt, i + n, i + 2 * n
        )
        if out_per_width > 0.0:  # outflow takes its tangential momentum along
            across, per_area = share * (y[i + 2 * n] * along_x - y[i + n] * along_y), plane[at + 2 * count + m]
            dydt[i + n] += out_per_width * per_area * across * along_y
            dydt[i + 2 * n] -= out_per_width * per_area * across * along_x


@njit
def quickest_inflow(t, y, dydt, out, handle):
    """Limit the step by waves that valves may start: with the speed of the head across a valve, over a dry bed too."""
    tables = open_tables(handle)
    st, valves, patches = tables.settings[0], tables.valves, tables.patches
    for k in range(valves.size):
        drop = head_drop(tables, out, k)[1]
        receiver = valves[k]["to_node"] if drop > 0.0 else valves[k]["from_node"]
        for p in range(patches.size if tables.nodes[receiver]["kind"] == PATCH else 0):
            if patches[p]["node"] == receiver and tables.basins[patches[p]["basin"]]["kind"] == MINE:
                wide = sqrt(area_of(tables, patches[p]) / patches[p]["count"])
                out[RATE] = max(out[RATE], 2.0 * sqrt(abs(drop) / st["rho"]) / wide)
