"""Accelerations of bodies: M q'' = forces - bias, M by composite bodies, factored along the tree. Knows no joint's law.

Lagrange's equations (70) of a tree, as Newton's and Euler's (68) of its bodies projected on the columns S of the
joints: M_jk = S_k . I_j S_j with I_j the inertia of all that hangs on joint j (Featherstone, 2008, chapter 6), a row of
it being the freedoms between j and the root alone; M = L'L fills in nothing else. In `scratch`, freedoms first: S (6 a
freedom), forces and then accelerations, a column, M; of bodies ten numbers of inertia about o (mass, mass times centre,
xx yy zz xy xz yz) and six of force.
"""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.masses import held_by
from fvsolve.kernels.mechanism.joints import at_origin, parameters, rates
from fvsolve.kernels.mechanism.laden import add_networks
from fvsolve.kernels.mechanism.room import (
    ACCELERATION,
    APPARENT,
    ARM,
    ATTITUDE,
    FORCE,
    PLACE,
    SPIN,
    SPIN_BIAS,
    STREAM,
    TORQUE,
    TURNING,
    cross,
    put,
    row_of,
    turned,
)
from fvsolve.kernels.mechanism.tanks import add_tanks
from fvsolve.kernels.records import ABOUT, FREE, PRISMATIC, RATE, REVOLUTE

INERTIA, LOAD = 10, 6


@njit(forceinline=True)
def loads_at(tables):
    """Where inertias, then forces of bodies stand in `scratch`."""
    freedoms, n = tables.freedoms, tables.freedoms.size
    rows = freedoms[n - 1]["row"] + freedoms[n - 1]["depth"] + 1 if n > 0 else 0
    first = 8 * n + rows
    return first, first + INERTIA * tables.bodies.size


@njit
def columns(body, out, here, work, at):
    """S of the freedoms of a joint: angular and linear velocity that each gives the axes at o."""
    kind, x, y, z = body["joint"], out[here + ARM], out[here + ARM + 1], out[here + ARM + 2]
    if kind == FREE:
        for k in range(18):
            work[at + k] = 0.0
        work[at + 3] = work[at + 10] = work[at + 17] = 1.0
        at += 18
    if kind == REVOLUTE or kind == PRISMATIC:
        a, b, c = turned(out, here + ATTITUDE, body["axis"], 0)
        if kind == PRISMATIC:
            put(work, at, 0.0, 0.0, 0.0)
            put(work, at + 3, a, b, c)
        else:
            put(work, at, a, b, c)
            put(work, at + 3, y * c - z * b, z * a - x * c, x * b - y * a)
        return
    for k in range(3):
        a, b, c = out[here + ATTITUDE + k], out[here + ATTITUDE + 3 + k], out[here + ATTITUDE + 6 + k]
        put(work, at + 6 * k, a, b, c)
        if kind == FREE:
            put(work, at + 6 * k + 3, 0.0, 0.0, 0.0)
        else:
            put(work, at + 6 * k + 3, y * c - z * b, z * a - x * c, x * b - y * a)


@njit
def inertia_at(body, out, here, work, at):
    """Ten numbers of a body about o: R J R' and what its mass adds."""
    m, own, r = body["mass"], body["inertia"], here + ATTITUDE
    gx, gy, gz = turned(out, r, body["centre"], 0)
    gx, gy, gz = gx + out[here + ARM], gy + out[here + ARM + 1], gz + out[here + ARM + 2]
    work[at] = m
    put(work, at + 1, m * gx, m * gy, m * gz)
    ax, ay, az = back_row(out, r, own)
    bx, by, bz = back_row(out, r + 3, own)
    cx, cy, cz = back_row(out, r + 6, own)
    work[at + 4] = ax * out[r] + ay * out[r + 1] + az * out[r + 2] + m * (gy * gy + gz * gz)
    work[at + 5] = bx * out[r + 3] + by * out[r + 4] + bz * out[r + 5] + m * (gx * gx + gz * gz)
    work[at + 6] = cx * out[r + 6] + cy * out[r + 7] + cz * out[r + 8] + m * (gx * gx + gy * gy)
    work[at + 7] = ax * out[r + 3] + ay * out[r + 4] + az * out[r + 5] - m * gx * gy
    work[at + 8] = ax * out[r + 6] + ay * out[r + 7] + az * out[r + 8] - m * gx * gz
    work[at + 9] = bx * out[r + 6] + by * out[r + 7] + bz * out[r + 8] - m * gy * gz


@njit(forceinline=True)
def back_row(out, r, own):
    """A row of R times the inertia of a body in its own axes."""
    x, y, z = out[r], out[r + 1], out[r + 2]
    return (
        x * own[0] + y * own[3] + z * own[6],
        x * own[1] + y * own[4] + z * own[7],
        x * own[2] + y * own[5] + z * own[8],
    )


@njit(forceinline=True)
def momentum(work, at, wx, wy, wz, vx, vy, vz):
    """(torque or angular momentum about o, force or momentum) that an inertia has with (w, v), six numbers."""
    m, hx, hy, hz = work[at], work[at + 1], work[at + 2], work[at + 3]
    xx, yy, zz, xy, xz, yz = work[at + 4], work[at + 5], work[at + 6], work[at + 7], work[at + 8], work[at + 9]
    return (
        xx * wx + xy * wy + xz * wz + hy * vz - hz * vy,
        xy * wx + yy * wy + yz * wz + hz * vx - hx * vz,
        xz * wx + yz * wy + zz * wz + hx * vy - hy * vx,
        m * vx + wy * hz - wz * hy,
        m * vy + wz * hx - wx * hz,
        m * vz + wx * hy - wy * hx,
    )


@njit
def bias(out, here, work, inertia, load):
    """What a body's motion asks of its joint about o, less what pushes it: I A + V x* I V - forces."""
    w, v, a, c = here + SPIN, here + STREAM, here + SPIN_BIAS, here + APPARENT
    lx, ly, lz, px, py, pz = momentum(work, inertia, out[w], out[w + 1], out[w + 2], out[v], out[v + 1], out[v + 2])
    tx, ty, tz, fx, fy, fz = momentum(work, inertia, out[a], out[a + 1], out[a + 2], out[c], out[c + 1], out[c + 2])
    ax, ay, az = cross(out, w, lx, ly, lz)
    bx, by, bz = cross(out, v, px, py, pz)
    gx, gy, gz = cross(out, w, px, py, pz)
    f, m = here + FORCE, here + TORQUE
    ex, ey, ez = cross(out, here + ARM, out[f], out[f + 1], out[f + 2])
    put(work, load, tx + ax + bx - out[m] - ex, ty + ay + by - out[m + 1] - ey, tz + az + bz - out[m + 2] - ez)
    put(work, load + 3, fx + gx - out[f], fy + gy - out[f + 1], fz + gz - out[f + 2])


@njit
def fill(y, out, tables):
    """S, M and the forces of all freedoms in `scratch`, the balance of the start taken off."""
    bodies, freedoms, work, paths = tables.bodies, tables.freedoms, tables.scratch, tables.integers
    n = freedoms.size
    first, loads = loads_at(tables)
    for i in range(bodies.size):
        here, inertia = row_of(tables, i), first + INERTIA * i
        if bodies[i]["freedoms"] > 0:
            columns(bodies[i], out, here, work, 6 * bodies[i]["freedom"])
        inertia_at(bodies[i], out, here, work, inertia)
        bias(out, here, work, inertia, loads + LOAD * i)
    for i in range(bodies.size - 1, -1, -1):
        body, inertia, load = bodies[i], first + INERTIA * i, loads + LOAD * i
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s, row, path, depth = 6 * j, 8 * n + freedoms[j]["row"], freedoms[j]["path"], freedoms[j]["depth"]
            found = 0.0
            for k in range(6):
                found -= work[s + k] * work[load + k]
            if body["damping"] > 0.0:
                k = body["rate"] + (j - body["freedom"])
                found -= body["damping"] * (body["speed"][j - body["freedom"]] + y[k])
            if body["stiffness"] > 0.0:
                found -= body["stiffness"] * (body["start"][0] + y[body["y"]])
            work[6 * n + j] = found - freedoms[j]["balance"]  # last, so that what is balanced leaves no bit
            tx, ty, tz, fx, fy, fz = momentum(
                work, inertia, work[s], work[s + 1], work[s + 2], work[s + 3], work[s + 4], work[s + 5]
            )
            for k in range(depth + 1):
                c = 6 * paths[path + k]
                turn = work[c] * tx + work[c + 1] * ty + work[c + 2] * tz
                work[row + k] = turn + (work[c + 3] * fx + work[c + 4] * fy + work[c + 5] * fz)
        if body["parent"] >= 0:
            up, over = first + INERTIA * body["parent"], loads + LOAD * body["parent"]
            for k in range(INERTIA):
                work[up + k] += work[inertia + k]
            for k in range(LOAD):
                work[over + k] += work[load + k]
    add_tanks(out, tables)
    add_networks(y, out, tables)


@njit
def factor(tables):
    """M = L'L in its own place, rows of freedoms from the leaves on; L has no entry that M has not."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    for j in range(n - 1, -1, -1):
        row, depth, path = 8 * n + freedoms[j]["row"], freedoms[j]["depth"], freedoms[j]["path"]
        root = sqrt(work[row + depth])
        work[row + depth] = root
        for k in range(depth):
            work[row + k] /= root
        for k in range(depth):
            up, share = 8 * n + freedoms[paths[path + k]]["row"], work[row + k]
            for m in range(k + 1):
                work[up + m] -= share * work[row + m]


@njit
def halve(tables, at):
    """z with L' z = b, in the place of b at scratch[at]: |z|^2 = b' M^-1 b."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    for j in range(n - 1, -1, -1):
        row, depth, path = 8 * n + freedoms[j]["row"], freedoms[j]["depth"], freedoms[j]["path"]
        z = work[at + j] / work[row + depth]
        work[at + j] = z
        for k in range(depth):
            work[at + paths[path + k]] -= work[row + k] * z


@njit
def solve(tables, at):
    """x with M x = b, in the place of b at scratch[at]."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    halve(tables, at)
    for j in range(n):
        row, depth, path = 8 * n + freedoms[j]["row"], freedoms[j]["depth"], freedoms[j]["path"]
        x = work[at + j]
        for k in range(depth):
            x -= work[row + k] * work[at + paths[path + k]]
        work[at + j] = x / work[row + depth]


@njit
def spread(out, tables):
    """Accelerations of all bodies from those of the freedoms, down the tree."""
    bodies, work, n = tables.bodies, tables.scratch, tables.freedoms.size
    loads = loads_at(tables)[1]
    for i in range(bodies.size):
        body, here, own = bodies[i], row_of(tables, i), loads + LOAD * i
        for k in range(LOAD):
            work[own + k] = work[loads + LOAD * body["parent"] + k] if body["parent"] >= 0 else 0.0
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            for k in range(LOAD):
                work[own + k] += work[6 * j + k] * work[6 * n + j]
        for k in range(3):  # for a while where what comes of it belongs
            out[here + TURNING + k] = out[here + SPIN_BIAS + k] + work[own + k]
            out[here + ACCELERATION + k] = out[here + APPARENT + k] + work[own + 3 + k]
        put(out, here + ACCELERATION, *at_origin(out, here, here + ACCELERATION, TURNING))


@njit
def coordinate_rates(body, y, dydt):
    """d/dt of a joint's coordinates: its velocities, of Euler parameters those of (44) with w in the body's axes."""
    at, first = body["y"], 0
    if body["joint"] == REVOLUTE or body["joint"] == PRISMATIC:
        dydt[at] = body["speed"][0] + y[body["rate"]]
        return
    if body["joint"] == FREE:
        put(dydt, at, *rates(body, 0, y))
        first = 3
    h, a, b, c = parameters(body, first, y)
    x, y0, z = rates(body, first, y)
    dydt[at + first] = -0.5 * (a * x + b * y0 + c * z)
    put(dydt, at + first + 1, 0.5 * (h * x + b * z - c * y0), 0.5 * (h * y0 + c * x - a * z),
        0.5 * (h * z + a * y0 - b * x))  # fmt: skip


@njit
def lean(out, tables, point, acts, x, y, z, at):
    """Add to b at scratch[at] what a force, or a torque, of one at a point is to the freedoms that move it."""
    if point < 0 or tables.points[point]["body"] < 0:
        return
    i = tables.points[point]["body"]
    here = row_of(tables, i)
    if acts == ABOUT:
        lean_by(tables, i, x, y, z, 0.0, 0.0, 0.0, at)
        return
    a, b, c = turned(out, here + ATTITUDE, tables.points[point]["place"], 0)
    k = here + PLACE
    lean_at(out, tables, i, out[k] + a, out[k + 1] + b, out[k + 2] + c, x, y, z, at)


@njit
def lean_at(out, tables, i, px, py, pz, x, y, z, at):
    """The same of a force on body i at a place of the world; on the world (i < 0) nothing."""
    if i >= 0:
        here = row_of(tables, i)
        a, b, c = (
            px - out[here + PLACE] + out[here + ARM],
            py - out[here + PLACE + 1] + out[here + ARM + 1],
            pz - out[here + PLACE + 2] + out[here + ARM + 2],
        )
        lean_by(tables, i, b * z - c * y, c * x - a * z, a * y - b * x, x, y, z, at)


@njit
def lean_by(tables, i, tx, ty, tz, fx, fy, fz, at):
    """The same of a torque about o and a force on body i."""
    work, freedoms, paths = tables.scratch, tables.freedoms, tables.integers
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    if i < 0:
        return
    last = freedoms[tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"] - 1]
    for k in range(last["depth"] + 1):
        j = paths[last["path"] + k]
        s = 6 * j
        turn = work[s] * tx + work[s + 1] * ty + work[s + 2] * tz
        work[at + j] += turn + (work[s + 3] * fx + work[s + 4] * fy + work[s + 5] * fz)


@njit
def ease(tables, at):
    """b' M^-1 b, of M factored and b at scratch[at]: how easily bodies give way to b."""
    work, total = tables.scratch, 0.0
    halve(tables, at)
    for j in range(tables.freedoms.size):
        total += work[at + j] * work[at + j]
    return total


@njit
def quickest_body(out, tables):
    """A bound of the rates [1/s] of bodies: c / 2 + sqrt(c^2 / 4 + k), k and c summed over pushes with b' M^-1 b.

    The trace of M^-1 K is above its greatest eigenvalue. What turns counts with its angular velocity.
    """
    rate, freedoms, work, lines = out[RATE], tables.freedoms, tables.scratch, tables.lines
    stiffness, damping, n, at = 0.0, 0.0, freedoms.size, 7 * freedoms.size
    for i in range(tables.bodies.size):
        w = row_of(tables, i) + SPIN
        rate = max(rate, sqrt(out[w] * out[w] + out[w + 1] * out[w + 1] + out[w + 2] * out[w + 2]))
        if tables.bodies[i]["damping"] > 0.0 or tables.bodies[i]["stiffness"] > 0.0:
            for j in range(tables.bodies[i]["freedom"], tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"]):
                for m in range(n):
                    work[at + m] = 1.0 if m == j else 0.0
                easy = ease(tables, at)
                damping += tables.bodies[i]["damping"] * easy
                stiffness += tables.bodies[i]["stiffness"] * easy
    for k in range(lines.size):
        line, u = lines[k], tables.layout[0]["along"] + 3 * k
        spring, brake = held_by(out, tables, line["push"])
        if spring == 0.0 and brake == 0.0:
            continue
        for m in range(n):
            work[at + m] = 0.0
        lean(out, tables, line["to_point"], line["acts"], out[u], out[u + 1], out[u + 2], at)
        lean(out, tables, line["from_point"], line["acts"], -out[u], -out[u + 1], -out[u + 2], at)
        easy = ease(tables, at)
        stiffness += spring * easy
        damping += brake * easy
    return max(rate, 0.5 * damping + sqrt(0.25 * damping * damping + stiffness))


@njit
def weigh(t, y, dydt, out, handle):
    """Forces of freedoms and M alone, as the start asks for them."""
    fill(y, out, open_tables(handle))


@njit
def state_rates(y, dydt, tables):
    """Rates of the states of joints from the accelerations of their freedoms; none where dydt is empty."""
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
def accelerate(t, y, dydt, out, handle):
    """Accelerations of all bodies under their forces, rates of their states."""
    tables = open_tables(handle)
    fill(y, out, tables)
    factor(tables)
    solve(tables, 6 * tables.freedoms.size)
    spread(out, tables)
    out[RATE] = quickest_body(out, tables)
    state_rates(y, dydt, tables)
