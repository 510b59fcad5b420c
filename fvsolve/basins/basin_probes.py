"""Probes common to basins of all types: flows through patches, and velocities.

Each type of basin computes the other probes of its cells. Column `side` of a probe of kind CELL_FIELD contains the
number of its quantity.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.density import density
from fvsolve.kernels.dtypes import PATCH_FLOW
from fvsolve.kernels.table_handle import open_tables

U, V, SPEED, FIRST_OWN = range(4)  # fields of velocities; numbers from FIRST_OWN on are fields of the physics


@njit
def velocity_value(field, u, v):
    """Value of a velocity quantity: u, v or the speed sqrt(u^2 + v^2), as the code `field` states."""
    return u if field == U else v if field == V else sqrt(u * u + v * v)


@njit
def observe_flows(t, y, out, handle, values):
    """Write the values of the probes of flows through patches [m3/s], under the density law `linear`."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == PATCH_FLOW:
            values[k] = probes[k]["scale"] * patch_flow(tables, probes[k], out)


@njit
def observe_dense_flows(t, y, out, handle, values):
    """Write the values of the probes of flows through patches [m3/s] under other density laws than `linear`.

    The volume flow is that at the density of the liquid at the patch.
    """
    tables = open_tables(handle)
    st, probes, at = tables.settings[0], tables.probes, tables.layout[0]["pressure"]
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
