"""Power of flows into basins through patches, under the density law `linear`.

The last entries of the array `power` belong to basins, five for each basin [W]: power of the inflow through patches at
their potential p - p_ambient + rho g z, and of moving walls and bodies; loss at patches (inflow has no kinetic energy,
and the potential does not include that of outflow); friction; rate of storage; on a body, power that the model of the
water dissipates (`frame_forces`). An entry of `stored` for each basin contains its energy minus that at rest [J]; on a
body see `frame_forces.add_stored`. Each type of basin writes the entries that are not zero for it. Kinetic energy is
computed from squares of cell means.
"""

from fvsolve.jit import njit
from fvsolve.kernels.energy_rows import BASIN_ROWS, basin_power_row
from fvsolve.kernels.network_energy import total_pressure
from fvsolve.kernels.table_handle import open_tables


@njit
def basin_first_row(tables, power, b):
    """Index of the first of the five entries of basin b in `power`."""
    return basin_power_row(tables, power) + BASIN_ROWS * b


@njit(forceinline=True)
def rest_potential(st, basin):
    """Potential p - p_ambient + rho g z of a basin in the initial steady state [Pa]; z : height above energy datum"""
    return basin["rest"] - st["rho"] * st["gravity"] * st["datum"]


@njit
def patch_power(t, y, dydt, out, handle, power):
    """Set the entries of basins in `power` to zero, and add the power of the inflow through all patches [W]."""
    tables = open_tables(handle)
    rho, patches, layout = tables.settings[0]["rho"], tables.patches, tables.layout[0]
    for k in range(basin_first_row(tables, power, 0), power.size):
        power[k] = 0.0
    for k in range(patches.size):
        node = patches[k]["node"]
        flow = out[layout["net"] + node] + out[layout["supply"] + node]
        power[basin_first_row(tables, power, patches[k]["basin"])] += total_pressure(tables, out, node) * flow / rho
