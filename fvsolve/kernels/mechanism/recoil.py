"""Fluid on bodies that forces move: what it feels of their accelerations once they are solved. Solves no body.

Rates of flow are found first with joints held; bodies feel what they throw back (`freight`) and, in their mass matrix,
all that is carried less what slides (`laden`); then flow feels the accelerations. All by one Lagrangian (70).
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.freight import load_all, mass_per_length, pipe_line, to_world, turned_way, way_of
from fvsolve.kernels.mechanism.matrix import ease, lean_at
from fvsolve.kernels.mechanism.room import (
    ACCELERATION,
    ATTITUDE,
    BIAS,
    PLACE,
    SPIN_BIAS,
    TURNING,
    back,
    carrier,
    row_of,
)
from fvsolve.kernels.records import ASKED, LAW_LINEAR, RATE


@njit
def felt_along(out, tables, ride, way):
    """What the acceleration of a body, beyond that with joints held, is along a way on it: C . a + Z . e."""
    here = row_of(tables, tables.rides[ride]["body"])
    a, e, b, c = here + ACCELERATION, here + TURNING, here + BIAS, here + SPIN_BIAS
    ax, ay, az = back(out, here + ATTITUDE, out[a] - out[b], out[a + 1] - out[b + 1], out[a + 2] - out[b + 2])
    ex, ey, ez = back(out, here + ATTITUDE, out[e] - out[c], out[e + 1] - out[c + 1], out[e + 2] - out[c + 2])
    return way[0] * ax + way[1] * ay + way[2] * az + (way[3] * ex + way[4] * ey + way[5] * ez)


@njit
def follow_pipe(y, dydt, out, tables, k):
    """Push the cells of a pipe, each by its mass over its length."""
    pipe, (r, t, way) = tables.pipes[k], pipe_line(tables, k)
    n, o = pipe["cells"], pipe["y"]
    felt = 0.5 * way / n / pipe["dx"] * felt_along(out, tables, pipe["ride"], turned_way(r, t))
    linear = tables.settings[0]["law"] == LAW_LINEAR
    for i in range(n):
        m = mass_per_length(tables, pipe, i) + (0.0 if linear else (y[o + i] + y[o + n + i]) / pipe["speed"])
        dydt[o + i] -= m * felt
        dydt[o + n + i] += m * felt


@njit
def follow_networks(t, y, dydt, out, handle):
    """Let flow feel what the accelerations of bodies are beyond those with joints held."""
    tables = open_tables(handle)
    pipes, columns, rides = tables.pipes, tables.columns, tables.rides
    if dydt.size == 0 or tables.freedoms.size == 0:
        return
    load_all(y, dydt, out, tables, ASKED, -1.0, BIAS, SPIN_BIAS)
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0 and carrier(tables, rides[pipes[k]["ride"]]["body"]) >= 0:
            follow_pipe(y, dydt, out, tables, k)
    for k in range(columns.size):
        column = columns[k]
        if column["ride"] >= 0 and carrier(tables, rides[column["ride"]]["body"]) >= 0:
            felt = felt_along(out, tables, column["ride"], way_of(y, tables, column))
            dydt[column["y"]] -= tables.settings[0]["rho"] * column["area"] / column["length"] * felt
    load_all(y, dydt, out, tables, ASKED, 1.0, ACCELERATION, TURNING)


@njit
def quicken_by_pipes(t, y, dydt, out, handle):
    """Let steps see how quickly waves brake light bodies: rho A c at both ends of a pipe, along it."""
    tables = open_tables(handle)
    work, n, damping = tables.scratch, tables.freedoms.size, 0.0
    for k in range(tables.pipes.size):
        pipe = tables.pipes[k]
        i = tables.rides[pipe["ride"]]["body"] if pipe["ride"] >= 0 else -1
        if carrier(tables, i) < 0:
            continue
        r, way, _ = pipe_line(tables, k)
        here = row_of(tables, i)
        x, y0, z = to_world(out, here, r[0], r[1], r[2])
        a, b, c = to_world(out, here, way[0], way[1], way[2])
        for m in range(n):
            work[7 * n + m] = 0.0
        lean_at(out, tables, i, x + out[here + PLACE], y0 + out[here + PLACE + 1], z + out[here + PLACE + 2],
                a, b, c, 7 * n)  # fmt: skip
        damping += 2.0 * tables.settings[0]["rho"] * pipe["area"] * pipe["speed"] * ease(tables, 7 * n)
    out[RATE] = max(out[RATE], damping)
