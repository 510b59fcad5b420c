"""Probes and power common to basins of all types: flows through patches, velocities, power of these flows.

Each type of basin computes the other probes of its cells. Column `side` of a probe of kind CELL_FIELD contains the
number of its quantity.

Power is computed under the density law `linear`. The last entries of the array `power` belong to basins, five for each
basin [W]: power of the inflow through patches at their potential p - p_ambient + rho g z, and of moving walls and
bodies; loss at patches (inflow has no kinetic energy, and the potential does not include that of outflow); friction;
rate of storage; on a body, power that the model of the water dissipates (`frame_forces`). An entry of `stored` for each
basin contains its energy minus that at rest [J]; on a body see `frame_forces.add_stored`. Each type of basin writes the
entries that are not zero for it. Kinetic energy is computed from squares of cell means.
"""

from math import sqrt

from fvsolve.core.kernels.density import density
from fvsolve.core.kernels.dtypes import PATCH_FLOW
from fvsolve.core.kernels.network_energy import total_pressure
from fvsolve.features.basins.energy_rows import BASIN_ROWS, basin_power_row
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import njit

# fields of velocities; numbers from FIRST_OWN on are fields of the physics
U, V, SPEED, FIRST_OWN = range(4)


@njit
def velocity_value(field, u, v):
    """Value of a velocity quantity: u, v or the speed sqrt(u^2 + v^2), as the code `field` states."""
    return u if field == U else v if field == V else sqrt(u * u + v * v)


@njit
def observe_flows(t, y, out, handle, values):
    """Write the values of the probes of flows through patches [m3/s], under the density law `linear`."""
    tables = open_basins(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == PATCH_FLOW:
            values[k] = probes[k]["scale"] * patch_flow(tables, probes[k], out)


@njit
def observe_dense_flows(t, y, out, handle, values):
    """Write the values of the probes of flows through patches [m3/s] under other density laws than `linear`.

    The volume flow is that at the density of the liquid at the patch.
    """
    tables = open_basins(handle)
    st = tables.settings[0]
    probes = tables.probes
    at = tables.layout[0]["pressure"]
    for k in range(probes.size):
        if probes[k]["kind"] == PATCH_FLOW:
            i = probes[k]["index"]
            rho = density(st, tables.floats, tables.nodes[i]["pressure"] + out[at + i])
            values[k] = patch_flow(tables, probes[k], out) / rho


@njit
def patch_flow(tables, probe, out):
    """Mass flow into a basin through the patch of a probe [kg/s], from links or through an open boundary."""
    layout, i = tables.layout[0], probe["index"]
    return out[layout["net"] + i] + out[layout["supply"] + i]


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
    tables = open_basins(handle)
    rho = tables.settings[0]["rho"]
    patches = tables.patches
    layout = tables.layout[0]
    for k in range(basin_first_row(tables, power, 0), power.size):
        power[k] = 0.0
    for k in range(patches.size):
        node = patches[k]["node"]
        flow = out[layout["net"] + node] + out[layout["supply"] + node]
        power[basin_first_row(tables, power, patches[k]["basin"])] += (
            total_pressure(tables, out, node) * flow / rho
        )
