"""Accelerations of bodies, M q'' = forces - bias, by the composite rigid body algorithm, factored along the tree.

q are the coordinates of the degrees of freedom. Column S of a degree of freedom is the spatial velocity (angular, then
linear at o) per unit rate. Lagrange's equations ((70) of docs/course.md) of a tree of bodies are the equations of
Newton and Euler (68) of the bodies, projected on the columns S. M_jk = S_k . I_j S_j, with I_j the inertia of all
bodies carried by joint j (Featherstone 2008, chapter 6). Row j of M contains only the degrees of freedom between j and
the root; the factor L of M = L'L has no further entries.

Layout of `scratch`, with n degrees of freedom: S (6 n numbers); forces, later accelerations (n); a work column (n); M.
Then for each body ten numbers of inertia about o (mass, mass times centre, xx yy zz xy xz yz), and for each body six of
torque and force, later of acceleration.
"""

from math import sqrt

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import BODY_OUT, RATE, RATE_UNWANTED
from fvsolve.core.kernels.moving_frames import body_row
from fvsolve.core.kernels.vectors import (
    cross,
    dot,
    minus,
    plus,
    rotate,
    scaled,
    vector,
    vector_product,
    write_vector,
)
from fvsolve.features.motion.kernels import body_kinematics as kinematics
from fvsolve.features.motion.kernels.body_trees import freedom_path, nearest_free_body
from fvsolve.features.motion.kernels.fluid_loads import add_basin_inertia, add_fluid_inertia
from fvsolve.features.motion.kernels.mass_dynamics import push_stiffness
from fvsolve.features.motion.kernels.tables import ABOUT, FREE, PRISMATIC, REVOLUTE, open_motion
from fvsolve.jit import inline, njit

INERTIA_SIZE, LOAD_SIZE = 10, 6  # numbers per body


@njit(forceinline=True)
def scratch_offsets(tables):
    """(offset of the inertias of bodies, offset of the torques and forces of bodies) in `scratch`."""
    freedoms, n = tables.freedoms, tables.freedoms.size
    rows = freedoms[n - 1]["row"] + freedoms[n - 1]["depth"] + 1 if n > 0 else 0
    first = 8 * n + rows
    return first, first + INERTIA_SIZE * tables.bodies.size


@inline
def joint_columns(body, own, s):
    """Write the angular velocity and the velocity at o per unit rate of each degree of freedom of a joint to s.

    They are the columns S of the joint, six numbers each; o : reference point, see `body_layout`
    """
    kind = body["joint"]
    arm = vector(own, layout.ARM)
    first = 0
    if kind == FREE:
        for k in range(18):
            s[k] = 0.0
        # For a free body o is its centre of mass, so that these columns are unit vectors of the world.
        s[3] = s[10] = s[17] = 1.0
        first = 18
    if kind == REVOLUTE or kind == PRISMATIC:
        axis = rotate(own, layout.ATTITUDE, body["axis"], 0)
        if kind == PRISMATIC:
            write_vector(s, 0, 0.0, 0.0, 0.0)
            write_vector(s, 3, *axis)
        else:
            write_vector(s, 0, *axis)
            write_vector(s, 3, *vector_product(arm, axis))
        return
    # Ball joint or free body: a column of rotation about each axis of the body.
    for k in range(3):
        axis = own[layout.ATTITUDE + k], own[layout.ATTITUDE + 3 + k], own[layout.ATTITUDE + 6 + k]
        write_vector(s, first + 6 * k, *axis)
        if kind == FREE:
            write_vector(s, first + 6 * k + 3, 0.0, 0.0, 0.0)
        else:
            write_vector(s, first + 6 * k + 3, *vector_product(arm, axis))


@inline
def inertia_about_o(body, own, result):
    """Write the inertia of a body about the reference point o (`body_layout`), in axes of the world, as ten numbers.

    The numbers are mass, mass times centre (3), and moments of inertia xx yy zz xy xz yz.
    """
    m = body["mass"]
    inertia = body["inertia"]
    r = layout.ATTITUDE
    # Centre of mass from o: from the origin of the body, plus the arm from o to the origin.
    gx, gy, gz = rotate(own, r, body["centre"], 0)
    gx = gx + own[layout.ARM]
    gy = gy + own[layout.ARM + 1]
    gz = gz + own[layout.ARM + 2]
    result[0] = m
    write_vector(result, 1, m * gx, m * gy, m * gz)
    # Rows of R J; their products with R' follow in the moments below.
    ax, ay, az = inertia_row(own, r, inertia)
    bx, by, bz = inertia_row(own, r + 3, inertia)
    cx, cy, cz = inertia_row(own, r + 6, inertia)
    # Steiner's theorem: the moments of a point mass at the centre are added to those about it.
    result[4] = ax * own[r] + ay * own[r + 1] + az * own[r + 2] + m * (gy * gy + gz * gz)
    result[5] = bx * own[r + 3] + by * own[r + 4] + bz * own[r + 5] + m * (gx * gx + gz * gz)
    result[6] = cx * own[r + 6] + cy * own[r + 7] + cz * own[r + 8] + m * (gx * gx + gy * gy)
    result[7] = ax * own[r + 3] + ay * own[r + 4] + az * own[r + 5] - m * gx * gy
    result[8] = ax * own[r + 6] + ay * own[r + 7] + az * own[r + 8] - m * gx * gz
    result[9] = bx * own[r + 6] + by * own[r + 7] + bz * own[r + 8] - m * gy * gz


@njit(forceinline=True)
def inertia_row(own, r, inertia):
    """Row of the rotation matrix R, at own[r], times the inertia matrix of a body in its own axes."""
    x = own[r]
    y = own[r + 1]
    z = own[r + 2]
    return (
        x * inertia[0] + y * inertia[3] + z * inertia[6],
        x * inertia[1] + y * inertia[4] + z * inertia[7],
        x * inertia[2] + y * inertia[5] + z * inertia[8],
    )


@njit(forceinline=True)
def spatial_momentum(inertia, w, v):
    """Angular momentum about the point o, and momentum, of an inertia at angular velocity w and velocity v at o.

    inertia : ten numbers, see `inertia_about_o`. For accelerations in place of w and v, the result is torque and force.
    """
    m, h = inertia[0], vector(inertia, 1)
    xx = inertia[4]
    yy = inertia[5]
    zz = inertia[6]
    xy = inertia[7]
    xz = inertia[8]
    yz = inertia[9]
    angular = (
        xx * w[0] + xy * w[1] + xz * w[2] + h[1] * v[2] - h[2] * v[1],
        xy * w[0] + yy * w[1] + yz * w[2] + h[2] * v[0] - h[0] * v[2],
        xz * w[0] + yz * w[1] + zz * w[2] + h[0] * v[1] - h[1] * v[0],
    )
    linear = (
        m * v[0] + w[1] * h[2] - w[2] * h[1],
        m * v[1] + w[2] * h[0] - w[0] * h[2],
        m * v[2] + w[0] * h[1] - w[1] * h[0],
    )
    return angular, linear


@inline
def bias_load(own, inertia, load):
    """Write torque about o and force that a body needs besides its applied loads for q'' = 0, six numbers, to `load`.

    They are I A + V x* I V - applied loads on the body. I : inertia; V : spatial velocity; A : spatial acceleration for
    q'' = 0; x* : spatial cross product of motion and force (Featherstone 2008); o : reference point, see `body_layout`
    """
    # I V, then I A; V x* I V adds w x L + v x p to the torque and w x p to the force.
    angular, linear = spatial_momentum(
        inertia, vector(own, layout.SPIN), vector(own, layout.VELOCITY_AT_O)
    )
    torque, force = spatial_momentum(
        inertia, vector(own, layout.SPIN_BIAS), vector(own, layout.BIAS_AT_O)
    )
    torque = plus(
        plus(torque, cross(own, layout.SPIN, *angular)), cross(own, layout.VELOCITY_AT_O, *linear)
    )
    applied = vector(own, layout.FORCE)
    # The applied loads are about the origin of the body and are moved to o.
    write_vector(
        load, 0, *minus(minus(torque, vector(own, layout.TORQUE)), cross(own, layout.ARM, *applied))
    )
    write_vector(load, 3, *minus(plus(force, cross(own, layout.SPIN, *linear)), applied))


@njit
def fill_mass_matrix(y, out, tables):
    """Write joint columns S, mass matrix M and the forces of all degrees of freedom to `scratch`, see the module.

    The forces contain the loads of all bodies, bias, and springs and dampers of joints. Forces at the start that are
    only rounding of its equilibrium are subtracted. M contains the fluid in basins and networks on bodies.
    """
    bodies = tables.bodies
    freedoms = tables.freedoms
    work = tables.scratch
    paths = tables.integers
    n = freedoms.size
    first, loads = scratch_offsets(tables)
    for i in range(bodies.size):  # views of rows: constant indices then compile to fast code
        here, at = body_row(tables, i), first + INERTIA_SIZE * i
        own = out[here : here + BODY_OUT]
        inertia = work[at : at + INERTIA_SIZE]
        load = work[loads + LOAD_SIZE * i :]
        if bodies[i]["freedoms"] > 0:
            joint_columns(bodies[i], own, work[6 * bodies[i]["freedom"] :])
        inertia_about_o(bodies[i], own, inertia)
        bias_load(own, inertia, load)
    # From the leaves on: inertia and load of a body must contain those of all bodies that it carries.
    for i in range(bodies.size - 1, -1, -1):
        body, at = bodies[i], first + INERTIA_SIZE * i
        inertia, load = work[at : at + INERTIA_SIZE], work[loads + LOAD_SIZE * i :]
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s = work[6 * j :]
            path = paths[freedoms[j]["path"] :]
            depth = freedoms[j]["depth"]
            row = work[8 * n + freedoms[j]["row"] :]
            # Generalised force: minus the load of all carried bodies along the column S.
            force = -dot(s, 0, *vector(load, 0)) - dot(s, 3, *vector(load, 3))
            if body["damping"] > 0.0:
                k = body["rate"] + (j - body["freedom"])
                force -= body["damping"] * (body["speed"][j - body["freedom"]] + y[k])
            if body["stiffness"] > 0.0:
                force -= body["stiffness"] * (body["start"][0] + y[body["y"]])
            # last: forces balanced at the start cancel without rounding
            work[6 * n + j] = force - freedoms[j]["balance"]
            # Row j of M: S_k . I S_j for all degrees of freedom k from the root to j.
            torque, push = spatial_momentum(inertia, vector(s, 0), vector(s, 3))
            for k in range(depth + 1):
                c = work[6 * path[k] :]
                row[k] = dot(c, 0, *torque) + dot(c, 3, *push)
        if body["parent"] >= 0:
            over = work[first + INERTIA_SIZE * body["parent"] :]
            up = work[loads + LOAD_SIZE * body["parent"] :]
            for k in range(INERTIA_SIZE):
                over[k] += inertia[k]
            for k in range(LOAD_SIZE):
                up[k] += load[k]
    # After all rows of M are written, to which the inertia of the fluid is added.
    add_basin_inertia(out, tables)
    add_fluid_inertia(y, out, tables)


@njit
def factor_mass_matrix(tables):
    """Factor the mass matrix M = L'L in place, row by row from the leaves of the tree; L has the sparsity of M.

    The diagonal contains the reciprocals of the diagonal of L, because later solutions divide by it.
    """
    freedoms = tables.freedoms
    work = tables.scratch
    paths = tables.integers
    n = tables.freedoms.size
    for j in range(n - 1, -1, -1):
        row = work[8 * n + freedoms[j]["row"] :]
        depth = freedoms[j]["depth"]
        path = paths[freedoms[j]["path"] :]
        per = 1.0 / sqrt(row[depth])
        row[depth] = per
        for k in range(depth):
            row[k] *= per
        # The outer product of the row changes only rows of degrees of freedom on its path.
        for k in range(depth):
            up, share = work[8 * n + freedoms[path[k]]["row"] :], row[k]
            for m in range(k + 1):
                up[m] -= share * row[m]


@njit
def solve_factor(tables, at):
    """Solve L' z = b in place, b at scratch[at], with the factored mass matrix M = L'L; |z|^2 = b' M^-1 b."""
    freedoms = tables.freedoms
    work = tables.scratch
    paths = tables.integers
    n = tables.freedoms.size
    b = work[at : at + n]
    for j in range(n - 1, -1, -1):
        row = work[8 * n + freedoms[j]["row"] :]
        depth = freedoms[j]["depth"]
        path = paths[freedoms[j]["path"] :]
        z = b[j] * row[depth]
        b[j] = z
        for k in range(depth):
            b[path[k]] -= row[k] * z


@njit
def solve_mass_matrix(tables, at):
    """Solve M x = b in place, b at scratch[at], with the mass matrix M factored."""
    freedoms = tables.freedoms
    work = tables.scratch
    paths = tables.integers
    n = tables.freedoms.size
    solve_factor(tables, at)
    b = work[at : at + n]
    # Second half, L x = z, from the root to the leaves.
    for j in range(n):
        row = work[8 * n + freedoms[j]["row"] :]
        depth = freedoms[j]["depth"]
        path = paths[freedoms[j]["path"] :]
        x = b[j]
        for k in range(depth):
            x -= row[k] * b[path[k]]
        b[j] = x * row[depth]


@njit
def spread_accelerations(out, tables):
    """Write ACCELERATION and SPIN_RATE of all bodies to `out`, from the accelerations of the degrees of freedom.

    Those are in `scratch` after the columns S; the torques and forces of bodies in `scratch` are overwritten.
    """
    bodies = tables.bodies
    work = tables.scratch
    n = tables.freedoms.size
    loads = scratch_offsets(tables)[1]
    for i in range(bodies.size):
        body = bodies[i]
        at = body_row(tables, i)
        acceleration = work[loads + LOAD_SIZE * i :]
        own = out[at : at + BODY_OUT]
        # A body has the acceleration of its parent and the columns of its own joint times their rates.
        if body["parent"] >= 0:
            up = work[loads + LOAD_SIZE * body["parent"] :]
            for k in range(LOAD_SIZE):
                acceleration[k] = up[k]
        else:
            for k in range(LOAD_SIZE):
                acceleration[k] = 0.0
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s, rate = work[6 * j :], work[6 * n + j]
            for k in range(LOAD_SIZE):
                acceleration[k] += s[k] * rate
        for k in range(3):  # acceleration at o for now; that of the origin is written below
            own[layout.SPIN_RATE + k] = own[layout.SPIN_BIAS + k] + acceleration[k]
            own[layout.ACCELERATION + k] = own[layout.BIAS_AT_O + k] + acceleration[3 + k]
        of_origin = kinematics.origin_acceleration(own, layout.ACCELERATION, layout.SPIN_RATE)
        write_vector(own, layout.ACCELERATION, *of_origin)


@njit
def coordinate_rates(body, y, dydt):
    """Write d/dt of the coordinates of a joint to `dydt`: velocities, and rates of Euler parameters.

    The rates of Euler parameters follow from the angular velocity in axes of the body.
    """
    at, first = body["y"], 0
    if body["joint"] == REVOLUTE or body["joint"] == PRISMATIC:
        dydt[at] = body["speed"][0] + y[body["rate"]]
        return
    if body["joint"] == FREE:
        write_vector(dydt, at, *kinematics.joint_velocities(body, 0, y))
        first = 3
    h, a, b, c = kinematics.joint_parameters(body, first, y)
    x, y0, z = kinematics.joint_velocities(body, first, y)
    # e' = E(e) w / 2, with the Euler parameters e and the angular velocity w.
    dydt[at + first] = -0.5 * (a * x + b * y0 + c * z)
    write_vector(
        dydt,
        at + first + 1,
        0.5 * (h * x + b * z - c * y0),
        0.5 * (h * y0 + c * x - a * z),
        0.5 * (h * z + a * y0 - b * x),
    )


@njit
def add_point_force(out, tables, point, acts, f, at):
    """Add the generalised forces of a force f at a point of a body to the vector at scratch[at].

    For `acts` ABOUT, f is a torque. Nothing is added for a point of the world, or point < 0.
    """
    i = kinematics.body_of_point(tables, point)
    if acts == ABOUT:
        add_body_wrench(tables, i, f, (0.0, 0.0, 0.0), at)
    else:
        add_body_force(
            out, tables, i, kinematics.point_at(out, tables, point, layout.POSITION)[:3], f, at
        )


@njit
def add_body_force(out, tables, i, p, f, at):
    """Add the generalised forces of a force f on body i at the position p to the vector at scratch[at].

    Both are in axes of the world. Nothing is added for the world (i < 0).
    """
    if i >= 0:
        here = body_row(tables, i)
        # From o, about which the columns S are written.
        arm = plus(minus(p, vector(out, here + layout.POSITION)), vector(out, here + layout.ARM))
        add_body_wrench(tables, i, vector_product(arm, f), f, at)


@njit
def add_pair_force(out, tables, link, p, f, at):
    """Add the generalised forces of f on the body of point `to`, and of -f on that of `from`, both at the position p.

    link : row of a bushing or pin; the forces are added to the vector at scratch[at]
    """
    add_body_force(out, tables, kinematics.body_of_point(tables, link["to_point"]), p, f, at)
    add_body_force(
        out, tables, kinematics.body_of_point(tables, link["from_point"]), p, scaled(-1.0, f), at
    )


@njit
def add_body_wrench(tables, i, torque, force, at):
    """Add the generalised forces of a load on body i, per degree of freedom, to the vector at scratch[at].

    torque, force : torque about the reference point o, and force, in axes of the world
    Nothing is added if no degree of freedom moves the body, or for the world (i < 0).
    """
    # A body without own degrees of freedom moves with the nearest one that has some, towards the root.
    work, i = tables.scratch, nearest_free_body(tables, i)
    if i < 0:
        return
    path, count = freedom_path(tables, i)
    for k in range(count):
        j = tables.integers[path + k]
        work[at + j] += dot(work, 6 * j, *torque) + dot(work, 6 * j + 3, *force)


@njit(forceinline=True)
def clear_column(tables, at):
    """Set the vector over degrees of freedom at scratch[at] to zero."""
    for m in range(tables.freedoms.size):
        tables.scratch[at + m] = 0.0


@njit
def mobility(tables, at):
    """Reciprocal of the effective mass in a direction b, b' M^-1 b; M : factored mass matrix.

    b : vector over degrees of freedom at scratch[at], which is overwritten
    """
    work, total = tables.scratch, 0.0
    solve_factor(tables, at)
    for j in range(tables.freedoms.size):
        total += work[at + j] * work[at + j]
    return total


@njit(forceinline=True)
def oscillation_rate(stiffness, damping):
    """Upper bound of the rates of damped oscillations [1/s], c / 2 + sqrt(c^2 / 4 + k).

    k, c : sums over springs and dampers of stiffness and damping, each times b' M^-1 b; M : factored mass matrix, b :
    direction of the force. The trace of M^-1 K is at least its greatest eigenvalue; K : stiffness matrix.
    """
    return 0.5 * damping + sqrt(0.25 * damping * damping + stiffness)


@njit
def body_rate_limit(out, tables):
    """Upper bound of the rates of bodies [1/s], with springs and dampers of joints and force elements.

    It is the `oscillation_rate`, and at least the greatest angular velocity and out[RATE]; or RATE_UNWANTED.
    """
    if out[RATE] == RATE_UNWANTED:
        return RATE_UNWANTED
    bodies = tables.bodies
    work = tables.scratch
    lines = tables.lines
    stiffness = 0.0
    damping = 0.0
    turns = 0.0
    at = 7 * tables.freedoms.size
    for i in range(bodies.size):
        own = out[body_row(tables, i) :]
        turns = max(turns, dot(own, layout.SPIN, *vector(own, layout.SPIN)))
        if bodies[i]["damping"] > 0.0 or bodies[i]["stiffness"] > 0.0:
            for j in range(bodies[i]["freedom"], bodies[i]["freedom"] + bodies[i]["freedoms"]):
                # `mobility` has overwritten the column of the joint before.
                clear_column(tables, at)
                work[at + j] = 1.0
                inverse_mass = mobility(tables, at)
                damping += bodies[i]["damping"] * inverse_mass
                stiffness += bodies[i]["stiffness"] * inverse_mass
    for k in range(lines.size):
        line = lines[k]
        spring, damper = push_stiffness(out, tables, line["push"])
        # A given force adds no rate, and `mobility` is costly.
        if spring == 0.0 and damper == 0.0:
            continue
        along = vector(out, tables.layout[0]["along"] + 3 * k)
        clear_column(tables, at)
        # The column becomes the direction b of a unit force along the element.
        add_point_force(out, tables, line["to_point"], line["acts"], along, at)
        add_point_force(out, tables, line["from_point"], line["acts"], scaled(-1.0, along), at)
        inverse_mass = mobility(tables, at)
        stiffness += spring * inverse_mass
        damping += damper * inverse_mass
    return max(max(out[RATE], sqrt(turns)), oscillation_rate(stiffness, damping))


@njit
def start_mass_matrix(t, y, dydt, out, handle):
    """Write the forces of the degrees of freedom and the mass matrix to `scratch`, for the equilibrium at the start."""
    fill_mass_matrix(y, out, open_motion(handle))


@njit
def state_rates(y, dydt, tables):
    """Write the rates of all states of joints to `dydt`, with accelerations from `scratch`, unless it is empty."""
    bodies = tables.bodies
    work = tables.scratch
    n = tables.freedoms.size
    if dydt.size == 0:
        return
    for i in range(bodies.size):
        body = bodies[i]
        if body["freedoms"] > 0:
            coordinate_rates(body, y, dydt)
            for k in range(body["freedoms"]):
                dydt[body["rate"] + k] = work[6 * n + body["freedom"] + k]


@njit
def solve_accelerations(t, y, dydt, out, handle):
    """Solve for the accelerations of all bodies under their forces; write them and the rates of the joint states.

    out[RATE] is raised by `body_rate_limit`. The factored mass matrix stays in `scratch`.
    """
    tables = open_motion(handle)
    fill_mass_matrix(y, out, tables)
    factor_mass_matrix(tables)
    solve_mass_matrix(tables, 6 * tables.freedoms.size)
    spread_accelerations(out, tables)
    out[RATE] = body_rate_limit(out, tables)
    state_rates(y, dydt, tables)
