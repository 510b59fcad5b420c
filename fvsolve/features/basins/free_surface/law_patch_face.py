"""Flow through the faces of a patch from the junction of its links into its cells, by the level at the junction.

Its numbers are those of the patch: lowest bed of its cells above the level at rest, offset in `work` of the states
inside its faces, number of its faces. The pressure of the cells is their mean, so the level of the junction above that
at rest is the sum of this pressure and the drop over rho g. The flow is that of `patch_closures.patch_flow`.
"""

from fvsolve.core.kernels.dtypes import FIRM
from fvsolve.core.kernels.structures import FACE_SHARE, least_slope
from fvsolve.features.basins.free_surface.patch_closures import (
    DEEPEST,
    faces_at,
    lowest_bed,
    patch_flow,
    solve_level,
)
from fvsolve.jit import njit

NUMBERS = 3  # of a patch
SAME_FLOW = 1e-9  # relative difference of flows that counts as rounding
NEAR = 1e-12  # least length of a chord [m]
# derivative at dry faces over their length: speed of waves in a millimetre of water [m/s]
DRY_SPEED = 0.1


@njit
def junction_level(out, tables, k, drop):
    """Level of the junction of a patch above the level at rest [m].

    k : restriction of its faces; drop : of pressure, to the cells [Pa]
    """
    st, valve = tables.settings[0], tables.valves[k]
    pressure = out[tables.layout[0]["pressure"] + valve["to_node"]] + drop
    return pressure / (st["rho"] * st["gravity"]) + tables.floats[valve["data"]]


@njit
def faces_of(tables, k):
    """State inside the faces of the patch of restriction k, as for `patch_flow`."""
    at = tables.valves[k]["data"]
    return faces_at(tables.work, int(tables.floats[at + 1]), int(tables.floats[at + 2]))


@njit
def level_step(g, faces, z, target, firm):
    """(change of the flow from `target` [m3/s], its derivative by the level [m2/s]) in Newton's step from the level z.

    At or below critical outflow, and below dry faces, the flow has no derivative by the level. If the target is
    greater, it is that of the chord to the level at which the target passes: with any slope of its own a patch that
    stays dry would keep Newton's method from its root. A smaller target has the level of `DEEPEST`.
    g : gravity; faces : as for `patch_flow`; firm : as for `structures.least_slope`
    """
    q, change = patch_flow(g, z, faces)
    if change > 0.0:
        return q - target, change
    long = 0.0
    for m in range(faces[3].size):
        long += faces[3][m]
    if q == 0.0 and target == 0.0:
        return 0.0, DRY_SPEED * long
    least = least_slope(q, target, firm)  # critical outflow does not depend on the level
    if not target > q + SAME_FLOW * abs(q):
        deeper = z - (lowest_bed(faces) - DEEPEST)
        return (
            (q + DRY_SPEED * long * deeper - target, DRY_SPEED * long)
            if deeper < 0.0
            else (q - target, least)
        )
    level = solve_level(g, faces, target, 0.0, faces[0][:0], faces[0][:0])
    return q - target, max((target - q) / max(level - z, NEAR), least)


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of `restrictions.restriction_step`: Newton's step."""
    st = tables.settings[0]
    z = junction_level(out, tables, k, drop)
    a, s = level_step(st["gravity"], faces_of(tables, k), z, m / st["rho"], FACE_SHARE * out[FIRM])
    return st["rho"] * a, s / st["gravity"]


@njit
def slope(out, tables, k, g, drop):
    """Derivative of the mass flow by the drop [kg/s/Pa]."""
    gravity = tables.settings[0]["gravity"]
    z = junction_level(out, tables, k, drop)
    return patch_flow(gravity, z, faces_of(tables, k))[1] / gravity
