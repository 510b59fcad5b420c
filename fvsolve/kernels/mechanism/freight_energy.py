"""Energy of fluid that rides on bodies, as the world has it. Knows the tables; adds nothing up over time.

Beside what a network holds that stands still: V^2 / 2 + g (z - z at the start) of all its mass, V the velocity of its
place, and M (v . C + W . Z) of what flows along a way (C, Z). Links bring a place (v^2 - |W x r|^2) / 2 + g (z - z at
the start) more by mass, a tank at its surface, where it is open; bodies bring -(F . v + T . W) with the load they feel.
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
    """z of a place on a body [m]."""
    return out[here + PLACE + 2] + dot(out, here + ATTITUDE + 6, r[0], r[1], r[2])


@njit(forceinline=True)
def square_of(own, r):
    """V^2 of a place on a body [m2/s2]."""
    u, v, w = cross(own, TURN, r[0], r[1], r[2])
    u, v, w = u + own[DRIFT], v + own[DRIFT + 1], w + own[DRIFT + 2]
    return u * u + v * v + w * w


@njit
def line_energy(tables, out, here, line, z, rise):
    """V^2 / 2 + g (height - z - rise s) of a line (r, t, m) [J]; with d in place of m, what it gains where it is."""
    own, g, (r, t, m) = tables.scratch, tables.settings[0]["gravity"], line
    u, v, w = cross(own, TURN, r[0], r[1], r[2])
    u, v, w = u + own[DRIFT], v + own[DRIFT + 1], w + own[DRIFT + 2]
    a, b, c = cross(own, TURN, t[0], t[1], t[2])
    kinetic = 0.5 * m[0] * (u * u + v * v + w * w) + m[1] * (u * a + v * b + w * c)
    kinetic += 0.5 * m[2] * (a * a + b * b + c * c)
    slope = dot(out, here + ATTITUDE + 6, t[0], t[1], t[2]) - rise
    return kinetic + g * (m[0] * (height_of(out, here, r) - z) + m[1] * slope)


@njit(forceinline=True)
def brought(own, load):
    """What a body brings to what it feels as a load [W]."""
    force = own[DRIFT] * load[0] + own[DRIFT + 1] * load[1] + own[DRIFT + 2] * load[2]
    return -(force + (own[TURN] * load[3] + own[TURN + 1] * load[4] + own[TURN + 2] * load[5]))


@njit
def line_gain(tables, out, here, line, d, z, rise):
    """d/dt of the energy of a line whose mass changes at d [W]."""
    own, (r, t, m) = tables.scratch, line
    carried = brought(own, line_load(own, r, t, m, NOTHING))
    return carried + line_energy(tables, out, here, (r, t, d), z, rise)


@njit(forceinline=True)
def drift_along(own, way):
    """v . C + W . Z."""
    return brought(own, (-way[0], -way[1], -way[2], -way[3], -way[4], -way[5]))


@njit
def flow_gain(tables, out, here, way, change, flow, rate):
    """d/dt of M (v . C + W . Z) [W]."""
    own, g, up = tables.scratch, tables.settings[0]["gravity"], here + ATTITUDE + 6
    x, y, z = cross(own, TURN, own[DRIFT], own[DRIFT + 1], own[DRIFT + 2])
    x, y, z = x + own[GRAVITY], y + own[GRAVITY + 1], z + own[GRAVITY + 2]
    faster = -(way[0] * (g * out[up] + x) + way[1] * (g * out[up + 1] + y) + way[2] * (g * out[up + 2] + z))
    faster += own[EULER] * way[3] + own[EULER + 1] * way[4] + own[EULER + 2] * way[5]
    return rate * drift_along(own, way) + flow * (faster + drift_along(own, change))


@njit
def head_beyond(y, out, tables, here, i):
    """What a mass brings node i more than where it stands still, in a tank at its surface [J/kg]."""
    st, node, own = tables.settings[0], tables.nodes[i], tables.scratch
    r = point(tables.rides[node["ride"]]["start"])
    z, more = node["elevation"], 0.0
    if node["kind"] == TANK:
        r = r[0], r[1], r[2] + level_at(y, tables, i)
        z = st["datum"]
        more = -head_at(st, tables.floats, node, node["pressure"] + out[tables.layout[0]["pressure"] + i])
    u, v, w = cross(own, TURN, r[0], r[1], r[2])
    square = own[DRIFT] * own[DRIFT] + own[DRIFT + 1] * own[DRIFT + 1] + own[DRIFT + 2] * own[DRIFT + 2]
    return more + st["gravity"] * (height_of(out, here, r) - z) + 0.5 * (square - (u * u + v * v + w * w))


# places ----------


@njit
def add_place_power(y, dydt, out, tables, i, power):
    """What place i supplies and gains beside what it would if it stood still."""
    node, st, own = tables.nodes[i], tables.settings[0], tables.scratch
    here = row_of(tables, tables.rides[node["ride"]]["body"])
    line = place_line(y, tables, i)
    if node["kind"] == FIXED or node["kind"] == JUNCTION:
        head = st["gravity"] * (height_of(out, here, line[0]) - node["elevation"]) + 0.5 * square_of(own, line[0])
        power[NODE * i] += head * out[tables.layout[0]["supply"] + i]
        return
    d, z = place_rates(y, dydt, out, tables, i), node["elevation"]
    if node["kind"] == TANK:
        z, power[NODE * i + 1] = st["datum"], 0.0
    power[NODE * i + 1] += line_gain(tables, out, here, line, d, z, 0.0)


@njit
def add_place_stored(y, out, tables, i, stored):
    """What place i holds beside what it would if it stood still."""
    node = tables.nodes[i]
    here, z = row_of(tables, tables.rides[node["ride"]]["body"]), node["elevation"]
    if node["kind"] == TANK:
        z, stored[i] = tables.settings[0]["datum"], 0.0
    if node["kind"] == TANK or node["kind"] == CHAMBER:
        stored[i] += line_energy(tables, out, here, place_line(y, tables, i), z, 0.0)


# pipes and columns ----------


@njit(forceinline=True)
def heights(tables, link, way):
    """(elevation of the `from` end at the start [m], rise along the way)."""
    z = tables.nodes[link["from_node"]]["elevation"]
    return z, (tables.nodes[link["to_node"]]["elevation"] - z) / way if way > 0.0 else 0.0


@njit
def pipe_gain(y, dydt, out, tables, k, here):
    """d/dt of what pipe k holds beside what it would if it stood still [W]."""
    r, t, way = pipe_line(tables, k)
    z, rise = heights(tables, tables.pipes[k], way)
    (m, flow), (d, rate) = pipe_moments(tables, y, k, way, 1.0), pipe_moments(tables, dydt, k, way, 0.0)
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
    """What pipe k holds beside what it would if it stood still [J]."""
    own, (r, t, way) = tables.scratch, pipe_line(tables, k)
    z, rise = heights(tables, tables.pipes[k], way)
    m, flow = pipe_moments(tables, y, k, way, 1.0)
    total = line_energy(tables, out, here, (r, t, m), z, rise) + flow * drift_along(own, turned_way(r, t))
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            up = up_tank(tables, i, (2.0 * right - 1.0) * level_at(y, tables, i))
            total += flow * drift_along(own, up)
    return total


@njit
def column_gain(y, dydt, out, tables, k, here):
    """d/dt of what column k holds beside what it would if it stood still [W]; heights from the datum."""
    column, z, total = tables.columns[k], tables.settings[0]["datum"], 0.0
    for m in range(column["rides"]):
        total += line_gain(tables, out, here, segment_line(tables, column, m), NOTHING, z, 0.0)
    i, j = column["from_node"], column["to_node"]
    faster = out_and_in(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    return total + flow_gain(tables, out, here, way_of(y, tables, column), faster, flow, rate)


@njit
def column_held(y, out, tables, k, here):
    """What column k holds beside what it would if it stood still [J]; heights from the datum."""
    column, z, own = tables.columns[k], tables.settings[0]["datum"], tables.scratch
    total = (column["flow"] + y[column["y"]]) * drift_along(own, way_of(y, tables, column))
    for m in range(column["rides"]):
        total += line_energy(tables, out, here, segment_line(tables, column, m), z, 0.0)
    return total


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add to rows of places, pipes and columns."""
    tables = open_tables(handle)
    nodes, pipes, columns, rides, own = tables.nodes, tables.pipes, tables.columns, tables.rides, tables.scratch
    for i in range(nodes.size):
        if nodes[i]["ride"] >= 0 and holds(nodes[i]["kind"]):
            set_axes(tables, out, rides[nodes[i]["ride"]]["body"], ACCELERATION, TURNING)
            add_place_power(y, dydt, out, tables, i, power)
    at = NODE * nodes.size
    for k in range(pipes.size):
        pipe, end = pipes[k], tables.layout[0]["ends"] + 4 * k
        if pipe["ride"] >= 0:
            body = rides[pipe["ride"]]["body"]
            here = row_of(tables, body)
            set_axes(tables, out, body, ACCELERATION, TURNING)
            into = head_beyond(y, out, tables, here, pipe["from_node"]) * (pipe["flow"] + (out[end] - out[end + 1]))
            into -= head_beyond(y, out, tables, here, pipe["to_node"]) * (pipe["flow"] + (out[end + 2] - out[end + 3]))
            power[at] += into + brought(own, pipe_load(y, dydt, tables, k))
            power[at + 3] += pipe_gain(y, dydt, out, tables, k, here)
        at += PIPE
    at += VALVE * tables.valves.size
    for k in range(columns.size):
        column = columns[k]
        if column["ride"] >= 0:
            body = rides[column["ride"]]["body"]
            here = row_of(tables, body)
            set_axes(tables, out, body, ACCELERATION, TURNING)
            drop = head_beyond(y, out, tables, here, column["from_node"])
            drop -= head_beyond(y, out, tables, here, column["to_node"])
            power[at] += drop * out[tables.layout[0]["column"] + k] + brought(own, column_load(y, dydt, tables, k))
            power[at + 2] += column_gain(y, dydt, out, tables, k, here)
        at += COLUMN


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add to rows of places, pipes and columns."""
    tables = open_tables(handle)
    nodes, pipes, columns, rides = tables.nodes, tables.pipes, tables.columns, tables.rides
    for i in range(nodes.size):
        if nodes[i]["ride"] >= 0 and holds(nodes[i]["kind"]):
            set_axes(tables, out, rides[nodes[i]["ride"]]["body"], ACCELERATION, TURNING)
            add_place_stored(y, out, tables, i, stored)
    at = nodes.size
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0:
            body = rides[pipes[k]["ride"]]["body"]
            set_axes(tables, out, body, ACCELERATION, TURNING)
            stored[at + 1] += pipe_held(y, out, tables, k, row_of(tables, body))
        at += 2
    for k in range(columns.size):
        if columns[k]["ride"] >= 0:
            body = rides[columns[k]["ride"]]["body"]
            set_axes(tables, out, body, ACCELERATION, TURNING)
            stored[at] += column_held(y, out, tables, k, row_of(tables, body))
        at += 1
