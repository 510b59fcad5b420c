"""What probes read off basins: fields at points, flows through patches. Knows the tables; changes no state."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.density import density
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.shallow_rows import THIN
from fvsolve.kernels.records import (
    CELL_DEPTH,
    CELL_SPEED,
    CELL_STATE,
    CELL_U,
    CELL_V,
    I_BASINS,
    I_FLOATS,
    I_INTEGERS,
    I_LAYOUT,
    I_NODES,
    I_PLANE,
    I_PROBES,
    I_SETTINGS,
    LAW_LINEAR,
    PATCH_FLOW,
    SHALLOW_FACES,
)


@njit
def observe_basins(t, y, out, handle, values):
    """values[k] = scale * quantity + offset of the probes that read cells of basins or flows through patches."""
    tables = open_tables(handle)
    probes = tables[I_PROBES]
    for k in range(probes.size):
        probe = probes[k]
        kind = probe["kind"]
        if kind == PATCH_FLOW:
            values[k] = patch_flow(tables, probe, out)
        elif kind == CELL_STATE or kind == CELL_DEPTH:
            values[k] = probe["scale"] * stored(tables, probe, y) + probe["offset"]
        elif kind == CELL_U:
            values[k] = velocity(tables, probe, 1, y)
        elif kind == CELL_V:
            values[k] = velocity(tables, probe, 2, y)
        elif kind == CELL_SPEED:
            u, v = velocity(tables, probe, 1, y), velocity(tables, probe, 2, y)
            values[k] = sqrt(u * u + v * v)


@njit
def patch_flow(tables, probe, out):
    """Flow into a basin through a patch, at the density of the place [m3/s]."""
    st, layout, i = tables[I_SETTINGS][0], tables[I_LAYOUT][0], probe["index"]
    flow = out[layout["net"] + i] + out[layout["supply"] + i]
    if st["law"] == LAW_LINEAR:
        return probe["scale"] * flow
    return flow / density(st, tables[I_FLOATS], tables[I_NODES][i]["pressure"] + out[layout["pressure"] + i])


@njit
def stored(tables, probe, y):
    """Weighted sum of a quantity's deviations, or of depths."""
    basin, total = tables[I_BASINS][probe["index"]], 0.0
    at = basin["y"] + probe["side"] * basin["n"]
    for m in range(probe["count"]):
        i = tables[I_INTEGERS][probe["cell"] + m]
        value = y[at + i]
        if probe["kind"] == CELL_DEPTH:
            value = max(tables[I_PLANE][basin["plan"] + i] + value, 0.0)
        total += tables[I_FLOATS][probe["weights"] + m] * value
    return total


@njit
def velocity(tables, probe, axis, y):
    """Weighted sum of velocities along x, axis 1, or y, axis 2 [m/s]."""
    basin, rho, total = tables[I_BASINS][probe["index"]], tables[I_SETTINGS][0]["rho"], 0.0
    n = basin["n"]
    for m in range(probe["count"]):
        i = tables[I_INTEGERS][probe["cell"] + m]
        flow = y[basin["y"] + axis * n + i]
        if basin["kind"] <= SHALLOW_FACES:  # which fades where water is thin
            depth = max(tables[I_PLANE][basin["plan"] + i] + y[basin["y"] + i], 0.0)
            wet = max(depth, THIN)
            flow *= 2.0 * depth / (depth * depth + wet * wet)
        else:
            flow /= rho
        total += tables[I_FLOATS][probe["weights"] + m] * flow
    return total
