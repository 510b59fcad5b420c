"""Friction of water on its bed: rates of unit flows, and the division of stages by it.

Manning -g n^2 |q| q / h^(7/3), Darcy -(f / 8) |q| q / h^2, with |q| q / h^2 as |u| u. In thin water the decay rate r of
a flow is unbounded. SSP methods divide stages by it (`steppers.semi_implicit`); implicit methods solve for it. Other
explicit methods cap it smoothly at FASTEST, r -> r / (1 + r / FASTEST); thin films are then too fast.
"""

from math import sqrt

from fvsolve.basins.free_surface.surface_rows import THIN
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import MANNING

RATE_CAP = 20.0  # [1/s]
TINY = 1e-300


@njit(forceinline=True)
def cube_root(x):
    """x^(1/3) to the last bits: a root of x^(1/4) x^(1/16) x^(1/64) by Halley's iteration.

    Unlike a power, it vectorises.
    """
    a = sqrt(sqrt(x))
    b = sqrt(sqrt(a))
    y = a * b * sqrt(sqrt(b))
    for _ in range(3):
        cube = y * y * y
        y *= (cube + 2.0 * x) / (2.0 * cube + x)
    return y


@njit(forceinline=True)
def drag_per_flow(law, g, value, depth):
    """Rate of friction over unit flow [1/m2] at a depth."""
    h = max(depth, 0.0)
    wet = max(h, THIN)
    share = 2.0 * h / (h * h + wet * wet)
    if law == MANNING:
        return g * value * value * share / (wet * cube_root(wet))
    return 0.125 * value * share / wet


@njit
def add_friction(law, g, coefficient, depth0, dh, qx, qy, content_x, content_y, rate_x, rate_y):
    """Add -r q to the rates of unit flows.

    law, coefficient : MANNING n [s/m^(1/3)] or DARCY f [-], float64[n] or float64[1] for all
    depth0, dh : depth of the profile and deviation from it [m]; qx, qy : unit flows [m2/s]
    content_x, content_y : quantities whose rates these are: unit flows, or contents of cells
    """
    is_uniform = coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if is_uniform else coefficient[i]
        rate = drag_per_flow(law, g, value, depth0[i] + dh[i]) * sqrt(qx[i] * qx[i] + qy[i] * qy[i])
        rate_x[i] -= rate * content_x[i]
        rate_y[i] -= rate * content_y[i]


@njit
def add_capped_friction(law, g, coefficient, cap, depth0, dh, qx, qy, content_x, content_y, rate_x, rate_y):
    """Friction capped as r / (1 + r / cap); returns the greatest decay rate 2 r of errors of the flow [1/s].

    The maximum over all cells prevents vectorisation, and then a power is faster than `cube_root`.
    """
    most, is_uniform = 0.0, coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if is_uniform else coefficient[i]
        h = max(depth0[i] + dh[i], 0.0)
        wet = max(h, THIN)
        speed = 2.0 * h * sqrt(qx[i] * qx[i] + qy[i] * qy[i]) / (h * h + wet * wet)
        if law == MANNING:
            rate = g * value * value * speed / wet ** (4.0 / 3.0)
        else:
            rate = 0.125 * value * speed / wet
        rate *= cap / (cap + rate + TINY)
        most = max(most, rate)
        rate_x[i] -= rate * content_x[i]
        rate_y[i] -= rate * content_y[i]
    return 2.0 * most


@njit
def damp_flows(law, g, coefficient, h, depth0, dh, qx, qy, content_x, content_y, rate_x, rate_y, quick_x, quick_y):
    """Divide rates of unit flows, which include friction -r q, by 1 + h R; quick_x, quick_y become h R.

    R = r + r', with r' the rate of the flow Q that friction alone leaves after a step h: Q (1 + h r') = q + h (rate + r
    q). R is the slope of friction between both flows along the flow, so the step ends at Q if all flows are collinear.
    """
    is_uniform = coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if is_uniform else coefficient[i]
        per, flow = drag_per_flow(law, g, value, depth0[i] + dh[i]), sqrt(qx[i] * qx[i] + qy[i] * qy[i])
        rate, content = per * flow, sqrt(content_x[i] * content_x[i] + content_y[i] * content_y[i])
        stretch = 1.0 if flow == content else flow / (content + TINY)  # undeformed area over present area
        x, y = (
            content_x[i] + h * (rate_x[i] + rate * content_x[i]),
            content_y[i] + h * (rate_y[i] + rate * content_y[i]),
        )
        free = h * per * stretch * sqrt(x * x + y * y)
        quick = h * rate + 2.0 * free / (1.0 + sqrt(1.0 + 4.0 * free))
        rate_x[i] /= 1.0 + quick
        rate_y[i] /= 1.0 + quick
        quick_x[i] = quick_y[i] = quick
