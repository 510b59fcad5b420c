"""Probe values of bodies and of their points, computed from the data of bodies in `out` (`body_layout`).

A quantity is given by its index in `BODY_QUANTITIES` or `POINT_QUANTITIES`; vectors are in axes of the world. Equation
numbers in brackets are those of docs/course.md. here : offset of the data of a body in `out`.
"""

from math import atan2, cos, hypot, sin, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import BODY_VALUE, FREE, POINT_VALUE, PRISMATIC, SURFACE_VALUE
from fvsolve.kernels.mechanism.basin_inertia import extra_basin_load
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ATTITUDE,
    FORCE,
    POSITION,
    SPIN,
    SPIN_RATE,
    TORQUE,
    VELOCITY,
    body_row,
    cross,
    dot,
    rotate,
)
from fvsolve.kernels.mechanism.force_elements import point_at
from fvsolve.kernels.mechanism.joints import centre_of, joint_coordinate, joint_parameters
from fvsolve.kernels.table_handle import open_tables

BODY_QUANTITIES = (
    "x", "y", "z", "roll", "pitch", "yaw", "eta", "eps_x", "eps_y", "eps_z", "vx", "vy", "vz", "wx", "wy", "wz",
    "ax", "ay", "az", "angle", "rate", "joint_fx", "joint_fy", "joint_fz", "joint_tx", "joint_ty", "joint_tz",
    "kinetic_energy", "momentum_x", "momentum_y", "momentum_z", "angular_momentum_x", "angular_momentum_y",
    "angular_momentum_z",
)  # fmt: skip
LEAST_COSINE = 1e-12  # cosine of pitch below which roll and yaw rotate about the same axis
ACCELERATION_PARTS = ("", "_relative", "_coriolis", "_transversal", "_centripetal")  # terms of an acceleration, (65)
POINT_QUANTITIES = (
    *"xyz", "vx", "vy", "vz", *(f"a{axis}{share}" for share in ACCELERATION_PARTS for axis in "xyz"),
)  # fmt: skip


@njit
def angular_momentum(body, out, here):
    """Angular momentum J w of a body about its centre of mass [kg m2/s], (68) of docs/course.md.

    J : inertia, w : angular velocity; here : offset of the body in `out`
    """
    r, w = here + ATTITUDE, here + SPIN
    return inertia_product(body["inertia"], out, r, out[w], out[w + 1], out[w + 2])


@njit
def inertia_product(own, out, r, x, y, z):
    """Product R J R' (x, y, z); J : inertia matrix `own` in axes of a body, by rows; R : rotation matrix at out[r]."""
    a, b, c = (
        out[r] * x + out[r + 3] * y + out[r + 6] * z,
        out[r + 1] * x + out[r + 4] * y + out[r + 7] * z,
        out[r + 2] * x + out[r + 5] * y + out[r + 8] * z,
    )
    p, q, s = dot(own, 0, a, b, c), dot(own, 3, a, b, c), dot(own, 6, a, b, c)
    return dot(out, r, p, q, s), dot(out, r + 3, p, q, s), dot(out, r + 6, p, q, s)


@njit
def kinetic_energy(body, out, here):
    """Kinetic energy of a body, m v^2 / 2 + w . J w / 2 [J].

    m : mass, v : velocity of the centre of mass, w : angular velocity, J : inertia about the centre of mass
    """
    _, _, _, u, v, w = centre_of(body, out, here)
    x, y, z = angular_momentum(body, out, here)
    return 0.5 * (body["mass"] * (u * u + v * v + w * w) + dot(out, here + SPIN, x, y, z))


@njit
def acceleration_at(out, here, at, x, y, z):
    """Acceleration of a point fixed in a body [m/s2], (65) of docs/course.md.

    (x, y, z) : position of the point from the origin of the body, in axes of the world
    here : offset of the body in `out`; at : index in `out` of the acceleration of its origin
    """
    a, b, c = cross(out, here + SPIN_RATE, x, y, z)
    u, v, w = cross(out, here + SPIN, x, y, z)
    p, q, r = cross(out, here + SPIN, u, v, w)
    return out[at] + a + p, out[at + 1] + b + q, out[at + 2] + c + r


@njit
def joint_load(out, tables, i):
    """Force [N] and torque [N m] of the joint of body i on that body, six numbers in axes of the world.

    The torque is about the origin of the body. Both follow from the equations of Newton and Euler, (68) of
    docs/course.md,
    of body i and of all bodies that it carries, with the loads of the water in basins on them.
    """
    bodies, first = tables.bodies, body_row(tables, i)
    fx = fy = fz = tx = ty = tz = 0.0
    for j in range(i, bodies.size):
        k = j
        while k > i:
            k = bodies[k]["parent"]
        if k != i:
            continue
        body, here = bodies[j], body_row(tables, j)
        dx, dy, dz = (
            out[here + POSITION] - out[first + POSITION],
            out[here + POSITION + 1] - out[first + POSITION + 1],
            out[here + POSITION + 2] - out[first + POSITION + 2],
        )
        x, y, z, _, _, _ = centre_of(body, out, here)
        a, b, c = acceleration_at(out, here, here + ACCELERATION, x, y, z)
        a, b, c = body["mass"] * a, body["mass"] * b, body["mass"] * c
        s, r, t = here + SPIN_RATE, here + ATTITUDE, here + TORQUE
        lx, ly, lz = inertia_product(body["inertia"], out, r, out[s], out[s + 1], out[s + 2])
        hx, hy, hz = cross(out, here + SPIN, *angular_momentum(body, out, here))
        f, g, h = out[here + FORCE], out[here + FORCE + 1], out[here + FORCE + 2]
        fx, fy, fz = fx + a - f, fy + b - g, fz + c - h
        x, y, z = x + dx, y + dy, z + dz
        tx += lx + hx + (y * c - z * b) - out[t] - (dy * h - dz * g)
        ty += ly + hy + (z * a - x * c) - out[t + 1] - (dz * f - dx * h)
        tz += lz + hz + (x * b - y * a) - out[t + 2] - (dx * g - dy * f)
        for k in range(tables.basins.size):
            if tables.basins[k]["body"] == j and tables.basins[k]["loads_body"] == 1:
                f, g, h, p, q, s = extra_basin_load(out, tables, k)
                fx, fy, fz = fx - f, fy - g, fz - h
                tx, ty, tz = tx - p - (dy * h - dz * g), ty - q - (dz * f - dx * h), tz - s - (dx * g - dy * f)
    return fx, fy, fz, tx, ty, tz


@njit
def roll_pitch_yaw(out, r):
    """Angles (roll, pitch, yaw) [rad] of the rotation matrix R at out[r], R = R_z(yaw) R_y(pitch) R_x(roll).

    This is (40) of docs/course.md. Roll is computed from R_z(-yaw) R. So the angles give R also near a pitch of 90
    degrees, where the entries of R that give roll and yaw vanish. There only the sum or difference of roll and yaw is
    defined: yaw is set to 0, as in `fvsolve.attitude`.
    """
    level = hypot(out[r], out[r + 3])  # cos(pitch)
    yaw = atan2(out[r + 3], out[r]) if level > LEAST_COSINE else 0.0
    c, s = cos(yaw), sin(yaw)
    roll = atan2(s * out[r + 2] - c * out[r + 5], c * out[r + 4] - s * out[r + 1])
    return roll, atan2(-out[r + 6], level), yaw


@njit
def euler_parameters(body, y, out, here):
    """Normalised Euler parameters (eta, eps_x, eps_y, eps_z) of the attitude of a body, (44) of docs/course.md.

    For a free body they are read from the states; for other bodies they are computed from R, with eta >= 0.
    here : offset of the body in `out`
    """
    if body["joint"] == FREE:
        h, a, b, c = joint_parameters(body, 3, y)
        size = sqrt(h * h + a * a + b * b + c * c)
        return h / size, a / size, b / size, c / size
    r = here + ATTITUDE
    xx, yy, zz = out[r], out[r + 4], out[r + 8]
    x, y0, z = out[r + 7] - out[r + 5], out[r + 2] - out[r + 6], out[r + 3] - out[r + 1]
    p, q, s = out[r + 1] + out[r + 3], out[r + 2] + out[r + 6], out[r + 5] + out[r + 7]
    h, a, b, c = 1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz  # 4 e^2
    greatest = max(max(h, a), max(b, c))
    if greatest == h:
        a, b, c = x, y0, z
    elif greatest == a:
        h, b, c = x, p, q
    elif greatest == b:
        h, a, c = y0, p, s
    else:
        h, a, b = z, q, s
    size = sqrt(h * h + a * a + b * b + c * c)
    if h < 0.0:
        size = -size
    return h / size, a / size, b / size, c / size


@njit
def body_value(t, y, out, tables, i, number):
    """Value of a quantity of body i in SI; number : index of the quantity in `BODY_QUANTITIES`.

    Angle or travel and rate of a joint without a single axis are 0. Angular momentum is about the origin of the world.
    """
    body, here = tables.bodies[i], body_row(tables, i)
    if number < 3:
        return out[here + POSITION + number]
    if number < 6:
        return roll_pitch_yaw(out, here + ATTITUDE)[number - 3]
    if number < 10:
        return euler_parameters(body, y, out, here)[number - 6]
    if number < 13:
        return out[here + VELOCITY + number - 10]
    if number < 16:
        return out[here + SPIN + number - 13]
    if number < 19:
        return out[here + ACCELERATION + number - 16]
    if number < 21:
        return joint_coordinate(body, t, y, tables)[number - 19] if body["joint"] <= PRISMATIC else 0.0
    if number < 27:
        return joint_load(out, tables, i)[number - 21]
    if number == 27:
        return kinetic_energy(body, out, here)
    x, y0, z, u, v, w = centre_of(body, out, here)
    u, v, w = body["mass"] * u, body["mass"] * v, body["mass"] * w
    if number < 31:
        return (u, v, w)[number - 28]
    lx, ly, lz = angular_momentum(body, out, here)
    x, y0, z = x + out[here + POSITION], y0 + out[here + POSITION + 1], z + out[here + POSITION + 2]
    return (lx + y0 * w - z * v, ly + z * u - x * w, lz + x * v - y0 * u)[number - 31]


@njit
def point_value(out, tables, k, number):
    """Value of a quantity of point k in SI; number : index of the quantity in `POINT_QUANTITIES`.

    Accelerations of a point of the world are 0. The parts of the acceleration are the terms of (65) of docs/course.md,
    relative to the axes of the parent of the body that contains the point. With the acceleration of the origin of the
    parent they add up to the acceleration of the point. If that body is joined to the world, its own axes replace those
    of
    a parent.
    """
    moved = point_at(out, tables, k, POSITION)
    if number < 6:
        return moved[number]
    i = tables.points[k]["body"]
    if i < 0:
        return 0.0
    here = body_row(tables, i)
    x, y, z = rotate(out, here + ATTITUDE, tables.points[k]["place"], 0)
    acceleration = acceleration_at(out, here, here + ACCELERATION, x, y, z)
    axis, share = (number - 6) % 3, (number - 6) // 3
    if share == 0:
        return acceleration[axis]
    b = body_row(tables, tables.bodies[i]["parent"]) if tables.bodies[i]["parent"] >= 0 else here
    x, y, z = moved[0] - out[b + POSITION], moved[1] - out[b + POSITION + 1], moved[2] - out[b + POSITION + 2]
    dragged = cross(out, b + SPIN, x, y, z)
    u, v, w = (
        moved[3] - out[b + VELOCITY] - dragged[0],
        moved[4] - out[b + VELOCITY + 1] - dragged[1],
        moved[5] - out[b + VELOCITY + 2] - dragged[2],
    )
    coriolis, transversal = cross(out, b + SPIN, 2.0 * u, 2.0 * v, 2.0 * w), cross(out, b + SPIN_RATE, x, y, z)
    centripetal = cross(out, b + SPIN, dragged[0], dragged[1], dragged[2])
    if share == 2:
        return coriolis[axis]
    if share == 3:
        return transversal[axis]
    if share == 4:
        return centripetal[axis]
    rest = transversal[axis] + centripetal[axis] + coriolis[axis]
    return acceleration[axis] - out[b + ACCELERATION + axis] - rest if b != here else 0.0


@njit
def surface_value(y, tables, probe):
    """Water depth of a sloshing model [m]: depth at rest plus the weighted displacements of its modal masses."""
    depth = probe["offset"]
    for k in range(probe["count"]):
        body = tables.bodies[tables.integers[probe["cell"] + k]]
        depth += tables.floats[probe["weights"] + k] * (body["start"][0] + y[body["y"]])
    return depth


@njit
def observe_bodies(t, y, out, handle, values):
    """Write the values of the probes of bodies, their points, and water surfaces of sloshing models to `values`."""
    tables = open_tables(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == BODY_VALUE:
            values[k] = body_value(t, y, out, tables, probes[k]["index"], probes[k]["side"])
        elif probes[k]["kind"] == POINT_VALUE:
            values[k] = point_value(out, tables, probes[k]["index"], probes[k]["side"])
        elif probes[k]["kind"] == SURFACE_VALUE:
            values[k] = surface_value(y, tables, probes[k])
