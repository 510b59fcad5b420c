"""Contribution of contained fluid to the mass matrix of bodies that forces can move.

The fluid counts as frozen, minus the inertia of its sliding along the flow path (C, Z), the integrals of dr and r x dr.
For a column this is rho (A / L) c c', c = (C, Z) from surface to surface. For each cell of a pipe the factor is its
mass over its length squared.
"""

from fvsolve.jit import njit
from fvsolve.kernels.mechanism.freight import (
    pipe_line,
    pipe_moments,
    place_line,
    segment_line,
    to_world,
    turned_way,
    way_of,
)
from fvsolve.kernels.mechanism.room import ARM, carrier, cross, given, path_of, row_of
from fvsolve.kernels.records import CHAMBER, LAW_LINEAR, TANK


@njit
def add_line(out, tables, i, segment):
    """Add a segment of fluid (r, t, m) on body i to M; velocities are linear along it."""
    r, t, m = segment
    work, n, here = tables.scratch, tables.freedoms.size, row_of(tables, i)
    path, count = path_of(tables, carrier(tables, i))
    x, y, z = to_world(out, here, r[0], r[1], r[2])
    x, y, z = x + out[here + ARM], y + out[here + ARM + 1], z + out[here + ARM + 2]
    tx, ty, tz = to_world(out, here, t[0], t[1], t[2])
    for p in range(count):
        j = tables.integers[path + p]
        u, v, w = given(work, 6 * j, x, y, z)
        a, b, c = cross(work, 6 * j, tx, ty, tz)
        ux, uy, uz = m[0] * u + m[1] * a, m[0] * v + m[1] * b, m[0] * w + m[1] * c
        ax, ay, az = m[1] * u + m[2] * a, m[1] * v + m[2] * b, m[1] * w + m[2] * c
        row = 8 * n + tables.freedoms[j]["row"]
        for q in range(p + 1):
            s = 6 * tables.integers[path + q]
            u, v, w = given(work, s, x, y, z)
            a, b, c = cross(work, s, tx, ty, tz)
            work[row + q] += u * ux + v * uy + w * uz + (a * ax + b * ay + c * az)


@njit(forceinline=True)
def along_way(out, work, here, s, flow_path):
    """Velocity of a freedom integrated along a flow path (C, Z): C . v + Z . w."""
    u, v, w = given(work, s, out[here + ARM], out[here + ARM + 1], out[here + ARM + 2])
    cx, cy, cz = to_world(out, here, flow_path[0], flow_path[1], flow_path[2])
    zx, zy, zz = to_world(out, here, flow_path[3], flow_path[4], flow_path[5])
    straight = cx * u + cy * v + cz * w
    return straight + (zx * work[s] + zy * work[s + 1] + zz * work[s + 2])


@njit
def let_slide(out, tables, i, flow_path, slides):
    """Subtract from M the inertia of sliding along a flow path on body i; slides : mass over length squared [kg/m2]."""
    work, n, here = tables.scratch, tables.freedoms.size, row_of(tables, i)
    path, count = path_of(tables, carrier(tables, i))
    for p in range(count):
        j = tables.integers[path + p]
        row, first = 8 * n + tables.freedoms[j]["row"], along_way(out, work, here, 6 * j, flow_path)
        for q in range(p + 1):
            second = along_way(out, work, here, 6 * tables.integers[path + q], flow_path)
            work[row + q] -= slides * first * second


@njit
def add_pipe(y, out, tables, k):
    """Add a pipe to M: its fluid is fixed across the axis and free along it, except the mass added by waves."""
    pipe, (r, t, span) = tables.pipes[k], pipe_line(tables, k)
    i, m = tables.rides[pipe["ride"]]["body"], pipe_moments(tables, y, k, span, 1.0)[0]
    add_line(out, tables, i, (r, t, m))
    length, slides = pipe["cells"] * pipe["dx"], m[0]
    if tables.settings[0]["law"] == LAW_LINEAR:
        slides = tables.settings[0]["rho"] * pipe["area"] * length
    let_slide(out, tables, i, turned_way(r, t), slides * (span / length) ** 2)


@njit
def add_networks(y, out, tables):
    """Add the fluid on bodies that forces can move to M in `scratch`."""
    nodes, segments, pipes, columns = tables.nodes, tables.rides, tables.pipes, tables.columns
    if segments.size == 0:
        return
    for i in range(nodes.size):
        kind, at = nodes[i]["kind"], nodes[i]["ride"]
        if at >= 0 and (kind == TANK or kind == CHAMBER) and carrier(tables, segments[at]["body"]) >= 0:
            add_line(out, tables, segments[at]["body"], place_line(y, tables, i))
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0 and carrier(tables, segments[pipes[k]["ride"]]["body"]) >= 0:
            add_pipe(y, out, tables, k)
    for k in range(columns.size):
        column = columns[k]
        if column["ride"] >= 0 and carrier(tables, segments[column["ride"]]["body"]) >= 0:
            i = segments[column["ride"]]["body"]
            for m in range(column["rides"]):
                add_line(out, tables, i, segment_line(tables, column, m))
            slides = tables.settings[0]["rho"] * column["area"] / column["length"]
            let_slide(out, tables, i, way_of(y, tables, column), slides)
