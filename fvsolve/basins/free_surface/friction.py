"""Friction of water on its bed, added to rates of unit flows. Knows cells one by one; knows no grid.

Manning -g n^2 |q| q / h^(7/3), Darcy -(f / 8) |q| q / h^2, with |q| q / h^2 as |u| u. Where water is thin the rate
that a flow fades at grows beyond all bounds; it is held to FASTEST smoothly, r -> r / (1 + r / FASTEST): a relaxation
that takes no part of a second in water that moves, and none that the step must follow in a film.
"""

from math import sqrt

from fvsolve.basins.free_surface.rows import THIN, TINY
from fvsolve.jit import njit
from fvsolve.kernels.records import MANNING

FASTEST = 20.0  # [1/s]


@njit
def add_friction(law, g, coefficient, fastest, depth0, dh, qx, qy, held_x, held_y, rate_x, rate_y):
    """Add -r q to the rates of unit flows; returns the greatest rate 2 r [1/s] that the flow's error fades at.

    law, coefficient : MANNING n [s/m^(1/3)] or DARCY f [-], float64[n] or float64[1] for all
    fastest : bound of r [1/s], in scenes FASTEST; depth0, dh : depth of the profile and less that [m]
    qx, qy : unit flows [m2/s]; held_x, held_y : what the rates are those of, these or what cells contain of them
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
        rate *= fastest / (fastest + rate + TINY)
        most = max(most, rate)
        rate_x[i] -= rate * held_x[i]
        rate_y[i] -= rate * held_y[i]
    return 2.0 * most
