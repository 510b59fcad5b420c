"""Bushings: springs with dampers between two points `from` and `to` of bodies, for displacement and for rotation.

Imported only for cases that have bushings. The force opposes the gap rho, the position of `to` minus that of `from`,
and its rate. The torque opposes the deviation of attitudes R~ = R R_d' (equation (56) of docs/course.md) and the
relative angular velocity. R is the attitude of the body of `to` in axes of the body of `from`, and R_d is R at the
attitudes that the case states; an equilibrium start may deviate from it. With the Euler parameters eta and eps of R~,
the torque is proportional to 2 eta eps, the vector of the skew part of R~; eps . eps = (3 - trace R~) / 4. The force
acts on both bodies at the point `to`, so its power is force times d(rho)/dt.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import BUSHING_VALUE, RATE
from fvsolve.kernels.energy_rows import BUSHING_ROWS, bushing_power_row, bushing_stored_row
from fvsolve.kernels.mechanism.body_layout import (
    ATTITUDE,
    POSITION,
    SPIN,
    VELOCITY,
    add_force,
    add_torque,
    body_row,
    cross,
)
from fvsolve.kernels.mechanism.force_elements import point_at, spin_of
from fvsolve.kernels.mechanism.mass_matrix import add_body_force, add_body_wrench, mobility
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def attitude_entry(out, tables, i, r, c):
    """Entry (r, c) of the rotation matrix of body i; for the world (i < 0) of the identity."""
    if i < 0:
        return 1.0 if r == c else 0.0
    return out[body_row(tables, i) + ATTITUDE + 3 * r + c]


@njit
def gap_of(out, tables, bushing):
    """Gap of a bushing and its rate, six numbers in axes of the world.

    The gap is the position of `to` minus that of `from` [m]. The rate is the velocity of `to` relative to the axes of
    the body of `from` [m/s].
    """
    i = tables.points[bushing["from_point"]]["body"]
    x, y, z, u, v, w = point_at(out, tables, bushing["to_point"], POSITION)
    p, q, s, _, _, _ = point_at(out, tables, bushing["from_point"], POSITION)
    if i >= 0:
        here = body_row(tables, i)
        a, b, c = cross(
            out, here + SPIN, x - out[here + POSITION], y - out[here + POSITION + 1], z - out[here + POSITION + 2]
        )
        k = here + VELOCITY
        u, v, w = u - out[k] - a, v - out[k + 1] - b, w - out[k + 2] - c
    return x - p, y - q, z - s, u, v, w


@njit
def deviation(out, tables, bushing, r, c):
    """Entry (r, c) of the deviation of attitudes R_to R_d' R_from' of a bushing, in axes of the world.

    R_to, R_from : attitudes of both bodies
    R_d : attitude of the body of `to` in axes of the body of `from` that the case states, without torque
    """
    i, j = tables.points[bushing["from_point"]]["body"], tables.points[bushing["to_point"]]["body"]
    total = 0.0
    for k in range(3):
        for m in range(3):
            total += (
                attitude_entry(out, tables, j, r, k)
                * bushing["attitude"][3 * m + k]
                * attitude_entry(out, tables, i, c, m)
            )
    return total


@njit
def rotation_deviation(out, tables, bushing):
    """Deviation of the relative attitude of the bodies of a bushing from R_d (see `deviation`), as seven numbers.

    They are, in axes of the world, 2 eta eps (3 numbers), the relative angular velocity [rad/s] (3 numbers), and
    eps . eps, with the Euler parameters (eta, eps) of the deviation.
    """
    x = 0.5 * (deviation(out, tables, bushing, 2, 1) - deviation(out, tables, bushing, 1, 2))
    y = 0.5 * (deviation(out, tables, bushing, 0, 2) - deviation(out, tables, bushing, 2, 0))
    z = 0.5 * (deviation(out, tables, bushing, 1, 0) - deviation(out, tables, bushing, 0, 1))
    trace = deviation(out, tables, bushing, 0, 0) + deviation(out, tables, bushing, 1, 1)
    trace += deviation(out, tables, bushing, 2, 2)
    a, b, c = spin_of(out, tables, bushing["from_point"])
    u, v, w = spin_of(out, tables, bushing["to_point"])
    return x, y, z, u - a, v - b, w - c, 0.25 * (3.0 - trace)


@njit
def bushing_loads(out, tables, bushing):
    """Force [N] and torque [N m] of a bushing on the body of `to`, six numbers in axes of the world."""
    x, y, z, u, v, w = gap_of(out, tables, bushing)
    a, b, c, p, q, s, _ = rotation_deviation(out, tables, bushing)
    k, d, h, e = bushing["stiffness"], bushing["damping"], bushing["turn_stiffness"], bushing["turn_damping"]
    return -k * x - d * u, -k * y - d * v, -k * z - d * w, -h * a - e * p, -h * b - e * q, -h * c - e * s


@njit
def add_bushing_loads(t, y, dydt, out, handle):
    """Add the forces and torques of all bushings to their bodies."""
    tables = open_tables(handle)
    bushings = tables.bushings
    for k in range(bushings.size):
        fx, fy, fz, tx, ty, tz = bushing_loads(out, tables, bushings[k])
        px, py, pz, _, _, _ = point_at(out, tables, bushings[k]["to_point"], POSITION)
        for end, sign in ((bushings[k]["to_point"], 1.0), (bushings[k]["from_point"], -1.0)):
            i = tables.points[end]["body"]
            if i >= 0:
                here = body_row(tables, i)
                rx, ry, rz = px - out[here + POSITION], py - out[here + POSITION + 1], pz - out[here + POSITION + 2]
                add_force(out, here, rx, ry, rz, sign * fx, sign * fy, sign * fz)
                add_torque(out, here, sign * tx, sign * ty, sign * tz)


@njit
def bushing_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], to the bound of `mass_matrix.body_rate_limit` for bushings.

    The factored mass matrix must be in `scratch`.
    """
    tables = open_tables(handle)
    bushings, work, n = tables.bushings, tables.scratch, tables.freedoms.size
    stiffness, damping = 0.0, 0.0
    for k in range(bushings.size):
        bushing = bushings[k]
        i, j = tables.points[bushing["from_point"]]["body"], tables.points[bushing["to_point"]]["body"]
        px, py, pz, _, _, _ = point_at(out, tables, bushing["to_point"], POSITION)
        for axis in range(6):
            x, y0, z = 1.0 * (axis % 3 == 0), 1.0 * (axis % 3 == 1), 1.0 * (axis % 3 == 2)
            for m in range(n):
                work[7 * n + m] = 0.0
            if axis < 3:
                add_body_force(out, tables, j, px, py, pz, x, y0, z, 7 * n)
                add_body_force(out, tables, i, px, py, pz, -x, -y0, -z, 7 * n)
            else:
                add_body_wrench(tables, j, x, y0, z, 0.0, 0.0, 0.0, 7 * n)
                add_body_wrench(tables, i, -x, -y0, -z, 0.0, 0.0, 0.0, 7 * n)
            inverse_mass = mobility(tables, 7 * n)
            stiffness += inverse_mass * (bushing["stiffness"] if axis < 3 else bushing["turn_stiffness"])
            damping += inverse_mass * (bushing["damping"] if axis < 3 else bushing["turn_damping"])
    out[RATE] = max(out[RATE], 0.5 * damping + sqrt(0.25 * damping * damping + stiffness))


@njit
def observe_bushings(t, y, out, handle, values):
    """Write probe values of bushings: magnitude of gap [m], force [N] or torque [N m]."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == BUSHING_VALUE:
            bushing = tables.bushings[probes[k]["index"]]
            x, y0, z, _, _, _ = gap_of(out, tables, bushing)
            fx, fy, fz, tx, ty, tz = bushing_loads(out, tables, bushing)
            if probes[k]["side"] == 1:
                x, y0, z = fx, fy, fz
            elif probes[k]["side"] == 2:
                x, y0, z = tx, ty, tz
            values[k] = sqrt(x * x + y0 * y0 + z * z)


@njit
def power_bushings(t, y, dydt, out, handle, power):
    """Write two entries of `power` for each bushing [W]: rate of stored energy, dissipated power."""
    tables = open_tables(handle)
    at = bushing_power_row(tables, power)
    for k in range(tables.bushings.size):
        bushing = tables.bushings[k]
        x, y0, z, u, v, w = gap_of(out, tables, bushing)
        a, b, c, p, q, s, _ = rotation_deviation(out, tables, bushing)
        power[at] = bushing["stiffness"] * (x * u + y0 * v + z * w)
        power[at] += bushing["turn_stiffness"] * (a * p + b * q + c * s)
        power[at + 1] = bushing["damping"] * (u * u + v * v + w * w)
        power[at + 1] += bushing["turn_damping"] * (p * p + q * q + s * s)
        at += BUSHING_ROWS


@njit
def stored_bushings(t, y, dydt, out, handle, stored):
    """Write an entry of `stored` for each bushing [J]: change since the start of k gap^2 / 2 + 2 k_turn eps . eps.

    k [N/m], k_turn [N m/rad] : stiffnesses of the bushing; eps : vector of the Euler parameters of its rotation
    """
    tables = open_tables(handle)
    at = bushing_stored_row(tables, stored)
    for k in range(tables.bushings.size):
        bushing = tables.bushings[k]
        x, y0, z, _, _, _ = gap_of(out, tables, bushing)
        eps = rotation_deviation(out, tables, bushing)[6]
        own = 0.5 * bushing["stiffness"] * (x * x + y0 * y0 + z * z) + 2.0 * bushing["turn_stiffness"] * eps
        stored[at + k] = own - bushing["energy"]
