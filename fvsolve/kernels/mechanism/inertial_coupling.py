"""Acceleration of contained fluid by its body, after the accelerations of bodies are solved.

The coupling follows from the Lagrangian of fluid and bodies ((70) of docs/course.md). First the rates of flow are
computed for q'' = 0; q'' are the accelerations of the degrees of freedom of bodies. Then q'' is solved with the fluid
loads (`fluid_loads`) and with the inertia of the fluid (`fluid_inertia`). Last, the rates of flow are corrected for
q''.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import JOINT_LOAD_READ, LAW_LINEAR, RATE
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ATTITUDE,
    BIAS,
    POSITION,
    SPIN_BIAS,
    SPIN_RATE,
    body_row,
    nearest_free_body,
    rotate_back,
)
from fvsolve.kernels.mechanism.fluid_loads import (
    add_all_fluid_loads,
    column_path,
    mass_per_length,
    pipe_segment,
    straight_path,
    to_world,
)
from fvsolve.kernels.mechanism.mass_matrix import add_body_force, mobility
from fvsolve.kernels.table_handle import open_tables


@njit
def path_acceleration(out, tables, segment, path):
    """Acceleration of a body integrated along a flow path on it, C . a + Z . e [m2/s2].

    path : (C, Z), integrals of dr and r x dr along the path; segment : row of the fluid in `moving_segments`
    a, e : acceleration of the origin and angular acceleration, minus their values for zero joint accelerations
    """
    here = body_row(tables, tables.moving_segments[segment]["body"])
    a, e, b, c = here + ACCELERATION, here + SPIN_RATE, here + BIAS, here + SPIN_BIAS
    ax, ay, az = rotate_back(out, here + ATTITUDE, out[a] - out[b], out[a + 1] - out[b + 1], out[a + 2] - out[b + 2])
    ex, ey, ez = rotate_back(out, here + ATTITUDE, out[e] - out[c], out[e + 1] - out[c + 1], out[e + 2] - out[c + 2])
    return path[0] * ax + path[1] * ay + path[2] * az + (path[3] * ex + path[4] * ey + path[5] * ez)


@njit
def accelerate_pipe_flow(y, dydt, out, tables, k):
    """Add the inertial force of the acceleration of the body to the rates of the waves in all cells of pipe k.

    The force of the acceleration for zero joint accelerations is left out.
    """
    pipe, (r, t, length) = tables.pipes[k], pipe_segment(tables, k)
    n, o = pipe["cells"], pipe["y"]
    push = 0.5 * length / n / pipe["dx"] * path_acceleration(out, tables, pipe["moving_segment"], straight_path(r, t))
    linear = tables.settings[0]["law"] == LAW_LINEAR
    for i in range(n):
        m = mass_per_length(tables, pipe, i) + (0.0 if linear else (y[o + i] + y[o + n + i]) / pipe["speed"])
        dydt[o + i] -= m * push
        dydt[o + n + i] += m * push


@njit
def accelerate_network_flow(t, y, dydt, out, handle):
    """Add the inertial forces of the accelerations of bodies to rates of flow in pipes and rigid columns.

    The forces for zero joint accelerations are left out, because these rates contain them. Where a joint load is an
    output (`loads_body` = 2), the fluid loads on bodies in `out` are replaced by those with the new rates and with the
    accelerations of bodies. Nothing is done if `dydt` is empty or there are no degrees of freedom.
    """
    tables = open_tables(handle)
    pipes, columns, segments = tables.pipes, tables.columns, tables.moving_segments
    if dydt.size == 0 or tables.freedoms.size == 0:
        return
    add_all_fluid_loads(y, dydt, out, tables, JOINT_LOAD_READ, -1.0, BIAS, SPIN_BIAS)
    for k in range(pipes.size):
        if (
            pipes[k]["moving_segment"] >= 0
            and nearest_free_body(tables, segments[pipes[k]["moving_segment"]]["body"]) >= 0
        ):
            accelerate_pipe_flow(y, dydt, out, tables, k)
    for k in range(columns.size):
        column = columns[k]
        if column["moving_segment"] >= 0 and nearest_free_body(tables, segments[column["moving_segment"]]["body"]) >= 0:
            acceleration = path_acceleration(out, tables, column["moving_segment"], column_path(y, tables, column))
            dydt[column["y"]] -= tables.settings[0]["rho"] * column["area"] / column["length"] * acceleration
    add_all_fluid_loads(y, dydt, out, tables, JOINT_LOAD_READ, 1.0, ACCELERATION, SPIN_RATE)


@njit
def pipe_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], for bodies that are damped by waves in their pipes.

    The damping is rho A c at both ends of a pipe; rho : density, A : area, c : wave speed. The factored mass matrix
    must be in `scratch`.
    """
    tables = open_tables(handle)
    work, n, damping = tables.scratch, tables.freedoms.size, 0.0
    for k in range(tables.pipes.size):
        pipe = tables.pipes[k]
        i = tables.moving_segments[pipe["moving_segment"]]["body"] if pipe["moving_segment"] >= 0 else -1
        if nearest_free_body(tables, i) < 0:
            continue
        r, direction, _ = pipe_segment(tables, k)
        here = body_row(tables, i)
        x, y0, z = to_world(out, here, r[0], r[1], r[2])
        a, b, c = to_world(out, here, direction[0], direction[1], direction[2])
        for m in range(n):
            work[7 * n + m] = 0.0
        add_body_force(
            out,
            tables,
            i,
            x + out[here + POSITION],
            y0 + out[here + POSITION + 1],
            z + out[here + POSITION + 2],
            a,
            b,
            c,
            7 * n,
        )
        damping += 2.0 * tables.settings[0]["rho"] * pipe["area"] * pipe["speed"] * mobility(tables, 7 * n)
    out[RATE] = max(out[RATE], damping)
