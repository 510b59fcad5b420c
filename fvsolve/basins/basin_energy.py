"""Power of flows into basins through patches, under the linear law.

Rows of `power` of a basin [W], at the end: power of the inflow through patches at their potential; loss there (inflow
has no speed, outflow takes its kinetic energy along unpaid); friction; rate of storage; on a body, power dissipated by
the law. `stored` contains the change of energy since the profile [J]. A physics fills its own rows that are not zero;
squares are those of cell means.
"""

from fvsolve.jit import njit
from fvsolve.kernels.energy_rows import BASIN_ROWS, basin_power_row
from fvsolve.kernels.linear_energy import total_pressure
from fvsolve.kernels.table_handle import open_tables


@njit
def basin_first_row(tables, power, b):
    """First row of `power` of basin b."""
    return basin_power_row(tables, power) + BASIN_ROWS * b


@njit(forceinline=True)
def rest_potential(st, basin):
    """Potential of the profile [Pa]."""
    return basin["rest"] - st["rho"] * st["gravity"] * st["datum"]


@njit
def patch_power(t, y, dydt, out, handle, power):
    """Set rows of basins to zero, and add the power of the inflow through all patches."""
    tables = open_tables(handle)
    rho, patches, layout = tables.settings[0]["rho"], tables.patches, tables.layout[0]
    for k in range(basin_first_row(tables, power, 0), power.size):
        power[k] = 0.0
    for k in range(patches.size):
        node = patches[k]["node"]
        flow = out[layout["net"] + node] + out[layout["supply"] + node]
        power[basin_first_row(tables, power, patches[k]["basin"])] += total_pressure(tables, out, node) * flow / rho
