"""Force elements between points of bodies: directions, changes of length and their rates, application of forces."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import ABOUT, ALONG
from fvsolve.kernels.mechanism.body_layout import (
    ARM,
    ATTITUDE,
    POSITION,
    SPIN,
    VELOCITY,
    add_force,
    add_torque,
    body_row,
    cross,
    rotate,
    write_vector,
)
from fvsolve.kernels.table_handle import open_tables


@njit
def point_at(out, tables, k, base):
    """Position [m] and velocity [m/s] of point k, six numbers in axes of the world; (59) and (67) of docs/course.md.

    base : POSITION for the position from the origin of the world, or ARM for that from o (`body_layout`)
    Points of the world have no velocity. All numbers are 0 for k < 0.
    """
    if k < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    point = tables.points[k]
    if point["body"] < 0:
        return point["place"][0], point["place"][1], point["place"][2], 0.0, 0.0, 0.0
    here = body_row(tables, point["body"])
    x, y, z = rotate(out, here + ATTITUDE, point["place"], 0)
    u, v, w = cross(out, here + SPIN, x, y, z)
    p, s = here + base, here + VELOCITY
    return out[p] + x, out[p + 1] + y, out[p + 2] + z, out[s] + u, out[s + 1] + v, out[s + 2] + w


@njit
def spin_of(out, tables, k):
    """Angular velocity of the body of point k [rad/s], in axes of the world; 0 for the world or k < 0."""
    if k < 0 or tables.points[k]["body"] < 0:
        return 0.0, 0.0, 0.0
    here = body_row(tables, tables.points[k]["body"]) + SPIN
    return out[here], out[here + 1], out[here + 2]


@njit(forceinline=True)
def root_of(tables, k):
    """Body that is the root of the tree to which point k belongs; -1 for the world or k < 0."""
    if k < 0 or tables.points[k]["body"] < 0:
        return -1
    return tables.bodies[tables.points[k]["body"]]["root"]


@njit
def update_elements(out, tables):
    """Write unit direction, change of length since the start [m] and its rate [m/s] of all force elements to `out`.

    The direction is from point `from` to point `to`, the length their distance. For elements that act TOWARD a fixed
    direction or ABOUT an axis, the change of length is 0. The rate is then the velocity of `to` relative to `from` in
    that direction, or the relative angular velocity about the axis [rad/s].
    """
    layout, lines = tables.layout[0], tables.lines
    for k in range(lines.size):
        line, at, to = lines[k], layout["along"] + 3 * k, layout["travel"] + 2 * lines[k]["push"]
        i, j = line["from_point"], line["to_point"]
        if line["acts"] == ABOUT:
            a, b, c = spin_of(out, tables, i)
            u, v, w = spin_of(out, tables, j)
            r = body_row(tables, tables.points[j]["body"]) + ATTITUDE
            write_vector(out, at, *rotate(out, r, line["direction"], 0))
            out[to], out[to + 1] = 0.0, out[at] * (u - a) + out[at + 1] * (v - b) + out[at + 2] * (w - c)
            continue
        root = root_of(tables, i)
        base = ARM if root >= 0 and root == root_of(tables, j) else POSITION
        x, y, z, a, b, c = point_at(out, tables, i, base)
        p, q, r, u, v, w = point_at(out, tables, j, base)
        x, y, z, length = p - x, q - y, r - z, 0.0
        if line["acts"] == ALONG:
            length = sqrt(x * x + y * y + z * z)
            write_vector(out, at, x / length, y / length, z / length)
        else:
            write_vector(out, at, line["direction"][0], line["direction"][1], line["direction"][2])
        out[to] = length - line["length"]
        out[to + 1] = out[at] * (u - a) + out[at + 1] * (v - b) + out[at + 2] * (w - c)


@njit(forceinline=True)
def add_element_end_force(out, tables, k, acts, x, y, z):
    """Add a force (x, y, z) [N], or for `acts` ABOUT a torque [N m], at point k to FORCE and TORQUE of its body."""
    if k >= 0 and tables.points[k]["body"] >= 0:
        here = body_row(tables, tables.points[k]["body"])
        if acts == ABOUT:
            add_torque(out, here, x, y, z)
        else:
            add_force(out, here, *rotate(out, here + ATTITUDE, tables.points[k]["place"], 0), x, y, z)


@njit
def add_element_forces(t, y, dydt, out, handle):
    """Add the forces of all elements to their bodies: along their direction at `to`, opposite to it at `from`."""
    tables = open_tables(handle)
    layout, lines = tables.layout[0], tables.lines
    for k in range(lines.size):
        line, at = lines[k], layout["along"] + 3 * k
        size = out[layout["push"] + line["push"]]
        x, y0, z = size * out[at], size * out[at + 1], size * out[at + 2]
        add_element_end_force(out, tables, line["to_point"], line["acts"], x, y0, z)
        add_element_end_force(out, tables, line["from_point"], line["acts"], -x, -y0, -z)
