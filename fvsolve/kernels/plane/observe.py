"""What probes read off basins: fields at points, flows through patches. Knows the tables; changes no state."""

from math import log1p, sqrt

from fvsolve.basins.free_surface.rows import THIN
from fvsolve.jit import njit
from fvsolve.kernels.density import density
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.records import (
    CELL_DEPTH,
    CELL_SPEED,
    CELL_STATE,
    CELL_U,
    CELL_V,
    LAW_LINEAR,
    LAW_LOG,
    PATCH_FLOW,
    SHALLOW_FACES,
)


@njit
def observe_basins(t, y, out, handle, values):
    """values[k] = scale * quantity + offset of the probes that read cells of basins or flows through patches."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        kind = probe["kind"]
        if kind == PATCH_FLOW:
            values[k] = probe["scale"] * patch_flow(tables, probe, out)
        elif kind == CELL_STATE or kind == CELL_DEPTH:
            values[k] = probe["scale"] * stored(tables, probe, y) + probe["offset"]
        elif kind == CELL_U or kind == CELL_V or kind == CELL_SPEED:
            u, v = velocity(tables, probe, y)
            values[k] = u if kind == CELL_U else v if kind == CELL_V else sqrt(u * u + v * v)


@njit
def observe_dense_flows(t, y, out, handle, values):
    """Flows through patches at the density of the place, under all laws but linear [m3/s]."""
    tables = open_tables(handle)
    st, probes, at = tables.settings[0], tables.probes, tables.layout[0]["pressure"]
    for k in range(probes.size):
        if probes[k]["kind"] == PATCH_FLOW:
            i = probes[k]["index"]
            rho = density(st, tables.floats, tables.nodes[i]["pressure"] + out[at + i])
            values[k] = patch_flow(tables, probes[k], out) / rho


@njit
def patch_flow(tables, probe, out):
    """Mass that flows into a basin through a patch [kg/s]."""
    layout, i = tables.layout[0], probe["index"]
    return out[layout["net"] + i] + out[layout["supply"] + i]


@njit
def stored(tables, probe, y):
    """Weighted sum of a quantity's deviations, or of depths."""
    basin, total = tables.basins[probe["index"]], 0.0
    at = basin["y"] + probe["side"] * basin["n"]
    for m in range(probe["count"]):
        i = tables.integers[probe["cell"] + m]
        value = y[at + i]
        if probe["kind"] == CELL_DEPTH:
            value = max(tables.plane[basin["plan"] + i] + value, 0.0)
        elif probe["side"] == 0 and tables.settings[0]["law"] == LAW_LOG:  # pressure over the slope at rest
            value = basin["density"] * log1p(value / basin["density"])
        total += tables.floats[probe["weights"] + m] * value
    return total


@njit
def velocity(tables, probe, y):
    """Weighted sums of velocities along x and y [m/s]."""
    basin, u, v = tables.basins[probe["index"]], 0.0, 0.0
    n, o = basin["n"], basin["y"]
    for m in range(probe["count"]):
        i = tables.integers[probe["cell"] + m]
        share = 1.0 / basin["density"] if basin["kind"] > SHALLOW_FACES else 1.0
        if tables.settings[0]["law"] != LAW_LINEAR:
            share = 1.0 / (basin["density"] + y[o + i])
        if basin["kind"] <= SHALLOW_FACES:  # which fades where water is thin
            depth = max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
            wet = max(depth, THIN)
            share = 2.0 * depth / (depth * depth + wet * wet)
        share *= tables.floats[probe["weights"] + m]
        u += share * y[o + n + i]
        v += share * y[o + 2 * n + i]
    return u, v
