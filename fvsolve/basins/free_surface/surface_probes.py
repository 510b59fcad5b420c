"""Probes of water with a free surface."""

from fvsolve.basins.basin_probes import FIRST_OWN, velocity_value
from fvsolve.basins.free_surface.surface_rows import THIN
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CELL_FIELD
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)
DEPTH = FIRST_OWN


@njit
def observe_water(t, y, out, handle, values):
    """Write the values of probes in cells of water: `scale` times depth plus `offset` [m], or velocities [m/s].

    `scale` and `offset` are columns of the table of probes.
    """
    tables = open_tables(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_FIELD and tables.basins[probe["index"]]["kind"] == OWN_CODE:
            depth, u, v = read_water(tables, probe, y)
            own = probe["side"] == DEPTH
            values[k] = probe["scale"] * depth + probe["offset"] if own else velocity_value(probe["side"], u, v)


@njit
def read_water(tables, probe, y):
    """(depth [m], velocity along x, velocity along y [m/s]) at a probe: weighted sums over its cells.

    Velocities fade to zero in thin water.
    """
    basin, total, u, v = tables.basins[probe["index"]], 0.0, 0.0, 0.0
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
