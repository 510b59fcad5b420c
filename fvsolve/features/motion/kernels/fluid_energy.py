"""Energy of the fluid that moving bodies contain, in the frame of the world.

Relative to a network at rest, each unit of mass has in addition V^2 / 2 + g (z - z at the start); V and z are velocity
and height of the point of the body where the fluid is. A mass flow M along a flow path (C, Z) has in addition
M (v . C + W . Z); v and W are velocity and angular velocity of the body, C and Z the integrals of dr and r x dr along
the path, r is the position in axes of the body. Fluid that passes from a node into a link brings in addition
(v^2 - |W x r|^2) / 2 + g (z - z at the start) per unit mass; for an open tank r and z are taken at its surface. If the
fluid loads a body with force F and torque T, the body supplies the power -(F . v + T . W) to the fluid.

Arguments are those of `fluid_loads`. z : elevation of the start of a segment in the network at rest [m]; rise : its
increase per distance along the segment.
"""

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import CHAMBER, FIXED, JUNCTION, TANK
from fvsolve.core.kernels.network_energy import COLUMN, NODE, PIPE, VALVE, energy_head
from fvsolve.core.kernels.vectors import cross, dot, plus, scalar_product, scaled, vector
from fvsolve.features.motion.kernels import fluid_loads as fluid
from fvsolve.features.motion.kernels.tables import open_motion
from fvsolve.jit import njit


@njit(forceinline=True)
def height_on_body(out, here, r):
    """Height in the world of a point r in axes of a body [m]."""
    return out[here + layout.POSITION + 2] + dot(out, here + layout.ATTITUDE + 6, *r)


@njit(forceinline=True)
def velocity_at(motion, r):
    """Velocity in the world of a point r in axes of a body, in these axes [m/s]."""
    return plus(cross(motion, fluid.BODY_SPIN, *r), vector(motion, fluid.BODY_VELOCITY))


@njit
def segment_energy(tables, out, here, segment, z, rise):
    """Energy of a segment of fluid that is due to the motion of its body [J].

    The energy is the integral of V^2 / 2 + g (height - z - rise s) over the mass; V : velocity in the world, s :
    distance along the segment [m].
    segment : (start r, direction t, mass moments m); with the rates of the moments in place of m, the result is the
        power that the inflow brings [W]
    """
    motion, g, (r, t, m) = tables.scratch, tables.settings[0]["gravity"], segment
    # V = v + a s along the segment, so V^2 / 2 integrates to a sum over mass moments.
    v, a = velocity_at(motion, r), cross(motion, fluid.BODY_SPIN, *t)
    kinetic = 0.5 * m[0] * scalar_product(v, v) + m[1] * scalar_product(v, a)
    kinetic += 0.5 * m[2] * scalar_product(a, a)
    # The height above the network at rest is linear along the segment too.
    slope = dot(out, here + layout.ATTITUDE + 6, *t) - rise
    return kinetic + g * (m[0] * (height_on_body(out, here, r) - z) + m[1] * slope)


@njit(forceinline=True)
def path_velocity(motion, path):
    """Velocity of a body integrated along a flow path (C, Z) on it, v . C + W . Z [m2/s].

    v, W : velocity of the origin of the body, and angular velocity. For a load (F, T) in place of the path, minus the
    result is the power that the body supplies to the fluid [W].
    """
    return dot(motion, fluid.BODY_VELOCITY, *path[:3]) + dot(motion, fluid.BODY_SPIN, *path[3:])


@njit
def segment_energy_rate(tables, out, here, segment, d, z, rise):
    """Rate of the energy of a segment that `segment_energy` gives [W]."""
    motion, (r, t, m) = tables.scratch, segment
    # Power that the body supplies, plus the energy that changes of mass bring.
    carried = -path_velocity(motion, fluid.segment_load(motion, r, t, m, fluid.ZERO_VECTOR))
    return carried + segment_energy(tables, out, here, (r, t, d), z, rise)


@njit
def path_energy_rate(tables, out, here, path, change, flow, rate):
    """Rate of the energy M (v . C + W . Z) of a mass flow M along a flow path (C, Z) on a body [W]."""
    motion = tables.scratch
    g = tables.settings[0]["gravity"]
    up = vector(out, here + layout.ATTITUDE + 6)
    # d/dt of v in axes of the body is a_o - W x v, which is minus `pull`.
    pull = cross(motion, fluid.BODY_SPIN, *vector(motion, fluid.BODY_VELOCITY))
    pull = plus(scaled(g, up), plus(pull, vector(motion, fluid.BODY_GRAVITY)))
    faster = -scalar_product(path, pull) + dot(motion, fluid.BODY_SPIN_RATE, *path[3:])
    return rate * path_velocity(motion, path) + flow * (faster + path_velocity(motion, change))


@njit
def extra_head(y, out, tables, here, i):
    """Energy per mass that the motion of the body adds to flow from node i into a link [J/kg].

    For a tank, the energy at its surface, above datum, also replaces the energy at the pressure of its bottom.
    """
    st = tables.settings[0]
    node = tables.nodes[i]
    motion = tables.scratch
    r = vector(tables.moving_segments[node["forcing"]]["start"], 0)
    z = node["elevation"]
    more = 0.0
    v = vector(motion, fluid.BODY_VELOCITY)
    if node["kind"] == TANK:
        r = r[0], r[1], r[2] + fluid.level_at(y, tables, i)
        z = st["datum"]
        more = -energy_head(
            st, tables.floats, node, node["pressure"] + out[tables.layout[0]["pressure"] + i]
        )
    turning = cross(motion, fluid.BODY_SPIN, *r)
    square = scalar_product(v, v) - scalar_product(turning, turning)
    return more + st["gravity"] * (height_on_body(out, here, r) - z) + 0.5 * square


# nodes ----------


@njit
def add_node_power(y, dydt, out, tables, here, i, power):
    """Add to `power` the supplied power or the rate of energy of node i that is due to the motion of its body [W].

    The supplied power is that of a junction or reservoir; the rate is that of a tank or chamber. For a tank the rate
    replaces the entry, and heights are those above the datum.
    """
    node, st = tables.nodes[i], tables.settings[0]
    segment, z = fluid.node_segment(y, tables, i), node["elevation"]
    if node["kind"] == FIXED or node["kind"] == JUNCTION:
        # Fluid from outside has the velocity of the node at which it enters.
        v = velocity_at(tables.scratch, segment[0])
        head = st["gravity"] * (height_on_body(out, here, segment[0]) - z) + 0.5 * scalar_product(
            v, v
        )
        power[NODE * i] += head * out[tables.layout[0]["supply"] + i]
        return
    d = fluid.node_segment_rates(y, dydt, out, tables, i)
    if node["kind"] == TANK:
        z, power[NODE * i + 1] = st["datum"], 0.0
    power[NODE * i + 1] += segment_energy_rate(tables, out, here, segment, d, z, 0.0)


@njit
def add_node_stored(y, out, tables, here, i, stored):
    """Add to `stored` the energy of the fluid at node i that is due to the motion of its body [J].

    For a tank it replaces the entry, and heights are those above the datum.
    """
    node = tables.nodes[i]
    z = node["elevation"]
    if node["kind"] == TANK:
        z, stored[i] = tables.settings[0]["datum"], 0.0
    if node["kind"] == TANK or node["kind"] == CHAMBER:
        stored[i] += segment_energy(tables, out, here, fluid.node_segment(y, tables, i), z, 0.0)


# pipes and columns ----------


@njit(forceinline=True)
def end_heights(tables, link, length):
    """(elevation of the `from` end at the start [m], rise per length of the straight line between the ends)."""
    z = tables.nodes[link["from_node"]]["elevation"]
    return z, (tables.nodes[link["to_node"]]["elevation"] - z) / length if length > 0.0 else 0.0


@njit
def pipe_energy_rate(y, dydt, out, tables, k, here):
    """Rate of the energy of pipe k that is due to the motion of its body [W]."""
    r, t, length = fluid.pipe_segment(tables, k)
    z, rise = end_heights(tables, tables.pipes[k], length)
    (m, flow) = fluid.pipe_moments(tables, y, k, length, 1.0)
    (d, rate) = fluid.pipe_moments(tables, dydt, k, length, 0.0)
    total = segment_energy_rate(tables, out, here, (r, t, m), d, z, rise)
    total += path_energy_rate(
        tables, out, here, fluid.straight_path(r, t), fluid.ZERO_FLOW_PATH, flow, rate
    )
    # In a tank the flow goes on from the end of the pipe to the surface.
    for right in range(2):
        i, flow = fluid.pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up = fluid.tank_path(tables, i, sign * fluid.level_at(y, tables, i))
            faster = fluid.tank_path(tables, i, sign * fluid.level_rate(dydt, tables, i))
            total += path_energy_rate(
                tables, out, here, up, faster, flow, fluid.pipe_end(dydt, tables, k, right, 0.0)[1]
            )
    return total


@njit
def pipe_extra_energy(y, out, tables, k, here):
    """Energy of pipe k that is due to the motion of its body [J]."""
    motion, (r, t, length) = tables.scratch, fluid.pipe_segment(tables, k)
    z, rise = end_heights(tables, tables.pipes[k], length)
    m, flow = fluid.pipe_moments(tables, y, k, length, 1.0)
    total = segment_energy(tables, out, here, (r, t, m), z, rise) + flow * path_velocity(
        motion, fluid.straight_path(r, t)
    )
    # In a tank the flow goes on from the end of the pipe to the surface.
    for right in range(2):
        i, flow = fluid.pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            up = fluid.tank_path(tables, i, (2.0 * right - 1.0) * fluid.level_at(y, tables, i))
            total += flow * path_velocity(motion, up)
    return total


@njit
def column_energy_rate(y, dydt, out, tables, k, here):
    """Rate of the energy of rigid column k that is due to the motion of its body [W].

    Heights are those above the datum.
    """
    column = tables.columns[k]
    z = tables.settings[0]["datum"]
    total = 0.0
    for m in range(column["forcings"]):
        total += segment_energy_rate(
            tables, out, here, fluid.column_segment(tables, column, m), fluid.ZERO_VECTOR, z, 0.0
        )
    i, j = column["from_node"], column["to_node"]
    faster = fluid.tank_paths(
        tables, i, j, fluid.level_rate(dydt, tables, i), fluid.level_rate(dydt, tables, j)
    )
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    return total + path_energy_rate(
        tables, out, here, fluid.column_path(y, tables, column), faster, flow, rate
    )


@njit
def column_extra_energy(y, out, tables, k, here):
    """Energy of rigid column k that is due to the motion of its body [J].

    Heights are those above the datum.
    """
    column = tables.columns[k]
    z = tables.settings[0]["datum"]
    motion = tables.scratch
    total = (column["flow"] + y[column["y"]]) * path_velocity(
        motion, fluid.column_path(y, tables, column)
    )
    for m in range(column["forcings"]):
        total += segment_energy(tables, out, here, fluid.column_segment(tables, column, m), z, 0.0)
    return total


@njit(forceinline=True)
def carrier(tables, out, row):
    """Result of `set_carrier_motion` for all fluid on bodies, with the solved accelerations."""
    return fluid.set_carrier_motion(tables, out, row, 0, layout.ACCELERATION, layout.SPIN_RATE)


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power due to the motion of bodies to the entries of nodes, pipes and rigid columns in `power` [W]."""
    tables = open_motion(handle)
    nodes = tables.nodes
    pipes = tables.pipes
    columns = tables.columns
    motion = tables.scratch
    for i in range(nodes.size):
        here = carrier(
            tables, out, nodes[i]["forcing"] if fluid.is_fluid_node(nodes[i]["kind"]) else -1
        )
        if here >= 0:
            add_node_power(y, dydt, out, tables, here, i, power)
    at = NODE * nodes.size
    for k in range(pipes.size):
        pipe, end = pipes[k], tables.layout[0]["ends"] + 4 * k
        here = carrier(tables, out, pipe["forcing"])
        if here >= 0:
            # Fluid brings the energy of the motion at both ends with the flow there.
            into = extra_head(y, out, tables, here, pipe["from_node"]) * (
                pipe["flow"] + (out[end] - out[end + 1])
            )
            into -= extra_head(y, out, tables, here, pipe["to_node"]) * (
                pipe["flow"] + (out[end + 2] - out[end + 3])
            )
            power[at] += into - path_velocity(motion, fluid.pipe_load(y, dydt, tables, k))
            power[at + 3] += pipe_energy_rate(y, dydt, out, tables, k, here)
        at += PIPE
    at += VALVE * tables.valves.size
    for k in range(columns.size):
        column = columns[k]
        here = carrier(tables, out, column["forcing"])
        if here >= 0:
            drop = extra_head(y, out, tables, here, column["from_node"])
            drop -= extra_head(y, out, tables, here, column["to_node"])
            into = drop * out[tables.layout[0]["column"] + k]
            power[at] += into - path_velocity(motion, fluid.column_load(y, dydt, tables, k))
            power[at + 2] += column_energy_rate(y, dydt, out, tables, k, here)
        at += COLUMN


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Add the energy due to the motion of bodies to the entries of nodes, pipes and rigid columns in `stored` [J].

    It is the difference from the energy with the body at rest in its position at the start. For tanks and columns,
    heights are those above the datum instead.
    """
    tables = open_motion(handle)
    nodes = tables.nodes
    pipes = tables.pipes
    columns = tables.columns
    for i in range(nodes.size):
        here = carrier(
            tables, out, nodes[i]["forcing"] if fluid.is_fluid_node(nodes[i]["kind"]) else -1
        )
        if here >= 0:
            add_node_stored(y, out, tables, here, i, stored)
    at = nodes.size
    for k in range(pipes.size):
        here = carrier(tables, out, pipes[k]["forcing"])
        if here >= 0:
            stored[at + 1] += pipe_extra_energy(y, out, tables, k, here)
        at += 2
    for k in range(columns.size):
        here = carrier(tables, out, columns[k]["forcing"])
        if here >= 0:
            stored[at] += column_extra_energy(y, out, tables, k, here)
        at += 1
