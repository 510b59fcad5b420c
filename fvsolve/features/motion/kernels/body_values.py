"""Probe values, power and stored energy of bodies, their joints and points, from the data of bodies in `out`.

A quantity is given by its index in `BODY_QUANTITIES` or `POINT_QUANTITIES`; vectors are in axes of the world. Equation
numbers in brackets are those of docs/course.md.

`power` has three entries for each body [W], before those of devices: rate of the stored energy, power
dissipated by the damping of the joint, power supplied by a driven joint. `stored` has one entry for each body [J], the
change since the start of kinetic energy + m g z + k s^2 / 2. m : mass, z : height of the centre of mass, k : stiffness
of the joint, s : its coordinate.
"""

from math import atan2, cos, hypot, sin, sqrt

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import BODY_VALUE, POINT_VALUE, SURFACE_VALUE, TANK_OUT
from fvsolve.core.kernels.energy_rows import device_power_row, device_stored_row
from fvsolve.core.kernels.moving_frames import body_row
from fvsolve.core.kernels.vectors import (
    cross,
    dot,
    minus,
    plus,
    rotate,
    rotate_back,
    scalar_product,
    scaled,
    vector,
    vector_product,
)
from fvsolve.features.motion.kernels.body_kinematics import (
    centre_of,
    joint_coordinate,
    joint_parameters,
    point_at,
)
from fvsolve.features.motion.kernels.tables import FREE, PRISMATIC, open_motion
from fvsolve.jit import njit

BODY_ROWS = 3  # rows of `power` for each body
BODY_QUANTITIES = (
    "x",
    "y",
    "z",
    "roll",
    "pitch",
    "yaw",
    "eta",
    "eps_x",
    "eps_y",
    "eps_z",
    "vx",
    "vy",
    "vz",
    "wx",
    "wy",
    "wz",
    "ax",
    "ay",
    "az",
    "angle",
    "rate",
    "joint_fx",
    "joint_fy",
    "joint_fz",
    "joint_tx",
    "joint_ty",
    "joint_tz",
    "kinetic_energy",
    "momentum_x",
    "momentum_y",
    "momentum_z",
    "angular_momentum_x",
    "angular_momentum_y",
    "angular_momentum_z",
)
LEAST_COSINE = 1e-12  # cosine of pitch below which roll and yaw rotate about the same axis
# terms of an acceleration, (65)
ACCELERATION_PARTS = ("", "_relative", "_coriolis", "_transversal", "_centripetal")
POINT_QUANTITIES = (
    *"xyz",
    "vx",
    "vy",
    "vz",
    *(f"a{axis}{share}" for share in ACCELERATION_PARTS for axis in "xyz"),
)


@njit
def angular_momentum(body, out, here):
    """Angular momentum J w of a body about its centre of mass [kg m2/s], (68) of docs/course.md.

    J : inertia, w : angular velocity
    """
    return inertia_product(
        body["inertia"], out, here + layout.ATTITUDE, *vector(out, here + layout.SPIN)
    )


@njit
def inertia_product(own, out, r, x, y, z):
    """Product R J R' (x, y, z); J : inertia matrix `own` in axes of a body, by rows; R : rotation matrix at out[r]."""
    return rotate(out, r, rotate(own, 0, rotate_back(out, r, x, y, z), 0), 0)


@njit
def kinetic_energy(body, out, here):
    """Kinetic energy of a body, m v^2 / 2 + w . J w / 2 [J].

    m : mass, v : velocity of the centre of mass, w : angular velocity, J : inertia about the centre of mass
    """
    v = centre_of(body, out, here)[3:]
    return 0.5 * (
        body["mass"] * scalar_product(v, v)
        + dot(out, here + layout.SPIN, *angular_momentum(body, out, here))
    )


@njit
def acceleration_at(out, here, at, x, y, z):
    """Acceleration of a point fixed in a body [m/s2], (65) of docs/course.md.

    (x, y, z) : position of the point from the origin of the body, in axes of the world
    at : index in `out` of the acceleration of its origin
    """
    turning = cross(out, here + layout.SPIN, *cross(out, here + layout.SPIN, x, y, z))
    return plus(plus(vector(out, at), cross(out, here + layout.SPIN_RATE, x, y, z)), turning)


@njit
def joint_load(out, tables, i):
    """Force [N] and torque [N m] of the joint of body i on that body, six numbers in axes of the world.

    The torque is about the origin of the body. Both follow from the equations of Newton and Euler, (68) of
    docs/course.md, of body i and of all bodies that it carries, with the loads of the water in basins on them.
    """
    bodies, first = tables.bodies, body_row(tables, i)
    force = torque = (0.0, 0.0, 0.0)
    for j in range(i, bodies.size):
        k = j
        # Parents have lower numbers, so that the way up meets i exactly for the bodies that it carries.
        while k > i:
            k = bodies[k]["parent"]
        if k != i:
            continue
        body, here = bodies[j], body_row(tables, j)
        offset = minus(vector(out, here + layout.POSITION), vector(out, first + layout.POSITION))
        centre, applied = centre_of(body, out, here)[:3], vector(out, here + layout.FORCE)
        # Newton for the force, Euler for the torque J alpha + w x J w, then both moved to the origin.
        push = scaled(body["mass"], acceleration_at(out, here, here + layout.ACCELERATION, *centre))
        turn = inertia_product(
            body["inertia"], out, here + layout.ATTITUDE, *vector(out, here + layout.SPIN_RATE)
        )
        turn = plus(turn, cross(out, here + layout.SPIN, *angular_momentum(body, out, here)))
        turn = minus(
            plus(turn, vector_product(plus(centre, offset), push)),
            vector(out, here + layout.TORQUE),
        )
        # The joint supplies what the other loads on the bodies do not.
        force = minus(plus(force, push), applied)
        torque = plus(torque, minus(turn, vector_product(offset, applied)))
        # FORCE contains the water of a basin for q'' = 0; here follows its part due to q''.
        for k in range(tables.tanks.size):
            if tables.tanks[k]["body"] == j and tables.tanks[k]["loads_body"] == 1:
                load = extra_basin_load(out, tables, k)
                force = minus(force, load[:3])
                torque = minus(minus(torque, load[3:]), vector_product(offset, load[:3]))
    return force + torque


@njit
def extra_basin_load(out, tables, b):
    """Load of the water in basin b on its body due to the joint accelerations q'' alone, without the load for q'' = 0.

    Returns six numbers in axes of the world: force [N], torque about the origin of the body [N m].
    """
    here, tank = body_row(tables, tables.tanks[b]["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    arm = minus(vector(out, tank + layout.BASIN_ARM), vector(out, here + layout.ARM))
    # Only the part of the motion that q'' causes: total minus bias.
    spin = minus(vector(out, here + layout.SPIN_RATE), vector(out, here + layout.SPIN_BIAS))
    (x, y, z), (p, q, u) = arm, spin
    ax, ay, az = minus(vector(out, here + layout.ACCELERATION), vector(out, here + layout.BIAS))
    # Normal acceleration of the bed as coefficients of 1, x and y, times the moments of mass.
    rises = dot(
        out, tank + layout.NORMAL, ax + q * z - u * y, ay + u * x - p * z, az + p * y - q * x
    )
    north, east = -dot(out, tank + layout.NORTH, *spin), dot(out, tank + layout.EAST, *spin)
    m = tank + layout.MOMENTS
    push = -(out[m] * rises + out[m + 1] * north + out[m + 2] * east)
    about_x = -(out[m + 2] * rises + out[m + 4] * north + out[m + 5] * east)
    about_y = out[m + 1] * rises + out[m + 3] * north + out[m + 4] * east
    force = scaled(push, vector(out, tank + layout.NORMAL))
    torque = plus(
        scaled(about_x, vector(out, tank + layout.EAST)),
        scaled(about_y, vector(out, tank + layout.NORTH)),
    )
    return force + plus(torque, vector_product(arm, force))


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
    """
    if body["joint"] == FREE:
        h, a, b, c = joint_parameters(body, 3, y)
        size = sqrt(h * h + a * a + b * b + c * c)
        return h / size, a / size, b / size, c / size
    r = here + layout.ATTITUDE
    # Entries of R give 4 eta eps by differences, 4 eps_i eps_j by sums, 4 e^2 by the diagonal.
    xx = out[r]
    yy = out[r + 4]
    zz = out[r + 8]
    x = out[r + 7] - out[r + 5]
    y0 = out[r + 2] - out[r + 6]
    z = out[r + 3] - out[r + 1]
    p = out[r + 1] + out[r + 3]
    q = out[r + 2] + out[r + 6]
    s = out[r + 5] + out[r + 7]
    # 4 e^2
    h = 1.0 + xx + yy + zz
    a = 1.0 + xx - yy - zz
    b = 1.0 - xx + yy - zz
    c = 1.0 - xx - yy + zz
    # Division by the greatest parameter: a small one would lose digits.
    greatest = max(max(h, a), max(b, c))
    if greatest == h:
        a = x
        b = y0
        c = z
    elif greatest == a:
        h = x
        b = p
        c = q
    elif greatest == b:
        h = y0
        a = p
        c = s
    else:
        h = z
        a = q
        b = s
    size = sqrt(h * h + a * a + b * b + c * c)
    # Both signs denote the same attitude.
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
        return out[here + layout.POSITION + number]
    if number < 6:
        return roll_pitch_yaw(out, here + layout.ATTITUDE)[number - 3]
    if number < 10:
        return euler_parameters(body, y, out, here)[number - 6]
    if number < 13:
        return out[here + layout.VELOCITY + number - 10]
    if number < 16:
        return out[here + layout.SPIN + number - 13]
    if number < 19:
        return out[here + layout.ACCELERATION + number - 16]
    if number < 21:
        return (
            joint_coordinate(body, t, y, tables)[number - 19] if body["joint"] <= PRISMATIC else 0.0
        )
    if number < 27:
        return joint_load(out, tables, i)[number - 21]
    if number == 27:
        return kinetic_energy(body, out, here)
    motion = centre_of(body, out, here)
    momentum = scaled(body["mass"], motion[3:])
    if number < 31:
        return momentum[number - 28]
    # r x m v is added to the angular momentum about the centre of mass.
    p, q, s = plus(motion[:3], vector(out, here + layout.POSITION))
    lx, ly, lz = angular_momentum(body, out, here)
    u, v, w = momentum
    return (lx + q * w - s * v, ly + s * u - p * w, lz + p * v - q * u)[number - 31]


@njit
def point_value(out, tables, k, number):
    """Value of a quantity of point k in SI; number : index of the quantity in `POINT_QUANTITIES`.

    Accelerations of a point of the world are 0. The parts of the acceleration are the terms of (65) of docs/course.md,
    relative to the axes of the parent of the body that contains the point. With the acceleration of the origin of the
    parent they add up to the acceleration of the point. If that body is joined to the world, its own axes replace those
    of a parent.
    """
    moved = point_at(out, tables, k, layout.POSITION)
    if number < 6:
        return moved[number]
    i = tables.points[k]["body"]
    if i < 0:
        return 0.0
    here = body_row(tables, i)
    place = rotate(out, here + layout.ATTITUDE, tables.points[k]["place"], 0)
    acceleration = acceleration_at(out, here, here + layout.ACCELERATION, *place)
    axis, share = (number - 6) % 3, (number - 6) // 3
    if share == 0:
        return acceleration[axis]
    b = body_row(tables, tables.bodies[i]["parent"]) if tables.bodies[i]["parent"] >= 0 else here
    arm = minus(moved, vector(out, b + layout.POSITION))
    dragged = cross(out, b + layout.SPIN, *arm)
    # Velocity in the turning axes of the parent, of which Coriolis is twice the spin times it.
    velocity = minus(minus(moved[3:], vector(out, b + layout.VELOCITY)), dragged)
    coriolis = cross(out, b + layout.SPIN, *scaled(2.0, velocity))
    transversal = cross(out, b + layout.SPIN_RATE, *arm)
    centripetal = cross(out, b + layout.SPIN, *dragged)
    if share == 2:
        return coriolis[axis]
    if share == 3:
        return transversal[axis]
    if share == 4:
        return centripetal[axis]
    # The relative acceleration is what the other terms leave.
    rest = transversal[axis] + centripetal[axis] + coriolis[axis]
    return acceleration[axis] - out[b + layout.ACCELERATION + axis] - rest if b != here else 0.0


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
    tables = open_motion(handle)
    probes = tables.probes
    for k in range(probes.size):
        if probes[k]["kind"] == BODY_VALUE:
            values[k] = body_value(t, y, out, tables, probes[k]["index"], probes[k]["side"])
        elif probes[k]["kind"] == POINT_VALUE:
            values[k] = point_value(out, tables, probes[k]["index"], probes[k]["side"])
        elif probes[k]["kind"] == SURFACE_VALUE:
            values[k] = surface_value(y, tables, probes[k])


# energy ----------


@njit
def body_energy_rate(body, out, here, gravity):
    """Rate of the kinetic and potential energy of a body [W]: m v . a + w . J alpha + m g v_z.

    m : mass; v, a : velocity and acceleration of the centre of mass; w, alpha : angular velocity and acceleration
    J : inertia about the centre of mass
    """
    x, y, z, u, v, w = centre_of(body, out, here)
    a, b, c = acceleration_at(out, here, here + layout.ACCELERATION, x, y, z)
    turn = inertia_product(
        body["inertia"], out, here + layout.ATTITUDE, *vector(out, here + layout.SPIN_RATE)
    )
    return body["mass"] * (u * a + v * b + w * (c + gravity)) + dot(out, here + layout.SPIN, *turn)


@njit
def joint_spring_energy(body, y):
    """(change of the energy of the spring of a joint since the start [J], its rate [W]), for a joint with one axis."""
    s, far = body["start"][0], y[body["y"]]
    # k ((s + far)^2 - s^2) / 2 as a product: no difference of squares.
    return (
        body["stiffness"] * far * (s + 0.5 * far),
        body["stiffness"] * (s + far) * (body["speed"][0] + y[body["rate"]]),
    )


@njit
def joint_drive_power(t, y, out, tables, i):
    """Power that the drive of the joint of body i supplies [W]: load of the joint along its axis times its rate."""
    body = tables.bodies[i]
    axis = rotate(out, body_row(tables, i) + layout.ATTITUDE, body["axis"], 0)
    load = joint_load(out, tables, i)
    along = scalar_product(load[:3] if body["joint"] == PRISMATIC else load[3:], axis)
    return joint_coordinate(body, t, y, tables)[1] * along


@njit
def joint_damping_power(body, y):
    """Power dissipated by the damping of a joint [W]; for a free body only its rotation is damped."""
    total, first = 0.0, 3 if body["joint"] == FREE else 0
    for k in range(first, body["freedoms"]):
        rate = body["speed"][k] + y[body["rate"] + k]
        total += body["damping"] * rate * rate
    return total


@njit
def power_bodies(t, y, dydt, out, handle, power):
    """Write three powers of each body to `power` [W]: rate of stored energy, joint damping, joint drive."""
    tables = open_motion(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = device_power_row(tables, power) - BODY_ROWS * tables.bodies.size
    for i in range(bodies.size):
        power[at] = body_energy_rate(bodies[i], out, body_row(tables, i), gravity)
        if bodies[i]["stiffness"] > 0.0:
            power[at] += joint_spring_energy(bodies[i], y)[1]
        power[at + 1] = joint_damping_power(bodies[i], y) if bodies[i]["damping"] > 0.0 else 0.0
        power[at + 2] = (
            joint_drive_power(t, y, out, tables, i) if bodies[i]["schedule"] >= 0 else 0.0
        )
        at += BODY_ROWS


@njit
def stored_bodies(t, y, dydt, out, handle, stored):
    """Write the change of kinetic, potential and spring energy of each body since the start [J] to `stored`."""
    tables = open_motion(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    at = device_stored_row(tables, stored) - tables.bodies.size
    for i in range(bodies.size):
        body, here = bodies[i], body_row(tables, i)
        z = out[here + layout.POSITION + 2] + centre_of(body, out, here)[2]
        stored[at + i] = (
            kinetic_energy(body, out, here)
            - body["energy"]
            + body["mass"] * gravity * (z - body["height"])
        )
        if body["stiffness"] > 0.0:
            stored[at + i] += joint_spring_energy(body, y)[0]
