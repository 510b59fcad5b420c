"""What fluid that rides does to its body, in axes of the body and about its origin. Knows ways; finds no flow.

A line from r along t holds m = (m0, m1, m2), the integrals of 1, s and s^2 over its mass, which change at d; a way
(C, Z), the integrals of dr and r x dr along it, carries M. By (68) of all of it the body feels

    force   m0 G - W' x S - W x (W x S + S') - (M C)' - W x M C
    torque  S x G - J W' - J' W - W x J W - (M Z)' - W x M Z

S the first moment, J the inertia, G = g - a_o, W and W' as `rides.set_axes` leaves them in `scratch`. What leaves a
network takes the velocity of its place along. In a tank flows what the first cell of a pipe, or a column, carries.
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.rides import EULER, GRAVITY, TURN, set_axes
from fvsolve.kernels.mechanism.room import (
    ATTITUDE,
    BIAS,
    SPIN_BIAS,
    add_force,
    add_torque,
    cross,
    row_of,
    turned,
)
from fvsolve.kernels.records import CHAMBER, FELT, FIXED, JUNCTION, LAW_LINEAR, TANK
from fvsolve.kernels.tanks import tank_level

NOTHING = (0.0, 0.0, 0.0)
NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit(forceinline=True)
def to_world(out, here, x, y, z):
    """A vector in axes of a body as the world sees it."""
    return turned(out, here + ATTITUDE, (x, y, z), 0)


@njit(forceinline=True)
def point(a):
    """Three numbers of a record as a vector."""
    return a[0], a[1], a[2]


@njit(forceinline=True)
def both(a, b):
    """Sum of two loads, or ways."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit
def inertia_times(r, t, m, x, y, z):
    """J w of a line: the integral of s' x (w x s') over its mass."""
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
def line_load(own, r, t, m, d):
    """Force and torque of a line of fluid that holds m, which changes at d."""
    sx, sy, sz = m[0] * r[0] + m[1] * t[0], m[0] * r[1] + m[1] * t[1], m[0] * r[2] + m[1] * t[2]
    gx, gy, gz = point(own[GRAVITY : GRAVITY + 3])
    ex, ey, ez = cross(own, EULER, sx, sy, sz)
    px, py, pz = cross(own, TURN, sx, sy, sz)
    px, py, pz = px + d[0] * r[0] + d[1] * t[0], py + d[0] * r[1] + d[1] * t[1], pz + d[0] * r[2] + d[1] * t[2]
    cx, cy, cz = cross(own, TURN, px, py, pz)
    wx, wy, wz = point(own[TURN : TURN + 3])
    hx, hy, hz = cross(own, TURN, *inertia_times(r, t, m, wx, wy, wz))
    dx, dy, dz = inertia_times(r, t, d, wx, wy, wz)
    jx, jy, jz = inertia_times(r, t, m, own[EULER], own[EULER + 1], own[EULER + 2])
    return (
        m[0] * gx - ex - cx, m[0] * gy - ey - cy, m[0] * gz - ez - cz,
        sy * gz - sz * gy - jx - dx - hx, sz * gx - sx * gz - jy - dy - hy, sx * gy - sy * gx - jz - dz - hz,
    )  # fmt: skip


@njit
def flow_load(own, way, change, flow, rate):
    """Force and torque of a flow along a way that itself changes."""
    cx, cy, cz = cross(own, TURN, way[0], way[1], way[2])
    zx, zy, zz = cross(own, TURN, way[3], way[4], way[5])
    return (
        -rate * way[0] - flow * (change[0] + cx), -rate * way[1] - flow * (change[1] + cy),
        -rate * way[2] - flow * (change[2] + cz), -rate * way[3] - flow * (change[3] + zx),
        -rate * way[4] - flow * (change[4] + zy), -rate * way[5] - flow * (change[5] + zz),
    )  # fmt: skip


# tanks ----------


@njit
def level_at(y, tables, i):
    """Level of the tank at node i [m]; 0 of another place."""
    node = tables.nodes[i]
    return tank_level(node, tables.floats, node["density"], y[node["y"]]) if node["kind"] == TANK else 0.0


@njit
def level_rate(dydt, tables, i):
    """How fast that rises [m/s]."""
    node = tables.nodes[i]
    return dydt[node["y"]] / (node["density"] * node["area"]) if node["kind"] == TANK else 0.0


@njit(forceinline=True)
def up_tank(tables, i, high):
    """The way from the bottom of the tank at node i to so high above it."""
    r = tables.rides[tables.nodes[i]["ride"]]["start"]
    return 0.0, 0.0, high, r[1] * high, -r[0] * high, 0.0


@njit(forceinline=True)
def out_and_in(tables, i, j, a, b):
    """The way down the tank at node i from height a, and up that at node j to b: of what flows from i to j."""
    return both(up_tank(tables, i, -a), up_tank(tables, j, b))


@njit(forceinline=True)
def along_z(mass, high):
    """m of a mass that stands evenly on a bottom."""
    return mass, 0.5 * mass * high, mass * high * high / 3.0


@njit
def place_line(y, tables, i):
    """(r, t, m) of what a place holds."""
    node = tables.nodes[i]
    r = point(tables.rides[node["ride"]]["start"])
    if node["kind"] == TANK:
        return r, (0.0, 0.0, 1.0), along_z(node["mass"] + y[node["y"]], level_at(y, tables, i))
    return r, NOTHING, (node["mass"] + y[node["y"]] if node["kind"] == CHAMBER else 0.0, 0.0, 0.0)


@njit
def place_rates(y, dydt, out, tables, i):
    """d of a place: what comes into it, in a tank at its surface; where nothing is held, what leaves there."""
    node = tables.nodes[i]
    if node["kind"] == TANK:
        high, more = level_at(y, tables, i), dydt[node["y"]]
        return more, more * high, more * high * high
    if node["kind"] == CHAMBER:
        return dydt[node["y"]], 0.0, 0.0
    return -out[tables.layout[0]["supply"] + i], 0.0, 0.0


@njit
def place_load(y, dydt, out, tables, i):
    """Force and torque of what a place holds, and of what leaves the network there."""
    r, t, m = place_line(y, tables, i)
    return line_load(tables.scratch, r, t, m, place_rates(y, dydt, out, tables, i))


# pipes ----------


@njit(forceinline=True)
def mass_per_length(tables, pipe, k):
    """Of the profile in cell k [kg/m]."""
    if tables.settings[0]["law"] == LAW_LINEAR:
        return tables.settings[0]["rho"] * pipe["area"]
    return tables.profile[pipe["center"] + k]


@njit
def pipe_line(tables, k):
    """(r, t, length of its way [m]) of a pipe that rides; no t where both ends are one place."""
    pipe = tables.pipes[k]
    r, s = tables.rides[pipe["ride"]]["start"], tables.rides[pipe["ride"] + pipe["cells"] - 1]["end"]
    x, y, z = s[0] - r[0], s[1] - r[1], s[2] - r[2]
    way = (x * x + y * y + z * z) ** 0.5
    per = 1.0 / way if way > 0.0 else 0.0
    return point(r), (per * x, per * y, per * z), way


@njit
def pipe_moments(tables, y, k, way, share):
    """(m, sum of the flows of its cells, each times its length along the way) of a pipe.

    Of states with share 1; of rates, as of any change, with 0.
    """
    pipe = tables.pipes[k]
    n, o, per = pipe["cells"], pipe["y"], 1.0 / pipe["speed"]
    step, m0, m1, m2, flow = way / n, 0.0, 0.0, 0.0, share * n * pipe["flow"]
    for i in range(n):
        mass, s = (share * mass_per_length(tables, pipe, i) + per * (y[o + i] + y[o + n + i])) * pipe["dx"], i + 0.5
        m0, m1, m2 = m0 + mass, m1 + mass * s, m2 + mass * s * s
        flow += y[o + i] - y[o + n + i]
    return (m0, m1 * step, (m2 + m0 / 12.0) * step * step), flow * step


@njit(forceinline=True)
def turned_way(r, t):
    """(C, Z) of a way along t, of length 1."""
    return t[0], t[1], t[2], r[1] * t[2] - r[2] * t[1], r[2] * t[0] - r[0] * t[2], r[0] * t[1] - r[1] * t[0]


@njit
def pipe_end(y, tables, k, right, share):
    """(tank that a pipe ends in, or -1, flow of the cell there, or its rate with share 0)."""
    pipe = tables.pipes[k]
    n, i = pipe["cells"], pipe["to_node"] if right == 1 else pipe["from_node"]
    at = pipe["y"] + right * (n - 1)
    return i if tables.nodes[i]["kind"] == TANK else -1, share * pipe["flow"] + y[at] - y[at + n]


@njit
def pipe_load(y, dydt, tables, k):
    """Force and torque of a pipe, and of what flows between its end and the surface of a tank."""
    own, (r, t, way) = tables.scratch, pipe_line(tables, k)
    m, flow = pipe_moments(tables, y, k, way, 1.0)
    d, rate = pipe_moments(tables, dydt, k, way, 0.0)
    found = both(line_load(own, r, t, m, d), flow_load(own, turned_way(r, t), NOWHERE, flow, rate))
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up, faster = (
                up_tank(tables, i, sign * level_at(y, tables, i)),
                up_tank(tables, i, sign * level_rate(dydt, tables, i)),
            )
            found = both(found, flow_load(own, up, faster, flow, pipe_end(dydt, tables, k, right, 0.0)[1]))
    return found


# columns ----------


@njit
def way_of(y, tables, column):
    """(C, Z) of a column, with what flows in tanks at its ends, in axes of its body."""
    first, last = tables.rides[column["ride"]]["start"], tables.rides[column["ride"] + column["rides"] - 1]["end"]
    x, z, w = 0.0, 0.0, 0.0
    for k in range(column["rides"]):
        swept = tables.rides[column["ride"] + k]["swept"]
        x, z, w = x + swept[0], z + swept[1], w + swept[2]
    i, j = column["from_node"], column["to_node"]
    way = last[0] - first[0], last[1] - first[1], last[2] - first[2], x, z, w
    return both(way, out_and_in(tables, i, j, level_at(y, tables, i), level_at(y, tables, j)))


@njit
def segment_line(tables, column, k):
    """(r, t, m) of the fluid in stretch k of a column, whose mass is shared by length."""
    whole = 0.0
    for m in range(column["rides"]):
        whole += long_of(tables.rides[column["ride"] + m])
    ride = tables.rides[column["ride"] + k]
    long, mass = long_of(ride), tables.settings[0]["rho"] * column["area"] * column["length"]
    if not long > 0.0:
        return point(ride["start"]), NOTHING, (mass if whole == 0.0 else 0.0, 0.0, 0.0)
    r, s = ride["start"], ride["end"]
    t = (s[0] - r[0]) / long, (s[1] - r[1]) / long, (s[2] - r[2]) / long
    return point(r), t, along_z(mass * long / whole, long)


@njit(forceinline=True)
def long_of(ride):
    """Length of a stretch [m]."""
    r, s = ride["start"], ride["end"]
    x, y, z = s[0] - r[0], s[1] - r[1], s[2] - r[2]
    return (x * x + y * y + z * z) ** 0.5


@njit
def column_load(y, dydt, tables, k):
    """Force and torque of a column, and of what flows between its ends and the surfaces of tanks."""
    column, own = tables.columns[k], tables.scratch
    i, j = column["from_node"], column["to_node"]
    faster = out_and_in(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    found = flow_load(own, way_of(y, tables, column), faster, flow, rate)
    for m in range(column["rides"]):
        r, t, mass = segment_line(tables, column, m)
        found = both(found, line_load(own, r, t, mass, NOTHING))
    return found


# bodies ----------


@njit(forceinline=True)
def holds(kind):
    """Whether a place holds fluid, or lets it out."""
    return kind == TANK or kind == CHAMBER or kind == FIXED or kind == JUNCTION


@njit
def put_load(out, here, load, sign):
    """Let a body feel a load, or feel it no more."""
    x, y, z = to_world(out, here, sign * load[0], sign * load[1], sign * load[2])
    add_force(out, here, 0.0, 0.0, 0.0, x, y, z)
    x, y, z = to_world(out, here, sign * load[3], sign * load[4], sign * load[5])
    add_torque(out, here, x, y, z)


@njit
def load_all(y, dydt, out, tables, least, sign, wide, spin):
    """Let bodies feel, with a sign, all networks as heavy as `least`; accelerations stand at `wide` and `spin`."""
    nodes, pipes, columns, rides = tables.nodes, tables.pipes, tables.columns, tables.rides
    for i in range(nodes.size):
        if nodes[i]["ride"] >= 0 and holds(nodes[i]["kind"]) and rides[nodes[i]["ride"]]["heavy"] >= least:
            body = rides[nodes[i]["ride"]]["body"]
            set_axes(tables, out, body, wide, spin)
            put_load(out, row_of(tables, body), place_load(y, dydt, out, tables, i), sign)
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0 and rides[pipes[k]["ride"]]["heavy"] >= least:
            body = rides[pipes[k]["ride"]]["body"]
            set_axes(tables, out, body, wide, spin)
            put_load(out, row_of(tables, body), pipe_load(y, dydt, tables, k), sign)
    for k in range(columns.size):
        if columns[k]["ride"] >= 0 and rides[columns[k]["ride"]]["heavy"] >= least:
            body = rides[columns[k]["ride"]]["body"]
            set_axes(tables, out, body, wide, spin)
            put_load(out, row_of(tables, body), column_load(y, dydt, tables, k), sign)


@njit
def load_networks(t, y, dydt, out, handle):
    """What fluid that rides does to bodies that feel it, joints held."""
    if dydt.size > 0:
        load_all(y, dydt, out, open_tables(handle), FELT, 1.0, BIAS, SPIN_BIAS)
