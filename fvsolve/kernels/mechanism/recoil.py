"""Fluid in columns and tanks that moves its body: weight, apparent forces, recoil. Knows columns; solves no body.

With P = m v + M C and H = S x v + J W + M Z of each column, in axes of the body and about its origin, S' = M C as what
flows is taken from one surface and put upon the other: the body feels what frozen fluid does, and besides

    -2 W x M C - (M C)',   -J' W - (M Z)' - W x M Z

Joints held, first; once accelerations are solved, with what slides off the mass matrix (`laden`), flow feels them.
"""

from fvsolve.jit import njit
from fvsolve.kernels.columns import column_rate
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.laden import carrier, level_at, segment_mass, to_world, way_of
from fvsolve.kernels.mechanism.room import (
    ACCELERATION,
    ATTITUDE,
    BIAS,
    SPIN,
    SPIN_BIAS,
    TURNING,
    add_force,
    add_torque,
    back,
    cross,
    row_of,
)
from fvsolve.kernels.records import TANK
from fvsolve.kernels.rigid import body_drive


@njit
def weigh_mass(out, tables, i, mass, x, y, z):
    """Weight of a mass at a place in axes of body i, and what it resists with joints held."""
    here = row_of(tables, i)
    x, y, z = to_world(out, here, x, y, z)
    ex, ey, ez = cross(out, here + SPIN_BIAS, x, y, z)
    vx, vy, vz = cross(out, here + SPIN, x, y, z)
    cx, cy, cz = cross(out, here + SPIN, vx, vy, vz)
    b, g = here + BIAS, tables.settings[0]["gravity"]
    add_force(out, here, x, y, z, -mass * (out[b] + ex + cx), -mass * (out[b + 1] + ey + cy),
              -mass * (g + out[b + 2] + ez + cz))  # fmt: skip


@njit
def weigh_line(out, tables, i, mass, x, y, z, u, v, w):
    """The same of a line of even mass."""
    weigh_mass(out, tables, i, mass / 6.0, x, y, z)
    weigh_mass(out, tables, i, mass / 1.5, 0.5 * (x + u), 0.5 * (y + v), 0.5 * (z + w))
    weigh_mass(out, tables, i, mass / 6.0, u, v, w)


@njit
def level_rate(y, tables, i):
    """How fast the level of the tank at node i rises [m/s]."""
    columns, total = tables.columns, 0.0
    for k in range(columns.size):
        flow = columns[k]["flow"] + y[columns[k]["y"]]
        if columns[k]["to_node"] == i:
            total += flow
        if columns[k]["from_node"] == i:
            total -= flow
    return total / (tables.settings[0]["rho"] * tables.nodes[i]["area"])


@njit
def carried(wx, wy, wz, x, y, z):
    """r x (W x r)."""
    square, along = x * x + y * y + z * z, x * wx + y * wy + z * wz
    return square * wx - along * x, square * wy - along * y, square * wz - along * z


@njit
def recoil(t, y, out, tables, k):
    """Force and torque of what flows in column k on its body, joints held."""
    column, p = tables.columns[k], tables.layout[0]["pressure"]
    here = row_of(tables, tables.rides[column["ride"]]["body"])
    change = out[p + column["from_node"]] - out[p + column["to_node"]]
    change += tables.settings[0]["rho"] * body_drive(tables, out, column)
    flow, rate = column["flow"] + y[column["y"]], column_rate(t, y, tables, out, k, change)
    cx, cy, cz, zx, zy, zz = way_of(y, tables, column)
    a, b = level_at(y, tables, column["from_node"]), level_at(y, tables, column["to_node"])
    da, db = level_rate(y, tables, column["from_node"]), level_rate(y, tables, column["to_node"])
    r, s = tables.rides[column["ride"]]["start"], tables.rides[column["ride"] + column["rides"] - 1]["end"]
    w = here + SPIN
    wx, wy, wz = back(out, here + ATTITUDE, out[w], out[w + 1], out[w + 2])
    fx, fy, fz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
    gx, gy, gz = wy * zz - wz * zy, wz * zx - wx * zz, wx * zy - wy * zx
    hx, hy, hz = carried(wx, wy, wz, s[0], s[1], s[2] + b)
    jx, jy, jz = carried(wx, wy, wz, r[0], r[1], r[2] + a)
    fx, fy, fz = -2.0 * flow * fx - rate * cx, -2.0 * flow * fy - rate * cy, -2.0 * flow * fz - rate * cz
    tx = -flow * (hx - jx + gx + (s[1] * db - r[1] * da)) - rate * zx
    ty = -flow * (hy - jy + gy - (s[0] * db - r[0] * da)) - rate * zy
    tz = -flow * (hz - jz + gz) - rate * zz
    fx, fy, fz = to_world(out, here, fx, fy, fz - flow * (db - da))
    add_force(out, here, 0.0, 0.0, 0.0, fx, fy, fz)
    tx, ty, tz = to_world(out, here, tx, ty, tz)
    add_torque(out, here, tx, ty, tz)


@njit
def load_networks(t, y, dydt, out, handle):
    """What the fluid in columns and tanks does to bodies that move freely, joints held."""
    tables = open_tables(handle)
    nodes, rides, columns = tables.nodes, tables.rides, tables.columns
    for i in range(nodes.size):
        if nodes[i]["kind"] == TANK and nodes[i]["ride"] >= 0 and carrier(tables, rides[nodes[i]["ride"]]["body"]) >= 0:
            ride, level = rides[nodes[i]["ride"]], level_at(y, tables, i)
            r, mass = ride["start"], nodes[i]["mass"] + y[nodes[i]["y"]]
            weigh_line(out, tables, ride["body"], mass, r[0], r[1], r[2], r[0], r[1], r[2] + level)
    for k in range(columns.size):
        if columns[k]["ride"] >= 0 and carrier(tables, rides[columns[k]["ride"]]["body"]) >= 0:
            for m in range(columns[k]["rides"]):
                ride = rides[columns[k]["ride"] + m]
                r, s = ride["start"], ride["end"]
                weigh_line(out, tables, ride["body"], segment_mass(tables, columns[k], m), r[0], r[1], r[2],
                           s[0], s[1], s[2])  # fmt: skip
            recoil(t, y, out, tables, k)


@njit
def follow_networks(t, y, dydt, out, handle):
    """Let columns feel what the accelerations of their bodies are beyond those with joints held."""
    tables = open_tables(handle)
    columns = tables.columns
    for k in range(columns.size if dydt.size > 0 else 0):
        column = columns[k]
        if column["ride"] < 0 or carrier(tables, tables.rides[column["ride"]]["body"]) < 0:
            continue
        here = row_of(tables, tables.rides[column["ride"]]["body"])
        a, e = here + ACCELERATION, here + TURNING
        b, c = here + BIAS, here + SPIN_BIAS
        ax, ay, az = back(out, here + ATTITUDE, out[a] - out[b], out[a + 1] - out[b + 1], out[a + 2] - out[b + 2])
        ex, ey, ez = back(out, here + ATTITUDE, out[e] - out[c], out[e + 1] - out[c + 1], out[e + 2] - out[c + 2])
        cx, cy, cz, zx, zy, zz = way_of(y, tables, column)
        felt = cx * ax + cy * ay + cz * az + (zx * ex + zy * ey + zz * ez)
        dydt[column["y"]] -= tables.settings[0]["rho"] * column["area"] / column["length"] * felt
