"""Accelerations of bodies: M q'' = forces - bias, M by composite bodies, factored along the tree. Knows no joint's law.

Lagrange's equations (70) of a tree, as Newton's and Euler's (68) of its bodies projected on the columns S of the
joints: M_jk = S_k . I_j S_j with I_j the inertia of all that hangs on joint j (Featherstone, 2008, chapter 6), a row of
it being the freedoms between j and the root alone; M = L'L fills in nothing else. In `scratch`, freedoms first: S (6 a
freedom), forces and then accelerations, a column, M; of bodies ten numbers of inertia about o (mass, mass times centre,
xx yy zz xy xz yz) and six of force.
"""

from math import sqrt

from fvsolve.jit import inner, njit
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
    carrier,
    cross,
    path_of,
    put,
    row_of,
    turned,
)
from fvsolve.kernels.mechanism.tanks import add_tanks
from fvsolve.kernels.records import ABOUT, BODY_OUT, FREE, PRISMATIC, RATE, REVOLUTE

INERTIA, LOAD = 10, 6


@njit(forceinline=True)
def loads_at(tables):
    """Where inertias, then forces of bodies stand in `scratch`."""
    freedoms, n = tables.freedoms, tables.freedoms.size
    rows = freedoms[n - 1]["row"] + freedoms[n - 1]["depth"] + 1 if n > 0 else 0
    first = 8 * n + rows
    return first, first + INERTIA * tables.bodies.size


@inner
def columns(body, own, s):
    """S of the freedoms of a joint: angular and linear velocity that each gives the axes at o; own : the body's row."""
    kind, x, y, z = body["joint"], own[ARM], own[ARM + 1], own[ARM + 2]
    first = 0
    if kind == FREE:
        for k in range(18):
            s[k] = 0.0
        s[3] = s[10] = s[17] = 1.0
        first = 18
    if kind == REVOLUTE or kind == PRISMATIC:
        a, b, c = turned(own, ATTITUDE, body["axis"], 0)
        if kind == PRISMATIC:
            put(s, 0, 0.0, 0.0, 0.0)
            put(s, 3, a, b, c)
        else:
            put(s, 0, a, b, c)
            put(s, 3, y * c - z * b, z * a - x * c, x * b - y * a)
        return
    for k in range(3):
        a, b, c = own[ATTITUDE + k], own[ATTITUDE + 3 + k], own[ATTITUDE + 6 + k]
        put(s, first + 6 * k, a, b, c)
        if kind == FREE:
            put(s, first + 6 * k + 3, 0.0, 0.0, 0.0)
        else:
            put(s, first + 6 * k + 3, y * c - z * b, z * a - x * c, x * b - y * a)


@inner
def inertia_at(body, own, found):
    """Ten numbers of a body about o: R J R' and what its mass adds."""
    m, inertia, r = body["mass"], body["inertia"], ATTITUDE
    gx, gy, gz = turned(own, r, body["centre"], 0)
    gx, gy, gz = gx + own[ARM], gy + own[ARM + 1], gz + own[ARM + 2]
    found[0] = m
    put(found, 1, m * gx, m * gy, m * gz)
    ax, ay, az = back_row(own, r, inertia)
    bx, by, bz = back_row(own, r + 3, inertia)
    cx, cy, cz = back_row(own, r + 6, inertia)
    found[4] = ax * own[r] + ay * own[r + 1] + az * own[r + 2] + m * (gy * gy + gz * gz)
    found[5] = bx * own[r + 3] + by * own[r + 4] + bz * own[r + 5] + m * (gx * gx + gz * gz)
    found[6] = cx * own[r + 6] + cy * own[r + 7] + cz * own[r + 8] + m * (gx * gx + gy * gy)
    found[7] = ax * own[r + 3] + ay * own[r + 4] + az * own[r + 5] - m * gx * gy
    found[8] = ax * own[r + 6] + ay * own[r + 7] + az * own[r + 8] - m * gx * gz
    found[9] = bx * own[r + 6] + by * own[r + 7] + bz * own[r + 8] - m * gy * gz


@njit(forceinline=True)
def back_row(own, r, inertia):
    """A row of R times the inertia of a body in its own axes."""
    x, y, z = own[r], own[r + 1], own[r + 2]
    return (
        x * inertia[0] + y * inertia[3] + z * inertia[6],
        x * inertia[1] + y * inertia[4] + z * inertia[7],
        x * inertia[2] + y * inertia[5] + z * inertia[8],
    )


@njit(forceinline=True)
def momentum(inertia, wx, wy, wz, vx, vy, vz):
    """(torque or angular momentum about o, force or momentum) that an inertia has with (w, v), six numbers."""
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


@inner
def bias(own, inertia, load):
    """What a body's motion asks of its joint about o, less what pushes it: I A + V x* I V - forces."""
    w, v, a, c = SPIN, STREAM, SPIN_BIAS, APPARENT
    lx, ly, lz, px, py, pz = momentum(inertia, own[w], own[w + 1], own[w + 2], own[v], own[v + 1], own[v + 2])
    tx, ty, tz, fx, fy, fz = momentum(inertia, own[a], own[a + 1], own[a + 2], own[c], own[c + 1], own[c + 2])
    ax, ay, az = cross(own, w, lx, ly, lz)
    bx, by, bz = cross(own, v, px, py, pz)
    gx, gy, gz = cross(own, w, px, py, pz)
    f, m = FORCE, TORQUE
    ex, ey, ez = cross(own, ARM, own[f], own[f + 1], own[f + 2])
    put(load, 0, tx + ax + bx - own[m] - ex, ty + ay + by - own[m + 1] - ey, tz + az + bz - own[m + 2] - ez)
    put(load, 3, fx + gx - own[f], fy + gy - own[f + 1], fz + gz - own[f + 2])


@njit
def fill(y, out, tables):
    """S, M and the forces of all freedoms in `scratch`, the balance of the start taken off."""
    bodies, freedoms, work, paths = tables.bodies, tables.freedoms, tables.scratch, tables.integers
    n = freedoms.size
    first, loads = loads_at(tables)
    for i in range(bodies.size):  # whose numbers are views: indices that are constants cost no more than they must
        here, at = row_of(tables, i), first + INERTIA * i
        own, inertia, load = out[here : here + BODY_OUT], work[at : at + INERTIA], work[loads + LOAD * i :]
        if bodies[i]["freedoms"] > 0:
            columns(bodies[i], own, work[6 * bodies[i]["freedom"] :])
        inertia_at(bodies[i], own, inertia)
        bias(own, inertia, load)
    for i in range(bodies.size - 1, -1, -1):
        body, at = bodies[i], first + INERTIA * i
        inertia, load = work[at : at + INERTIA], work[loads + LOAD * i :]
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s, path, depth = work[6 * j :], paths[freedoms[j]["path"] :], freedoms[j]["depth"]
            row = work[8 * n + freedoms[j]["row"] :]
            found = -(s[0] * load[0] + s[1] * load[1] + s[2] * load[2])
            found -= s[3] * load[3] + s[4] * load[4] + s[5] * load[5]
            if body["damping"] > 0.0:
                k = body["rate"] + (j - body["freedom"])
                found -= body["damping"] * (body["speed"][j - body["freedom"]] + y[k])
            if body["stiffness"] > 0.0:
                found -= body["stiffness"] * (body["start"][0] + y[body["y"]])
            work[6 * n + j] = found - freedoms[j]["balance"]  # last, so that what is balanced leaves no bit
            tx, ty, tz, fx, fy, fz = momentum(inertia, s[0], s[1], s[2], s[3], s[4], s[5])
            for k in range(depth + 1):
                c = work[6 * path[k] :]
                turn = c[0] * tx + c[1] * ty + c[2] * tz
                row[k] = turn + (c[3] * fx + c[4] * fy + c[5] * fz)
        if body["parent"] >= 0:
            over, up = work[first + INERTIA * body["parent"] :], work[loads + LOAD * body["parent"] :]
            for k in range(INERTIA):
                over[k] += inertia[k]
            for k in range(LOAD):
                up[k] += load[k]
    add_tanks(out, tables)
    add_networks(y, out, tables)


@njit
def factor(tables):
    """M = L'L in its own place, rows of freedoms from the leaves on; L has no entry that M has not.

    On the diagonal stands 1 over that of L, which is what all who come later divide by.
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
def halve(tables, at):
    """z with L' z = b, in the place of b at scratch[at]: |z|^2 = b' M^-1 b."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    b = work[at : at + n]
    for j in range(n - 1, -1, -1):
        row, depth, path = work[8 * n + freedoms[j]["row"] :], freedoms[j]["depth"], paths[freedoms[j]["path"] :]
        z = b[j] * row[depth]
        b[j] = z
        for k in range(depth):
            b[path[k]] -= row[k] * z


@njit
def solve(tables, at):
    """x with M x = b, in the place of b at scratch[at]."""
    freedoms, work, paths, n = tables.freedoms, tables.scratch, tables.integers, tables.freedoms.size
    halve(tables, at)
    b = work[at : at + n]
    for j in range(n):
        row, depth, path = work[8 * n + freedoms[j]["row"] :], freedoms[j]["depth"], paths[freedoms[j]["path"] :]
        x = b[j]
        for k in range(depth):
            x -= row[k] * b[path[k]]
        b[j] = x * row[depth]


@njit
def spread(out, tables):
    """Accelerations of all bodies from those of the freedoms, down the tree."""
    bodies, work, n = tables.bodies, tables.scratch, tables.freedoms.size
    loads = loads_at(tables)[1]
    for i in range(bodies.size):
        body, at, given = bodies[i], row_of(tables, i), work[loads + LOAD * i :]
        own = out[at : at + BODY_OUT]
        if body["parent"] >= 0:
            up = work[loads + LOAD * body["parent"] :]
            for k in range(LOAD):
                given[k] = up[k]
        else:
            for k in range(LOAD):
                given[k] = 0.0
        for j in range(body["freedom"], body["freedom"] + body["freedoms"]):
            s, rate = work[6 * j :], work[6 * n + j]
            for k in range(LOAD):
                given[k] += s[k] * rate
        for k in range(3):  # for a while where what comes of it belongs
            own[TURNING + k] = own[SPIN_BIAS + k] + given[k]
            own[ACCELERATION + k] = own[APPARENT + k] + given[3 + k]
        put(own, ACCELERATION, *at_origin(own, 0, ACCELERATION, TURNING))


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
    work, i = tables.scratch, carrier(tables, i)
    if i < 0:
        return
    path, many = path_of(tables, i)
    for k in range(many):
        j = tables.integers[path + k]
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
    turns = 0.0
    for i in range(tables.bodies.size):
        own = out[row_of(tables, i) :]
        turns = max(turns, own[SPIN] * own[SPIN] + own[SPIN + 1] * own[SPIN + 1] + own[SPIN + 2] * own[SPIN + 2])
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
    return max(max(rate, sqrt(turns)), 0.5 * damping + sqrt(0.25 * damping * damping + stiffness))


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
