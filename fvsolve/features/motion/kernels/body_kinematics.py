"""Kinematics of bodies and their points from (t, y): attitudes, positions, velocities, bias accelerations and weight.

Equations (45), (52) and (59) to (67) of docs/course.md: the axes of a body are those of its parent, rotated by the
joint. Velocities and accelerations along a tree of bodies are spatial vectors (angular part, linear part) at the
reference point o (`body_layout`), V = V_parent + S q'; q' are the rates of the joint. Columns of S, with axis a, unit
vectors e and position r of the joint from o: revolute (a, r x a); prismatic (0, a); ball joint three columns
(R e, r x R e). A free body has as rates the velocity of its centre of mass in the world and its angular velocity in its
own axes. The acceleration at o is A = A_parent + S q'' + V x S q' (Featherstone 2008, chapter 2). The bias is A for
q'' = 0. The axes of a joint are in scratch[9:18], see `set_joint_frame`.
"""

from math import cos, sin, sqrt

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import BODY_OUT
from fvsolve.core.kernels.moving_frames import body_row
from fvsolve.core.kernels.schedule_pieces import schedule_slopes, schedule_value
from fvsolve.core.kernels.vectors import (
    add_vector,
    cross,
    minus,
    plus,
    rotate,
    scaled,
    vector,
    write_vector,
)
from fvsolve.features.motion.kernels.tables import (
    ABOUT,
    ALONG,
    BALL,
    FREE,
    PRISMATIC,
    REVOLUTE,
    open_motion,
)
from fvsolve.jit import njit


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
        x = a[row]
        y = a[row + 1]
        z = a[row + 2]
        c[k] = x * b[j] + y * b[j + 3] + z * b[j + 6]
        c[k + 1] = x * b[j + 1] + y * b[j + 4] + z * b[j + 7]
        c[k + 2] = x * b[j + 2] + y * b[j + 5] + z * b[j + 8]
        k += 3


@njit
def rotation_about_axis(q, k, angle, axis):
    """Write the rotation matrix about a unit axis by an angle [rad], by rows, to q[k], (43) of docs/course.md."""
    c = cos(angle)
    s = sin(angle)
    x = axis[0]
    y = axis[1]
    z = axis[2]
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
    return (
        e[first] + y[at],
        e[first + 1] + y[at + 1],
        e[first + 2] + y[at + 2],
        e[first + 3] + y[at + 3],
    )


@njit(forceinline=True)
def joint_velocities(body, first, y):
    """Three velocities of a joint; first : index of the first of them among the velocities of the joint."""
    return plus(vector(body["speed"], first), vector(y, body["rate"] + first))


@njit
def set_free_body(body, y, own):
    """Write attitude, position of the origin, and velocity and bias acceleration at o of a free body to `own`.

    The reference point o is the centre of mass.
    """
    rotation_of_parameters(own, layout.ATTITUDE, *joint_parameters(body, 3, y))
    centre, v = rotate(own, layout.ATTITUDE, body["centre"], 0), joint_velocities(body, 0, y)
    write_vector(own, layout.ARM, *scaled(-1.0, centre))
    write_vector(
        own, layout.POSITION, *minus(plus(vector(body["start"], 0), vector(y, body["y"])), centre)
    )
    write_vector(own, layout.VELOCITY_AT_O, *v)
    write_vector(own, layout.SPIN, *rotate(own, layout.ATTITUDE, joint_velocities(body, 3, y), 0))
    # A spatial acceleration at o is the acceleration of the point there minus w x v.
    write_vector(own, layout.BIAS_AT_O, *scaled(-1.0, cross(own, layout.SPIN, *v)))
    write_vector(own, layout.SPIN_BIAS, 0.0, 0.0, 0.0)


@njit
def set_joint_frame(body, out, tables, own):
    """Set position and motion of a body to those of its parent, or of the world, at the joint.

    The rotation matrix of the joint axes is written to scratch[9:18].
    """
    work = tables.scratch
    if body["parent"] < 0:
        for k in range(9):
            work[9 + k] = body["attitude"][k]
        for k in range(3):
            own[layout.POSITION + k], own[layout.ARM + k] = body["at"][k], 0.0
            own[layout.SPIN + k] = own[layout.VELOCITY_AT_O + k] = 0.0
            own[layout.SPIN_BIAS + k] = own[layout.BIAS_AT_O + k] = 0.0
        return
    at = body_row(tables, body["parent"])
    up = out[at : at + BODY_OUT]
    multiply_matrices(up, layout.ATTITUDE, body["attitude"], 0, work, 9)
    offset = rotate(up, layout.ATTITUDE, body["at"], 0)
    write_vector(own, layout.POSITION, *plus(vector(up, layout.POSITION), offset))
    write_vector(own, layout.ARM, *plus(vector(up, layout.ARM), offset))
    for k in range(3):
        own[layout.SPIN + k], own[layout.VELOCITY_AT_O + k] = (
            up[layout.SPIN + k],
            up[layout.VELOCITY_AT_O + k],
        )
        own[layout.SPIN_BIAS + k], own[layout.BIAS_AT_O + k] = (
            up[layout.SPIN_BIAS + k],
            up[layout.BIAS_AT_O + k],
        )


@njit
def set_revolute(body, t, y, tables, own):
    """Rotate a body by its revolute joint; add the joint velocity and, for a driven joint, its acceleration."""
    angle, rate, change = joint_coordinate(body, t, y, tables)
    rotation_about_axis(tables.scratch, 0, angle, body["axis"])
    # Attitude of the joint axes, rotated by the joint.
    multiply_matrices(tables.scratch, 9, tables.scratch, 0, own, layout.ATTITUDE)
    axis = rotate(own, layout.ATTITUDE, body["axis"], 0)
    # Only a driven joint has a given acceleration; others are solved later.
    if change != 0.0:
        add_drive_acceleration(own, scaled(change, axis), True)
    w = scaled(rate, axis)
    add_joint_velocity(own, w, cross(own, layout.ARM, *w))


@njit
def set_prismatic(body, t, y, tables, own):
    """Move a body by its prismatic joint; add the joint velocity and, for a driven joint, its acceleration."""
    travel, rate, change = joint_coordinate(body, t, y, tables)
    axis = rotate(own, layout.ATTITUDE, body["axis"], 0)
    add_vector(own, layout.POSITION, scaled(travel, axis))
    add_vector(own, layout.ARM, scaled(travel, axis))
    if change != 0.0:
        add_drive_acceleration(own, scaled(change, axis), False)
    add_joint_velocity(own, (0.0, 0.0, 0.0), scaled(rate, axis))


@njit
def add_joint_velocity(own, w, v):
    """Add the joint velocity S q' = (w, v) to the velocity V of a body, and V x S q' to its bias acceleration.

    (w, v) : angular velocity and velocity at the reference point o, in axes of the world
    """
    add_vector(own, layout.SPIN, w)
    add_vector(own, layout.VELOCITY_AT_O, v)
    # V contains S q' by now, whose product with S q' itself is zero.
    add_vector(own, layout.SPIN_BIAS, cross(own, layout.SPIN, *w))
    add_vector(
        own,
        layout.BIAS_AT_O,
        plus(cross(own, layout.SPIN, *v), cross(own, layout.VELOCITY_AT_O, *w)),
    )


@njit
def set_jointed_body(body, t, y, out, tables, own):
    """Write attitude, position, and motion at o of a body with a joint to `own`, computed from those of its parent."""
    set_joint_frame(body, out, tables, own)
    if body["joint"] == REVOLUTE:
        set_revolute(body, t, y, tables, own)
    elif body["joint"] == BALL:
        rotation_of_parameters(tables.scratch, 0, *joint_parameters(body, 0, y))
        multiply_matrices(tables.scratch, 9, tables.scratch, 0, own, layout.ATTITUDE)
        w = rotate(own, layout.ATTITUDE, joint_velocities(body, 0, y), 0)
        add_joint_velocity(own, w, cross(own, layout.ARM, *w))
    else:
        for k in range(9):
            own[layout.ATTITUDE + k] = tables.scratch[9 + k]
        if body["joint"] == PRISMATIC:
            set_prismatic(body, t, y, tables, own)


@njit
def add_drive_acceleration(own, a, turns):
    """Add the acceleration of a driven joint to the bias acceleration of a body.

    a : axis times joint acceleration in axes of the world; turns : True for a revolute, False for a prismatic joint
    """
    if turns:
        add_vector(own, layout.SPIN_BIAS, a)
        a = cross(own, layout.ARM, *a)
    add_vector(own, layout.BIAS_AT_O, a)


@njit(forceinline=True)
def origin_acceleration(own, wide, spin):
    """Acceleration of the origin of a body: a + alpha x r + w x v.

    a : spatial acceleration at the reference point o, at offset `wide` of `own`; r : origin minus o
    alpha : angular acceleration, at offset `spin`; w, v : angular velocity, and velocity of the origin
    """
    at_o = plus(vector(own, wide), cross(own, spin, *vector(own, layout.ARM)))
    return plus(at_o, cross(own, layout.SPIN, *vector(own, layout.VELOCITY)))


@njit
def centre_of(body, out, here):
    """Position of the centre of mass from the origin of its body, and its velocity in the world: 6 numbers.

    Both are in axes of the world.
    """
    centre = rotate(out, here + layout.ATTITUDE, body["centre"], 0)
    return centre + plus(
        vector(out, here + layout.VELOCITY), cross(out, here + layout.SPIN, *centre)
    )


@njit
def point_at(out, tables, k, base):
    """Position [m] and velocity [m/s] of point k, six numbers in axes of the world; (59) and (67) of docs/course.md.

    base : POSITION for the position from the origin of the world, or ARM for that from o (`body_layout`)
    Points of the world have no velocity. All numbers are 0 for k < 0.
    """
    if k < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    point = tables.points[k]
    if point["body"] < 0:
        return point["place"][0], point["place"][1], point["place"][2], 0.0, 0.0, 0.0
    here = body_row(tables, point["body"])
    place = rotate(out, here + layout.ATTITUDE, point["place"], 0)
    velocity = plus(vector(out, here + layout.VELOCITY), cross(out, here + layout.SPIN, *place))
    return plus(vector(out, here + base), place) + velocity


@njit(forceinline=True)
def body_of_point(tables, k):
    """Number of the body of point k; -1 for the world or k < 0."""
    return tables.points[k]["body"] if k >= 0 else -1


@njit
def spin_of(out, tables, k):
    """Angular velocity of the body of point k [rad/s], in axes of the world; 0 for the world or k < 0."""
    i = body_of_point(tables, k)
    return vector(out, body_row(tables, i) + layout.SPIN) if i >= 0 else (0.0, 0.0, 0.0)


@njit(forceinline=True)
def root_of(tables, k):
    """Body that is the root of the tree to which point k belongs; -1 for the world or k < 0."""
    i = body_of_point(tables, k)
    return tables.bodies[i]["root"] if i >= 0 else -1


@njit
def update_elements(out, tables):
    """Write unit direction, change of length since the start [m] and its rate [m/s] of all force elements to `out`.

    The direction is from point `from` to point `to`, the length their distance. For elements that act TOWARD a fixed
    direction or ABOUT an axis, the change of length is 0. The rate is then the velocity of `to` relative to `from` in
    that direction, or the relative angular velocity about the axis [rad/s].
    """
    offsets, lines = tables.layout[0], tables.lines
    for k in range(lines.size):
        line = lines[k]
        at = offsets["along"] + 3 * k
        to = offsets["travel"] + 2 * lines[k]["push"]
        i, j = line["from_point"], line["to_point"]
        if line["acts"] == ABOUT:
            a, b, c = spin_of(out, tables, i)
            u, v, w = spin_of(out, tables, j)
            # The axis is fixed in the body of `to` and turns with it.
            r = body_row(tables, tables.points[j]["body"]) + layout.ATTITUDE
            write_vector(out, at, *rotate(out, r, line["direction"], 0))
            out[to], out[to + 1] = (
                0.0,
                out[at] * (u - a) + out[at + 1] * (v - b) + out[at + 2] * (w - c),
            )
            continue
        root = root_of(tables, i)
        # Within a tree positions count from o, so that a body far from the origin of the world loses no digits.
        base = layout.ARM if root >= 0 and root == root_of(tables, j) else layout.POSITION
        x, y, z, a, b, c = point_at(out, tables, i, base)
        p, q, r, u, v, w = point_at(out, tables, j, base)
        x = p - x
        y = q - y
        z = r - z
        length = 0.0
        if line["acts"] == ALONG:
            length = sqrt(x * x + y * y + z * z)
            write_vector(out, at, x / length, y / length, z / length)
        else:
            write_vector(out, at, *vector(line["direction"], 0))
        out[to] = length - line["length"]
        out[to + 1] = out[at] * (u - a) + out[at + 1] * (v - b) + out[at + 2] * (w - c)


@njit
def kinematics(t, y, dydt, out, handle):
    """Write attitude, position and motion of all bodies, and direction and length of force elements, from (t, y).

    The sums FORCE and TORQUE of each body are set to its weight. See `body_layout` and `update_elements`.
    """
    tables = open_motion(handle)
    bodies, gravity = tables.bodies, tables.settings[0]["gravity"]
    # Parents come before the bodies that they carry.
    for i in range(bodies.size):
        body, at = bodies[i], body_row(tables, i)
        own = out[at : at + BODY_OUT]
        if body["joint"] == FREE:
            set_free_body(body, y, own)
        else:
            set_jointed_body(body, t, y, out, tables, own)
        # Motion at o serves the equations; loads and points need that of the origin.
        turning = cross(own, layout.SPIN, *vector(own, layout.ARM))
        write_vector(own, layout.VELOCITY, *plus(vector(own, layout.VELOCITY_AT_O), turning))
        write_vector(
            own, layout.BIAS, *origin_acceleration(own, layout.BIAS_AT_O, layout.SPIN_BIAS)
        )
        weight = -body["mass"] * gravity
        # The weight acts at the centre of mass, so that it has a torque about the origin.
        x, y0, z = rotate(own, layout.ATTITUDE, body["centre"], 0)
        write_vector(own, layout.FORCE, 0.0, 0.0, weight)
        write_vector(own, layout.TORQUE, y0 * weight, -x * weight, 0.0)
    update_elements(out, tables)


@njit
def kinematics_for_events(t, y, out, handle, g):
    """Call `kinematics` before event functions are evaluated, because they do not follow an evaluation of the rates."""
    kinematics(t, y, y[:0], out, handle)
