"""Force and torque of contained fluid on its body, in axes of the body and about its origin, and its inertia.

Fluid lies along straight segments. A segment from r along the unit vector t has the mass moments m = (m0, m1, m2), the
integrals of 1, s and s^2 over its mass; s is the distance from r, and d are the rates of m. A flow path has (C, Z), the
integrals of dr and r x dr along it, and carries the mass flow M. By the equations of Newton and Euler ((68) of
docs/course.md) for all fluid, the load on the body is

    force   m0 G - W' x S - W x (W x S + S') - (M C)' - W x M C
    torque  S x G - J W' - J' W - W x J W - (M Z)' - W x M Z

A prime is d/dt. S is the sum of mass times position, J the inertia about the origin. G = g - a_o is gravity minus the
acceleration of the origin, W the angular velocity; `set_body_motion` writes G, W and W' to `scratch`. Fluid leaves a
network with the velocity of its node. The flow inside a tank is that of the first cell of each connected pipe, and of
each connected rigid column. A load is a tuple of six numbers: force [N], torque [N m].

Arguments: r, t : start and direction of a segment; m, d : its mass moments and their rates; path, change : (C, Z) and
its rate; flow, rate : mass flow [kg/s] and its derivative [kg/s2]; motion : `scratch` after `set_body_motion`; wide,
spin : offsets, in the data of a body, of the acceleration of its origin and of its angular acceleration.

Contribution of the fluid of networks and of the water in basins to the mass matrix M of bodies that forces can move:
First all fluid of a network counts as fixed to its body. Then the inertia of its sliding along the flow path (C, Z) is
subtracted; C and Z are the integrals of dr and r x dr along the path. For a rigid column of density rho, area A and
length L this inertia is rho (A / L) c c' with c = (C, Z), taken from surface to surface. For each cell of a pipe, the
mass of the cell over the square of its length replaces rho A / L. M contains the products over degrees of freedom, see
`mass_matrix`. The water in a basin moves with its body only along the normal of the bed; along the bed it slides.

s : offset in `work`, or `scratch`, of the angular velocity and the velocity at o (`body_layout`) per unit rate of one
degree of freedom
"""

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.dtypes import CHAMBER, FIXED, JUNCTION, LAW_LINEAR, TANK, TANK_OUT
from fvsolve.core.kernels.moving_frames import add_force, add_torque, body_row
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.core.kernels.vectors import (
    cross,
    dot,
    minus,
    plus,
    rotate,
    rotate_back,
    scalar_product,
    scaled,
    vector,
    vector_product,
    write_vector,
)
from fvsolve.features.motion.kernels.body_trees import freedom_path, nearest_free_body
from fvsolve.features.motion.kernels.tables import MOVED_BY_FORCES, open_motion
from fvsolve.jit import njit

ZERO_VECTOR = (0.0, 0.0, 0.0)
ZERO_FLOW_PATH = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# in `scratch`, written by `set_body_motion`: g - a_o, W, W' and velocity of the origin, in axes of a body
BODY_GRAVITY, BODY_SPIN, BODY_SPIN_RATE, BODY_VELOCITY = 0, 3, 6, 9


@njit
def set_body_motion(tables, out, i, wide, spin):
    """Write g - a_o, W, W' and the velocity of the origin of body i, in its own axes, to scratch[:12].

    g : acceleration of gravity; a_o : acceleration of its origin; W, W' : its angular velocity and acceleration
    wide, spin : offsets of a_o and W' in the data of the body in `out`
    """
    here = body_row(tables, i)
    motion = tables.scratch
    down = -tables.settings[0]["gravity"]
    r, (x, y, z) = here + layout.ATTITUDE, vector(out, here + wide)
    write_vector(motion, BODY_GRAVITY, *rotate_back(out, r, -x, -y, down - z))
    write_vector(motion, BODY_SPIN, *rotate_back(out, r, *vector(out, here + layout.SPIN)))
    write_vector(motion, BODY_SPIN_RATE, *rotate_back(out, r, *vector(out, here + spin)))
    write_vector(motion, BODY_VELOCITY, *rotate_back(out, r, *vector(out, here + layout.VELOCITY)))


@njit(forceinline=True)
def add_six(a, b):
    """Sum of two loads, or of two flow paths, of six numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit
def inertia_times(r, t, m, w):
    """Inertia of a segment times the vector w: integral of p x (w x p) over its mass; p : position."""
    square = m[0] * scalar_product(r, r) + m[2] * scalar_product(t, t)
    square += 2.0 * m[1] * scalar_product(r, t)
    a, b = scalar_product(r, w), scalar_product(t, w)
    along = scaled(m[0] * a + m[1] * b, r)
    return minus(minus(scaled(square, w), along), scaled(m[1] * a + m[2] * b, t))


@njit
def segment_load(motion, r, t, m, d):
    """Force and torque of a segment of fluid on its body."""
    g = vector(motion, BODY_GRAVITY)
    w, e = vector(motion, BODY_SPIN), vector(motion, BODY_SPIN_RATE)
    # S = sum of mass times position, and the momentum W x S + S'.
    s = plus(scaled(m[0], r), scaled(m[1], t))
    momentum = plus(plus(vector_product(w, s), scaled(d[0], r)), scaled(d[1], t))
    force = minus(minus(scaled(m[0], g), vector_product(e, s)), vector_product(w, momentum))
    torque = minus(
        minus(vector_product(s, g), inertia_times(r, t, m, e)), inertia_times(r, t, d, w)
    )
    return force + minus(torque, vector_product(w, inertia_times(r, t, m, w)))


@njit
def flow_load(motion, path, change, flow, rate):
    """Force and torque of a mass flow along a flow path on its body."""
    # C and Z in axes of the world change as the body turns: C' + W x C, Z' + W x Z.
    straight = plus(change, cross(motion, BODY_SPIN, *path[:3]))
    around = plus(change[3:], cross(motion, BODY_SPIN, *path[3:]))
    return minus(scaled(-rate, path), scaled(flow, straight)) + minus(
        scaled(-rate, path[3:]), scaled(flow, around)
    )


# tanks ----------


@njit
def level_at(y, tables, i):
    """Level of the tank at node i [m]; 0 for nodes of other kinds."""
    node = tables.nodes[i]
    return (
        tank_level(node, tables.floats, node["density"], y[node["y"]])
        if node["kind"] == TANK
        else 0.0
    )


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
    r = tables.moving_segments[tables.nodes[i]["forcing"]]["start"]
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
    r = vector(tables.moving_segments[node["forcing"]]["start"], 0)
    if node["kind"] == TANK:
        return (
            r,
            (0.0, 0.0, 1.0),
            vertical_moments(node["mass"] + y[node["y"]], level_at(y, tables, i)),
        )
    return (
        r,
        ZERO_VECTOR,
        (node["mass"] + y[node["y"]] if node["kind"] == CHAMBER else 0.0, 0.0, 0.0),
    )


@njit
def node_segment_rates(y, dydt, out, tables, i):
    """Rates of the three mass moments of the fluid at node i, from its inflow [kg/s, kg m/s, kg m2/s].

    In a tank the inflow counts at the surface. A node without volume has the rate -supply, because supplied fluid
    leaves it into the network.
    """
    node = tables.nodes[i]
    if node["kind"] == TANK:
        # Fluid enters at the surface, so its moments are those of a mass at this height.
        high, more = level_at(y, tables, i), dydt[node["y"]]
        return more, more * high, more * high * high
    if node["kind"] == CHAMBER:
        return dydt[node["y"]], 0.0, 0.0
    return -out[tables.layout[0]["supply"] + i], 0.0, 0.0


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
    pipe, segments = tables.pipes[k], tables.moving_segments
    r = vector(segments[pipe["forcing"]]["start"], 0)
    span = minus(vector(segments[pipe["forcing"] + pipe["cells"] - 1]["end"], 0), r)
    length = scalar_product(span, span) ** 0.5
    return r, scaled(1.0 / length if length > 0.0 else 0.0, span), length


@njit
def pipe_moments(tables, y, k, length, share):
    """Mass moments of pipe k, and the sum over its cells of mass flow times length along the segment [kg m/s].

    y : states with share = 1; or rates of states with share = 0, then the results are rates
    length : distance between the ends of the pipe [m]
    """
    pipe = tables.pipes[k]
    n = pipe["cells"]
    o = pipe["y"]
    per = 1.0 / pipe["speed"]
    step = length / n
    m0 = 0.0
    m1 = 0.0
    m2 = 0.0
    flow = share * n * pipe["flow"]
    for i in range(n):
        mass = (share * mass_per_length(tables, pipe, i) + per * (y[o + i] + y[o + n + i])) * pipe[
            "dx"
        ]
        s = i + 0.5
        m0 = m0 + mass
        m1 = m1 + mass * s
        m2 = m2 + mass * s * s
        flow += y[o + i] - y[o + n + i]
    # 1 / 12: the mass of a cell is spread over its length, not concentrated at its centre.
    return (m0, m1 * step, (m2 + m0 / 12.0) * step * step), flow * step


@njit(forceinline=True)
def straight_path(r, t):
    """Integrals of dr and r x dr along a flow path of unit length from r in the direction t."""
    return t + vector_product(r, t)


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
    """
    motion, (r, t, length) = tables.scratch, pipe_segment(tables, k)
    m, flow = pipe_moments(tables, y, k, length, 1.0)
    d, rate = pipe_moments(tables, dydt, k, length, 0.0)
    load = add_six(
        segment_load(motion, r, t, m, d),
        flow_load(motion, straight_path(r, t), ZERO_FLOW_PATH, flow, rate),
    )
    # In a tank the flow goes on from the end of the pipe to the surface.
    for right in range(2):
        i, flow = pipe_end(y, tables, k, right, 1.0)
        if i >= 0:
            sign = 2.0 * right - 1.0
            up = tank_path(tables, i, sign * level_at(y, tables, i))
            faster = tank_path(tables, i, sign * level_rate(dydt, tables, i))
            load = add_six(
                load, flow_load(motion, up, faster, flow, pipe_end(dydt, tables, k, right, 0.0)[1])
            )
    return load


# columns ----------


@njit
def column_path(y, tables, column):
    """Integrals of dr and r x dr along the flow path of a rigid column, in axes of its body.

    The paths in tanks at the ends of the column are included.
    """
    segments = tables.moving_segments
    first = column["forcing"]
    count = column["forcings"]
    span = minus(vector(segments[first + count - 1]["end"], 0), vector(segments[first]["start"], 0))
    swept = ZERO_VECTOR
    for k in range(count):
        swept = plus(swept, vector(segments[first + k]["swept"], 0))
    i, j = column["from_node"], column["to_node"]
    return add_six(
        span + swept, tank_paths(tables, i, j, level_at(y, tables, i), level_at(y, tables, j))
    )


@njit
def column_segment(tables, column, k):
    """Segment number k of a rigid column: (start r, unit vector t, mass moments m).

    The mass of the column is distributed by length.
    """
    total = 0.0
    for m in range(column["forcings"]):
        total += segment_length(tables.moving_segments[column["forcing"] + m])
    segment = tables.moving_segments[column["forcing"] + k]
    long = segment_length(segment)
    mass = tables.settings[0]["rho"] * column["area"] * column["length"]
    r = vector(segment["start"], 0)
    # A column whose segments all have length zero has its mass at a point.
    if not long > 0.0:
        return r, ZERO_VECTOR, (mass if total == 0.0 else 0.0, 0.0, 0.0)
    span = minus(vector(segment["end"], 0), r)
    return (
        r,
        (span[0] / long, span[1] / long, span[2] / long),
        vertical_moments(mass * long / total, long),
    )


@njit(forceinline=True)
def segment_length(segment):
    """Length of a segment [m]."""
    span = minus(vector(segment["end"], 0), vector(segment["start"], 0))
    return scalar_product(span, span) ** 0.5


@njit
def column_load(y, dydt, tables, k):
    """Force and torque of the fluid in rigid column k, and of the flow between its ends and surfaces of tanks."""
    column, motion = tables.columns[k], tables.scratch
    i, j = column["from_node"], column["to_node"]
    faster = tank_paths(tables, i, j, level_rate(dydt, tables, i), level_rate(dydt, tables, j))
    flow, rate = column["flow"] + y[column["y"]], dydt[column["y"]]
    load = flow_load(motion, column_path(y, tables, column), faster, flow, rate)
    # Segments of a column are always full: their moments have no rates.
    for m in range(column["forcings"]):
        r, t, mass = column_segment(tables, column, m)
        load = add_six(load, segment_load(motion, r, t, mass, ZERO_VECTOR))
    return load


# bodies ----------


@njit(forceinline=True)
def is_fluid_node(kind):
    """True if nodes of a kind contain fluid or let it leave the network."""
    return kind == TANK or kind == CHAMBER or kind == FIXED or kind == JUNCTION


@njit(forceinline=True)
def free_carrier(tables, row):
    """Body that carries the fluid with a row of `moving_segments`, if forces can move it; else, or for row < 0, -1."""
    i = tables.moving_segments[row]["body"] if row >= 0 else -1
    return i if nearest_free_body(tables, i) >= 0 else -1


@njit
def set_carrier_motion(tables, out, row, least, wide, spin):
    """Write the motion of the body that carries the fluid with a row of `moving_segments` to `scratch`.

    Returns the offset of the body in `out`. It is -1, and nothing is written, for row < 0 and for a code `loads_body`
    below `least`: 1 : forces move the body, 2 : a joint load is an output.
    """
    if row < 0 or tables.moving_segments[row]["loads_body"] < least:
        return -1
    body = tables.moving_segments[row]["body"]
    set_body_motion(tables, out, body, wide, spin)
    return body_row(tables, body)


@njit
def add_load(out, here, load, sign):
    """Add a load in axes of a body to its sums FORCE and TORQUE (sign +1), or subtract it (sign -1)."""
    add_force(out, here, 0.0, 0.0, 0.0, *rotate(out, here + layout.ATTITUDE, scaled(sign, load), 0))
    add_torque(out, here, *rotate(out, here + layout.ATTITUDE, scaled(sign, load[3:]), 0))


@njit
def add_all_fluid_loads(y, dydt, out, tables, least, sign, wide, spin):
    """Add (sign +1) or subtract (sign -1) the loads of the fluid in nodes, pipes and rigid columns on their bodies.

    least : least code `loads_body` that is included, see `set_carrier_motion`
    """
    nodes = tables.nodes
    pipes = tables.pipes
    columns = tables.columns
    for i in range(nodes.size):
        row = nodes[i]["forcing"] if is_fluid_node(nodes[i]["kind"]) else -1
        here = set_carrier_motion(tables, out, row, least, wide, spin)
        if here >= 0:
            r, t, m = node_segment(y, tables, i)
            load = segment_load(
                tables.scratch, r, t, m, node_segment_rates(y, dydt, out, tables, i)
            )
            add_load(out, here, load, sign)
    for k in range(pipes.size):
        here = set_carrier_motion(tables, out, pipes[k]["forcing"], least, wide, spin)
        if here >= 0:
            add_load(out, here, pipe_load(y, dydt, tables, k), sign)
    for k in range(columns.size):
        here = set_carrier_motion(tables, out, columns[k]["forcing"], least, wide, spin)
        if here >= 0:
            add_load(out, here, column_load(y, dydt, tables, k), sign)


@njit
def add_fluid_loads(t, y, dydt, out, handle):
    """Add the fluid loads for q'' = 0 (zero joint accelerations) to the bodies, unless `dydt` is empty.

    The loads of moving segments with `loads_body` 0 are left out.
    """
    if dydt.size > 0:
        add_all_fluid_loads(
            y, dydt, out, open_motion(handle), MOVED_BY_FORCES, 1.0, layout.BIAS, layout.SPIN_BIAS
        )


@njit(forceinline=True)
def freedom_velocity(work, s, r):
    """Velocity of a point of a body per unit rate of one degree of freedom; r : position of the point from o."""
    return plus(vector(work, s + 3), cross(work, s, *r))


@njit
def add_segment_inertia(out, tables, i, segment):
    """Add the inertia of a straight segment of fluid on body i to the mass matrix M in `scratch`.

    Velocities are linear along the segment. segment : (start r, direction t, mass moments m), see `fluid_loads`
    """
    (r, t, m), work, here = segment, tables.scratch, body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    # Velocity per unit rate is v at the start of the segment, plus a s along it.
    start = plus(rotate(out, here + layout.ATTITUDE, r, 0), vector(out, here + layout.ARM))
    along = rotate(out, here + layout.ATTITUDE, t, 0)
    for p in range(count):
        j = tables.integers[path + p]
        v, a = freedom_velocity(work, 6 * j, start), cross(work, 6 * j, *along)
        first = plus(scaled(m[0], v), scaled(m[1], a))
        second = plus(scaled(m[1], v), scaled(m[2], a))
        row = 8 * tables.freedoms.size + tables.freedoms[j]["row"]
        # M is symmetric: row j has only the degrees of freedom from the root to j.
        for q in range(p + 1):
            s = 6 * tables.integers[path + q]
            v, a = freedom_velocity(work, s, start), cross(work, s, *along)
            work[row + q] += scalar_product(v, first) + scalar_product(a, second)


@njit(forceinline=True)
def path_component(out, work, here, s, flow_path):
    """Velocity of a body integrated along a flow path (C, Z), C . v + Z . w, per unit rate of one degree of freedom.

    v, w : velocity of the origin of the body, and angular velocity
    """
    v = freedom_velocity(work, s, vector(out, here + layout.ARM))
    straight = scalar_product(rotate(out, here + layout.ATTITUDE, flow_path, 0), v)
    return straight + dot(work, s, *rotate(out, here + layout.ATTITUDE, flow_path, 3))


@njit
def subtract_sliding_inertia(out, tables, i, flow_path, slides):
    """Subtract the inertia of fluid that slides along a flow path on body i from the mass matrix M in `scratch`.

    flow_path : integrals of dr and r x dr along the path
    slides : mass of the fluid over the square of its length [kg/m2]; if the path has unit length, this value times the
        square of the distance between the ends of the fluid [kg]
    """
    work = tables.scratch
    n = tables.freedoms.size
    here = body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    for p in range(count):
        j = tables.integers[path + p]
        row = 8 * n + tables.freedoms[j]["row"]
        first = path_component(out, work, here, 6 * j, flow_path)
        for q in range(p + 1):
            second = path_component(out, work, here, 6 * tables.integers[path + q], flow_path)
            work[row + q] -= slides * first * second


@njit
def add_pipe_inertia(y, out, tables, k):
    """Add the fluid of pipe k to the mass matrix M: it moves with its body, but slides along the axis of the pipe.

    Under the linear density law, the mass that pressure waves add does not slide.
    """
    pipe, (r, t, span) = tables.pipes[k], pipe_segment(tables, k)
    i, m = tables.moving_segments[pipe["forcing"]]["body"], pipe_moments(tables, y, k, span, 1.0)[0]
    # First as if fixed to the body, then without what slides along the axis.
    add_segment_inertia(out, tables, i, (r, t, m))
    length, slides = pipe["cells"] * pipe["dx"], m[0]
    if tables.settings[0]["law"] == LAW_LINEAR:
        slides = tables.settings[0]["rho"] * pipe["area"] * length
    subtract_sliding_inertia(out, tables, i, straight_path(r, t), slides * (span / length) ** 2)


@njit
def add_fluid_inertia(y, out, tables):
    """Add the fluid of nodes, pipes and rigid columns to the mass matrix M of bodies that forces can move."""
    nodes = tables.nodes
    pipes = tables.pipes
    columns = tables.columns
    if tables.moving_segments.size == 0:
        return
    for i in range(nodes.size):
        kind, body = nodes[i]["kind"], free_carrier(tables, nodes[i]["forcing"])
        if body >= 0 and (kind == TANK or kind == CHAMBER):
            add_segment_inertia(out, tables, body, node_segment(y, tables, i))
    for k in range(pipes.size):
        if free_carrier(tables, pipes[k]["forcing"]) >= 0:
            add_pipe_inertia(y, out, tables, k)
    for k in range(columns.size):
        column, body = columns[k], free_carrier(tables, columns[k]["forcing"])
        if body >= 0:
            for m in range(column["forcings"]):
                add_segment_inertia(out, tables, body, column_segment(tables, column, m))
            slides = tables.settings[0]["rho"] * column["area"] / column["length"]
            subtract_sliding_inertia(out, tables, body, column_path(y, tables, column), slides)


# basins ----------


@njit
def add_basin_inertia(out, tables):
    """Add the inertia of the water in all basins on bodies, J' N J for each basin, to the mass matrix in `scratch`.

    Basins on bodies that no degree of freedom moves are left out.
    J : coefficients of 1, x, y in the normal acceleration of the bed, a column for each degree of freedom
    N : matrix of the moments of mass of 1, x, y
    """
    work = tables.scratch
    freedoms = tables.freedoms
    paths = tables.integers
    n = tables.freedoms.size
    for b in range(tables.tanks.size):
        i = nearest_free_body(tables, tables.tanks[b]["body"])
        tank = tables.layout[0]["tank"] + TANK_OUT * b
        if i < 0:
            continue
        path, count = freedom_path(tables, i)
        for p in range(count):
            j = paths[path + p]
            row, (a, c, d) = (
                8 * n + freedoms[j]["row"],
                normal_accelerations(out, work, tank, 6 * j),
            )
            # N times the column of J for j; its products with the other columns are entries of M.
            m = tank + layout.MOMENTS
            e = out[m] * a + out[m + 1] * c + out[m + 2] * d
            f = out[m + 1] * a + out[m + 3] * c + out[m + 4] * d
            g = out[m + 2] * a + out[m + 4] * c + out[m + 5] * d
            for q in range(p + 1):
                x, y, z = normal_accelerations(out, work, tank, 6 * paths[path + q])
                work[row + q] += e * x + f * y + g * z


@njit(forceinline=True)
def normal_accelerations(out, work, tank, s):
    """Normal velocity of the bed of a basin per unit rate of one degree of freedom, as coefficients of 1, x and y.

    They are also those of the normal acceleration per unit acceleration of that degree of freedom.
    tank : offset of the numbers of the basin in `out`
    """
    v, w = freedom_velocity(work, s, vector(out, tank + layout.BASIN_ARM)), vector(work, s)
    return (
        dot(out, tank + layout.NORMAL, *v),
        -dot(out, tank + layout.NORTH, *w),
        dot(out, tank + layout.EAST, *w),
    )
