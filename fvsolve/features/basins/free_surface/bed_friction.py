"""Friction of water on its bed: its part of the rates of unit flows, and the division of stage rates by 1 + h R.

Rate of the unit flow q [m2/s] in water of depth h: Manning -g n^2 |q| q / h^(7/3), Darcy -(f / 8) |q| q / h^2, both
-r q with the decay rate r [1/s]. In thin water r is unbounded. SSP methods divide the rates of stages
(`steppers.erk`); implicit methods solve for the friction. Other explicit methods, and SSP methods in a basin
on a body that forces move, cap r smoothly, r -> r / (1 + r / RATE_CAP); thin films are then too fast.
"""

from math import sqrt

from fvsolve.core.kernels.cube_root import cube_root_reciprocal
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.tables import MANNING
from fvsolve.jit import njit

RATE_CAP = 20.0  # [1/s]
TINY = 1e-300


@njit(forceinline=True)
def drag_per_flow(law, g, value, depth):
    """Decay rate r of a flow by friction over its unit flow |q| [1/m2], in water of a given depth [m].

    law, value : MANNING and n [s/m^(1/3)], or DARCY and f [-]
    """
    h = max(depth, 0.0)
    wet = max(h, THIN)
    share = 2.0 * h / (h * h + wet * wet)
    if law == MANNING:
        square = cube_root_reciprocal(wet) ** 2
        return g * value * value * share * square * square
    return 0.125 * value * share / wet


@njit
def add_friction(law, g, values, depth0, dh, flows, contents, rates):
    """Add the friction -r q to the rates of n cells; r is the decay rate of the flow [1/s], see `drag_per_flow`.

    law, values : MANNING and n in cells [s/m^(1/3)], or DARCY and f in cells [-]
    depth0, dh : depth at rest and deviation from it [m]; flows : unit flows along x and y, two arrays
    contents : states q along x and y that have the rates `rates`: unit flows, or, with moving walls, unit flows times
    present over undeformed area
    """
    (qx, qy), (content_x, content_y), (rate_x, rate_y) = flows, contents, rates
    for i in range(dh.size):
        rate = drag_per_flow(law, g, values[i], depth0[i] + dh[i]) * sqrt(
            qx[i] * qx[i] + qy[i] * qy[i]
        )
        rate_x[i] -= rate * content_x[i]
        rate_y[i] -= rate * content_y[i]


@njit
def add_capped_friction(law, g, values, cap, depth0, dh, flows, contents, rates):
    """Add friction with a capped decay rate of the flow, r / (1 + r / cap) [1/s]; return twice its greatest value.

    An error of the flow decays at the returned rate, which limits explicit steps. Other arguments as for `add_friction`
    """
    (qx, qy), (content_x, content_y), (rate_x, rate_y) = flows, contents, rates
    most = 0.0
    for i in range(dh.size):
        rate = drag_per_flow(law, g, values[i], depth0[i] + dh[i]) * sqrt(
            qx[i] * qx[i] + qy[i] * qy[i]
        )
        rate *= cap / (cap + rate + TINY)
        most = max(most, rate)
        rate_x[i] -= rate * content_x[i]
        rate_y[i] -= rate * content_y[i]
    return 2.0 * most


@njit
def damp_flows(law, g, values, h, depth0, dh, flows, contents, rates, quick):
    """Divide the rates of unit flows q, which include friction -r q, by 1 + h R, and write h R to `quick`.

    h is the time step, and R = r + r'. Without friction, a step would lead to the flow q + h (rate + r q). Implicit
    friction reduces it to the flow Q of the decay rate r', with Q (1 + h r') = q + h (rate + r q). R is the slope of
    friction between q and Q, so the step ends at Q if all flows have one direction.
    quick : two arrays, for the flows along x and y; other arguments as for `add_friction`
    """
    (qx, qy), (content_x, content_y), (rate_x, rate_y) = flows, contents, rates
    quick_x, quick_y = quick
    for i in range(dh.size):
        per = drag_per_flow(law, g, values[i], depth0[i] + dh[i])
        flow = qx[i] * qx[i] + qy[i] * qy[i]
        content = content_x[i] * content_x[i] + content_y[i] * content_y[i]
        rate = per * sqrt(flow)
        # undeformed area over present area, squared
        stretch = 1.0 if flow == content else flow / (content + TINY)
        x = content_x[i] + h * (rate_x[i] + rate * content_x[i])
        y = content_y[i] + h * (rate_y[i] + rate * content_y[i])
        free = h * per * sqrt(stretch * (x * x + y * y))
        damping = h * rate + 2.0 * free / (1.0 + sqrt(1.0 + 4.0 * free))
        part = 1.0 / (1.0 + damping)
        rate_x[i] *= part
        rate_y[i] *= part
        quick_x[i] = quick_y[i] = damping
