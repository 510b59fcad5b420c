"""Energy of the fluid that moving bodies contain, in the frame of the world.

Relative to a network at rest, each unit of mass has in addition V^2 / 2 + g (z - z at the start); V and z are velocity
and height of the point of the body where the fluid is. A mass flow M along a flow path (C, Z) has in addition
M (v . C + W . Z); v and W are velocity and angular velocity of the body, C and Z the integrals of dr and r x dr along
the path, r is the position in axes of the body. Fluid that passes from a node into a link brings in addition
(v^2 - |W x r|^2) / 2 + g (z - z at the start) per unit mass; for an open tank r and z are taken at its surface. If the
fluid loads a body with force F and torque T, the body supplies the power -(F . v + T . W) to the fluid.

Other arguments: here : offset of a body in `out`; motion : `scratch` after `set_body_motion`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CHAMBER, FIXED, JUNCTION, TANK
from fvsolve.kernels.mechanism.body_layout import ACCELERATION, ATTITUDE, POSITION, SPIN_RATE, body_row, cross, dot
from fvsolve.kernels.mechanism.fluid_loads import (
    ZERO_FLOW_PATH,
    ZERO_VECTOR,
    as_tuple,
    column_load,
    column_path,
    column_segment,
    is_fluid_node,
    level_at,
    level_rate,
    node_segment,
    node_segment_rates,
    pipe_end,
    pipe_load,
    pipe_moments,
    pipe_segment,
    segment_load,
    straight_path,
    tank_path,
    tank_paths,
)
from fvsolve.kernels.mechanism.noninertial_forces import (
    BODY_GRAVITY,
    BODY_SPIN,
    BODY_SPIN_RATE,
    BODY_VELOCITY,
    set_body_motion,
)
from fvsolve.kernels.network_energy import COLUMN, NODE, PIPE, VALVE, energy_head
from fvsolve.kernels.table_handle import open_tables


@njit(forceinline=True)
def height_on_body(out, here, r):
    """Height in the world of a point r in axes of a body [m]; here : offset of the body in `out`."""
    return out[here + POSITION + 2] + dot(out, here + ATTITUDE + 6, r[0], r[1], r[2])


@njit(forceinline=True)
def speed_squared_at(motion, r):
    """Square of the speed in the world of a point r in axes of a body [m2/s2]; motion : after `set_body_motion`."""
    u, v, w = cross(motion, BODY_SPIN, r[0], r[1], r[2])
    u, v, w = u + motion[BODY_VELOCITY], v + motion[BODY_VELOCITY + 1], w + motion[BODY_VELOCITY + 2]
    return u * u + v * v + w * w


@njit
def segment_energy(tables, out, here, segment, z, rise):
    """Energy of a segment of fluid that is due to the motion of its body [J].

    The energy is the integral of V^2 / 2 + g (height - z - rise s) over the mass; V : velocity in the world, s :
    distance along the segment [m].
    segment : (start r, direction t, mass moments m), see `fluid_loads`; with the rates of the moments in place of m,
        the result is the power that the inflow brings [W]
    z, rise : elevation of the start of the segment in the network at rest [m], and its increase per distance s
    here : offset of the body in `out`
    """
    motion, g, (r, t, m) = tables.scratch, tables.settings[0]["gravity"], segment
    u, v, w = cross(motion, BODY_SPIN, r[0], r[1], r[2])
    u, v, w = u + motion[BODY_VELOCITY], v + motion[BODY_VELOCITY + 1], w + motion[BODY_VELOCITY + 2]
    a, b, c = cross(motion, BODY_SPIN, t[0], t[1], t[2])
    kinetic = 0.5 * m[0] * (u * u + v * v + w * w) + m[1] * (u * a + v * b + w * c)
    kinetic += 0.5 * m[2] * (a * a + b * b + c * c)
    slope = dot(out, here + ATTITUDE + 6, t[0], t[1], t[2]) - rise
    return kinetic + g * (m[0] * (height_on_body(out, here, r) - z) + m[1] * slope)


@njit(forceinline=True)
def load_power(motion, load):
    """Power -(F . v + T . W) that a body supplies to fluid [W]; load : force F and torque T of the fluid on it.

    v, W : velocity of the origin of the body, and angular velocity
    """
    force = motion[BODY_VELOCITY] * load[0] + motion[BODY_VELOCITY + 1] * load[1] + motion[BODY_VELOCITY + 2] * load[2]
    return -(force + (motion[BODY_SPIN] * load[3] + motion[BODY_SPIN + 1] * load[4] + motion[BODY_SPIN + 2] * load[5]))


@njit
def segment_energy_rate(tables, out, here, segment, d, z, rise):
    """Rate of the energy of a segment that `segment_energy` gives [W].

    d : rates of the mass moments of the segment; other arguments as for `segment_energy`
    """
    motion, (r, t, m) = tables.scratch, segment
    carried = load_power(motion, segment_load(motion, r, t, m, ZERO_VECTOR))
    return carried + segment_energy(tables, out, here, (r, t, d), z, rise)


@njit(forceinline=True)
def path_velocity(motion, path):
    """Velocity of a body integrated along a flow path (C, Z) on it, v . C + W . Z [m2/s].

    C, Z : integrals of dr and r x dr along the path; v, W : velocity of the origin of the body, and angular velocity
    """
    return load_power(motion, (-path[0], -path[1], -path[2], -path[3], -path[4], -path[5]))


@njit
def path_energy_rate(tables, out, here, path, change, flow, rate):
    """Rate of the energy M (v . C + W . Z) of a mass flow M along a flow path (C, Z) on a body [W].

    path, change : (C, Z) and its rate; flow, rate : M [kg/s] and dM/dt [kg/s2]; v, W : see `path_velocity`
    here : offset of the body in `out`
    """
    motion, g, up = tables.scratch, tables.settings[0]["gravity"], here + ATTITUDE + 6
    x, y, z = cross(motion, BODY_SPIN, motion[BODY_VELOCITY], motion[BODY_VELOCITY + 1], motion[BODY_VELOCITY + 2])
    x, y, z = x + motion[BODY_GRAVITY], y + motion[BODY_GRAVITY + 1], z + motion[BODY_GRAVITY + 2]
    faster = -(path[0] * (g * out[up] + x) + path[1] * (g * out[up + 1] + y) + path[2] * (g * out[up + 2] + z))
    faster += (
        motion[BODY_SPIN_RATE] * path[3] + motion[BODY_SPIN_RATE + 1] * path[4] + motion[BODY_SPIN_RATE + 2] * path[5]
    )
    return rate * path_velocity(motion, path) + flow * (faster + path_velocity(motion, change))


@njit
def extra_head(y, out, tables, here, i):
    """Energy per mass that the motion of the body adds to flow from node i into a link [J/kg].

    For a tank, the energy at its surface, above datum, also replaces the energy at the pressure of its bottom.
    here : offset of the body in `out`
    """
    st, node, motion = tables.settings[0], tables.nodes[i], tables.scratch
    r = as_tuple(tables.moving_segments[node["moving_segment"]]["start"])
    z, more = node["elevation"], 0.0
    if node["kind"] == TANK:
        r = r[0], r[1], r[2] + level_at(y, tables, i)
        z = st["datum"]
        more = -energy_head(st, tables.floats, node, node["pressure"] + out[tables.layout[0]["pressure"] + i])
    u, v, w = cross(motion, BODY_SPIN, r[0], r[1], r[2])
    square = (
        motion[BODY_VELOCITY] * motion[BODY_VELOCITY]
        + motion[BODY_VELOCITY + 1] * motion[BODY_VELOCITY + 1]
        + motion[BODY_VELOCITY + 2] * motion[BODY_VELOCITY + 2]
    )
    return more + st["gravity"] * (height_on_body(out, here, r) - z) + 0.5 * (square - (u * u + v * v + w * w))


# nodes ----------


@njit
def add_node_power(y, dydt, out, tables, i, power):
    """Add to `power` the supplied power or the rate of energy of node i that is due to the motion of its body [W].

    The supplied power is that of a junction or reservoir; the rate is that of a tank or chamber. For a tank the rate
    replaces the entry, and heights are those above the datum.
    """
    node, st, motion = tables.nodes[i], tables.settings[0], tables.scratch
    here = body_row(tables, tables.moving_segments[node["moving_segment"]]["body"])
    segment = node_segment(y, tables, i)
    if node["kind"] == FIXED or node["kind"] == JUNCTION:
        head = st["gravity"] * (height_on_body(out, here, segment[0]) - node["elevation"]) + 0.5 * speed_squared_at(
            motion, segment[0]
        )
        power[NODE * i] += head * out[tables.layout[0]["supply"] + i]
        return
    d, z = node_segment_rates(y, dydt, out, tables, i), node["elevation"]
    if node["kind"] == TANK:
        z, power[NODE * i + 1] = st["datum"], 0.0
    power[NODE * i + 1] += segment_energy_rate(tables, out, here, segment, d, z, 0.0)


@njit
def add_node_stored(y, out, tables, i, stored):
    """Add to `stored` the energy of the fluid at node i that is due to the motion of its body [J].

    For a tank it replaces the entry, and heights are those above the datum.
    """
    node = tables.nodes[i]
    here, z = body_row(tables, tables.moving_segments[node["moving_segment"]]["body"]), node["elevation"]
    if node["kind"] == TANK:
        z, stored[i] = tables.settings[0]["datum"], 0.0
    if node["kind"] == TANK or node["kind"] == CHAMBER:
        stored[i] += segment_energy(tables, out, here, node_segment(y, tables, i), z, 0.0)


# pipes and columns ----------


@njit(forceinline=True)
def end_heights(tables, link, length):
    """(elevation of the `from` end at the start [m], rise per length of the straight line between the ends)."""
    z = tables.nodes[link["from_node"]]["elevation"]
    return z, (tables.nodes[link["to_node"]]["elevation"] - z) / length if length > 0.0 else 0.0


@njit
def pipe_energy_rate(y, dydt, out, tables, k, here):
    """Rate of the energy of pipe k that is due to the motion of its body [W]; here : offset of the body in `out`."""
    r, t, length = pipe_segment(tables, k)
    z, rise = end_heights(tables, tables.pipes[k], length)
    (m, flow), (d, rate) = pipe_moments(tables, y, k, length, 1.0), pipe_moments(tables, dydt, k, length, 0.0)
    total = segment_energy_rate(tables, out, here, (r, t, m), d, z, rise)
    total += path_energy_rate(tables, out, here, straight_path(r, t), ZERO_FLOW_PATH, flow, rate)
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up = tank_path(tables, i, sign * level_at(y, tables, i))
            faster = tank_path(tables, i, sign * level_rate(dydt, tables, i))
            total += path_energy_rate(tables, out, here, up, faster, flow, pipe_end(dydt, tables, k, right, 0.0)[1])
    return total


@njit
def pipe_extra_energy(y, out, tables, k, here):
    """Energy of pipe k that is due to the motion of its body [J]; here : offset of the body in `out`."""
    motion, (r, t, length) = tables.scratch, pipe_segment(tables, k)
    z, rise = end_heights(tables, tables.pipes[k], length)
    m, flow = pipe_moments(tables, y, k, length, 1.0)
    total = segment_energy(tables, out, here, (r, t, m), z, rise) + flow * path_velocity(motion, straight_path(r, t))
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            up = tank_path(tables, i, (2.0 * right - 1.0) * level_at(y, tables, i))
            total += flow * path_velocity(motion, up)
    return total


@njit
def column_energy_rate(y, dydt, out, tables, k, here):
    """Rate of the energy of rigid column k that is due to the motion of its body [W].

    Heights are those above the datum. here : offset of the body in `out`
    """
    column, z, total = tables.columns[k], tables.settings[0]["datum"], 0.0
    for m in range(column["moving_segments"]):
        total += segment_energy_rate(tables, out, here, column_segment(tables, column, m), ZERO_VECTOR, z, 0.0)
    i, j = column["from_node"], column["to_node"]
    faster = tank_paths(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    return total + path_energy_rate(tables, out, here, column_path(y, tables, column), faster, flow, rate)


@njit
def column_extra_energy(y, out, tables, k, here):
    """Energy of rigid column k that is due to the motion of its body [J].

    Heights are those above the datum. here : offset of the body in `out`
    """
    column, z, motion = tables.columns[k], tables.settings[0]["datum"], tables.scratch
    total = (column["flow"] + y[column["y"]]) * path_velocity(motion, column_path(y, tables, column))
    for m in range(column["moving_segments"]):
        total += segment_energy(tables, out, here, column_segment(tables, column, m), z, 0.0)
    return total


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power due to the motion of bodies to the entries of nodes, pipes and rigid columns in `power` [W]."""
    tables = open_tables(handle)
    nodes, pipes, columns, segments, motion = (
        tables.nodes,
        tables.pipes,
        tables.columns,
        tables.moving_segments,
        tables.scratch,
    )
    for i in range(nodes.size):
        if nodes[i]["moving_segment"] >= 0 and is_fluid_node(nodes[i]["kind"]):
            set_body_motion(tables, out, segments[nodes[i]["moving_segment"]]["body"], ACCELERATION, SPIN_RATE)
            add_node_power(y, dydt, out, tables, i, power)
    at = NODE * nodes.size
    for k in range(pipes.size):
        pipe, end = pipes[k], tables.layout[0]["ends"] + 4 * k
        if pipe["moving_segment"] >= 0:
            body = segments[pipe["moving_segment"]]["body"]
            here = body_row(tables, body)
            set_body_motion(tables, out, body, ACCELERATION, SPIN_RATE)
            into = extra_head(y, out, tables, here, pipe["from_node"]) * (pipe["flow"] + (out[end] - out[end + 1]))
            into -= extra_head(y, out, tables, here, pipe["to_node"]) * (pipe["flow"] + (out[end + 2] - out[end + 3]))
            power[at] += into + load_power(motion, pipe_load(y, dydt, tables, k))
            power[at + 3] += pipe_energy_rate(y, dydt, out, tables, k, here)
        at += PIPE
    at += VALVE * tables.valves.size
    for k in range(columns.size):
        column = columns[k]
        if column["moving_segment"] >= 0:
            body = segments[column["moving_segment"]]["body"]
            here = body_row(tables, body)
            set_body_motion(tables, out, body, ACCELERATION, SPIN_RATE)
            drop = extra_head(y, out, tables, here, column["from_node"])
            drop -= extra_head(y, out, tables, here, column["to_node"])
            power[at] += drop * out[tables.layout[0]["column"] + k] + load_power(
                motion, column_load(y, dydt, tables, k)
            )
            power[at + 2] += column_energy_rate(y, dydt, out, tables, k, here)
        at += COLUMN


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the energy due to the motion of bodies to the entries of nodes, pipes and rigid columns in `stored` [J].

    It is the difference from the energy with the body at rest in its position at the start. For tanks and columns,
    heights
    are those above the datum instead.
    """
    tables = open_tables(handle)
    nodes, pipes, columns, segments = tables.nodes, tables.pipes, tables.columns, tables.moving_segments
    for i in range(nodes.size):
        if nodes[i]["moving_segment"] >= 0 and is_fluid_node(nodes[i]["kind"]):
            set_body_motion(tables, out, segments[nodes[i]["moving_segment"]]["body"], ACCELERATION, SPIN_RATE)
            add_node_stored(y, out, tables, i, stored)
    at = nodes.size
    for k in range(pipes.size):
        if pipes[k]["moving_segment"] >= 0:
            body = segments[pipes[k]["moving_segment"]]["body"]
            set_body_motion(tables, out, body, ACCELERATION, SPIN_RATE)
            stored[at + 1] += pipe_extra_energy(y, out, tables, k, body_row(tables, body))
        at += 2
    for k in range(columns.size):
        if columns[k]["moving_segment"] >= 0:
            body = segments[columns[k]["moving_segment"]]["body"]
            set_body_motion(tables, out, body, ACCELERATION, SPIN_RATE)
            stored[at] += column_extra_energy(y, out, tables, k, body_row(tables, body))
        at += 1
