"""Energy of fluid contained in moving bodies, in the frame of the world.

The energy of a moving network exceeds that of a network at rest by V^2 / 2 + g (z - z at the start) of all its mass, V
the velocity of its place, and by M (v . C + W . Z) of the flow M along a path (C, Z). Fluid from links supplies
(v^2 - |W x r|^2) / 2 + g (z - z at the start) per mass in addition, at the surface of an open tank. A body supplies the
power -(F . v + T . W) by the load (F, T) of the fluid on it.
"""

from fvsolve.jit import njit
from fvsolve.kernels.energy import COLUMN, NODE, PIPE, VALVE
from fvsolve.kernels.energy_barotropic import head_at
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.freight import (
    NOTHING,
    NOWHERE,
    column_load,
    holds,
    level_at,
    level_rate,
    line_load,
    out_and_in,
    pipe_end,
    pipe_line,
    pipe_load,
    pipe_moments,
    place_line,
    place_rates,
    point,
    segment_line,
    turned_way,
    up_tank,
    way_of,
)
from fvsolve.kernels.mechanism.rides import DRIFT, EULER, GRAVITY, TURN, set_axes
from fvsolve.kernels.mechanism.room import ACCELERATION, ATTITUDE, PLACE, TURNING, cross, dot, row_of
from fvsolve.kernels.records import CHAMBER, FIXED, JUNCTION, TANK


@njit(forceinline=True)
def height_of(out, here, r):
    """z of a point r of a body in the world [m]."""
    return out[here + PLACE + 2] + dot(out, here + ATTITUDE + 6, r[0], r[1], r[2])


@njit(forceinline=True)
def square_of(motion, r):
    """V^2 of a point r of a body [m2/s2]."""
    u, v, w = cross(motion, TURN, r[0], r[1], r[2])
    u, v, w = u + motion[DRIFT], v + motion[DRIFT + 1], w + motion[DRIFT + 2]
    return u * u + v * v + w * w


@njit
def line_energy(tables, out, here, segment, z, rise):
    """V^2 / 2 + g (height - z - rise s) of a segment (r, t, m) [J]; with d in place of m, its inflow [W]."""
    motion, g, (r, t, m) = tables.scratch, tables.settings[0]["gravity"], segment
    u, v, w = cross(motion, TURN, r[0], r[1], r[2])
    u, v, w = u + motion[DRIFT], v + motion[DRIFT + 1], w + motion[DRIFT + 2]
    a, b, c = cross(motion, TURN, t[0], t[1], t[2])
    kinetic = 0.5 * m[0] * (u * u + v * v + w * w) + m[1] * (u * a + v * b + w * c)
    kinetic += 0.5 * m[2] * (a * a + b * b + c * c)
    slope = dot(out, here + ATTITUDE + 6, t[0], t[1], t[2]) - rise
    return kinetic + g * (m[0] * (height_of(out, here, r) - z) + m[1] * slope)


@njit(forceinline=True)
def brought(motion, load):
    """Power that a body supplies to the fluid that exerts a load on it, -(F . v + T . W) [W]."""
    force = motion[DRIFT] * load[0] + motion[DRIFT + 1] * load[1] + motion[DRIFT + 2] * load[2]
    return -(force + (motion[TURN] * load[3] + motion[TURN + 1] * load[4] + motion[TURN + 2] * load[5]))


@njit
def line_gain(tables, out, here, segment, d, z, rise):
    """Rate of the energy of a segment whose mass moments change at d [W]."""
    motion, (r, t, m) = tables.scratch, segment
    carried = brought(motion, line_load(motion, r, t, m, NOTHING))
    return carried + line_energy(tables, out, here, (r, t, d), z, rise)


@njit(forceinline=True)
def drift_along(motion, path):
    """v . C + W . Z, the velocity of the body integrated along a flow path [m2/s]."""
    return brought(motion, (-path[0], -path[1], -path[2], -path[3], -path[4], -path[5]))


@njit
def flow_gain(tables, out, here, path, change, flow, rate):
    """Rate of the energy M (v . C + W . Z) of a flow M along a path [W]; change : rate of the path, rate : dM/dt."""
    motion, g, up = tables.scratch, tables.settings[0]["gravity"], here + ATTITUDE + 6
    x, y, z = cross(motion, TURN, motion[DRIFT], motion[DRIFT + 1], motion[DRIFT + 2])
    x, y, z = x + motion[GRAVITY], y + motion[GRAVITY + 1], z + motion[GRAVITY + 2]
    faster = -(path[0] * (g * out[up] + x) + path[1] * (g * out[up + 1] + y) + path[2] * (g * out[up + 2] + z))
    faster += motion[EULER] * path[3] + motion[EULER + 1] * path[4] + motion[EULER + 2] * path[5]
    return rate * drift_along(motion, path) + flow * (faster + drift_along(motion, change))


@njit
def head_beyond(y, out, tables, here, i):
    """Energy per mass supplied to node i in addition to that at rest, in a tank at its surface [J/kg]."""
    st, node, motion = tables.settings[0], tables.nodes[i], tables.scratch
    r = point(tables.rides[node["ride"]]["start"])
    z, more = node["elevation"], 0.0
    if node["kind"] == TANK:
        r = r[0], r[1], r[2] + level_at(y, tables, i)
        z = st["datum"]
        more = -head_at(st, tables.floats, node, node["pressure"] + out[tables.layout[0]["pressure"] + i])
    u, v, w = cross(motion, TURN, r[0], r[1], r[2])
    square = (
        motion[DRIFT] * motion[DRIFT] + motion[DRIFT + 1] * motion[DRIFT + 1] + motion[DRIFT + 2] * motion[DRIFT + 2]
    )
    return more + st["gravity"] * (height_of(out, here, r) - z) + 0.5 * (square - (u * u + v * v + w * w))


# nodes ----------


@njit
def add_place_power(y, dydt, out, tables, i, power):
    """Add the supply and the energy rate of node i that are due to the motion of its body [W]."""
    node, st, motion = tables.nodes[i], tables.settings[0], tables.scratch
    here = row_of(tables, tables.rides[node["ride"]]["body"])
    segment = place_line(y, tables, i)
    if node["kind"] == FIXED or node["kind"] == JUNCTION:
        head = st["gravity"] * (height_of(out, here, segment[0]) - node["elevation"]) + 0.5 * square_of(
            motion, segment[0]
        )
        power[NODE * i] += head * out[tables.layout[0]["supply"] + i]
        return
    d, z = place_rates(y, dydt, out, tables, i), node["elevation"]
    if node["kind"] == TANK:
        z, power[NODE * i + 1] = st["datum"], 0.0
    power[NODE * i + 1] += line_gain(tables, out, here, segment, d, z, 0.0)


@njit
def add_place_stored(y, out, tables, i, stored):
    """Add the energy stored at node i that is due to the motion of its body [J]."""
    node = tables.nodes[i]
    here, z = row_of(tables, tables.rides[node["ride"]]["body"]), node["elevation"]
    if node["kind"] == TANK:
        z, stored[i] = tables.settings[0]["datum"], 0.0
    if node["kind"] == TANK or node["kind"] == CHAMBER:
        stored[i] += line_energy(tables, out, here, place_line(y, tables, i), z, 0.0)


# pipes and columns ----------


@njit(forceinline=True)
def heights(tables, link, length):
    """(elevation of the `from` end at the start [m], rise per length of the straight line between the ends)."""
    z = tables.nodes[link["from_node"]]["elevation"]
    return z, (tables.nodes[link["to_node"]]["elevation"] - z) / length if length > 0.0 else 0.0


@njit
def pipe_gain(y, dydt, out, tables, k, here):
    """Rate of the energy of pipe k that is due to the motion of its body [W]."""
    r, t, length = pipe_line(tables, k)
    z, rise = heights(tables, tables.pipes[k], length)
    (m, flow), (d, rate) = pipe_moments(tables, y, k, length, 1.0), pipe_moments(tables, dydt, k, length, 0.0)
    total = line_gain(tables, out, here, (r, t, m), d, z, rise)
    total += flow_gain(tables, out, here, turned_way(r, t), NOWHERE, flow, rate)
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up = up_tank(tables, i, sign * level_at(y, tables, i))
            faster = up_tank(tables, i, sign * level_rate(dydt, tables, i))
            total += flow_gain(tables, out, here, up, faster, flow, pipe_end(dydt, tables, k, right, 0.0)[1])
    return total


@njit
def pipe_held(y, out, tables, k, here):
    """Energy of pipe k that is due to the motion of its body [J]."""
    motion, (r, t, length) = tables.scratch, pipe_line(tables, k)
    z, rise = heights(tables, tables.pipes[k], length)
    m, flow = pipe_moments(tables, y, k, length, 1.0)
    total = line_energy(tables, out, here, (r, t, m), z, rise) + flow * drift_along(motion, turned_way(r, t))
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            up = up_tank(tables, i, (2.0 * right - 1.0) * level_at(y, tables, i))
            total += flow * drift_along(motion, up)
    return total


@njit
def column_gain(y, dydt, out, tables, k, here):
    """Rate of the energy of column k that is due to the motion of its body [W]; heights from the datum."""
    column, z, total = tables.columns[k], tables.settings[0]["datum"], 0.0
    for m in range(column["rides"]):
        total += line_gain(tables, out, here, segment_line(tables, column, m), NOTHING, z, 0.0)
    i, j = column["from_node"], column["to_node"]
    faster = out_and_in(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    return total + flow_gain(tables, out, here, way_of(y, tables, column), faster, flow, rate)


@njit
def column_held(y, out, tables, k, here):
    """Energy of column k that is due to the motion of its body [J]; heights from the datum."""
    column, z, motion = tables.columns[k], tables.settings[0]["datum"], tables.scratch
    total = (column["flow"] + y[column["y"]]) * drift_along(motion, way_of(y, tables, column))
    for m in range(column["rides"]):
        total += line_energy(tables, out, here, segment_line(tables, column, m), z, 0.0)
    return total


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power due to the motion of bodies to the power rows of nodes, pipes and columns."""
    tables = open_tables(handle)
    nodes, pipes, columns, segments, motion = tables.nodes, tables.pipes, tables.columns, tables.rides, tables.scratch
    for i in range(nodes.size):
        if nodes[i]["ride"] >= 0 and holds(nodes[i]["kind"]):
            set_axes(tables, out, segments[nodes[i]["ride"]]["body"], ACCELERATION, TURNING)
            add_place_power(y, dydt, out, tables, i, power)
    at = NODE * nodes.size
    for k in range(pipes.size):
        pipe, end = pipes[k], tables.layout[0]["ends"] + 4 * k
        if pipe["ride"] >= 0:
            body = segments[pipe["ride"]]["body"]
            here = row_of(tables, body)
            set_axes(tables, out, body, ACCELERATION, TURNING)
            into = head_beyond(y, out, tables, here, pipe["from_node"]) * (pipe["flow"] + (out[end] - out[end + 1]))
            into -= head_beyond(y, out, tables, here, pipe["to_node"]) * (pipe["flow"] + (out[end + 2] - out[end + 3]))
            power[at] += into + brought(motion, pipe_load(y, dydt, tables, k))
            power[at + 3] += pipe_gain(y, dydt, out, tables, k, here)
        at += PIPE
    at += VALVE * tables.valves.size
    for k in range(columns.size):
        column = columns[k]
        if column["ride"] >= 0:
            body = segments[column["ride"]]["body"]
            here = row_of(tables, body)
            set_axes(tables, out, body, ACCELERATION, TURNING)
            drop = head_beyond(y, out, tables, here, column["from_node"])
            drop -= head_beyond(y, out, tables, here, column["to_node"])
            power[at] += drop * out[tables.layout[0]["column"] + k] + brought(motion, column_load(y, dydt, tables, k))
            power[at + 2] += column_gain(y, dydt, out, tables, k, here)
        at += COLUMN


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the energy due to the motion of bodies to the storage rows of nodes, pipes and columns."""
    tables = open_tables(handle)
    nodes, pipes, columns, segments = tables.nodes, tables.pipes, tables.columns, tables.rides
    for i in range(nodes.size):
        if nodes[i]["ride"] >= 0 and holds(nodes[i]["kind"]):
            set_axes(tables, out, segments[nodes[i]["ride"]]["body"], ACCELERATION, TURNING)
            add_place_stored(y, out, tables, i, stored)
    at = nodes.size
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0:
            body = segments[pipes[k]["ride"]]["body"]
            set_axes(tables, out, body, ACCELERATION, TURNING)
            stored[at + 1] += pipe_held(y, out, tables, k, row_of(tables, body))
        at += 2
    for k in range(columns.size):
        if columns[k]["ride"] >= 0:
            body = segments[columns[k]["ride"]]["body"]
            set_axes(tables, out, body, ACCELERATION, TURNING)
            stored[at] += column_held(y, out, tables, k, row_of(tables, body))
        at += 1
