"""What fluid in columns and tanks adds to the mass matrix of bodies that move freely. Knows places; knows no flow.

Fluid counts as frozen, less what a column lets slide: rho (A / L) c c', c the pair (C, Z) with C from the surface at
its `from` end to that at its `to` end and Z the integral of r x dr along all of this way. A line of even mass is a
sixth of it at each end and the rest in its middle, to the second moment.
"""

from fvsolve.jit import njit
from fvsolve.kernels.mechanism.room import ARM, ATTITUDE, cross, dot, row_of
from fvsolve.kernels.records import TANK
from fvsolve.kernels.tanks import tank_level


@njit
def carrier(tables, i):
    """The body nearest to body i on the way to its root that forces move; -1 for none."""
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    return i


@njit
def level_at(y, tables, i):
    """Level of the tank at node i [m]."""
    return tank_level(tables.nodes[i], tables.floats, tables.settings[0]["rho"], y[tables.nodes[i]["y"]])


@njit
def way_of(y, tables, column):
    """C and Z of a column, in axes of its body: six numbers."""
    a, b = level_at(y, tables, column["from_node"]), level_at(y, tables, column["to_node"])
    first, last = tables.rides[column["ride"]]["start"], tables.rides[column["ride"] + column["rides"] - 1]["end"]
    x, z, w = 0.0, 0.0, 0.0
    for k in range(column["rides"]):
        swept = tables.rides[column["ride"] + k]["swept"]
        x, z, w = x + swept[0], z + swept[1], w + swept[2]
    return (
        last[0] - first[0], last[1] - first[1], last[2] - first[2] + b - a,
        x + last[1] * b - first[1] * a, z - (last[0] * b - first[0] * a), w,
    )  # fmt: skip


@njit(forceinline=True)
def to_world(out, here, x, y, z):
    """A vector in axes of a body as the world sees it."""
    r = here + ATTITUDE
    return dot(out, r, x, y, z), dot(out, r + 3, x, y, z), dot(out, r + 6, x, y, z)


@njit(forceinline=True)
def given(work, s, x, y, z):
    """Velocity at (x, y, z) from o that a freedom gives, its S at scratch[s]."""
    u, v, w = cross(work, s, x, y, z)
    return work[s + 3] + u, work[s + 4] + v, work[s + 5] + w


@njit
def add_mass(out, tables, i, mass, x, y, z):
    """Add a mass at a place in axes of body i to M."""
    work, n, here, own = tables.scratch, tables.freedoms.size, row_of(tables, i), carrier(tables, i)
    x, y, z = to_world(out, here, x, y, z)
    x, y, z = x + out[here + ARM], y + out[here + ARM + 1], z + out[here + ARM + 2]
    last = tables.freedoms[tables.bodies[own]["freedom"] + tables.bodies[own]["freedoms"] - 1]
    for p in range(last["depth"] + 1):
        j = tables.integers[last["path"] + p]
        u, v, w = given(work, 6 * j, x, y, z)
        row = 8 * n + tables.freedoms[j]["row"]
        for q in range(p + 1):
            a, b, c = given(work, 6 * tables.integers[last["path"] + q], x, y, z)
            work[row + q] += mass * (u * a + v * b + w * c)


@njit
def add_line(out, tables, i, mass, x, y, z, u, v, w):
    """Add a line of even mass between two places in axes of body i to M."""
    add_mass(out, tables, i, mass / 6.0, x, y, z)
    add_mass(out, tables, i, mass / 1.5, 0.5 * (x + u), 0.5 * (y + v), 0.5 * (z + w))
    add_mass(out, tables, i, mass / 6.0, u, v, w)


@njit(forceinline=True)
def along_way(out, work, here, s, way):
    """What a freedom gives along a way (C, Z): C . v + Z . w."""
    u, v, w = given(work, s, out[here + ARM], out[here + ARM + 1], out[here + ARM + 2])
    cx, cy, cz = to_world(out, here, way[0], way[1], way[2])
    zx, zy, zz = to_world(out, here, way[3], way[4], way[5])
    straight = cx * u + cy * v + cz * w
    return straight + (zx * work[s] + zy * work[s + 1] + zz * work[s + 2])


@njit
def let_slide(y, out, tables, column):
    """Take off M what a column lets slide."""
    work, n, i = tables.scratch, tables.freedoms.size, tables.rides[column["ride"]]["body"]
    here, own, way = row_of(tables, i), carrier(tables, i), way_of(y, tables, column)
    slides = tables.settings[0]["rho"] * column["area"] / column["length"]
    last = tables.freedoms[tables.bodies[own]["freedom"] + tables.bodies[own]["freedoms"] - 1]
    for p in range(last["depth"] + 1):
        j = tables.integers[last["path"] + p]
        row, one = 8 * n + tables.freedoms[j]["row"], along_way(out, work, here, 6 * j, way)
        for q in range(p + 1):
            other = along_way(out, work, here, 6 * tables.integers[last["path"] + q], way)
            work[row + q] -= slides * one * other


@njit
def segment_mass(tables, column, k):
    """Mass of the fluid in stretch k of a column [kg]: shared by length."""
    whole, own = 0.0, 0.0
    for m in range(column["rides"]):
        ride = tables.rides[column["ride"] + m]
        x, y, z = (
            ride["end"][0] - ride["start"][0],
            ride["end"][1] - ride["start"][1],
            ride["end"][2] - ride["start"][2],
        )
        long = (x * x + y * y + z * z) ** 0.5
        whole += long
        if m == k:
            own = long
    return tables.settings[0]["rho"] * column["area"] * column["length"] * own / whole


@njit
def add_networks(y, out, tables):
    """Add the fluid of columns and tanks on bodies that move freely to M in `scratch`."""
    nodes, rides, columns = tables.nodes, tables.rides, tables.columns
    if rides.size == 0:
        return
    for i in range(nodes.size):
        if nodes[i]["kind"] == TANK and nodes[i]["ride"] >= 0 and carrier(tables, rides[nodes[i]["ride"]]["body"]) >= 0:
            ride, level = rides[nodes[i]["ride"]], level_at(y, tables, i)
            r, mass = ride["start"], nodes[i]["mass"] + y[nodes[i]["y"]]
            add_line(out, tables, ride["body"], mass, r[0], r[1], r[2], r[0], r[1], r[2] + level)
    for k in range(columns.size):
        if columns[k]["ride"] >= 0 and carrier(tables, rides[columns[k]["ride"]]["body"]) >= 0:
            for m in range(columns[k]["rides"]):
                ride = rides[columns[k]["ride"] + m]
                r, s = ride["start"], ride["end"]
                add_line(out, tables, ride["body"], segment_mass(tables, columns[k], m), r[0], r[1], r[2],
                         s[0], s[1], s[2])  # fmt: skip
            let_slide(y, out, tables, columns[k])
