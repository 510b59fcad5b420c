"""Force and torque of contained fluid on its body, in axes of the body and about its origin.

Fluid lies along straight segments. A segment from r along the unit vector t has the mass moments m = (m0, m1, m2), the
integrals of 1, s and s^2 over its mass; s is the distance from r, and d are the rates of m. A flow path has (C, Z), the
integrals of dr and r x dr along it, and carries the mass flow M. By the equations of Newton and Euler ((68) of
docs/course.md) for all fluid, the load on the body is

    force   m0 G - W' x S - W x (W x S + S') - (M C)' - W x M C
    torque  S x G - J W' - J' W - W x J W - (M Z)' - W x M Z

A prime is d/dt. S is the sum of mass times position, J the inertia about the origin. G = g - a_o is gravity minus the
acceleration of the origin, W the angular velocity; `noninertial_forces.set_body_motion` writes G, W and W' to `scratch`
(also named `motion`). Fluid leaves a network with the velocity of its node. The flow inside a tank is that of the first
cell of each connected pipe, and of each connected rigid column. A load is a tuple of six numbers: force [N], torque
[N m].
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CHAMBER, FIXED, JUNCTION, LAW_LINEAR, MOVED_BY_FORCES, TANK
from fvsolve.kernels.mechanism.body_layout import (
    ATTITUDE,
    BIAS,
    SPIN_BIAS,
    add_force,
    add_torque,
    body_row,
    cross,
    rotate,
)
from fvsolve.kernels.mechanism.noninertial_forces import BODY_GRAVITY, BODY_SPIN, BODY_SPIN_RATE, set_body_motion
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tanks import tank_level

ZERO_VECTOR = (0.0, 0.0, 0.0)
ZERO_FLOW_PATH = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit(forceinline=True)
def to_world(out, here, x, y, z):
    """Vector (x, y, z) in axes of a body, transformed to axes of the world; here : offset of the body in `out`."""
    return rotate(out, here + ATTITUDE, (x, y, z), 0)


@njit(forceinline=True)
def as_tuple(a):
    """Vector of the first three numbers of an array, as a tuple."""
    return a[0], a[1], a[2]


@njit(forceinline=True)
def add_six(a, b):
    """Sum of two loads, or of two flow paths, of six numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit
def inertia_times(r, t, m, x, y, z):
    """Inertia of a segment times the vector w = (x, y, z): integral of p x (w x p) over its mass; p : position.

    r, t, m : start, direction and mass moments of the segment
    """
    square = m[0] * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) + m[2] * (t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    square += 2.0 * m[1] * (r[0] * t[0] + r[1] * t[1] + r[2] * t[2])
    a, b = r[0] * x + r[1] * y + r[2] * z, t[0] * x + t[1] * y + t[2] * z
    p, q = m[0] * a + m[1] * b, m[1] * a + m[2] * b
    return (
        square * x - p * r[0] - q * t[0],
        square * y - p * r[1] - q * t[1],
        square * z - p * r[2] - q * t[2],
    )


@njit
def segment_load(motion, r, t, m, d):
    """Force and torque of a segment of fluid on its body; r, t : start and direction of the segment.

    m, d : integrals of 1, s and s^2 over the mass of the segment, s : distance from r; and their rates
    motion : `scratch` after `set_body_motion`
    """
    sx, sy, sz = m[0] * r[0] + m[1] * t[0], m[0] * r[1] + m[1] * t[1], m[0] * r[2] + m[1] * t[2]
    gx, gy, gz = as_tuple(motion[BODY_GRAVITY : BODY_GRAVITY + 3])
    ex, ey, ez = cross(motion, BODY_SPIN_RATE, sx, sy, sz)
    px, py, pz = cross(motion, BODY_SPIN, sx, sy, sz)
    px, py, pz = px + d[0] * r[0] + d[1] * t[0], py + d[0] * r[1] + d[1] * t[1], pz + d[0] * r[2] + d[1] * t[2]
    cx, cy, cz = cross(motion, BODY_SPIN, px, py, pz)
    wx, wy, wz = as_tuple(motion[BODY_SPIN : BODY_SPIN + 3])
    hx, hy, hz = cross(motion, BODY_SPIN, *inertia_times(r, t, m, wx, wy, wz))
    dx, dy, dz = inertia_times(r, t, d, wx, wy, wz)
    jx, jy, jz = inertia_times(r, t, m, motion[BODY_SPIN_RATE], motion[BODY_SPIN_RATE + 1], motion[BODY_SPIN_RATE + 2])
    return (
        m[0] * gx - ex - cx, m[0] * gy - ey - cy, m[0] * gz - ez - cz,
        sy * gz - sz * gy - jx - dx - hx, sz * gx - sx * gz - jy - dy - hy, sx * gy - sy * gx - jz - dz - hz,
    )  # fmt: skip


@njit
def flow_load(motion, path, change, flow, rate):
    """Force and torque of a mass flow along a flow path on its body.

    path, change : integrals of dr and r x dr along the path, and their rates
    flow, rate : mass flow [kg/s] and its derivative [kg/s2]; motion : `scratch` after `set_body_motion`
    """
    cx, cy, cz = cross(motion, BODY_SPIN, path[0], path[1], path[2])
    zx, zy, zz = cross(motion, BODY_SPIN, path[3], path[4], path[5])
    return (
        -rate * path[0] - flow * (change[0] + cx), -rate * path[1] - flow * (change[1] + cy),
        -rate * path[2] - flow * (change[2] + cz), -rate * path[3] - flow * (change[3] + zx),
        -rate * path[4] - flow * (change[4] + zy), -rate * path[5] - flow * (change[5] + zz),
    )  # fmt: skip


# tanks ----------


@njit
def level_at(y, tables, i):
    """Level of the tank at node i [m]; 0 for nodes of other kinds."""
    node = tables.nodes[i]
    return tank_level(node, tables.floats, node["density"], y[node["y"]]) if node["kind"] == TANK else 0.0


@njit
def level_rate(dydt, tables, i):
    """Rate of the level of the tank at node i [m/s]; 0 for nodes of other kinds."""
    node = tables.nodes[i]
    return dydt[node["y"]] / (node["density"] * node["area"]) if node["kind"] == TANK else 0.0


@njit(forceinline=True)
def tank_path(tables, i, high):
    """Integrals of dr and r x dr along the flow path from the bottom of the tank at node i to the height `high` [m].

    A negative `high` gives the opposite path, down from the height -high to the bottom.
    """
    r = tables.moving_segments[tables.nodes[i]["moving_segment"]]["start"]
    return 0.0, 0.0, high, r[1] * high, -r[0] * high, 0.0


@njit(forceinline=True)
def tank_paths(tables, i, j, a, b):
    """Integrals of dr and r x dr along the flow path of a flow from node i to node j inside the tanks there.

    It leads down the tank at node i from height a [m], and up the tank at node j to height b [m].
    """
    return add_six(tank_path(tables, i, -a), tank_path(tables, j, b))


@njit(forceinline=True)
def vertical_moments(mass, high):
    """Integrals of 1, s, s^2 over a mass [kg] that is distributed evenly over s = 0 .. `high` [m]."""
    return mass, 0.5 * mass * high, mass * high * high / 3.0


@njit
def node_segment(y, tables, i):
    """Segment of the fluid stored at node i: (start r, unit vector t, mass moments m); no mass without storage."""
    node = tables.nodes[i]
    r = as_tuple(tables.moving_segments[node["moving_segment"]]["start"])
    if node["kind"] == TANK:
        return r, (0.0, 0.0, 1.0), vertical_moments(node["mass"] + y[node["y"]], level_at(y, tables, i))
    return r, ZERO_VECTOR, (node["mass"] + y[node["y"]] if node["kind"] == CHAMBER else 0.0, 0.0, 0.0)


@njit
def node_segment_rates(y, dydt, out, tables, i):
    """Rates of the three mass moments of the fluid at node i, from its inflow [kg/s, kg m/s, kg m2/s].

    In a tank the inflow counts at the surface. A node without volume has the rate -supply, because supplied fluid
    leaves it into the network.
    """
    node = tables.nodes[i]
    if node["kind"] == TANK:
        high, more = level_at(y, tables, i), dydt[node["y"]]
        return more, more * high, more * high * high
    if node["kind"] == CHAMBER:
        return dydt[node["y"]], 0.0, 0.0
    return -out[tables.layout[0]["supply"] + i], 0.0, 0.0


@njit
def node_load(y, dydt, out, tables, i):
    """Force and torque of the fluid at node i, and of the fluid that leaves the network there, on its body.

    `set_body_motion` must have written the motion of the body to `scratch`.
    """
    r, t, m = node_segment(y, tables, i)
    return segment_load(tables.scratch, r, t, m, node_segment_rates(y, dydt, out, tables, i))


# pipes ----------


@njit(forceinline=True)
def mass_per_length(tables, pipe, k):
    """Mass per length in cell k of a pipe in the initial steady state [kg/m]."""
    if tables.settings[0]["law"] == LAW_LINEAR:
        return tables.settings[0]["rho"] * pipe["area"]
    return tables.profile[pipe["center"] + k]


@njit
def pipe_segment(tables, k):
    """Start r, unit vector t and distance between the ends [m] of pipe k on a body.

    t is zero if both ends are at the same point.
    """
    pipe = tables.pipes[k]
    r, s = (
        tables.moving_segments[pipe["moving_segment"]]["start"],
        tables.moving_segments[pipe["moving_segment"] + pipe["cells"] - 1]["end"],
    )
    x, y, z = s[0] - r[0], s[1] - r[1], s[2] - r[2]
    length = (x * x + y * y + z * z) ** 0.5
    per = 1.0 / length if length > 0.0 else 0.0
    return as_tuple(r), (per * x, per * y, per * z), length


@njit
def pipe_moments(tables, y, k, length, share):
    """Mass moments of pipe k, and the sum over its cells of mass flow times length along the segment [kg m/s].

    y : states with share = 1; or rates of states with share = 0, then the results are rates
    length : distance between the ends of the pipe [m]
    """
    pipe = tables.pipes[k]
    n, o, per = pipe["cells"], pipe["y"], 1.0 / pipe["speed"]
    step, m0, m1, m2, flow = length / n, 0.0, 0.0, 0.0, share * n * pipe["flow"]
    for i in range(n):
        mass, s = (share * mass_per_length(tables, pipe, i) + per * (y[o + i] + y[o + n + i])) * pipe["dx"], i + 0.5
        m0, m1, m2 = m0 + mass, m1 + mass * s, m2 + mass * s * s
        flow += y[o + i] - y[o + n + i]
    return (m0, m1 * step, (m2 + m0 / 12.0) * step * step), flow * step


@njit(forceinline=True)
def straight_path(r, t):
    """Integrals of dr and r x dr along a flow path of unit length from r in the direction t."""
    return t[0], t[1], t[2], r[1] * t[2] - r[2] * t[1], r[2] * t[0] - r[0] * t[2], r[0] * t[1] - r[1] * t[0]


@njit
def pipe_end(y, tables, k, right, share):
    """(node of the tank at an end of pipe k, -1 without a tank; mass flow of the cell at that end [kg/s]).

    right : 1 for the end at `to`, 0 at `from`
    y : states with share = 1; or rates of states with share = 0, then the flow is a rate [kg/s2]
    """
    pipe = tables.pipes[k]
    n, i = pipe["cells"], pipe["to_node"] if right == 1 else pipe["from_node"]
    at = pipe["y"] + right * (n - 1)
    return i if tables.nodes[i]["kind"] == TANK else -1, share * pipe["flow"] + y[at] - y[at + n]


@njit
def pipe_load(y, dydt, tables, k):
    """Force and torque of the fluid in pipe k, and of the flow between its ends and the surfaces of tanks, on its body.

    Axes and origin are those of the body.
    `set_body_motion` must have written the motion of the body to `scratch`.
    """
    motion, (r, t, length) = tables.scratch, pipe_segment(tables, k)
    m, flow = pipe_moments(tables, y, k, length, 1.0)
    d, rate = pipe_moments(tables, dydt, k, length, 0.0)
    load = add_six(segment_load(motion, r, t, m, d), flow_load(motion, straight_path(r, t), ZERO_FLOW_PATH, flow, rate))
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up, faster = (
                tank_path(tables, i, sign * level_at(y, tables, i)),
                tank_path(tables, i, sign * level_rate(dydt, tables, i)),
            )
            load = add_six(load, flow_load(motion, up, faster, flow, pipe_end(dydt, tables, k, right, 0.0)[1]))
    return load


# columns ----------


@njit
def column_path(y, tables, column):
    """Integrals of dr and r x dr along the flow path of a rigid column, in axes of its body.

    The paths in tanks at the ends of the column are included.
    """
    first, last = (
        tables.moving_segments[column["moving_segment"]]["start"],
        tables.moving_segments[column["moving_segment"] + column["moving_segments"] - 1]["end"],
    )
    x, z, w = 0.0, 0.0, 0.0
    for k in range(column["moving_segments"]):
        swept = tables.moving_segments[column["moving_segment"] + k]["swept"]
        x, z, w = x + swept[0], z + swept[1], w + swept[2]
    i, j = column["from_node"], column["to_node"]
    path = last[0] - first[0], last[1] - first[1], last[2] - first[2], x, z, w
    return add_six(path, tank_paths(tables, i, j, level_at(y, tables, i), level_at(y, tables, j)))


@njit
def column_segment(tables, column, k):
    """Segment number k of a rigid column: (start r, unit vector t, mass moments m).

    The mass of the column is distributed by length.
    """
    total = 0.0
    for m in range(column["moving_segments"]):
        total += segment_length(tables.moving_segments[column["moving_segment"] + m])
    segment = tables.moving_segments[column["moving_segment"] + k]
    long, mass = segment_length(segment), tables.settings[0]["rho"] * column["area"] * column["length"]
    if not long > 0.0:
        return as_tuple(segment["start"]), ZERO_VECTOR, (mass if total == 0.0 else 0.0, 0.0, 0.0)
    r, s = segment["start"], segment["end"]
    t = (s[0] - r[0]) / long, (s[1] - r[1]) / long, (s[2] - r[2]) / long
    return as_tuple(r), t, vertical_moments(mass * long / total, long)


@njit(forceinline=True)
def segment_length(segment):
    """Length of a segment [m]."""
    r, s = segment["start"], segment["end"]
    x, y, z = s[0] - r[0], s[1] - r[1], s[2] - r[2]
    return (x * x + y * y + z * z) ** 0.5


@njit
def column_load(y, dydt, tables, k):
    """Force and torque of the fluid in rigid column k, and of the flow between its ends and surfaces of tanks.

    They act on its body, whose motion `set_body_motion` must have written to `scratch`.
    """
    column, motion = tables.columns[k], tables.scratch
    i, j = column["from_node"], column["to_node"]
    faster = tank_paths(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    load = flow_load(motion, column_path(y, tables, column), faster, flow, rate)
    for m in range(column["moving_segments"]):
        r, t, mass = column_segment(tables, column, m)
        load = add_six(load, segment_load(motion, r, t, mass, ZERO_VECTOR))
    return load


# bodies ----------


@njit(forceinline=True)
def is_fluid_node(kind):
    """True if nodes of a kind contain fluid or let it leave the network."""
    return kind == TANK or kind == CHAMBER or kind == FIXED or kind == JUNCTION


@njit
def add_load(out, here, load, sign):
    """Add a load in axes of a body to its sums FORCE and TORQUE (sign +1), or subtract it (sign -1).

    load : force [N], torque about the origin [N m]; here : offset of the body in `out`
    """
    x, y, z = to_world(out, here, sign * load[0], sign * load[1], sign * load[2])
    add_force(out, here, 0.0, 0.0, 0.0, x, y, z)
    x, y, z = to_world(out, here, sign * load[3], sign * load[4], sign * load[5])
    add_torque(out, here, x, y, z)


@njit
def add_all_fluid_loads(y, dydt, out, tables, least, sign, wide, spin):
    """Add (sign +1) or subtract (sign -1) the loads of the fluid in nodes, pipes and rigid columns on their bodies.

    least : least code `loads_body` that is included; 1 : forces move the body, 2 : a joint load is an output
    wide, spin : offsets, in the data of a body, of the acceleration of its origin and of its angular acceleration
    """
    nodes, pipes, columns, segments = tables.nodes, tables.pipes, tables.columns, tables.moving_segments
    for i in range(nodes.size):
        if (
            nodes[i]["moving_segment"] >= 0
            and is_fluid_node(nodes[i]["kind"])
            and segments[nodes[i]["moving_segment"]]["loads_body"] >= least
        ):
            body = segments[nodes[i]["moving_segment"]]["body"]
            set_body_motion(tables, out, body, wide, spin)
            add_load(out, body_row(tables, body), node_load(y, dydt, out, tables, i), sign)
    for k in range(pipes.size):
        if pipes[k]["moving_segment"] >= 0 and segments[pipes[k]["moving_segment"]]["loads_body"] >= least:
            body = segments[pipes[k]["moving_segment"]]["body"]
            set_body_motion(tables, out, body, wide, spin)
            add_load(out, body_row(tables, body), pipe_load(y, dydt, tables, k), sign)
    for k in range(columns.size):
        if columns[k]["moving_segment"] >= 0 and segments[columns[k]["moving_segment"]]["loads_body"] >= least:
            body = segments[columns[k]["moving_segment"]]["body"]
            set_body_motion(tables, out, body, wide, spin)
            add_load(out, body_row(tables, body), column_load(y, dydt, tables, k), sign)


@njit
def add_fluid_loads(t, y, dydt, out, handle):
    """Add the fluid loads for q'' = 0 (zero joint accelerations) to the bodies, unless `dydt` is empty.

    The loads of moving segments with `loads_body` 0 are left out.
    """
    if dydt.size > 0:
        add_all_fluid_loads(y, dydt, out, open_tables(handle), MOVED_BY_FORCES, 1.0, BIAS, SPIN_BIAS)
