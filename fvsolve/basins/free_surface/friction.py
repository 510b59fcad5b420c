"""Friction of water on its bed: rates of unit flows, and what divides them. Knows cells one by one; knows no grid.

Manning -g n^2 |q| q / h^(7/3), Darcy -(f / 8) |q| q / h^2, with |q| q / h^2 as |u| u. Where water is thin the rate r
that a flow fades at grows beyond all bounds. SSP methods divide stages by it (`steppers.semi_implicit`), implicit ones
solve for it. Other explicit methods hold it to FASTEST smoothly, r -> r / (1 + r / FASTEST), and films run too fast.
"""

from math import sqrt

from fvsolve.basins.free_surface.rows import THIN
from fvsolve.jit import njit
from fvsolve.kernels.records import MANNING

FASTEST = 20.0  # [1/s]
LEAST = 1e-300


@njit(forceinline=True)
def cube_root(x):
    """x^(1/3) to the last bits: a root of x^(1/4) x^(1/16) x^(1/64) by Halley; whole vectors, where a power is none."""
    a = sqrt(sqrt(x))
    b = sqrt(sqrt(a))
    y = a * b * sqrt(sqrt(b))
    for _ in range(3):
        cube = y * y * y
        y *= (cube + 2.0 * x) / (2.0 * cube + x)
    return y


@njit(forceinline=True)
def drag_per_flow(law, g, value, depth):
    """Rate of friction over unit flow [1/m2] of water so deep."""
    h = max(depth, 0.0)
    wet = max(h, THIN)
    share = 2.0 * h / (h * h + wet * wet)
    if law == MANNING:
        return g * value * value * share / (wet * cube_root(wet))
    return 0.125 * value * share / wet


@njit
def add_friction(law, g, coefficient, depth0, dh, qx, qy, held_x, held_y, rate_x, rate_y):
    """Add -r q to the rates of unit flows.

    law, coefficient : MANNING n [s/m^(1/3)] or DARCY f [-], float64[n] or float64[1] for all
    depth0, dh : depth of the profile and less that [m]; qx, qy : unit flows [m2/s]
    held_x, held_y : what the rates are those of, these or what cells contain of them
    """
    one = coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if one else coefficient[i]
        rate = drag_per_flow(law, g, value, depth0[i] + dh[i]) * sqrt(qx[i] * qx[i] + qy[i] * qy[i])
        rate_x[i] -= rate * held_x[i]
        rate_y[i] -= rate * held_y[i]


@njit
def add_held_friction(law, g, coefficient, held, depth0, dh, qx, qy, held_x, held_y, rate_x, rate_y):
    """Friction capped as r / (1 + r / held); returns the greatest rate 2 r [1/s] that the flow's error fades at.

    A greatest of all is no whole vectors, and then a power is quicker.
    """
    most, one = 0.0, coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if one else coefficient[i]
        h = max(depth0[i] + dh[i], 0.0)
        wet = max(h, THIN)
        speed = 2.0 * h * sqrt(qx[i] * qx[i] + qy[i] * qy[i]) / (h * h + wet * wet)
        if law == MANNING:
            rate = g * value * value * speed / wet ** (4.0 / 3.0)
        else:
            rate = 0.125 * value * speed / wet
        rate *= held / (held + rate + LEAST)
        most = max(most, rate)
        rate_x[i] -= rate * held_x[i]
        rate_y[i] -= rate * held_y[i]
    return 2.0 * most


@njit
def damp_flows(law, g, coefficient, h, depth0, dh, qx, qy, held_x, held_y, rate_x, rate_y, quick_x, quick_y):
    """Divide rates of unit flows, friction -r q among them, by 1 + h R; quick_x, quick_y become h R.

    R = r + r', r' of the flow Q that friction alone leaves in a step h: Q (1 + h r') = q + h (rate + r q). Between
    both flows R is the slope of friction along the flow, so the step ends at Q where all lies along one line.
    """
    one = coefficient.size == 1
    for i in range(dh.size):
        value = coefficient[0] if one else coefficient[i]
        per, flow = drag_per_flow(law, g, value, depth0[i] + dh[i]), sqrt(qx[i] * qx[i] + qy[i] * qy[i])
        rate, whole = per * flow, sqrt(held_x[i] * held_x[i] + held_y[i] * held_y[i])
        drawn = 1.0 if flow == whole else flow / (whole + LEAST)  # areas as drawn over those now
        x, y = held_x[i] + h * (rate_x[i] + rate * held_x[i]), held_y[i] + h * (rate_y[i] + rate * held_y[i])
        free = h * per * drawn * sqrt(x * x + y * y)
        quick = h * rate + 2.0 * free / (1.0 + sqrt(1.0 + 4.0 * free))
        rate_x[i] /= 1.0 + quick
        rate_y[i] /= 1.0 + quick
        quick_x[i] = quick_y[i] = quick
