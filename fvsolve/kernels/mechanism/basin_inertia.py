"""Contribution of the water in basins to the mass matrix of the bodies that carry the basins.

The water moves with its body only along the normal of the bed of the basin; along the bed it slides. For basin b the
array `out` contains TANK_OUT numbers from layout["tank"] + TANK_OUT b on, all 0 for a basin that is not on a body:

    MOMENTS       6 sums over cells of mass times 1, x, y, x^2, x y, y^2 [kg, kg m, kg m2]; x, y in axes of the basin
    EAST, NORTH, NORMAL   unit vectors of the x, y and z axes of the basin, in axes of the world
    BASIN_ARM     position of the origin of the basin from the point o (`body_layout`), in axes of the world [m]
    BASIN_LOAD    force [N] and torque about the origin of the basin [N m] of the water on the body for zero joint
                  accelerations (q'' = 0), in axes of the basin
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import TANK_OUT
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ARM,
    BIAS,
    SPIN_BIAS,
    SPIN_RATE,
    body_row,
    dot,
    freedom_path,
    freedom_velocity,
    nearest_free_body,
)

MOMENTS, EAST, NORTH, NORMAL, BASIN_ARM, BASIN_LOAD = 0, 6, 9, 12, 15, 18

__all__ = [
    "BASIN_ARM",
    "EAST",
    "BASIN_LOAD",
    "MOMENTS",
    "NORMAL",
    "NORTH",
    "TANK_OUT",
    "add_basin_inertia",
    "extra_basin_load",
]


@njit
def add_basin_inertia(out, tables):
    """Add the inertia of the water in all basins on bodies, J' N J for each basin, to the mass matrix in `scratch`.

    Basins on bodies that no degree of freedom moves are left out.
    J : coefficients of 1, x, y in the normal acceleration of the bed, a column for each degree of freedom
    N : matrix of the moments of mass of 1, x, y
    """
    work, freedoms, paths, n = tables.scratch, tables.freedoms, tables.integers, tables.freedoms.size
    for b in range(tables.basins.size):
        i, tank = nearest_free_body(tables, tables.basins[b]["body"]), tables.layout[0]["tank"] + TANK_OUT * b
        if i < 0:
            continue
        path, count = freedom_path(tables, i)
        for p in range(count):
            j = paths[path + p]
            row, (a, c, d) = 8 * n + freedoms[j]["row"], normal_accelerations(out, work, tank, 6 * j)
            m = tank + MOMENTS
            e = out[m] * a + out[m + 1] * c + out[m + 2] * d
            f = out[m + 1] * a + out[m + 3] * c + out[m + 4] * d
            g = out[m + 2] * a + out[m + 4] * c + out[m + 5] * d
            for q in range(p + 1):
                x, y, z = normal_accelerations(out, work, tank, 6 * paths[path + q])
                work[row + q] += e * x + f * y + g * z


@njit(forceinline=True)
def normal_accelerations(out, work, tank, s):
    """Normal velocity of the bed of a basin per unit rate of one degree of freedom, as coefficients of 1, x and y.

    They are also those of the normal acceleration per unit acceleration of that degree of freedom.
    tank : offset of the numbers of the basin in `out`
    s : offset in `work` of the angular velocity and the velocity at o per unit rate of that degree of freedom
    """
    wx, wy, wz = work[s], work[s + 1], work[s + 2]
    u, v, w = freedom_velocity(work, s, out[tank + BASIN_ARM], out[tank + BASIN_ARM + 1], out[tank + BASIN_ARM + 2])
    n, e, k = tank + NORMAL, tank + EAST, tank + NORTH
    return (
        out[n] * u + out[n + 1] * v + out[n + 2] * w,
        -(out[k] * wx + out[k + 1] * wy + out[k + 2] * wz),
        out[e] * wx + out[e + 1] * wy + out[e + 2] * wz,
    )


@njit
def extra_basin_load(out, tables, b):
    """Load of the water in basin b on its body due to the joint accelerations q'' alone, without the load for q'' = 0.

    Returns six numbers in axes of the world: force [N], torque about the origin of the body [N m].
    """
    here, tank = body_row(tables, tables.basins[b]["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    r = tank + BASIN_ARM
    x, y, z = out[r] - out[here + ARM], out[r + 1] - out[here + ARM + 1], out[r + 2] - out[here + ARM + 2]
    a, c, w, s = here + ACCELERATION, here + BIAS, here + SPIN_RATE, here + SPIN_BIAS
    p, q, u = out[w] - out[s], out[w + 1] - out[s + 1], out[w + 2] - out[s + 2]
    ax, ay, az = out[a] - out[c], out[a + 1] - out[c + 1], out[a + 2] - out[c + 2]
    ax, ay, az = ax + q * z - u * y, ay + u * x - p * z, az + p * y - q * x
    rises, north = dot(out, tank + NORMAL, ax, ay, az), -dot(out, tank + NORTH, p, q, u)
    east = dot(out, tank + EAST, p, q, u)
    m, n, e, k = tank + MOMENTS, tank + NORMAL, tank + EAST, tank + NORTH
    push = -(out[m] * rises + out[m + 1] * north + out[m + 2] * east)
    about_x = -(out[m + 2] * rises + out[m + 4] * north + out[m + 5] * east)
    about_y = out[m + 1] * rises + out[m + 3] * north + out[m + 4] * east
    fx, fy, fz = push * out[n], push * out[n + 1], push * out[n + 2]
    return (
        fx, fy, fz,
        about_x * out[e] + about_y * out[k] + (y * fz - z * fy),
        about_x * out[e + 1] + about_y * out[k + 1] + (z * fx - x * fz),
        about_x * out[e + 2] + about_y * out[k + 2] + (x * fy - y * fx),
    )  # fmt: skip
