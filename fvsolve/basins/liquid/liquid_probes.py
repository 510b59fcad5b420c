"""Probes of a liquid."""

from math import log1p

from fvsolve.basins.basin_probes import FIRST_OWN, velocity_value
from fvsolve.basins.physics_codes import physics_code
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CELL_FIELD, LAW_LINEAR, LAW_LOG
from fvsolve.kernels.table_handle import open_tables

OWN_CODE = physics_code(__package__)
PRESSURE = FIRST_OWN


@njit
def observe_liquid(t, y, out, handle, values):
    """Write the values of probes in cells of liquids: pressures [Pa] or velocities [m/s].

    A pressure is `scale` times the first result of `read_liquid` plus `offset`, two columns of the table of probes.
    Under the density law `table`, `liquid_table_law.observe_pressures` replaces it.
    """
    tables = open_tables(handle)
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == CELL_FIELD and tables.basins[probe["index"]]["kind"] == OWN_CODE:
            dense, u, v = read_liquid(tables, probe, y)
            own = probe["side"] == PRESSURE
            values[k] = probe["scale"] * dense + probe["offset"] if own else velocity_value(probe["side"], u, v)


@njit
def read_liquid(tables, probe, y):
    """(deviation of density [kg/m3], velocity along x, along y [m/s]) at a probe: weighted sums over its cells.

    Under the density law `log`, the first is instead rho0 ln(rho / rho0), the pressure above that at rest over c0^2.
    """
    basin, law, total, u, v = tables.basins[probe["index"]], tables.settings[0]["law"], 0.0, 0.0, 0.0
    n, o = basin["n"], basin["y"]
    for m in range(probe["count"]):
        i, weight = tables.integers[probe["cell"] + m], tables.floats[probe["weights"] + m]
        value = y[o + i]
        share = 1.0 / (basin["density"] + (0.0 if law == LAW_LINEAR else value)) * weight
        if law == LAW_LOG:
            value = basin["density"] * log1p(value / basin["density"])
        total += weight * value
        u += share * y[o + n + i]
        v += share * y[o + 2 * n + i]
    return total, u, v
