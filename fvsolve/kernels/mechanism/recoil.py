"""Acceleration of contained fluid by its body, once the accelerations of bodies are solved.

The coupling follows from the Lagrangian (70) of fluid and bodies. First the rates of flow are computed for
q'' = 0, q'' being the accelerations of the freedoms of bodies. Then the bodies are solved with the fluid loads
(`fluid_loads`) and with the fluid in the mass matrix, minus its sliding (`fluid_inertia`). Last, the accelerations of
bodies act on the flow.
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
def felt_along(out, tables, segment, path):
    """Acceleration of a body, minus that for q'' = 0, integrated along a flow path on it: C . a + Z . e [m2/s2]."""
    here = row_of(tables, tables.rides[segment]["body"])
    a, e, b, c = here + ACCELERATION, here + TURNING, here + BIAS, here + SPIN_BIAS
    ax, ay, az = back(out, here + ATTITUDE, out[a] - out[b], out[a + 1] - out[b + 1], out[a + 2] - out[b + 2])
    ex, ey, ez = back(out, here + ATTITUDE, out[e] - out[c], out[e + 1] - out[c + 1], out[e + 2] - out[c + 2])
    return path[0] * ax + path[1] * ay + path[2] * az + (path[3] * ex + path[4] * ey + path[5] * ez)


@njit
def follow_pipe(y, dydt, out, tables, k):
    """Add the inertial force by the acceleration of its body to the waves of all cells of a pipe."""
    pipe, (r, t, length) = tables.pipes[k], pipe_line(tables, k)
    n, o = pipe["cells"], pipe["y"]
    push = 0.5 * length / n / pipe["dx"] * felt_along(out, tables, pipe["ride"], turned_way(r, t))
    linear = tables.settings[0]["law"] == LAW_LINEAR
    for i in range(n):
        m = mass_per_length(tables, pipe, i) + (0.0 if linear else (y[o + i] + y[o + n + i]) / pipe["speed"])
        dydt[o + i] -= m * push
        dydt[o + n + i] += m * push


@njit
def follow_networks(t, y, dydt, out, handle):
    """Add the inertial forces of the accelerations of bodies, minus those for q'' = 0, to the rates of flow.

    Where joint loads are requested (`loads_body` 2), the fluid loads are computed again with the new rates.
    """
    tables = open_tables(handle)
    pipes, columns, segments = tables.pipes, tables.columns, tables.rides
    if dydt.size == 0 or tables.freedoms.size == 0:
        return
    load_all(y, dydt, out, tables, ASKED, -1.0, BIAS, SPIN_BIAS)
    for k in range(pipes.size):
        if pipes[k]["ride"] >= 0 and carrier(tables, segments[pipes[k]["ride"]]["body"]) >= 0:
            follow_pipe(y, dydt, out, tables, k)
    for k in range(columns.size):
        column = columns[k]
        if column["ride"] >= 0 and carrier(tables, segments[column["ride"]]["body"]) >= 0:
            acceleration = felt_along(out, tables, column["ride"], way_of(y, tables, column))
            dydt[column["y"]] -= tables.settings[0]["rho"] * column["area"] / column["length"] * acceleration
    load_all(y, dydt, out, tables, ASKED, 1.0, ACCELERATION, TURNING)


@njit
def quicken_by_pipes(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], for bodies braked by waves: rho A c at both ends of a pipe."""
    tables = open_tables(handle)
    work, n, damping = tables.scratch, tables.freedoms.size, 0.0
    for k in range(tables.pipes.size):
        pipe = tables.pipes[k]
        i = tables.rides[pipe["ride"]]["body"] if pipe["ride"] >= 0 else -1
        if carrier(tables, i) < 0:
            continue
        r, direction, _ = pipe_line(tables, k)
        here = row_of(tables, i)
        x, y0, z = to_world(out, here, r[0], r[1], r[2])
        a, b, c = to_world(out, here, direction[0], direction[1], direction[2])
        for m in range(n):
            work[7 * n + m] = 0.0
        lean_at(out, tables, i, x + out[here + PLACE], y0 + out[here + PLACE + 1], z + out[here + PLACE + 2],
                a, b, c, 7 * n)  # fmt: skip
        damping += 2.0 * tables.settings[0]["rho"] * pipe["area"] * pipe["speed"] * ease(tables, 7 * n)
    out[RATE] = max(out[RATE], damping)
