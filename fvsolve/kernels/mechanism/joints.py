"""Kinematics of bodies from (t, y): attitudes, positions, velocities, bias accelerations and weight.

Equations (45), (52) and (59) to (67) of docs/course.md: the axes of a body are those of its parent, rotated by the
joint. Velocities and accelerations along a tree of bodies are spatial vectors (angular part, linear part) at the
reference point o (`body_layout`), V = V_parent + S q'; q' are the rates of the joint. Columns of S, with axis a, unit
vectors e and position r of the joint from o: revolute (a, r x a); prismatic (0, a); ball joint three columns
(R e, r x R e). A free body has as rates the velocity of its centre of mass in the world and its angular velocity in its
own axes. The acceleration at o is A = A_parent + S q'' + V x S q' (Featherstone 2008, chapter 2). The bias is A for
q'' = 0. own : data of a body in `out`.
"""

from math import cos, sin

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import BALL, BODY_OUT, FREE, PRISMATIC, REVOLUTE
from fvsolve.kernels.mechanism.body_layout import (
    ARM,
    ATTITUDE,
    BIAS,
    BIAS_AT_O,
    FORCE,
    POSITION,
    SPIN,
    SPIN_BIAS,
    TORQUE,
    VELOCITY,
    VELOCITY_AT_O,
    body_row,
    cross,
    rotate,
    write_vector,
)
from fvsolve.kernels.mechanism.force_elements import update_elements
from fvsolve.kernels.schedule_pieces import schedule_slopes, schedule_value
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def joint_coordinate(body, t, y, tables):
    """(angle [rad] or travel [m], rate, acceleration) of a joint with a single axis; acceleration 0 unless driven."""
    if body["schedule"] >= 0:
        rate, change = schedule_slopes(tables, body["schedule"], t)
        return schedule_value(tables, body["schedule"], t), rate, change
    return body["start"][0] + y[body["y"]], body["speed"][0] + y[body["rate"]], 0.0


@njit(forceinline=True)
def multiply_matrices(a, i, b, j, c, k):
    """Write the product A B of 3 x 3 matrices at a[i] and b[j] to c[k]; all are stored by rows."""
    for row in range(i, i + 9, 3):
        x, y, z = a[row], a[row + 1], a[row + 2]
        c[k] = x * b[j] + y * b[j + 3] + z * b[j + 6]
        c[k + 1] = x * b[j + 1] + y * b[j + 4] + z * b[j + 7]
        c[k + 2] = x * b[j + 2] + y * b[j + 5] + z * b[j + 8]
        k += 3


@njit
def rotation_about_axis(q, k, angle, axis):
    """Write the rotation matrix about a unit axis by an angle [rad], by rows, to q[k], (43) of docs/course.md."""
    c, s, x, y, z = cos(angle), sin(angle), axis[0], axis[1], axis[2]
    rest = 1.0 - c
    write_vector(q, k, c + x * x * rest, x * y * rest - z * s, x * z * rest + y * s)
    write_vector(q, k + 3, x * y * rest + z * s, c + y * y * rest, y * z * rest - x * s)
    write_vector(q, k + 6, x * z * rest - y * s, y * z * rest + x * s, c + z * z * rest)


@njit
def rotation_of_parameters(q, k, h, a, b, c):
    """Write the rotation matrix of the Euler parameters (h, a, b, c), by rows, to q[k], (45) of docs/course.md.

    The result is a rotation also if the norm of the parameters has drifted from 1.
    """
    s = 2.0 / (h * h + a * a + b * b + c * c)
    write_vector(q, k, 1.0 - s * (b * b + c * c), s * (a * b - h * c), s * (a * c + h * b))
    write_vector(q, k + 3, s * (a * b + h * c), 1.0 - s * (a * a + c * c), s * (b * c - h * a))
    write_vector(q, k + 6, s * (a * c - h * b), s * (b * c + h * a), 1.0 - s * (a * a + b * b))


@njit(forceinline=True)
def joint_parameters(body, first, y):
    """Euler parameters (eta, eps) of a joint, not normalised; first : index of eta among the joint's coordinates."""
    at, e = body["y"] + first, body["start"]
    return e[first] + y[at], e[first + 1] + y[at + 1], e[first + 2] + y[at + 2], e[first + 3] + y[at + 3]


@njit(forceinline=True)
def joint_velocities(body, first, y):
    """Three velocities of a joint; first : index of the first of them among the velocities of the joint."""
    at, v = body["rate"] + first, body["speed"]
    return v[first] + y[at], v[first + 1] + y[at + 1], v[first + 2] + y[at + 2]


@njit
def set_free_body(body, y, own):
    """Write attitude, position of the origin, and velocity and bias acceleration at o of a free body to `own`.

    `body_layout` defines these data; the reference point o is the centre of mass. own : data of the body in `out`
    """
    rotation_of_parameters(own, ATTITUDE, *joint_parameters(body, 3, y))
    cx, cy, cz = rotate(own, ATTITUDE, body["centre"], 0)
    at, x0 = body["y"], body["start"]
    write_vector(own, ARM, -cx, -cy, -cz)
    write_vector(own, POSITION, x0[0] + y[at] - cx, x0[1] + y[at + 1] - cy, x0[2] + y[at + 2] - cz)
    vx, vy, vz = joint_velocities(body, 0, y)
    write_vector(own, VELOCITY_AT_O, vx, vy, vz)
    write_vector(own, SPIN, *rotate(own, ATTITUDE, joint_velocities(body, 3, y), 0))
    ax, ay, az = cross(own, SPIN, vx, vy, vz)
    write_vector(own, BIAS_AT_O, -ax, -ay, -az)
    write_vector(own, SPIN_BIAS, 0.0, 0.0, 0.0)


@njit
def set_joint_frame(body, out, tables, own):
    """Set position and motion of a body to those of its parent, or of the world, at the joint.

    The rotation matrix of the joint axes is written to scratch[9:18]. own : data of the body in `out`
    """
    work = tables.scratch
    if body["parent"] < 0:
        for k in range(9):
            work[9 + k] = body["attitude"][k]
        for k in range(3):
            own[POSITION + k], own[ARM + k] = body["at"][k], 0.0
            own[SPIN + k] = own[VELOCITY_AT_O + k] = 0.0
            own[SPIN_BIAS + k] = own[BIAS_AT_O + k] = 0.0
        return
    at = body_row(tables, body["parent"])
    up = out[at : at + BODY_OUT]
    multiply_matrices(up, ATTITUDE, body["attitude"], 0, work, 9)
    x, y, z = rotate(up, ATTITUDE, body["at"], 0)
    for k, offset in ((0, x), (1, y), (2, z)):
        own[POSITION + k] = up[POSITION + k] + offset
        own[ARM + k] = up[ARM + k] + offset
        own[SPIN + k], own[VELOCITY_AT_O + k] = up[SPIN + k], up[VELOCITY_AT_O + k]
        own[SPIN_BIAS + k], own[BIAS_AT_O + k] = up[SPIN_BIAS + k], up[BIAS_AT_O + k]


@njit
def set_revolute(body, t, y, tables, own):
    """Rotate a body by its revolute joint; add the joint velocity and, for a driven joint, its acceleration.

    scratch[9:18] : axes of the joint, see `set_joint_frame`; own : data of the body in `out`
    """
    angle, rate, change = joint_coordinate(body, t, y, tables)
    rotation_about_axis(tables.scratch, 0, angle, body["axis"])
    multiply_matrices(tables.scratch, 9, tables.scratch, 0, own, ATTITUDE)
    a, b, c = rotate(own, ATTITUDE, body["axis"], 0)
    if change != 0.0:
        add_drive_acceleration(own, a * change, b * change, c * change, 1)
    add_joint_velocity(own, a * rate, b * rate, c * rate, *cross(own, ARM, a * rate, b * rate, c * rate))


@njit
def set_prismatic(body, t, y, tables, own):
    """Move a body by its prismatic joint; add the joint velocity and, for a driven joint, its acceleration.

    scratch[9:18] : axes of the joint, see `set_joint_frame`; own : data of the body in `out`
    """
    travel, rate, change = joint_coordinate(body, t, y, tables)
    copy_joint_axes(tables, own)
    a, b, c = rotate(own, ATTITUDE, body["axis"], 0)
    for k, x in ((0, a), (1, b), (2, c)):
        own[POSITION + k] += x * travel
        own[ARM + k] += x * travel
    if change != 0.0:
        add_drive_acceleration(own, a * change, b * change, c * change, 0)
    add_joint_velocity(own, 0.0, 0.0, 0.0, a * rate, b * rate, c * rate)


@njit
def copy_joint_axes(tables, own):
    """Set the attitude of a body to the axes of its joint, for joints without rotation.

    scratch[9:18] : axes of the joint, see `set_joint_frame`; own : data of the body in `out`
    """
    for k in range(9):
        own[ATTITUDE + k] = tables.scratch[9 + k]


@njit
def add_joint_velocity(own, wx, wy, wz, vx, vy, vz):
    """Add the joint velocity S q' = (w, v) to the velocity V of a body, and V x S q' to its bias acceleration.

    (w, v) : angular velocity and velocity at the reference point o, in axes of the world; own : data of the body
    """
    for k, w, v in ((0, wx, vx), (1, wy, vy), (2, wz, vz)):
        own[SPIN + k] += w
        own[VELOCITY_AT_O + k] += v
    ax, ay, az = cross(own, SPIN, wx, wy, wz)
    bx, by, bz = cross(own, SPIN, vx, vy, vz)
    dx, dy, dz = cross(own, VELOCITY_AT_O, wx, wy, wz)
    for k, a, b in ((0, ax, bx + dx), (1, ay, by + dy), (2, az, bz + dz)):
        own[SPIN_BIAS + k] += a
        own[BIAS_AT_O + k] += b


@njit
def set_jointed_body(body, t, y, out, tables, own):
    """Write attitude, position, and motion at o of a body with a joint to `own`, computed from those of its parent.

    own : data of the body in `out`; o : reference point, see `body_layout`
    """
    set_joint_frame(body, out, tables, own)
    if body["joint"] == REVOLUTE:
        set_revolute(body, t, y, tables, own)
    elif body["joint"] == PRISMATIC:
        set_prismatic(body, t, y, tables, own)
    elif body["joint"] == BALL:
        rotation_of_parameters(tables.scratch, 0, *joint_parameters(body, 0, y))
        multiply_matrices(tables.scratch, 9, tables.scratch, 0, own, ATTITUDE)
        a, b, c = rotate(own, ATTITUDE, joint_velocities(body, 0, y), 0)
        add_joint_velocity(own, a, b, c, *cross(own, ARM, a, b, c))
    else:
        copy_joint_axes(tables, own)


@njit
def add_drive_acceleration(own, x, y, z, turns):
    """Add the acceleration of a driven joint to the bias acceleration of a body.

    (x, y, z) : axis times joint acceleration in axes of the world; turns : 1 for a revolute, 0 for a prismatic joint
    """
    if turns == 1:
        own[SPIN_BIAS] += x
        own[SPIN_BIAS + 1] += y
        own[SPIN_BIAS + 2] += z
        x, y, z = cross(own, ARM, x, y, z)
    own[BIAS_AT_O] += x
    own[BIAS_AT_O + 1] += y
    own[BIAS_AT_O + 2] += z


@njit(forceinline=True)
def origin_acceleration(out, here, wide, spin):
    """Acceleration of the origin of a body: a + alpha x r + w x v.

    a : spatial acceleration at the reference point o, at index `wide` of `out`; r : origin minus o
    alpha : angular acceleration, at offset `spin` in the data of the body; here : offset of these data in `out`
    w, v : angular velocity, and velocity of the origin
    """
    ax, ay, az = cross(out, here + spin, out[here + ARM], out[here + ARM + 1], out[here + ARM + 2])
    v = here + VELOCITY
    bx, by, bz = cross(out, here + SPIN, out[v], out[v + 1], out[v + 2])
    return out[wide] + ax + bx, out[wide + 1] + ay + by, out[wide + 2] + az + bz


@njit
def centre_of(body, out, here):
    """Position of the centre of mass from the origin of its body, and its velocity in the world: 6 numbers.

    Both are in axes of the world.

    here : offset of the body in `out`
    """
    x, y, z = rotate(out, here + ATTITUDE, body["centre"], 0)
    u, v, w = cross(out, here + SPIN, x, y, z)
    s = here + VELOCITY
    return x, y, z, out[s] + u, out[s + 1] + v, out[s + 2] + w


@njit
def kinematics(t, y, dydt, out, handle):
    """Write attitude, position and motion of all bodies, and direction and length of force elements, from (t, y).

    The sums FORCE and TORQUE of each body are set to its weight. See `body_layout` and `update_elements`.
    """
    tables = open_tables(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    for i in range(bodies.size):
        body, at = bodies[i], body_row(tables, i)
        own = out[at : at + BODY_OUT]
        if body["joint"] == FREE:
            set_free_body(body, y, own)
        else:
            set_jointed_body(body, t, y, out, tables, own)
        x, y0, z = cross(own, SPIN, own[ARM], own[ARM + 1], own[ARM + 2])
        write_vector(own, VELOCITY, own[VELOCITY_AT_O] + x, own[VELOCITY_AT_O + 1] + y0, own[VELOCITY_AT_O + 2] + z)
        write_vector(own, BIAS, *origin_acceleration(own, 0, BIAS_AT_O, SPIN_BIAS))
        weight = -body["mass"] * gravity
        x, y0, z = rotate(own, ATTITUDE, body["centre"], 0)
        write_vector(own, FORCE, 0.0, 0.0, weight)
        write_vector(own, TORQUE, y0 * weight, -x * weight, 0.0)
    update_elements(out, tables)


@njit
def kinematics_for_events(t, y, out, handle, g):
    """Call `kinematics` before event functions are evaluated, because they do not follow an evaluation of the rates."""
    kinematics(t, y, y[:0], out, handle)
