"""Patches and probes of water with a free surface: pressures, and the effect of the flows of links on cells."""

from math import inf, sqrt

from fvsolve.core.kernels.dtypes import CELL_FIELD, PATCH, RATE
from fvsolve.core.kernels.restrictions import head_drop
from fvsolve.features.basins import boundary_cells as near
from fvsolve.features.basins.basin_frames import potential_coefficients
from fvsolve.features.basins.basin_output import FIRST_OWN, velocity_value
from fvsolve.features.basins.basin_patches import add_link_momentum, normal_gravity, physics_code
from fvsolve.features.basins.cell_sides import deviations_of, stretch_of_cell
from fvsolve.features.basins.free_surface.patch_closures import (
    DEEPEST,
    faces_inside,
    level_of_patch,
    lowest_bed,
    patch_flow,
    read_faces,
    read_faces_around,
)
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.free_surface.water_sources import (
    infiltration,
    rain_rate,
    sum_of_products,
)
from fvsolve.features.basins.tables import GN, INTERIOR, LINKED, NO_SOIL, open_basins
from fvsolve.jit import njit

OWN_CODE = physics_code(__package__)
DEPTH, VOLUME, WET_AREA, RAIN, RAINED, INFILTRATION, INFILTRATED = range(FIRST_OWN, FIRST_OWN + 7)
TOTALS = {  # quantity of a whole basin -> code
    "volume": VOLUME,
    "wet_area": WET_AREA,
    "rain": RAIN,
    "rained": RAINED,
    "infiltration": INFILTRATION,
    "infiltrated": INFILTRATED,
}


@njit
def water_at_patch(tables, patch, y):
    """(rise of the surface [m], depth [m], volume [m3], sum of area times weight squared [m4]) of the cells at a patch.

    Rise and depth are means with the weight area times `outflow_weight`, so that a dry bank does not count; the volume
    is the sum of these weights. The rise counts from the surface at rest, or from the lowest bed if the patch is dry at
    rest. In a basin on a body it counts from the level at rest. Without water it is that of the cell with the lowest
    bed.
    """
    basin, plane = tables.basins[patch["basin"]], tables.plane
    n = basin["n"]
    plan = basin["plan"]
    low = inf
    lowest = 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        bed = plane[plan + n + i] - plane[plan + i]  # above the level at rest
        if bed < low:
            low, lowest = bed, plane[plan + n + i] + y[basin["y"] + i]
    rest = max(low, 0.0) if basin["frame"] < 0 else 0.0
    rise = 0.0
    depth = 0.0
    volume = 0.0
    squares = 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        h = near.depth_at_patch(plane, basin, i, y)
        part = plane[basin["area"] + i] * near.outflow_weight(h)
        volume, squares = volume + part, squares + part * near.outflow_weight(h)
        rise += part * (plane[plan + n + i] + y[basin["y"] + i] - rest)
        depth += part * h
    filling = max(near.LEAST_DEPTH * near.patch_area(tables, patch) - volume, 0.0)
    total = volume + filling
    return (rise + filling * (lowest - rest)) / total, depth / total, volume, squares


@njit
def bottom_pressure_at_patch(plane, basin, patch, rise, depth):
    """Deviation of the pressure at the bottom of a patch on a body from the steady start, over density [J/kg].

    The water is at rest in the frame of the basin, so its surface is an equipotential, and its height over any position
    follows from the potential phi of gravity and inertial forces. At a dry position the pressure is 0.
    Below the depth near.SHALLOW it is multiplied by `available_fraction`.
    rise, depth : results of `water_at_patch`
    """
    at, (fx, fy, xx, xy, yy) = (
        patch["sizes"] + 2,
        potential_coefficients(plane, basin["frame"], 1.0),
    )
    x = plane[at]
    y = plane[at + 1]
    z = plane[at + 2]
    profile = plane[at + 3]
    phi = x * (fx + xx * x + xy * y) + y * (fy + yy * y)
    return (
        near.available_fraction(depth) * max(plane[basin["frame"] + GN] * (rise - z) - phi, 0.0)
        - profile
    )


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Write pressure, its slope and available fraction of outflow at every patch of water to its node in `out`.

    The pressure is the deviation from the steady start [Pa]; the slope is per mass in the cells next to the patch
    [Pa/kg]. The supply of the node is set to 0. States inside the faces of linked patches are written to their work
    arrays.
    """
    tables = open_basins(handle)
    st, layout = tables.settings[0], tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE:
            continue
        node, seen = tables.nodes[patch["node"]], deviations_of(basin, tables.seen, y)
        if patch["closure"] == LINKED:
            read_faces(tables, patch, seen)
        elif patch["closure"] == INTERIOR:
            read_faces_around(tables, patch, seen)
        stored, depth, volume, squares = water_at_patch(tables, patch, seen)
        area = near.patch_area(tables, patch)
        slope, content = st["rho"] * normal_gravity(st, tables.plane, basin), st["rho"] * area
        spread = area * squares / (volume * volume) if volume > near.LEAST_DEPTH * area else 1.0
        pressure = slope * stored
        if basin["frame"] >= 0:
            pressure = st["rho"] * bottom_pressure_at_patch(
                tables.plane, basin, patch, stored, depth
            )
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["outflow_fraction"] + node["row"]] = near.available_fraction(depth)
        out[layout["stiffness"] + node["row"]] = slope * spread / content


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add the mass and momentum of flows through patches of water to the rates of the cells next to them."""
    tables = open_basins(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        if basin["kind"] != OWN_CODE or patch["closure"] == LINKED:
            continue
        inflow, seen = out[layout["net"] + patch["node"]], deviations_of(basin, tables.seen, y)
        if patch["closure"] == INTERIOR:
            put_held_outflow(tables, patch, t, out)
            add_interior_flow(
                tables, patch, inflow + out[layout["supply"] + patch["node"]], seen, dydt, out
            )
        else:
            add_patch_flow(tables, patch, inflow, seen, dydt, out)


@njit
def put_held_outflow(tables, patch, t, out):
    """Write what links draw from an interior patch beyond critical outflow to `out`, as a supply from outside."""
    st, faces = tables.settings[0], faces_inside(tables, patch)
    z, target = level_of_patch(tables, patch, st["gravity"], faces, t, out)
    if z < lowest_bed(faces) - DEEPEST:
        critical = patch_flow(st["gravity"], z, faces)[0]
        out[tables.layout[0]["supply"] + patch["node"]] = st["rho"] * max(critical - target, 0.0)


@njit
def add_interior_flow(tables, patch, inflow, y, dydt, out):
    """Add the mass flow [kg/s] into an interior patch to the rates of its cells: inflow by area, outflow by volume.

    The outflow takes its momentum along; the inflow has none. During outflow out[RATE], which limits the step, is
    raised to the fraction of the water that leaves in a second.
    """
    plane = tables.plane
    basin = tables.basins[patch["basin"]]
    leaves = inflow < 0.0
    n = basin["n"]
    o = basin["y"]
    volume = 0.0
    for m in range(patch["count"] if leaves else 0):
        i = tables.integers[patch["first"] + m]
        volume += plane[basin["area"] + i] * near.depth_at_patch(plane, basin, i, y)
    flow = inflow / tables.settings[0]["rho"]
    least = near.LEAST_DEPTH * near.patch_area(tables, patch)
    if leaves:
        out[RATE] = max(out[RATE], -2.0 * flow / max(volume, least))
        if volume < least:  # a film of nanometres cannot give it all: the rest comes from outside
            out[tables.layout[0]["supply"] + patch["node"]] += (volume / least - 1.0) * inflow
    for m in range(patch["count"] if dydt.size > 0 else 0):
        i = tables.integers[patch["first"] + m]
        if leaves:
            rate = flow / max(volume, least)
            dydt[o + i] += rate * near.depth_at_patch(plane, basin, i, y)
            dydt[o + n + i] += rate * y[o + n + i]
            dydt[o + 2 * n + i] += rate * y[o + 2 * n + i]
        else:
            dydt[o + i] += flow / near.patch_area(tables, patch)


@njit
def add_patch_flow(tables, patch, demand, y, dydt, out):
    """Add the flow through a patch to the rates of its cells; in thin water the outflow may be smaller than the demand.

    demand : mass flow into the basin that the links of the patch require [kg/s], negative for outflow
    The missing part of an outflow is written to `out` as a supply from outside. During outflow out[RATE], which limits
    the step, is raised too.
    """
    st = tables.settings[0]
    layout = tables.layout[0]
    integers = tables.integers
    plane = tables.plane
    basin, rho = tables.basins[patch["basin"]], st["rho"]
    n = basin["n"]
    o = basin["y"]
    first = patch["first"]
    _, depth, volume, _ = water_at_patch(tables, patch, y)
    leaves, available = demand < 0.0, 1.0
    total = near.weighted_volume(tables, patch, leaves, y)
    if leaves:
        available = near.available_fraction(depth)  # the rest comes from outside
        slope = -2.0 * demand * available * min(depth / near.SHALLOW, 1.0) / (rho * total)
        out[RATE] = max(out[RATE], slope)  # 2 is more than the slope of `outflow_weight`
        out[layout["supply"] + patch["node"]] += (available * volume / total - 1.0) * demand
    flow = available * demand / (rho * total)  # of depth, over weights [1/s]
    for m in range(patch["count"] if dydt.size > 0 else 0):
        i = integers[first + m]
        dydt[o + i] += (
            flow * near.flow_weight(plane, basin, leaves, i, y) * stretch_of_cell(plane, basin, i)
        )
    # over weights [m/s]
    per_width = -flow * near.patch_area(tables, patch) / near.patch_length(tables, patch)
    for m in range(patch["faces"] if dydt.size > 0 and flow != 0.0 else 0):
        k = integers[patch["ring"] + patch["faces"] + m]
        out_per_width = per_width * near.flow_weight(plane, basin, leaves, k, y)
        h = near.depth_at_patch(plane, basin, k, y)
        i = o + k
        at = patch["normals"]
        count = patch["faces"]
        share = 2.0 * h / (h * h + max(h, THIN) * max(h, THIN))
        along_x, along_y = plane[at + m], plane[at + count + m]
        u = share * (y[i + n] * along_x + y[i + 2 * n] * along_y)
        push = (abs(u) + sqrt(normal_gravity(st, plane, basin) * h)) * out_per_width
        add_link_momentum(plane, patch, m, push, dydt, i + n, i + 2 * n)
        if out_per_width > 0.0:  # outflow takes its tangential momentum along
            across = share * (y[i + 2 * n] * along_x - y[i + n] * along_y)
            per_area = plane[at + 2 * count + m]
            dydt[i + n] += out_per_width * per_area * across * along_y
            dydt[i + 2 * n] -= out_per_width * per_area * across * along_x


@njit
def limit_inflow_rate(t, y, dydt, out, handle):
    """Raise out[RATE], which limits the step, for waves that valves may start at patches of water, also over a dry bed.

    Their speed is taken as sqrt(drop / rho), with the pressure drop across the valve.
    """
    tables = open_basins(handle)
    st = tables.settings[0]
    valves = tables.valves
    patches = tables.patches
    for k in range(valves.size):
        drop = head_drop(tables, out, k)[1]
        receiver = valves[k]["to_node"] if drop > 0.0 else valves[k]["from_node"]
        for p in range(patches.size if tables.nodes[receiver]["kind"] == PATCH else 0):
            if (
                patches[p]["node"] == receiver
                and tables.basins[patches[p]["basin"]]["kind"] == OWN_CODE
            ):
                wide = sqrt(near.patch_area(tables, patches[p]) / patches[p]["count"])
                out[RATE] = max(out[RATE], 2.0 * sqrt(abs(drop) / st["rho"]) / wide)


@njit
def observe_water(t, y, out, handle, values):
    """Write the values of probes in cells of water: `scale` times depth plus `offset` [m], or velocities [m/s].

    `scale` and `offset` are columns of the table of probes.
    """
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] != CELL_FIELD or tables.basins[probe["index"]]["kind"] != OWN_CODE:
            continue
        if probe["side"] > DEPTH:
            values[k] = total_of_basin(tables, tables.basins[probe["index"]], probe["side"], t, y)
        else:
            depth, u, v = read_water(tables, probe, y)
            own = probe["side"] == DEPTH
            values[k] = (
                probe["scale"] * depth + probe["offset"]
                if own
                else velocity_value(probe["side"], u, v)
            )


@njit
def total_of_basin(tables, basin, quantity, t, y):
    """Value of one of `TOTALS` for a basin: volume [m3], area deeper than `wet_depth` [m2], flow [m3/s]."""
    if quantity == RAIN:
        return rain_rate(tables, basin, t) * basin["total_area"]
    if quantity == RAINED:
        return y[basin["rained"]] * basin["total_area"] if basin["rain"] >= 0 else 0.0
    total = 0.0
    n = basin["n"]
    soaks = basin["soil"] != NO_SOIL
    if quantity == INFILTRATION:
        return infiltration(tables, basin, t, y) if soaks else 0.0
    if quantity == INFILTRATED:
        area, first = tables.plane[basin["area"] : basin["area"] + n], basin["infiltrated"]
        return sum_of_products(y[first : first + n], area) if soaks else 0.0
    for i in range(n):
        area = tables.plane[basin["area"] + i]
        depth = near.depth_at_patch(tables.plane, basin, i, y)
        total += area * depth if quantity == VOLUME else area if depth > basin["wet_depth"] else 0.0
    return total


@njit
def read_water(tables, probe, y):
    """(depth [m], velocity along x, velocity along y [m/s]) at a probe: weighted sums over its cells.

    Velocities fade to zero in thin water.
    """
    basin = tables.basins[probe["index"]]
    total = 0.0
    u = 0.0
    v = 0.0
    n, o = basin["n"], basin["y"]
    for m in range(probe["count"]):
        i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
        depth = max(tables.plane[basin["plan"] + i] + y[o + i], 0.0)
        wet = max(depth, THIN)
        share = 2.0 * depth / (depth * depth + wet * wet) * weight
        total += weight * depth
        u += share * y[o + n + i]
        v += share * y[o + 2 * n + i]
    return total, u, v
