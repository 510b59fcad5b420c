"""Scalars in basins as rooms of a scene: what patches have of them, and rates of their amounts. Knows the tables.

Amounts are per area, s = depth c; a basin with a given velocity has depth 1.
"""

from math import cos, pi

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.advection import INFINITE, THIN, grid_advection, grid_fastest
from fvsolve.kernels.plane.diffusion import grid_diffusion, scalar_sources
from fvsolve.kernels.records import (
    CARRIED_GRID,
    CELL_SCALAR,
    I_BASINS,
    I_FLOATS,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_PATCHES,
    I_PLANE,
    I_PROBES,
    I_SCALARS,
    I_SETTINGS,
    RATE,
    SHALLOW_FACES,
    SHALLOW_GRID,
    WENO5,
)
from fvsolve.kernels.schedules import schedule_value


@njit
def depth_at(tables, basin, y, i):
    """Depth of a cell that an amount is spread over."""
    if basin["kind"] > SHALLOW_FACES:
        return 1.0
    return max(tables[I_PLANE][basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit
def cell_value(tables, basin, q, y, i):
    """Value of scalar q in a cell."""
    return y[basin["carried"] + q * basin["n"] + i] / max(depth_at(tables, basin, y, i), THIN)


@njit
def patch_values(t, y, dydt, out, handle):
    """Value of every scalar at every patch: the mean of the cells behind it, by their areas."""
    tables = open_tables(handle)
    nodes, value = tables[I_NODES].size, tables[I_LAYOUT][0]["value"]
    for k in range(tables[I_PATCHES].size):
        patch = tables[I_PATCHES][k]
        basin = tables[I_BASINS][patch["basin"]]
        for q in range(tables[I_SCALARS].size):
            total = 0.0
            for m in range(patch["count"]):
                i = tables[I_INTEGERS][patch["first"] + m]
                total += tables[I_PLANE][basin["area"] + i] * cell_value(tables, basin, q, y, i)
            out[value + q * nodes + patch["node"]] = total / patch["area"]


@njit
def observe_values(t, y, out, handle, values):
    """values[k] of every probe of a scalar at a point of a basin."""
    tables = open_tables(handle)
    for k in range(tables[I_PROBES].size):
        probe = tables[I_PROBES][k]
        if probe["kind"] == CELL_SCALAR:
            values[k] = 0.0
            for m in range(probe["count"]):
                i, weight = tables[I_INTEGERS][probe["cell"] + m], tables[I_FLOATS][probe["weights"] + m]
                values[k] += weight * cell_value(tables, tables[I_BASINS][probe["index"]], probe["scalar"], y, i)


@njit
def put_outside(t, tables, patch, basin, q, outer):
    """Fill the values beyond the faces of a patch, the last known ones where nothing is said."""
    schedule = tables[I_INTEGERS][patch["values"] + q]
    value = tables[I_SCALARS][q]["initial"]
    if schedule >= 0:
        value = schedule_value(tables, schedule, t)
    for m in range(patch["faces"]):
        k = tables[I_INTEGERS][patch["ring"] + m]
        tables[I_PLANE][basin["outside"] + q * outer + k] = value
    return value


@njit
def ring_flow(plane, basin, k):
    """Flow inward through face k of a grid's boundary."""
    nx, ny, at = basin["nx"], basin["ny"], basin["flows"]
    if k < ny:
        return plane[at + k * (nx + 1)]
    if k < 2 * ny:
        return -plane[at + (k - ny) * (nx + 1) + nx]
    up = at + ny * (nx + 1)
    return plane[up + k - 2 * ny] if k < 2 * ny + nx else -plane[up + ny * nx + k - 2 * ny - nx]


@njit
def carried_rates(t, y, dydt, out, handle):
    """Rates of all amounts in basins on grids; what open boundaries bring and take and what decays to the ledger."""
    tables = open_tables(handle)
    plane, patches, scalars = tables[I_PLANE], tables[I_PATCHES], tables[I_SCALARS]
    nodes, layout, rho = tables[I_NODES].size, tables[I_LAYOUT][0], tables[I_SETTINGS][0]["rho"]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        if basin["carried"] < 0 or (basin["kind"] != SHALLOW_GRID and basin["kind"] != CARRIED_GRID):
            continue
        n, nx, ny, k, f = basin["n"], basin["nx"], basin["ny"], basin["spacing"], basin["flows"]
        kx, ky, outer = plane[k : k + nx], plane[k + nx : k + nx + ny], basin["outer"]
        many = ny * (nx + 1)
        flow_x, flow_y = plane[f : f + many], plane[f + many : f + many + (ny + 1) * nx]
        depth, work = plane[basin["toil"] : basin["toil"]], plane[basin["toil"] + n :]
        factor, given = 1.0, basin["kind"] == CARRIED_GRID
        fastest = basin["fastest"]
        if basin["period"] > 0.0:
            factor = cos(pi * t / basin["period"])
        per = rho
        if given:
            per = basin["density"] * basin["thickness"]
            out[RATE] = max(out[RATE], abs(factor) * fastest)
        else:
            depth = plane[basin["toil"] : basin["toil"] + n]
            for i in range(n):
                depth[i] = max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
            fastest = grid_fastest(nx, ny, kx, ky, flow_x, flow_y, depth, work)
        for q in range(scalars.size):
            scalar = scalars[q]
            o, ring, lies = basin["carried"] + q * n, basin["outside"] + q * outer, layout["gain"] + q * (nodes + 1)
            s, rate, outside = y[o : o + n], dydt[o : o + n], plane[ring : ring + outer]
            for p in range(patches.size):
                if patches[p]["basin"] == b:
                    put_outside(t, tables, patches[p], basin, q, outer)
            least = most = INFINITE
            if basin["scheme"] == WENO5 and scalar["greatest"] > scalar["least"]:
                least, most = scalar["least"], scalar["greatest"]
            else:
                least = -INFINITE
            grid_advection(
                basin["scheme"], basin["limiter"], nx, ny, kx, ky, factor, flow_x, flow_y, depth, outside, least, most,
                max(fastest, THIN), s, work, rate,
            )  # fmt: skip
            if scalar["diffusivity"] > 0.0:
                spreads = grid_diffusion(
                    nx, ny, kx, ky, scalar["diffusivity"], factor, flow_x, flow_y, depth, outside, s, work, rate
                )
                out[RATE] = max(out[RATE], (fastest if given else 0.0) + spreads)
            if basin["open"] >= 0:
                book_boundary(tables, b, basin, q, factor, per, rate, outside, out)
            lost = 0.0
            if scalar["decay"] > 0.0:
                area = plane[basin["area"] : basin["area"] + n]
                for i in range(n):
                    high = depth[i] if depth.size > 0 else 1.0
                    lost += area[i] * (s[i] - high * scalar["ambient"])
                scalar_sources(scalar["decay"], scalar["ambient"], depth, depth[:0], s, rate)
                out[lies + nodes] -= per * scalar["decay"] * lost
                out[RATE] = max(out[RATE], 0.5 * scalar["decay"])
            for p in range(0 if given else patches.size):
                if patches[p]["basin"] == b:
                    bring(tables, patches[p], basin, q, y, rate, out)


@njit
def book_boundary(tables, b, basin, q, factor, per, rate, outside, out):
    """What a given velocity brings in is booked to its patches; what it takes out, all else that cells gain, to one."""
    plane, patches, nodes = tables[I_PLANE], tables[I_PATCHES], tables[I_NODES].size
    lies, gained = tables[I_LAYOUT][0]["gain"] + q * (nodes + 1), 0.0
    for i in range(basin["n"]):
        gained += plane[basin["area"] + i] * rate[i]
    last, most = basin["open"], 0.0
    for p in range(patches.size):
        if patches[p]["basin"] != b:
            continue
        into, away = 0.0, 0.0
        for m in range(patches[p]["faces"]):
            k = tables[I_INTEGERS][patches[p]["ring"] + m]
            flow = factor * ring_flow(plane, basin, k)
            into += max(flow, 0.0) * outside[k]
            away -= min(flow, 0.0)
        out[lies + patches[p]["node"]] = per * into
        gained -= into
        if away > most:
            last, most = patches[p]["node"], away
    out[lies + last] += per * gained


@njit
def bring(tables, patch, basin, q, y, rate, out):
    """What the network brings through a patch into the cells behind it; each gives of its own where water leaves."""
    layout, nodes, rho = tables[I_LAYOUT][0], tables[I_NODES].size, tables[I_SETTINGS][0]["rho"]
    node = patch["node"]
    made_up = out[layout["gain"] + q * (nodes + 1) + node]
    flow = (out[layout["net"] + node] + out[layout["supply"] + node]) / (rho * patch["area"])  # [m/s] of depth
    brought = (out[layout["brought"] + q * nodes + node] + made_up) / (rho * patch["area"])
    leaves = min(flow, 0.0)
    even = brought - leaves * out[layout["value"] + q * nodes + node]
    for m in range(patch["count"]):
        i = tables[I_INTEGERS][patch["first"] + m]
        rate[i] += even + leaves * cell_value(tables, basin, q, y, i)
