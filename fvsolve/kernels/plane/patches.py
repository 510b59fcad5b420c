"""Patches as a room of a scene: their pressures, and what the network brings into the cells behind them."""

from math import inf, log1p, sqrt

from fvsolve.basins.free_surface.rows import THIN
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.behind import (
    HARDLY,
    SHALLOW,
    counted,
    depth_behind,
    through_patch,
    to_be_had,
    weight,
    weight_out,
)
from fvsolve.kernels.records import LAW_LOG, PATCH, RATE, SHALLOW_FACES
from fvsolve.kernels.restrictions import head_drop


@njit
def mean_deviation(tables, patch, y):
    """Of what is stored in the cells behind a patch, per area of these."""
    basin, total = tables.basins[patch["basin"]], 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += tables.plane[basin["area"] + i] * y[basin["y"] + i]
    return total / patch["area"]


@njit
def water_behind(tables, patch, y):
    """(rise of the surface, depth, volume, sum of area times weight squared) of the cells behind a patch.

    Cells count by their area times `weight_out`, so that a dry bank is no water; the volume is the sum. The rise is
    from the surface at rest, where all is dry from the lowest bed.
    """
    basin, plane = tables.basins[patch["basin"]], tables.plane
    n, plan, low, lowest = basin["n"], basin["plan"], inf, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        bed = plane[plan + n + i] - plane[plan + i]  # above the level at rest
        if bed < low:
            low, lowest = bed, plane[plan + n + i] + y[basin["y"] + i]
    rest, rise, depth, volume, squares = max(low, 0.0), 0.0, 0.0, 0.0, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        h = depth_behind(plane, basin, i, y)
        part = plane[basin["area"] + i] * weight_out(h)
        volume, squares = volume + part, squares + part * weight_out(h)
        rise += part * (plane[plan + n + i] + y[basin["y"] + i] - rest)
        depth += part * h
    hardly = max(HARDLY * patch["area"] - volume, 0.0)
    total = volume + hardly
    return (rise + hardly * (lowest - rest)) / total, depth / total, volume, squares


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Deviations of the pressure at every patch from the profile's, and its rise with mass [Pa/kg]."""
    tables = open_tables(handle)
    st, layout = tables.settings[0], tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin, node = tables.basins[patch["basin"]], tables.nodes[patch["node"]]
        if basin["kind"] <= SHALLOW_FACES:
            stored, depth, volume, squares = water_behind(tables, patch, y)
            slope, content, had = st["rho"] * st["gravity"], st["rho"] * patch["area"], to_be_had(depth)
            spread = patch["area"] * squares / (volume * volume) if volume > HARDLY * patch["area"] else 1.0
        else:
            stored, spread, had = mean_deviation(tables, patch, y), 1.0, 1.0
            slope, content = basin["speed"] * basin["speed"], basin["thickness"] * patch["area"]
        pressure = slope * stored
        if st["law"] == LAW_LOG and basin["density"] > 0.0:
            strain = stored / basin["density"]
            pressure, slope = slope * basin["density"] * log1p(strain), slope / (1.0 + strain)
        out[layout["pressure"] + patch["node"]] = pressure
        out[layout["supply"] + patch["node"]] = 0.0
        out[layout["had"] + node["row"]] = had
        out[layout["stiffness"] + node["row"]] = slope * spread / content


@njit
def book_open(tables, b, per, out):
    """Book what passes the open boundary of a basin, to each patch its own."""
    patches = tables.patches
    for k in range(patches.size):
        if patches[k]["basin"] == b and patches[k]["open"] == 1:
            out[tables.layout[0]["supply"] + patches[k]["node"]] = per * through_patch(tables, patches[k])


@njit
def record_patches(t, y, out, handle, values):
    """Mark where a link asked for more than there was; what passes an open boundary is booked, and no mark."""
    tables = open_tables(handle)
    patches, marks, nodes = tables.patches, tables.marks, tables.nodes.size
    for k in range(patches.size):
        at = tables.pipes.size + nodes + patches[k]["node"]
        made_up = patches[k]["open"] == 0 and out[tables.layout[0]["supply"] + patches[k]["node"]] > 0.0
        if made_up and marks[at] != marks[at]:
            marks[at] = t


@njit
def patch_flows(t, y, dydt, out, handle):
    """Add what the patches bring or take to the rates of the cells behind them."""
    tables = open_tables(handle)
    layout = tables.layout[0]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        asked = out[layout["net"] + patch["node"]]
        if tables.basins[patch["basin"]]["kind"] <= SHALLOW_FACES:
            shallow_patch(tables, patch, asked, y, dydt, out)
        elif dydt.size > 0:
            basin = tables.basins[patch["basin"]]
            n, flow = basin["n"], asked / (basin["thickness"] * patch["area"])
            for m in range(patch["count"]):
                dydt[basin["y"] + tables.integers[patch["first"] + m]] += flow
            for m in range(patch["faces"]):
                i = basin["y"] + tables.integers[patch["ring"] + patch["faces"] + m]
                push = -basin["speed"] * asked / (basin["thickness"] * patch["length"])
                give_way(tables.plane, patch, m, push, dydt, i + n, i + 2 * n)


@njit
def give_way(plane, patch, m, push, dydt, x, y):
    """Add to the momentum of the cell behind face m of a patch what a wall would not have let pass.

    A wall stops what runs into it, p + Z u_n; where v passes the pressure on it is p + Z (u_n - v).
    push : Z v, v positive outward
    """
    at, many = patch["normals"], patch["faces"]
    share = push * plane[at + 2 * many + m]
    dydt[x] += share * plane[at + m]
    dydt[y] += share * plane[at + many + m]


@njit
def quickest_inflow(t, y, dydt, out, handle):
    """Let steps see what is about to come: waves as quick as the head before a gate makes them, over a dry bed too."""
    tables = open_tables(handle)
    st, valves, patches = tables.settings[0], tables.valves, tables.patches
    for k in range(valves.size):
        drop = head_drop(tables, out, k)[1]
        taker = valves[k]["to_node"] if drop > 0.0 else valves[k]["from_node"]
        for p in range(patches.size if tables.nodes[taker]["kind"] == PATCH else 0):
            if patches[p]["node"] == taker and tables.basins[patches[p]["basin"]]["kind"] <= SHALLOW_FACES:
                wide = sqrt(patches[p]["area"] / patches[p]["count"])
                out[RATE] = max(out[RATE], 2.0 * sqrt(abs(drop) / st["rho"]) / wide)


@njit
def shallow_patch(tables, patch, asked, y, dydt, out):
    """What a patch brings or takes of water with a free surface; where it is thin, what is asked may not be had."""
    st, layout, integers, plane = tables.settings[0], tables.layout[0], tables.integers, tables.plane
    basin, rho = tables.basins[patch["basin"]], st["rho"]
    n, o, first = basin["n"], basin["y"], patch["first"]
    _, depth, volume, _ = water_behind(tables, patch, y)
    leaves, had = asked < 0.0, 1.0
    total = counted(tables, patch, leaves, y)
    if leaves:
        had = to_be_had(depth)  # the rest comes from outside
        slope = -2.0 * asked * had * min(depth / SHALLOW, 1.0) / (rho * total)  # 2, more than that of `weight_out`
        out[RATE] = max(out[RATE], slope)
        out[layout["supply"] + patch["node"]] += (had * volume / total - 1.0) * asked
    flow = had * asked / (rho * total)  # of depth, over weights [1/s]
    for m in range(patch["count"] if dydt.size > 0 else 0):
        dydt[o + integers[first + m]] += flow * weight(plane, basin, leaves, integers[first + m], y)
    per_width = -flow * patch["area"] / patch["length"]  # over weights [m/s]
    for m in range(patch["faces"] if dydt.size > 0 and flow != 0.0 else 0):
        k = integers[patch["ring"] + patch["faces"] + m]
        out_per_width = per_width * weight(plane, basin, leaves, k, y)
        h = depth_behind(plane, basin, k, y)
        i, at, many = o + k, patch["normals"], patch["faces"]
        share = 2.0 * h / (h * h + max(h, THIN) * max(h, THIN))
        along_x, along_y = plane[at + m], plane[at + many + m]
        u = share * (y[i + n] * along_x + y[i + 2 * n] * along_y)
        give_way(plane, patch, m, (abs(u) + sqrt(st["gravity"] * h)) * out_per_width, dydt, i + n, i + 2 * n)
        if out_per_width > 0.0:  # water that leaves takes along what it has across
            across, taken = share * (y[i + 2 * n] * along_x - y[i + n] * along_y), plane[at + 2 * many + m]
            dydt[i + n] += out_per_width * taken * across * along_y
            dydt[i + 2 * n] -= out_per_width * taken * across * along_x
