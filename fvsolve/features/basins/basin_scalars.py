"""Scalars in basins: values at patches and beyond the boundary; rates by advection, diffusion, decay and links.

The amount of a scalar per area is s = depth c, with c its value; a basin with a given velocity has depth 1. In the
functions of one scalar, q is its number, `seen` the states or deviations (`deviations_of`), `rate` the rates of its
amounts per area.
"""

from math import cos, pi

from fvsolve.core.kernels import stage_sums
from fvsolve.core.kernels.dtypes import CELL_SCALAR, GIVEN_FLOW, MUSCL, RATE, UPWIND
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.features.basins import advection, fifth_order
from fvsolve.features.basins.advection import DRY, AdvectionGrid, GridFlows
from fvsolve.features.basins.advection_faces import MeshFlows, advection_rates
from fvsolve.features.basins.boundary_cells import (
    depth_at_patch,
    flow_weight,
    has_given_flows,
    patch_inflow,
    stencil_cells,
    weighted_volume,
)
from fvsolve.features.basins.cell_sides import deviations_of
from fvsolve.features.basins.tables import INTERIOR, NO_CLOSURE, open_basins
from fvsolve.features.scalars.kernels.scalar_transport import change_rate
from fvsolve.jit import njit

DRY_WEIGHT = 1e-12  # weight of a dry cell in the value at a patch [m]


@njit
def cell_value(tables, basin, q, y, i):
    """Value of scalar q in cell i of a basin, towards 0 below the depth DRY."""
    depth = 1.0
    if basin["deep"] == 1:
        depth = max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
    return y[basin["carried"] + q * basin["n"] + i] / max(depth, DRY)


@njit
def patch_values(t, y, dydt, out, handle):
    """Write the value of every scalar in the water that leaves each patch to `out`.

    It is the mean over the cells at the patch, with the weights area times `flow_weight`; with the areas alone as
    weights in a basin without depth, or if all cells are dry.
    """
    tables = open_basins(handle)
    nodes, value = tables.nodes.size, tables.layout[0]["value"]
    for k in range(tables.patches.size):
        patch = tables.patches[k]
        basin = tables.basins[patch["basin"]]
        seen = deviations_of(basin, tables.seen, y)
        for q in range(tables.scalars.size):
            deep = basin["deep"] == 1
            total = 0.0
            amount = 0.0
            for m in range(patch["count"]):
                i = tables.integers[patch["first"] + m]
                part = tables.plane[basin["area"] + i]
                if deep and patch["closure"] == INTERIOR:
                    part *= max(depth_at_patch(tables.plane, basin, i, seen), DRY_WEIGHT)
                elif deep:
                    part *= max(flow_weight(tables.plane, basin, True, i, seen), DRY_WEIGHT)
                total, amount = total + part, amount + part * cell_value(tables, basin, q, seen, i)
            out[value + q * nodes + patch["node"]] = amount / total


@njit
def observe_values(t, y, out, handle, values):
    """Write the values of the probes of scalars at points of basins to `values`."""
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_SCALAR:
            values[k] = 0.0
            for m in range(probe["count"]):
                i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
                values[k] += weight * cell_value(
                    tables, tables.basins[probe["index"]], probe["scalar"], y, i
                )


@njit
def observe_given_flows(t, y, out, handle, values):
    """Write the values of probes of the inflow through patches [m3/s], in basins with a given velocity.

    It is 0 at patches without flow.
    """
    tables = open_basins(handle)
    for k in range(tables.probes.size):
        if tables.probes[k]["kind"] == GIVEN_FLOW:
            patch = tables.patches[tables.probes[k]["index"]]
            basin, values[k] = tables.basins[patch["basin"]], 0.0
            if patch["open"] == 1:
                values[k] = flow_factor(t, basin) * basin["thickness"] * patch_inflow(tables, patch)


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
    plane = tables.plane
    basin = tables.basins[b]
    patches = tables.patches
    n = basin["n"]
    o = basin["y"]
    at = basin["plan"]
    seen = deviations_of(basin, tables.seen, y)
    if basin["deep"] == 1:
        depth = tables.work[basin["scalar_work"] : basin["scalar_work"] + n]
        rest, change = plane[at : at + n], seen[o : o + n]
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


@njit(forceinline=True)
def depth_range(basin):
    """(first, last + 1) in `tables.work` of the depths that `prepare_scalars` computes; empty without depth."""
    first = basin["scalar_work"]
    return first, first + (basin["n"] if basin["deep"] == 1 else 0)


@njit(forceinline=True)
def outside_range(basin, q):
    """(first, last + 1) in `tables.work` of the values of scalar q beyond all boundary faces of a basin."""
    first = basin["outside"] + q * basin["outer"]
    return first, first + basin["outer"]


@njit(forceinline=True)
def on_grid(basin, dydt):
    """True if the rates of scalars in a grid are requested."""
    return basin["carried"] >= 0 and basin["nx"] > 0 and dydt.size > 0


@njit(forceinline=True)
def grid_arrays(tables, b):
    """(grid, depths, work array) of basin b, a grid with scalars."""
    basin = tables.basins[b]
    plane = tables.plane
    nx = basin["nx"]
    ny = basin["ny"]
    k = basin["spacing"]
    grid = AdvectionGrid(
        nx,
        ny,
        tables.bands[2 * b],
        tables.bands[2 * b + 1],
        plane[k : k + nx],
        plane[k + nx : k + nx + ny],
    )
    first, last = depth_range(basin)
    return grid, tables.work[first:last], tables.work[basin["scalar_work"] + basin["n"] :]


@njit(forceinline=True)
def grid_flows(t, tables, basin, q):
    """Flows through the faces of a grid at time t, and values of scalar q beyond its boundary."""
    nx = basin["nx"]
    ny = basin["ny"]
    f = basin["flows"]
    flows = tables.plane if has_given_flows(basin) else tables.work
    across = f + ny * (nx + 1)
    first, last = outside_range(basin, q)
    flow_y, outside = flows[across : across + (ny + 1) * nx], tables.work[first:last]
    return GridFlows(flow_factor(t, basin), flows[f:across], flow_y, outside)


@njit
def advect_on_grids(t, y, dydt, out, handle):
    """Write the rates of the amounts of all scalars in grids by muscl, or by upwind under all other schemes.

    out[RATE], which limits the step, is raised. Requested stage sums are formed too.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if not on_grid(basin, dydt):
            continue
        prepare_scalars(t, tables, b, y)
        grid, depth, work = grid_arrays(tables, b)
        seen, n = deviations_of(basin, tables.seen, y), basin["n"]
        # at full speed: a periodic velocity may grow within a step
        quick = basin["unsplit"] * basin["fastest"]
        for q in range(tables.scalars.size):
            out[RATE] = max(out[RATE], quick + change_rate(out, tables, q))
            flows = grid_flows(t, tables, basin, q)
            at = basin["carried"] + q * n
            scheme = basin["scheme"]
            limiter = basin["limiter"]
            rate = dydt[at : at + n]
            if stage_sums.requested_mode(tables, b) != stage_sums.OFF:
                by_blocks(tables.sums, at, scheme, limiter, grid, flows, y, work, rate)
            else:
                advection.grid_advection(
                    scheme, limiter, grid, flows, depth, seen[at : at + n], work, rate
                )
    if tables.sums.size > 0 and tables.sums[stage_sums.MODE] == stage_sums.STAGE_AND_END:
        stage_sums.form_checked_runs(tables.sums)


@njit
def by_blocks(sums, at, scheme, limiter, grid, flows, y, work, rate):
    """Write rates of a scalar as `grid_advection` does for depth 1, block by block, and form the requested stage sums.

    Both happen in the same pass. sums : see `kernels.stage_sums`; at : index in the states y of the first amount
    """
    nx = grid.nx
    begin = grid.begin
    stop = grid.stop
    n = rate.size
    mode = sums[stage_sums.MODE]
    formed_ahead, formed_end = begin, begin
    rows = max(sums[stage_sums.CELLS] // nx, 1)
    for row in range(begin, stop, rows):
        block_stop = min(row + rows, stop)
        ahead = min(block_stop + 2, stop)
        if mode != stage_sums.CHECK:
            stage_sums.form_rows(sums, False, at, nx, formed_ahead, ahead, 0, nx)
        formed_ahead = ahead
        first, c = scheme if scheme == MUSCL else UPWIND, y[at : at + n]
        advection.second_order_rates(
            first, limiter, grid, row, block_stop, flows, c, work[n:], rate
        )
        if mode == stage_sums.CHECK:
            stage_sums.check_rows(sums, y, at, nx, row, block_stop, 0, nx)
        elif mode == stage_sums.STAGE_AND_END:  # rates of the next row read the last of these rows
            last = block_stop if block_stop == stop else block_stop - 1
            stage_sums.form_rows(sums, True, at, nx, formed_end, last, 0, nx)
            formed_end = block_stop - 1


@njit
def add_fifth_order_on_grids(t, y, dydt, out, handle):
    """Add the difference of upwind5 or weno5 from upwind to the rates of all scalars in grids.

    The fluxes of weno5 are limited to keep the bounds of the scalars, see `fifth_order.add_fifth_order`.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if not on_grid(basin, dydt):
            continue
        grid, depth, work = grid_arrays(tables, b)
        seen = deviations_of(basin, tables.seen, y)
        n = basin["n"]
        fastest = basin["fastest"]
        for q in range(tables.scalars.size):
            flows = grid_flows(t, tables, basin, q)
            at = basin["carried"] + q * n
            bounds = (tables.scalars[q]["least"], tables.scalars[q]["greatest"])
            s, rate = seen[at : at + n], dydt[at : at + n]
            fifth_order.add_fifth_order(
                basin["scheme"], grid, flows, depth, bounds, fastest, s, work, rate
            )


@njit
def diffuse_on_grids(t, y, dydt, out, handle):
    """Add diffusion to the rates of the amounts of all scalars in grids; raise out[RATE], which limits the step."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if not on_grid(basin, dydt):
            continue
        grid, depth, work = grid_arrays(tables, b)
        seen, n = deviations_of(basin, tables.seen, y), basin["n"]
        for q in range(tables.scalars.size):
            at, diffusivity = basin["carried"] + q * n, tables.scalars[q]["diffusivity"]
            if diffusivity > 0.0:
                flows = grid_flows(t, tables, basin, q)
                s, rate = seen[at : at + n], dydt[at : at + n]
                diffusion_rate = advection.grid_diffusion(
                    grid, diffusivity, flows, depth, s, work, rate
                )
                other_rates = basin["unsplit"] * basin["fastest"] + change_rate(out, tables, q)
                out[RATE] = max(out[RATE], other_rates + diffusion_rate)


@njit
def advect_on_meshes(t, y, dydt, out, handle):
    """Write the rates of all scalars in basins on meshes other than grids, by advection and diffusion.

    out[RATE], which limits the step, is raised.
    """
    tables = open_basins(handle)
    scalars = tables.scalars
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["carried"] < 0 or basin["nx"] > 0:
            continue
        n, through = basin["n"], tables.plane if has_given_flows(basin) else tables.work
        prepare_scalars(t, tables, b, y)
        seen, factor = deviations_of(basin, tables.seen, y), flow_factor(t, basin)
        first, last = depth_range(basin)
        depth, work = tables.work[first:last], tables.work[basin["scalar_work"] + n :]
        mesh = tables.plane[basin["mesh"] :], tables.integers[basin["links"] :]
        for q in range(scalars.size):
            at, bounds = basin["carried"] + q * n, (scalars[q]["least"], scalars[q]["greatest"])
            flow = through[basin["flows"] : basin["flows"] + basin["faces"]]
            first, last = outside_range(basin, q)
            flows = MeshFlows(factor, flow, tables.work[first:last])
            quickest = advection_rates(
                basin["scheme"],
                basin["wide"],
                scalars[q]["diffusivity"],
                mesh,
                flows,
                depth,
                bounds,
                seen[at : at + n],
                work,
                dydt[at : at + n],
            )
            # a periodic velocity returns to full speed
            full_rate = (1.0 - abs(factor)) * basin["unsplit"] * basin["fastest"]
            out[RATE] = max(out[RATE], quickest + full_rate + change_rate(out, tables, q))


@njit
def add_sources(t, y, dydt, out, handle):
    """Add decay and flows of links to the rates of all scalars; write losses by decay and boundary flows to `out`."""
    tables = open_basins(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        seen = deviations_of(basin, tables.seen, y)
        per = (
            tables.settings[0]["rho"]
            if basin["deep"] == 1
            else basin["density"] * basin["thickness"]
        )
        for q in range(tables.scalars.size if basin["carried"] >= 0 else 0):
            at = basin["carried"] + q * basin["n"]
            rate = dydt[at : at + basin["n"]]
            if basin["through"] >= 0:
                record_boundary(t, tables, b, q, per, rate, out)
            if tables.scalars[q]["decay"] > 0.0:
                add_decay(tables, basin, q, per, seen[at : at + basin["n"]], rate, out)
            for p in range(0 if has_given_flows(basin) else tables.patches.size):
                patch = tables.patches[p]
                if patch["basin"] == b and patch["open"] == 0 and patch["closure"] == NO_CLOSURE:
                    add_link_inflow(tables, patch, basin, q, seen, rate, out)


@njit
def add_decay(tables, basin, q, per, s, rate, out):
    """Add the decay of the amounts s of scalar q to their rates; write the losses to `out` [kg/s].

    per : factor from amounts per area to mass per area: density [kg/m3], or density times thickness [kg/m2] for depth 1
    """
    scalar, (first, last) = tables.scalars[q], depth_range(basin)
    depth = tables.work[first:last]
    decay = scalar["decay"]
    ambient = scalar["ambient"]
    area = tables.plane[basin["area"] : basin["area"] + s.size]
    losses = out[tables.layout[0]["loss"] + scalar["loss"] :]
    # The ledger has a single entry for all cells, or an entry for each.
    has_single, first = scalar["losses"] == 1, basin["lost"]
    total = losses[0]
    for i in range(s.size):
        cell_depth = depth[i] if depth.size > 0 else 1.0
        lost = per * decay * area[i] * (s[i] - cell_depth * ambient)
        if has_single:
            total -= lost
        else:
            losses[first + i] = -lost
    if has_single:
        losses[0] = total
    advection.add_decay(decay, ambient, depth, s, rate)


@njit
def record_boundary(t, tables, b, q, per, rate, out):
    """Write the inflow of scalar q through each open patch to `out` [kg/s]; per : as for `add_decay`.

    The outflow of all patches (the rate of change in all cells minus these inflows) is counted, with its negative sign,
    at the patch with the greatest outflow.
    """
    plane = tables.plane
    patches = tables.patches
    nodes = tables.nodes.size
    basin = tables.basins[b]
    factor, (begin, end) = flow_factor(t, basin), outside_range(basin, q)
    outside = tables.work[begin:end]
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
    layout = tables.layout[0]
    nodes = tables.nodes.size
    rho = tables.settings[0]["rho"]
    node = patch["node"]
    supplied = out[layout["gain"] + q * nodes + node]
    flow = min(out[layout["net"] + node] + out[layout["supply"] + node], 0.0)
    flow = flow / (rho * weighted_volume(tables, patch, True, y))
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
