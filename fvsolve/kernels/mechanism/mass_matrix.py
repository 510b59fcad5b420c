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

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import ABOUT, BODY_OUT, FREE, PRISMATIC, RATE, REVOLUTE
from fvsolve.kernels.mass_dynamics import push_stiffness
from fvsolve.kernels.mechanism.basin_inertia import add_basin_inertia
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ARM,
    ATTITUDE,
    BIAS_AT_O,
    FORCE,
    POSITION,
    SPIN,
    SPIN_BIAS,
    SPIN_RATE,
    TORQUE,
    VELOCITY_AT_O,
    body_row,
    cross,
    freedom_path,
    nearest_free_body,
    rotate,
    write_vector,
)
from fvsolve.kernels.mechanism.fluid_inertia import add_fluid_inertia
from fvsolve.kernels.mechanism.joints import joint_parameters, joint_velocities, origin_acceleration
from fvsolve.kernels.table_handle import open_tables

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

    They are the columns S of the joint, six numbers each. own : data of the body in `out`
    o : reference point, see `body_layout`
    """
    kind, x, y, z = body["joint"], own[ARM], own[ARM + 1], own[ARM + 2]
    first = 0
    if kind == FREE:
        for k in range(18):
            s[k] = 0.0
        s[3] = s[10] = s[17] = 1.0
        first = 18
    if kind == REVOLUTE or kind == PRISMATIC:
        a, b, c = rotate(own, ATTITUDE, body["axis"], 0)
        if kind == PRISMATIC:
            write_vector(s, 0, 0.0, 0.0, 0.0)
            write_vector(s, 3, a, b, c)
        else:
            write_vector(s, 0, a, b, c)
            write_vector(s, 3, y * c - z * b, z * a - x * c, x * b - y * a)
        return
    for k in range(3):
        a, b, c = own[ATTITUDE + k], own[ATTITUDE + 3 + k], own[ATTITUDE + 6 + k]
        write_vector(s, first + 6 * k, a, b, c)
        if kind == FREE:
            write_vector(s, first + 6 * k + 3, 0.0, 0.0, 0.0)
        else:
            write_vector(s, first + 6 * k + 3, y * c - z * b, z * a - x * c, x * b - y * a)


@inline
def inertia_about_o(body, own, result):
    """Write the inertia of a body about the reference point o (`body_layout`), in axes of the world, as ten numbers.

    The numbers are mass, mass times centre (3), and moments of inertia xx yy zz xy xz yz.
    """
    m, inertia, r = body["mass"], body["inertia"], ATTITUDE
    gx, gy, gz = rotate(own, r, body["centre"], 0)
    gx, gy, gz = gx + own[ARM], gy + own[ARM + 1], gz + own[ARM + 2]
    result[0] = m
    write_vector(result, 1, m * gx, m * gy, m * gz)
    ax, ay, az = inertia_row(own, r, inertia)
    bx, by, bz = inertia_row(own, r + 3, inertia)
    cx, cy, cz = inertia_row(own, r + 6, inertia)
    result[4] = ax * own[r] + ay * own[r + 1] + az * own[r + 2] + m * (gy * gy + gz * gz)
    result[5] = bx * own[r + 3] + by * own[r + 4] + bz * own[r + 5] + m * (gx * gx + gz * gz)
    result[6] = cx * own[r + 6] + cy * own[r + 7] + cz * own[r + 8] + m * (gx * gx + gy * gy)
    result[7] = ax * own[r + 3] + ay * own[r + 4] + az * own[r + 5] - m * gx * gy
    result[8] = ax * own[r + 6] + ay * own[r + 7] + az * own[r + 8] - m * gx * gz
    result[9] = bx * own[r + 6] + by * own[r + 7] + bz * own[r + 8] - m * gy * gz


@njit(forceinline=True)
def inertia_row(own, r, inertia):
    """Row of the rotation matrix R, at own[r], times the inertia matrix of a body in its own axes."""
    x, y, z = own[r], own[r + 1], own[r + 2]
    return (
        x * inertia[0] + y * inertia[3] + z * inertia[6],
        x * inertia[1] + y * inertia[4] + z * inertia[7],
        x * inertia[2] + y * inertia[5] + z * inertia[8],
    )


@njit(forceinline=True)
def spatial_momentum(inertia, wx, wy, wz, vx, vy, vz):
    """Angular momentum about the point o, and momentum, of an inertia at angular velocity w and velocity v at o.

    inertia : ten numbers, see `inertia_about_o`; the result has six numbers. For accelerations in place of (w, v), the
    result is torque and force.
    """
    m, hx, hy, hz = inertia[0], inertia[1], inertia[2], inertia[3]
    xx, yy, zz, xy, xz, yz = inertia[4], inertia[5], inertia[6], inertia[7], inertia[8], inertia[9]
    return (
        xx * wx + xy * wy + xz * wz + hy * vz - hz * vy,
        xy * wx + yy * wy + yz * wz + hz * vx - hx * vz,
        xz * wx + yz * wy + zz * wz + hx * vy - hy * vx,
        m * vx + wy * hz - wz * hy,
        m * vy + wz * hx - wx * hz,
        m * vz + wx * hy - wy * hx,
    )


@inline
def bias_load(own, inertia, load):
    """Write torque about o and force that a body needs besides its applied loads for q'' = 0, six numbers, to `load`.

    They are I A + V x* I V - applied loads on the body. I : inertia; V : spatial velocity; A : spatial acceleration for
    q'' = 0; x* : spatial cross product of motion and force (Featherstone 2008); o : reference point, see `body_layout`
    """
    w, v, a, c = SPIN, VELOCITY_AT_O, SPIN_BIAS, BIAS_AT_O
    lx, ly, lz, px, py, pz = spatial_momentum(inertia, own[w], own[w + 1], own[w + 2], own[v], own[v + 1], own[v + 2])
    tx, ty, tz, fx, fy, fz = spatial_momentum(inertia, own[a], own[a + 1], own[a + 2], own[c], own[c + 1], own[c + 2])
    ax, ay, az = cross(own, w, lx, ly, lz)
    bx, by, bz = cross(own, v, px, py, pz)
    gx, gy, gz = cross(own, w, px, py, pz)
    f, m = FORCE, TORQUE
    ex, ey, ez = cross(own, ARM, own[f], own[f + 1], own[f + 2])
    write_vector(load, 0, tx + ax + bx - own[m] - ex, ty + ay + by - own[m + 1] - ey, tz + az + bz - own[m + 2] - ez)
    write_vector(load, 3, fx + gx - own[f], fy + gy - own[f + 1], fz + gz - own[f + 2])


@njit
def fill_mass_matrix(y, out, tables):
    """Write joint columns S, mass matrix M and the forces of all degrees of freedom to `scratch`, see the module.

    The forces contain the loads of all bodies, bias, and springs and dampers of joints. Forces at the start that are
    only
    rounding of its equilibrium are subtracted. M contains the fluid in basins and networks on bodies.
    """
    bodies, freedoms, work, paths = tables.bodies, tables.freedoms, tables.scratch, tables.integers
    n = freedoms.size
    first, loads = scratch_offsets(tables)
    for i in range(bodies.size):  # views of rows: constant indices then compile to fast code
        here, at = body_row(tables, i), first + INERTIA_SIZE * i
        own, inertia, load = out[here : here + BODY_OUT], work[at : at + INERTIA_SIZE], work[loads + LOAD_SIZE * i :]
        if bodies[i]["freedoms"] > 0:
            joint_columns(bodies[i], own, work[6 * bodies[i]["freedom"] :])
        inertia_about_o(bodies[i], own, inertia)
        bias_load(own, inertia, load)
    for i in range(bodies.size - 1, -1, -1):
        body, at = bodies[i], first + INERTIA_SIZE * i
        inertia, load = work[at : at + INERTIA_SIZE], work[loads + LOAD_SIZE * i :]
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s, path, depth = work[6 * j :], paths[freedoms[j]["path"] :], freedoms[j]["depth"]
            row = work[8 * n + freedoms[j]["row"] :]
            force = -(s[0] * load[0] + s[1] * load[1] + s[2] * load[2])
            force -= s[3] * load[3] + s[4] * load[4] + s[5] * load[5]
            if body["damping"] > 0.0:
                k = body["rate"] + (j - body["freedom"])
                force -= body["damping"] * (body["speed"][j - body["freedom"]] + y[k])
            if body["stiffness"] > 0.0:
                force -= body["stiffness"] * (body["start"][0] + y[body["y"]])
            work[6 * n + j] = (
                force - freedoms[j]["balance"]
            )  # last: forces balanced at the start cancel without rounding
            tx, ty, tz, fx, fy, fz = spatial_momentum(inertia, s[0], s[1], s[2], s[3], s[4], s[5])
            for k in range(depth + 1):
                c = work[6 * path[k] :]
                turn = c[0] * tx + c[1] * ty + c[2] * tz
                row[k] = turn + (c[3] * fx + c[4] * fy + c[5] * fz)
        if body["parent"] >= 0:
            over, up = work[first + INERTIA_SIZE * body["parent"] :], work[loads + LOAD_SIZE * body["parent"] :]
            for k in range(INERTIA_SIZE):
                over[k] += inertia[k]
            for k in range(LOAD_SIZE):
                up[k] += load[k]
    add_basin_inertia(out, tables)
    add_fluid_inertia(y, out, tables)


@njit
def factor_mass_matrix(tables):
    """Factor the mass matrix M = L'L in place, row by row from the leaves of the tree; L has the sparsity of M.

    The diagonal contains the reciprocals of the diagonal of L, because later solutions divide by it.
    """
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    for j in range(n - 1, -1, -1):
        row, depth, path = work[8 * n + freedoms[j]["row"] :], freedoms[j]["depth"], paths[freedoms[j]["path"] :]
        per = 1.0 / sqrt(row[depth])
        row[depth] = per
        for k in range(depth):
            row[k] *= per
        for k in range(depth):
            up, share = work[8 * n + freedoms[path[k]]["row"] :], row[k]
            for m in range(k + 1):
                up[m] -= share * row[m]


@njit
def solve_factor(tables, at):
    """Solve L' z = b in place, b at scratch[at], with the factored mass matrix M = L'L; |z|^2 = b' M^-1 b."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    b = work[at : at + n]
    for j in range(n - 1, -1, -1):
        row, depth, path = work[8 * n + freedoms[j]["row"] :], freedoms[j]["depth"], paths[freedoms[j]["path"] :]
        z = b[j] * row[depth]
        b[j] = z
        for k in range(depth):
            b[path[k]] -= row[k] * z


@njit
def solve_mass_matrix(tables, at):
    """Solve M x = b in place, b at scratch[at], with the mass matrix M factored."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    solve_factor(tables, at)
    b = work[at : at + n]
    for j in range(n):
        row, depth, path = work[8 * n + freedoms[j]["row"] :], freedoms[j]["depth"], paths[freedoms[j]["path"] :]
        x = b[j]
        for k in range(depth):
            x -= row[k] * b[path[k]]
        b[j] = x * row[depth]


@njit
def spread_accelerations(out, tables):
    """Write ACCELERATION and SPIN_RATE of all bodies to `out`, from the accelerations of the degrees of freedom.

    Those are in `scratch` after the columns S; the torques and forces of bodies in `scratch` are overwritten.
    """
    bodies, work, n = tables.bodies, tables.scratch, tables.freedoms.size
    loads = scratch_offsets(tables)[1]
    for i in range(bodies.size):
        body, at, acceleration = bodies[i], body_row(tables, i), work[loads + LOAD_SIZE * i :]
        own = out[at : at + BODY_OUT]
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
            own[SPIN_RATE + k] = own[SPIN_BIAS + k] + acceleration[k]
            own[ACCELERATION + k] = own[BIAS_AT_O + k] + acceleration[3 + k]
        write_vector(own, ACCELERATION, *origin_acceleration(own, 0, ACCELERATION, SPIN_RATE))


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
        write_vector(dydt, at, *joint_velocities(body, 0, y))
        first = 3
    h, a, b, c = joint_parameters(body, first, y)
    x, y0, z = joint_velocities(body, first, y)
    dydt[at + first] = -0.5 * (a * x + b * y0 + c * z)
    write_vector(dydt, at + first + 1, 0.5 * (h * x + b * z - c * y0), 0.5 * (h * y0 + c * x - a * z),
        0.5 * (h * z + a * y0 - b * x))  # fmt: skip


@njit
def add_point_force(out, tables, point, acts, x, y, z, at):
    """Add the generalised forces of a force (x, y, z) at a point of a body to the vector at scratch[at].

    For `acts` ABOUT, (x, y, z) is a torque. Nothing is added for a point of the world, or point < 0.
    """
    if point < 0 or tables.points[point]["body"] < 0:
        return
    i = tables.points[point]["body"]
    here = body_row(tables, i)
    if acts == ABOUT:
        add_body_wrench(tables, i, x, y, z, 0.0, 0.0, 0.0, at)
        return
    a, b, c = rotate(out, here + ATTITUDE, tables.points[point]["place"], 0)
    k = here + POSITION
    add_body_force(out, tables, i, out[k] + a, out[k + 1] + b, out[k + 2] + c, x, y, z, at)


@njit
def add_body_force(out, tables, i, px, py, pz, x, y, z, at):
    """Add the generalised forces of a force (x, y, z) on body i at (px, py, pz) to the vector at scratch[at].

    All are in axes of the world. Nothing is added for the world (i < 0).
    """
    if i >= 0:
        here = body_row(tables, i)
        a, b, c = (
            px - out[here + POSITION] + out[here + ARM],
            py - out[here + POSITION + 1] + out[here + ARM + 1],
            pz - out[here + POSITION + 2] + out[here + ARM + 2],
        )
        add_body_wrench(tables, i, b * z - c * y, c * x - a * z, a * y - b * x, x, y, z, at)


@njit
def add_body_wrench(tables, i, tx, ty, tz, fx, fy, fz, at):
    """Add the generalised forces of a load on body i, per degree of freedom, to the vector at scratch[at].

    (tx, ty, tz), (fx, fy, fz) : torque about the reference point o, and force, in axes of the world
    Nothing is added if no degree of freedom moves the body, or for the world (i < 0).
    """
    work, i = tables.scratch, nearest_free_body(tables, i)
    if i < 0:
        return
    path, count = freedom_path(tables, i)
    for k in range(count):
        j = tables.integers[path + k]
        s = 6 * j
        turn = work[s] * tx + work[s + 1] * ty + work[s + 2] * tz
        work[at + j] += turn + (work[s + 3] * fx + work[s + 4] * fy + work[s + 5] * fz)


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


@njit
def body_rate_limit(out, tables):
    """Upper bound of the rates of bodies [1/s], c / 2 + sqrt(c^2 / 4 + k), at least the greatest angular velocity.

    It is at least out[RATE] too. k, c : sums over springs and dampers, also of joints, of stiffness and damping, each
    times b' M^-1 b; M : factored mass matrix, b : direction of the force. The trace of M^-1 K is at least its greatest
    eigenvalue; K : stiffness matrix.
    """
    rate, freedoms, work, lines = out[RATE], tables.freedoms, tables.scratch, tables.lines
    stiffness, damping, n, at = 0.0, 0.0, freedoms.size, 7 * freedoms.size
    turns = 0.0
    for i in range(tables.bodies.size):
        own = out[body_row(tables, i) :]
        turns = max(turns, own[SPIN] * own[SPIN] + own[SPIN + 1] * own[SPIN + 1] + own[SPIN + 2] * own[SPIN + 2])
        if tables.bodies[i]["damping"] > 0.0 or tables.bodies[i]["stiffness"] > 0.0:
            for j in range(tables.bodies[i]["freedom"], tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"]):
                for m in range(n):
                    work[at + m] = 1.0 if m == j else 0.0
                inverse_mass = mobility(tables, at)
                damping += tables.bodies[i]["damping"] * inverse_mass
                stiffness += tables.bodies[i]["stiffness"] * inverse_mass
    for k in range(lines.size):
        line, u = lines[k], tables.layout[0]["along"] + 3 * k
        spring, damper = push_stiffness(out, tables, line["push"])
        if spring == 0.0 and damper == 0.0:
            continue
        for m in range(n):
            work[at + m] = 0.0
        add_point_force(out, tables, line["to_point"], line["acts"], out[u], out[u + 1], out[u + 2], at)
        add_point_force(out, tables, line["from_point"], line["acts"], -out[u], -out[u + 1], -out[u + 2], at)
        inverse_mass = mobility(tables, at)
        stiffness += spring * inverse_mass
        damping += damper * inverse_mass
    return max(max(rate, sqrt(turns)), 0.5 * damping + sqrt(0.25 * damping * damping + stiffness))


@njit
def start_mass_matrix(t, y, dydt, out, handle):
    """Write the forces of the degrees of freedom and the mass matrix to `scratch`, for the equilibrium at the start."""
    fill_mass_matrix(y, out, open_tables(handle))


@njit
def state_rates(y, dydt, tables):
    """Write the rates of all states of joints to `dydt`, with accelerations from `scratch`, unless it is empty."""
    bodies, work, n = tables.bodies, tables.scratch, tables.freedoms.size
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
    tables = open_tables(handle)
    fill_mass_matrix(y, out, tables)
    factor_mass_matrix(tables)
    solve_mass_matrix(tables, 6 * tables.freedoms.size)
    spread_accelerations(out, tables)
    out[RATE] = body_rate_limit(out, tables)
    state_rates(y, dydt, tables)
