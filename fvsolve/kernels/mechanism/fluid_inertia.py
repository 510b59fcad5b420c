"""Contribution of the fluid of networks to the mass matrix M of bodies that forces can move.

First all fluid counts as fixed to its body. Then the inertia of its sliding along the flow path (C, Z) is subtracted; C
and Z are the integrals of dr and r x dr along the path. For a rigid column of density rho, area A and length L this
inertia is rho (A / L) c c' with c = (C, Z), taken from surface to surface. For each cell of a pipe, the mass of the
cell over the square of its length replaces rho A / L. M contains the products over degrees of freedom, see
`mass_matrix`.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CHAMBER, LAW_LINEAR, TANK
from fvsolve.kernels.mechanism.body_layout import (
    ARM,
    body_row,
    cross,
    freedom_path,
    freedom_velocity,
    nearest_free_body,
)
from fvsolve.kernels.mechanism.fluid_loads import (
    column_path,
    column_segment,
    node_segment,
    pipe_moments,
    pipe_segment,
    straight_path,
    to_world,
)


@njit
def add_segment_inertia(out, tables, i, segment):
    """Add the inertia of a straight segment of fluid on body i to the mass matrix M in `scratch`.

    Velocities are linear along the segment. segment : (start r, direction t, mass moments m), see `fluid_loads`
    """
    r, t, m = segment
    work, n, here = tables.scratch, tables.freedoms.size, body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    x, y, z = to_world(out, here, r[0], r[1], r[2])
    x, y, z = x + out[here + ARM], y + out[here + ARM + 1], z + out[here + ARM + 2]
    tx, ty, tz = to_world(out, here, t[0], t[1], t[2])
    for p in range(count):
        j = tables.integers[path + p]
        u, v, w = freedom_velocity(work, 6 * j, x, y, z)
        a, b, c = cross(work, 6 * j, tx, ty, tz)
        ux, uy, uz = m[0] * u + m[1] * a, m[0] * v + m[1] * b, m[0] * w + m[1] * c
        ax, ay, az = m[1] * u + m[2] * a, m[1] * v + m[2] * b, m[1] * w + m[2] * c
        row = 8 * n + tables.freedoms[j]["row"]
        for q in range(p + 1):
            s = 6 * tables.integers[path + q]
            u, v, w = freedom_velocity(work, s, x, y, z)
            a, b, c = cross(work, s, tx, ty, tz)
            work[row + q] += u * ux + v * uy + w * uz + (a * ax + b * ay + c * az)


@njit(forceinline=True)
def path_component(out, work, here, s, flow_path):
    """Velocity of a body integrated along a flow path (C, Z), C . v + Z . w, per unit rate of one degree of freedom.

    C, Z : integrals of dr and r x dr along the path; v, w : velocity of the origin of the body, and angular velocity
    s : offset in `work` of the angular velocity and the velocity at o per unit rate; here : offset of the body in `out`
    """
    u, v, w = freedom_velocity(work, s, out[here + ARM], out[here + ARM + 1], out[here + ARM + 2])
    cx, cy, cz = to_world(out, here, flow_path[0], flow_path[1], flow_path[2])
    zx, zy, zz = to_world(out, here, flow_path[3], flow_path[4], flow_path[5])
    straight = cx * u + cy * v + cz * w
    return straight + (zx * work[s] + zy * work[s + 1] + zz * work[s + 2])


@njit
def subtract_sliding_inertia(out, tables, i, flow_path, slides):
    """Subtract the inertia of fluid that slides along a flow path on body i from the mass matrix M in `scratch`.

    flow_path : integrals of dr and r x dr along the path
    slides : mass of the fluid over the square of its length [kg/m2]; if the path has unit length, this value times the
        square of the distance between the ends of the fluid [kg]
    """
    work, n, here = tables.scratch, tables.freedoms.size, body_row(tables, i)
    path, count = freedom_path(tables, nearest_free_body(tables, i))
    for p in range(count):
        j = tables.integers[path + p]
        row, first = 8 * n + tables.freedoms[j]["row"], path_component(out, work, here, 6 * j, flow_path)
        for q in range(p + 1):
            second = path_component(out, work, here, 6 * tables.integers[path + q], flow_path)
            work[row + q] -= slides * first * second


@njit
def add_pipe_inertia(y, out, tables, k):
    """Add the fluid of pipe k to the mass matrix M: it moves with its body, but slides along the axis of the pipe.

    Under the linear density law, the mass that pressure waves add does not slide.
    """
    pipe, (r, t, span) = tables.pipes[k], pipe_segment(tables, k)
    i, m = tables.moving_segments[pipe["moving_segment"]]["body"], pipe_moments(tables, y, k, span, 1.0)[0]
    add_segment_inertia(out, tables, i, (r, t, m))
    length, slides = pipe["cells"] * pipe["dx"], m[0]
    if tables.settings[0]["law"] == LAW_LINEAR:
        slides = tables.settings[0]["rho"] * pipe["area"] * length
    subtract_sliding_inertia(out, tables, i, straight_path(r, t), slides * (span / length) ** 2)


@njit
def add_fluid_inertia(y, out, tables):
    """Add the fluid of nodes, pipes and rigid columns to the mass matrix M of bodies that forces can move."""
    nodes, segments, pipes, columns = tables.nodes, tables.moving_segments, tables.pipes, tables.columns
    if segments.size == 0:
        return
    for i in range(nodes.size):
        kind, at = nodes[i]["kind"], nodes[i]["moving_segment"]
        if at >= 0 and (kind == TANK or kind == CHAMBER) and nearest_free_body(tables, segments[at]["body"]) >= 0:
            add_segment_inertia(out, tables, segments[at]["body"], node_segment(y, tables, i))
    for k in range(pipes.size):
        if (
            pipes[k]["moving_segment"] >= 0
            and nearest_free_body(tables, segments[pipes[k]["moving_segment"]]["body"]) >= 0
        ):
            add_pipe_inertia(y, out, tables, k)
    for k in range(columns.size):
        column = columns[k]
        if column["moving_segment"] >= 0 and nearest_free_body(tables, segments[column["moving_segment"]]["body"]) >= 0:
            i = segments[column["moving_segment"]]["body"]
            for m in range(column["moving_segments"]):
                add_segment_inertia(out, tables, i, column_segment(tables, column, m))
            slides = tables.settings[0]["rho"] * column["area"] / column["length"]
            subtract_sliding_inertia(out, tables, i, column_path(y, tables, column), slides)
