"""What the motion of a body does to the fluid in pipes, rigid columns and tanks on it. Knows stretches; moves no body.

In axes of the body a stretch from r1 to r2 is driven, per mass of what is in it, by

    (g - a_o) . (r2 - r1) - W' . w + (|W x r2|^2 - |W x r1|^2) / 2,  w = integral of r x dr along it,

a_o the acceleration of the body's origin, W its angular velocity: Lagrange's (70) for fluid that slides along a given
way. Coriolis forces stand at right angles to it. Of this, what gravity does at the start is in the profile already.
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.room import ATTITUDE, BIAS, SPIN, SPIN_BIAS, VELOCITY, back, cross, dot, put, row_of
from fvsolve.kernels.records import NO_WEIGHT, STATUS, TANK, WHERE
from fvsolve.kernels.tanks import tank_level

GRAVITY, TURN, EULER, DRIFT = 0, 3, 6, 9  # in scratch: g - a_o, W, W' and the origin's velocity, in axes of a body
THIN = 1e-6  # [m]


@njit
def set_axes(tables, out, i, wide, spin):
    """What body i does in its own axes, into scratch, with the accelerations at out[row + wide] and out[row + spin]."""
    here, own = row_of(tables, i), tables.scratch
    b, w, e, v = here + wide, here + SPIN, here + spin, here + VELOCITY
    down = -tables.settings[0]["gravity"]
    put(own, GRAVITY, *back(out, here + ATTITUDE, -out[b], -out[b + 1], down - out[b + 2]))
    put(own, TURN, *back(out, here + ATTITUDE, out[w], out[w + 1], out[w + 2]))
    put(own, EULER, *back(out, here + ATTITUDE, out[e], out[e + 1], out[e + 2]))
    put(own, DRIFT, *back(out, here + ATTITUDE, out[v], out[v + 1], out[v + 2]))


@njit
def speed_squared(own, x, y, z):
    """|W x r|^2 [m2/s2]."""
    u, v, w = cross(own, TURN, x, y, z)
    return u * u + v * v + w * w


@njit
def drive_along(own, r1, r2, wx, wy, wz):
    """What drives a stretch from r1 to r2 [J/kg], by `set_axes` of its body; (wx, wy, wz): integral of r x dr."""
    found = dot(own, GRAVITY, r2[0] - r1[0], r2[1] - r1[1], r2[2] - r1[2]) - dot(own, EULER, wx, wy, wz)
    return found + 0.5 * (speed_squared(own, r2[0], r2[1], r2[2]) - speed_squared(own, r1[0], r1[1], r1[2]))


@njit
def set_rides(t, y, dydt, out, handle):
    """What drives all stretches since the start, into out[ride]."""
    tables = open_tables(handle)
    rides, at, last = tables.rides, tables.layout[0]["ride"], -1
    for k in range(rides.size):
        ride = rides[k]
        if ride["body"] != last:
            last = ride["body"]
            set_axes(tables, out, last, BIAS, SPIN_BIAS)
        w = ride["swept"]
        out[at + k] = drive_along(tables.scratch, ride["start"], ride["end"], w[0], w[1], w[2]) - ride["rest"]


@njit
def weight_under(tables, out, ride, level):
    """What presses on the bottom of a tank [J/kg], filled to a level along its body's z [m]."""
    set_axes(tables, out, ride["body"], BIAS, SPIN_BIAS)
    own, r = tables.scratch, ride["start"]
    x, y, z = r[0], r[1], r[2]
    squares = speed_squared(own, x, y, z + level) - speed_squared(own, x, y, z)
    return -(level * (own[GRAVITY + 2] - (own[EULER] * y - own[EULER + 1] * x)) + 0.5 * squares)


@njit
def press_tanks(t, y, dydt, out, handle):
    """Pressures at the bottoms of tanks that ride, under the linear law; p' = rho (weight now - that of the profile).

    One that nothing presses would lose what it holds, and ends the run.
    """
    tables = open_tables(handle)
    nodes, rho = tables.nodes, tables.settings[0]["rho"]
    for i in range(nodes.size):
        node = nodes[i]
        if node["kind"] == TANK and node["ride"] >= 0:
            ride, level = tables.rides[node["ride"]], tank_level(node, tables.floats, rho, y[node["y"]])
            out[tables.layout[0]["pressure"] + i] = rho * (weight_under(tables, out, ride, level) - ride["rest"])
            mark_weightless(tables, out, i, ride, level)


@njit
def mark_weightless(tables, out, i, ride, level):
    """Say so where the surface of the tank at node i is pressed no more: its place is behind those of basins."""
    if not weight_under(tables, out, ride, level + THIN) > weight_under(tables, out, ride, level):
        out[STATUS], out[WHERE] = NO_WEIGHT, tables.basins.size + i


@njit
def push_columns(t, y, dydt, out, handle):
    """d/dt of the flow in rigid columns as their profile has it, but for what drives them since the start."""
    tables = open_tables(handle)
    columns, p, at = tables.columns, tables.layout[0]["pressure"], tables.layout[0]["ride"]
    for k in range(columns.size):
        column, drive = columns[k], 0.0
        for m in range(column["rides"] if column["ride"] >= 0 else 0):
            drive += out[at + column["ride"] + m]
        drop = out[p + column["from_node"]] - out[p + column["to_node"]] + tables.settings[0]["rho"] * drive
        dydt[column["y"]] = column["area"] / column["length"] * (drop + column["offset"])


@njit
def push_cells(t, y, dydt, out, handle):
    """Add what drives the cells of pipes to their waves under the linear law: A rho / dx of it to dM/dt."""
    tables = open_tables(handle)
    pipes, rho, at = tables.pipes, tables.settings[0]["rho"], tables.layout[0]["ride"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n, o, ride = pipe["cells"], pipe["y"], pipe["ride"]
        half = 0.5 * pipe["area"] * rho / pipe["dx"]
        for k in range(n if ride >= 0 else 0):
            push = half * out[at + ride + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push
