"""Scalars in basins: values at patches and beyond the boundary, sources and decay of their amounts.

The amount of a scalar per area is s = depth c, with c its value; a basin with a given velocity has depth 1.
"""

from math import cos, pi

from fvsolve.basins.advection import THIN
from fvsolve.basins.boundary_cells import flow_weight, has_given_flows, weighted_volume
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.basins.diffusion import add_decay
from fvsolve.basins.row_bands import stencil_cells
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CELL_SCALAR
from fvsolve.kernels.node_mixing import record_loss
from fvsolve.kernels.schedule_pieces import schedule_value
from fvsolve.kernels.table_handle import open_tables

DRY_WEIGHT = 1e-12  # weight of a dry cell in the value at a patch [m]


@njit
def depth_at(tables, basin, y, i):
    """Depth of cell i over which the amount of a scalar is distributed [m]; 1 for a basin without depth."""
    if basin["deep"] == 0:
        return 1.0
    return max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit
def cell_value(tables, basin, q, y, i):
    """Value of scalar q in cell i of a basin, towards 0 below the depth THIN."""
    return y[basin["carried"] + q * basin["n"] + i] / max(depth_at(tables, basin, y, i), THIN)


@njit
def patch_values(t, y, dydt, out, handle):
    """Write the value of every scalar in the water that leaves each patch to `out`.

    It is the mean over the cells at the patch, with the weights area times `flow_weight`; with the areas alone as
    weights in a basin without depth, or if all cells are dry.
    """
    tables = open_tables(handle)
    nodes, value = tables.nodes.size, tables.layout[0]["value"]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        seen = deviations_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            deep, total, amount = basin["deep"] == 1, 0.0, 0.0
            for m in range(patch["count"]):
                i = tables.integers[patch["first"] + m]
                part = tables.plane[basin["area"] + i]
                part *= max(flow_weight(tables.plane, basin, True, i, seen), DRY_WEIGHT) if deep else 1.0
                total, amount = total + part, amount + part * cell_value(tables, basin, q, seen, i)
            out[value + q * nodes + patch["node"]] = amount / total


@njit
def observe_values(t, y, out, handle, values):
    """Write the values of the probes of scalars at points of basins to `values`."""
    tables = open_tables(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_SCALAR:
            values[k] = 0.0
            for m in range(probe["count"]):
                i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
                values[k] += weight * cell_value(tables, tables.basins[probe["index"]], probe["scalar"], y, i)


@njit
def put_boundary_values(t, tables, patch, basin, q):
    """Write the value of scalar q beyond the faces of a patch to `tables.work`.

    It is the value of the schedule of the scalar at the patch, or the initial value of the scalar without a schedule.
    """
    schedule = tables.integers[patch["values"] + q]
    value = tables.scalars[q]["initial"]
    if schedule >= 0:
        value = schedule_value(tables, schedule, t)
    for m in range(patch["faces"]):
        k = tables.integers[patch["ring"] + m]
        tables.work[basin["outside"] + q * basin["outer"] + k] = value


@njit
def prepare_scalars(t, tables, b, y):
    """Write the depths of the cells of basin b, and the values of scalars beyond its boundary, to `tables.work`.

    Depths are written only for a basin with depth, in the cells of `stencil_cells`.
    """
    plane, basin, patches = tables.plane, tables.basins[b], tables.patches
    n, o, at, seen = basin["n"], basin["y"], basin["plan"], deviations_of(basin, tables.seen, y)
    if basin["deep"] == 1:
        depth, rest, change = (
            tables.work[basin["scalar_work"] : basin["scalar_work"] + n],
            plane[at : at + n],
            seen[o : o + n],
        )
        first, stop = stencil_cells(tables, b)
        for i in range(first, stop):
            depth[i] = max(rest[i] + change[i], 0.0)
    for p in range(patches.size):
        for q in range(tables.scalars.size if patches[p]["basin"] == b else 0):
            put_boundary_values(t, tables, patches[p], basin, q)


@njit
def flow_factor(t, basin):
    """Factor on the flows of a basin at time t: cos(pi t / period) for a periodic given velocity, else 1."""
    return cos(pi * t / basin["period"]) if basin["period"] > 0.0 else 1.0


@njit
def depth_count(basin):
    """Number of depths that `prepare_scalars` computes: one for each cell, or 0 for a basin without depth."""
    return basin["n"] if basin["deep"] == 1 else 0


@njit
def add_sources(t, y, dydt, out, handle):
    """Add decay and flows of links to the rates of all scalars; write losses by decay and boundary flows to `out`."""
    tables = open_tables(handle)
    work = tables.work
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        seen = deviations_of(basin, tables.seen, y)
        n, depth = basin["n"], work[basin["scalar_work"] : basin["scalar_work"] + depth_count(basin)]
        per = tables.settings[0]["rho"]
        if basin["deep"] == 0:
            per = basin["density"] * basin["thickness"]
        for q in range(tables.scalars.size if basin["carried"] >= 0 else 0):
            at, ring = basin["carried"] + q * n, basin["outside"] + q * basin["outer"]
            outside, s, rate = work[ring : ring + basin["outer"]], seen[at : at + n], dydt[at : at + n]
            add_scalar_sources(tables, b, basin, q, flow_factor(t, basin), per, depth, outside, seen, s, rate, out)


@njit
def add_scalar_sources(tables, b, basin, q, factor, per, depth, outside, y, s, rate, out):
    """Add decay and flows of links to the rates of scalar q; write losses by decay and boundary flows to `out`.

    factor : factor on given flows
    per : factor from amounts per area to mass per area: density [kg/m3], or density times thickness [kg/m2] for depth 1
    depth : depths of the cells, empty for depth 1; outside : values beyond the boundary faces
    y : states; s, rate : amounts of the scalar per area, and their rates
    """
    scalar, patches, n = tables.scalars[q], tables.patches, basin["n"]
    if basin["through"] >= 0:
        record_boundary(tables, b, basin, q, factor, per, rate, outside, out)
    if scalar["decay"] > 0.0:
        area = tables.plane[basin["area"] : basin["area"] + n]
        for i in range(n):
            cell_depth = depth[i] if depth.size > 0 else 1.0
            record_loss(
                out,
                tables,
                q,
                basin["lost"] + i,
                per * scalar["decay"] * area[i] * (s[i] - cell_depth * scalar["ambient"]),
            )
        add_decay(scalar["decay"], scalar["ambient"], depth, s, rate)
    for p in range(0 if has_given_flows(basin) else patches.size):
        if patches[p]["basin"] == b and patches[p]["open"] == 0:
            add_link_inflow(tables, patches[p], basin, q, y, rate, out)


@njit
def record_boundary(tables, b, basin, q, factor, per, rate, outside, out):
    """Write the inflow of scalar q through each open patch to `out` [kg/s].

    The outflow of all patches (the rate of change in all cells minus these inflows) is counted, with its negative sign,
    at the patch with the greatest outflow. Arguments as for `add_scalar_sources`.
    """
    plane, patches, nodes = tables.plane, tables.patches, tables.nodes.size
    flows = plane if has_given_flows(basin) else tables.work
    first, total = tables.layout[0]["gain"] + q * nodes, 0.0
    for i in range(basin["n"]):
        total += plane[basin["area"] + i] * rate[i]
    largest, largest_outflow = -1, -1.0
    for p in range(patches.size):
        if patches[p]["basin"] != b or patches[p]["open"] == 0:
            continue
        inflow, outflow = 0.0, 0.0
        for m in range(patches[p]["faces"]):
            k = tables.integers[patches[p]["ring"] + m]
            flow = factor * flows[basin["through"] + k]
            inflow += max(flow, 0.0) * outside[k]
            outflow -= min(flow, 0.0)
        out[first + patches[p]["node"]] = per * inflow
        total -= inflow
        if outflow > largest_outflow:
            largest, largest_outflow = patches[p]["node"], outflow
    out[first + largest] += per * total


@njit
def add_link_inflow(tables, patch, basin, q, y, rate, out):
    """Add the inflow of scalar q from the links at a patch to the rates of the cells at the patch.

    Where water leaves, each cell loses its own value. rate : rates of the amounts of the scalar per area
    """
    layout, nodes, rho = tables.layout[0], tables.nodes.size, tables.settings[0]["rho"]
    node = patch["node"]
    supplied = out[layout["gain"] + q * nodes + node]
    flow = min(out[layout["net"] + node] + out[layout["supply"] + node], 0.0) / (
        rho * weighted_volume(tables, patch, True, y)
    )
    inflow, plane = (out[layout["scalar_inflow"] + q * nodes + node] + supplied) / rho, tables.plane
    for m in range(patch["count"] if flow < 0.0 else 0):
        i = tables.integers[patch["first"] + m]
        loss = flow * flow_weight(plane, basin, True, i, y) * cell_value(tables, basin, q, y, i)
        rate[i] += loss
        inflow -= plane[basin["area"] + i] * loss
    inflow /= weighted_volume(tables, patch, False, y)
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        rate[i] += inflow * flow_weight(plane, basin, False, i, y)
