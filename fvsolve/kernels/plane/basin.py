"""Basins as a room of a scene: pressures of their patches, and what these bring into the cells. Knows the tables."""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.shallow import PLANS, grid_rates
from fvsolve.kernels.records import (
    I_BASINS,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_PATCHES,
    I_PLANE,
    I_SETTINGS,
    MUSCL,
    RATE,
    UPWIND,
)

NO_SLOPE = -1  # in place of a limiter: first order
SHALLOW = 1e-3  # depth at a patch below which no more than a share of what is asked can leave [m]
UNSPLIT = 2.0  # Courant numbers count half cells, so that no depth falls below zero at one


@njit
def patch_pressures(t, y, dydt, out, handle):
    """Deviations of the pressure over the bed of every patch from the profile's, and its rise with mass [Pa/kg]."""
    tables = open_tables(handle)
    st, layout, integers = tables[I_SETTINGS][0], tables[I_LAYOUT][0], tables[I_INTEGERS]
    for k in range(tables[I_PATCHES].size):
        patch = tables[I_PATCHES][k]
        basin, node = tables[I_BASINS][patch["basin"]], tables[I_NODES][patch["node"]]
        total = 0.0
        for m in range(patch["count"]):
            total += y[basin["y"] + integers[patch["first"] + m]]
        out[layout["pressure"] + patch["node"]] = st["rho"] * st["gravity"] * (total / patch["count"])
        area = patch["count"] * basin["dx"] * basin["dy"]
        out[layout["stiffness"] + node["row"]] = st["gravity"] / area


@njit
def basin_rates(t, y, dydt, out, handle):
    """Rates of all cells, with what the patches bring or take, its momentum too; and the greatest rate."""
    tables = open_tables(handle)
    st, integers, net = tables[I_SETTINGS][0], tables[I_INTEGERS], tables[I_LAYOUT][0]["net"]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        n, o, at = basin["nx"] * basin["ny"], basin["y"], basin["plan"]
        plan = tables[I_PLANE][at : at + PLANS * n].reshape((PLANS, n))
        work, nx, ny = tables[I_PLANE][basin["work"] :], basin["nx"], basin["ny"]
        rate = grid_rates(
            st["gravity"], UPWIND if basin["limiter"] == NO_SLOPE else MUSCL, basin["limiter"], nx, ny,
            work[:nx], work[nx : nx + ny], work[:0], plan, y[o : o + n], y[o + n : o + 2 * n], y[o + 2 * n : o + 3 * n],
            work[:0], work[:0], work[nx + ny :], dydt[o : o + n], dydt[o + n : o + 2 * n], dydt[o + 2 * n : o + 3 * n],
        )  # fmt: skip
        out[RATE] = max(out[RATE], UNSPLIT * rate)
    for k in range(tables[I_PATCHES].size):
        patch = tables[I_PATCHES][k]
        basin, asked = tables[I_BASINS][patch["basin"]], out[net + patch["node"]]
        n, o, plan, first = basin["nx"] * basin["ny"], basin["y"], basin["plan"], patch["first"]
        depth = 0.0
        for m in range(patch["count"]):
            depth += (tables[I_PLANE][plan + integers[first + m]] + y[o + integers[first + m]]) / patch["count"]
        share, area = 1.0, patch["count"] * basin["dx"] * basin["dy"]
        if asked < 0.0:  # 1.5, the steepest slope of the share
            out[RATE] = max(out[RATE], -1.5 * asked / (st["rho"] * area * max(depth, SHALLOW)))
        if asked < 0.0 and depth < SHALLOW:  # less and less of it can still be had, the rest comes from outside
            s = max(depth, 0.0) / SHALLOW
            share = s * s * (3.0 - 2.0 * s)
        supply = (share - 1.0) * asked
        out[tables[I_LAYOUT][0]["supply"] + patch["node"]] = supply
        if dydt.size == 0:
            continue
        flow = (asked + supply) / (st["rho"] * area)  # [m/s] of depth
        for m in range(patch["count"]):
            i = o + integers[first + m]
            dydt[i] += flow
            if flow < 0.0 and depth > 0.0:  # water that leaves takes its momentum along
                dydt[i + n] += flow * y[i + n] / depth
                dydt[i + 2 * n] += flow * y[i + 2 * n] / depth
