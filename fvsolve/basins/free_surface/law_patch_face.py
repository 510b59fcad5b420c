"""Flow through the faces of a patch from the junction of its links into its cells, by the level at the junction.

Its number is the row of the patch. The pressure of the cells is their mean, so the level of the junction above that at
rest is the sum of this pressure and the drop over rho g. The flow is that of `patch_closures.patch_flow`.
"""

from fvsolve.basins.free_surface.patch_closures import faces_inside, patch_flow
from fvsolve.jit import njit

LEAST_SLOPE = 1e-12  # least derivative of the flow by the level [m2/s]; critical outflow does not depend on the level


@njit
def face_inflow(out, tables, k, drop):
    """(flow into the cells [m3/s], its derivative by the level [m2/s]) at a drop of pressure to the cells [Pa]."""
    patch, st = tables.patches[int(tables.floats[tables.valves[k]["data"]])], tables.settings[0]
    pressure = out[tables.layout[0]["pressure"] + patch["node"]] + drop
    z = pressure / (st["rho"] * st["gravity"]) + patch["lowest"]
    q, change = patch_flow(st["gravity"], z, faces_inside(tables, patch))
    return q, max(change, LEAST_SLOPE)


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of `restrictions.restriction_step`: Newton's step."""
    q, change = face_inflow(out, tables, k, drop)
    return tables.settings[0]["rho"] * q - m, change / tables.settings[0]["gravity"]


@njit
def slope(out, tables, k, g, drop):
    """Derivative of the mass flow by the drop [kg/s/Pa]."""
    return face_inflow(out, tables, k, drop)[1] / tables.settings[0]["gravity"]
