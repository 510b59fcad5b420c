"""Inertial and gravity forces on the fluid in pipes, rigid columns and tanks of moving bodies.

The drive of a segment of fluid from r1 to r2 is the work of these forces along it per unit mass [J/kg]. In axes of the
body it is

    (g - a_o) . (r2 - r1) - W' . w + (|W x r2|^2 - |W x r1|^2) / 2,  w = integral of r x dr along it

a_o : acceleration of the origin of the body; W, W' : its angular velocity and angular acceleration. This is Lagrange's
equation ((70) of docs/course.md) for fluid that slides along a given path. Coriolis forces are perpendicular to the
path. The initial steady state already balances the part of gravity at the start.

First the rates of flow are computed for q'' = 0; q'' are the accelerations of the degrees of freedom of bodies. Then
q'' is solved with the fluid loads (`fluid_loads`) and with the inertia of the fluid (`fluid_loads`). Last, the rates
of flow are corrected for q''.
"""

from fvsolve.core.kernels import moving_frames as layout
from fvsolve.core.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.core.kernels.dtypes import (
    LAW_LINEAR,
    NO_WEIGHT,
    RATE,
    RATE_UNWANTED,
    STATUS,
    TANK,
    WHERE,
)
from fvsolve.core.kernels.moving_frames import body_row
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.core.kernels.vectors import (
    cross,
    dot,
    minus,
    plus,
    rotate,
    rotate_back,
    scalar_product,
    vector,
)
from fvsolve.features.motion.kernels import fluid_loads as fluid
from fvsolve.features.motion.kernels.mass_matrix import add_body_force, clear_column, mobility
from fvsolve.features.motion.kernels.tables import JOINT_LOAD_READ, open_motion
from fvsolve.jit import njit

THIN_LAYER = 1e-6  # thickness of a layer added at the surface to test if fluid has weight there [m]


@njit(forceinline=True)
def speed_squared(motion, r):
    """Square of the speed of rotation at r, |W x r|^2 [m2/s2]; W : angular velocity of the body."""
    v = cross(motion, fluid.BODY_SPIN, *r)
    return scalar_product(v, v)


@njit
def segment_drive(motion, segment):
    """Work of gravity and inertial forces per mass along a segment of fluid [J/kg], a row of `moving_segments`."""
    r1, r2 = vector(segment["start"], 0), vector(segment["end"], 0)
    drive = dot(motion, fluid.BODY_GRAVITY, *minus(r2, r1)) - dot(
        motion, fluid.BODY_SPIN_RATE, *vector(segment["swept"], 0)
    )
    return drive + 0.5 * (speed_squared(motion, r2) - speed_squared(motion, r1))


@njit
def set_segment_drives(t, y, dydt, out, handle):
    """Write the work of gravity and inertial forces per mass along each moving segment of fluid to `out` [J/kg].

    The values are for q'' = 0 (zero joint accelerations), minus those of gravity at the start.
    """
    tables = open_motion(handle)
    segments = tables.moving_segments
    at = tables.layout[0]["forcing"]
    last = -1
    for k in range(segments.size):
        segment = segments[k]
        # Segments of a body follow each other, so that its motion is set once for them.
        if segment["body"] != last:
            last = segment["body"]
            fluid.set_body_motion(tables, out, last, layout.BIAS, layout.SPIN_BIAS)
        out[at + k] = segment_drive(tables.scratch, segment) - segment["rest"]


@njit
def bottom_pressure_per_density(tables, out, segment, level):
    """Integral of dp / density from the surface to the bottom of a tank on a body [J/kg].

    At constant density it is the gauge pressure at the bottom over density. Joint accelerations are taken as zero.
    segment : row of the tank in `moving_segments`; level : depth along the z axis of the body [m]
    `scratch` is overwritten by `set_body_motion`.
    """
    fluid.set_body_motion(tables, out, segment["body"], layout.BIAS, layout.SPIN_BIAS)
    motion, (x, y, z) = tables.scratch, vector(segment["start"], 0)
    # Rotation adds the difference of |W x r|^2 / 2 between surface and bottom.
    squares = speed_squared(motion, (x, y, z + level)) - speed_squared(motion, (x, y, z))
    turning = motion[fluid.BODY_SPIN_RATE] * y - motion[fluid.BODY_SPIN_RATE + 1] * x
    return -(level * (motion[fluid.BODY_GRAVITY + 2] - turning) + 0.5 * squares)


@njit
def tank_drives(tables, out, i, level):
    """(`bottom_pressure_per_density` of the tank at node i, its value under gravity at the start) [J/kg].

    A tank whose fluid has no weight at its surface would lose the fluid: it ends the run, by the status NO_WEIGHT.
    out[WHERE] is then i plus the number of parts with a mesh, which lower numbers denote.
    """
    segment = tables.moving_segments[tables.nodes[i]["forcing"]]
    drive = bottom_pressure_per_density(tables, out, segment, level)
    # The pressure must rise with depth at the surface, or the fluid would leave it.
    if not bottom_pressure_per_density(tables, out, segment, level + THIN_LAYER) > drive:
        out[STATUS], out[WHERE] = NO_WEIGHT, tables.tanks.size + i
    return drive, segment["rest"]


@njit
def moving_tank_pressures(t, y, dydt, out, handle):
    """Write the pressures at the bottoms of tanks on bodies, as deviations from the initial steady state.

    For the density law `linear`: p' = rho (bottom pressure over density - its value under gravity at the start).
    """
    tables = open_motion(handle)
    nodes = tables.nodes
    rho = tables.settings[0]["rho"]
    pressure = tables.layout[0]["pressure"]
    for i in range(nodes.size):
        if nodes[i]["kind"] == TANK and nodes[i]["forcing"] >= 0:
            level = tank_level(nodes[i], tables.floats, rho, y[nodes[i]["y"]])
            drive, rest = tank_drives(tables, out, i, level)
            out[pressure + i] = rho * (drive - rest)


@njit
def moving_tank_pressures_barotropic(t, y, dydt, out, handle):
    """Write the pressures at the bottoms of tanks on bodies, as deviations from the initial steady state.

    Under barotropic laws the pressure p follows from the enthalpy, h(p) = h(ambient pressure) +
    `bottom_pressure_per_density`.
    """
    tables = open_motion(handle)
    st = tables.settings[0]
    nodes = tables.nodes
    pressure = tables.layout[0]["pressure"]
    for i in range(nodes.size):
        if nodes[i]["kind"] == TANK and nodes[i]["forcing"] >= 0:
            drive, rest = tank_drives(tables, out, i, fluid.level_at(y, tables, i))
            # Hydrostatics at variable density: the integral of dp / density is a change of enthalpy.
            h = enthalpy(st, tables.floats, st["ambient"])
            now = pressure_of_enthalpy(st, tables.floats, h + drive)
            out[pressure + i] = now - pressure_of_enthalpy(st, tables.floats, h + rest)


@njit
def moving_column_rates(t, y, dydt, out, handle):
    """Write the rates of the mass flow in all rigid columns [kg/s2], on bodies or not, without friction, to `dydt`.

    The rate is area / length times the driving pressure: deviation of the pressure difference of the ends, plus density
    times the drive in out[forcing], plus the constant `offset` of the column.
    """
    tables = open_motion(handle)
    columns = tables.columns
    p = tables.layout[0]["pressure"]
    at = tables.layout[0]["forcing"]
    for k in range(columns.size):
        column, drive = columns[k], 0.0
        # A column that is not on a body has no drive.
        for m in range(column["forcings"] if column["forcing"] >= 0 else 0):
            drive += out[at + column["forcing"] + m]
        drop = (
            out[p + column["from_node"]]
            - out[p + column["to_node"]]
            + tables.settings[0]["rho"] * drive
        )
        dydt[column["y"]] = column["area"] / column["length"] * (drop + column["offset"])


@njit
def add_cell_drives(t, y, dydt, out, handle):
    """Add the drive of the cells of pipes on bodies to the rates of their waves, under the density law `linear`.

    Nothing is done if `dydt` is empty. The drive, in out[forcing], is the work of gravity and inertial forces
    along a cell per mass [J/kg], see `set_segment_drives`. It changes dM/dt by A rho / dx times the drive.
    M : mass flow, A : area, rho : density, dx : length of a cell
    """
    tables = open_motion(handle)
    pipes = tables.pipes
    rho = tables.settings[0]["rho"]
    at = tables.layout[0]["forcing"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n = pipe["cells"]
        o = pipe["y"]
        first = pipe["forcing"]
        # Half for each wave, with opposite signs: the drive changes M = r - l and not m.
        half = 0.5 * pipe["area"] * rho / pipe["dx"]
        for k in range(n if first >= 0 else 0):
            push = half * out[at + first + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push


@njit
def add_cell_drives_barotropic(t, y, dydt, out, handle):
    """Add the drive of the cells of pipes on bodies to the rates of their waves, under barotropic density laws.

    The drive is that of `add_cell_drives`. It changes dM/dt by m / dx times the drive. M : mass flow, m : mass per
    length, dx : length of a cell
    """
    tables = open_motion(handle)
    pipes = tables.pipes
    profile = tables.profile
    at = tables.layout[0]["forcing"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n = pipe["cells"]
        o = pipe["y"]
        first = pipe["forcing"]
        for k in range(n if first >= 0 else 0):
            # Mass that waves add is driven too, unlike under the density law `linear`.
            m = profile[pipe["center"] + k] + (y[o + k] + y[o + n + k]) / pipe["speed"]
            push = 0.5 * m / pipe["dx"] * out[at + first + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push


# correction for the accelerations of bodies ----------


@njit
def path_acceleration(out, tables, segment, path):
    """Acceleration of a body integrated along a flow path on it, C . a + Z . e [m2/s2].

    path : (C, Z), integrals of dr and r x dr along the path; segment : row of the fluid in `moving_segments`
    a, e : acceleration of the origin and angular acceleration, minus their values for zero joint accelerations
    """
    here = body_row(tables, tables.moving_segments[segment]["body"])
    a = minus(vector(out, here + layout.ACCELERATION), vector(out, here + layout.BIAS))
    e = minus(vector(out, here + layout.SPIN_RATE), vector(out, here + layout.SPIN_BIAS))
    straight = scalar_product(path, rotate_back(out, here + layout.ATTITUDE, *a))
    return straight + scalar_product(path[3:], rotate_back(out, here + layout.ATTITUDE, *e))


@njit
def accelerate_pipe_flow(y, dydt, out, tables, k):
    """Add the inertial force of the acceleration of the body to the rates of the waves in all cells of pipe k.

    The force of the acceleration for zero joint accelerations is left out.
    """
    pipe, (r, t, length) = tables.pipes[k], fluid.pipe_segment(tables, k)
    n, o = pipe["cells"], pipe["y"]
    acceleration = path_acceleration(out, tables, pipe["forcing"], fluid.straight_path(r, t))
    # Half for each wave; the ends may be closer together than the pipe is long.
    push = 0.5 * length / n / pipe["dx"] * acceleration
    linear = tables.settings[0]["law"] == LAW_LINEAR
    for i in range(n):
        # Under `linear` the mass that waves add does not slide, as in `fluid_loads.add_pipe_inertia`.
        m = fluid.mass_per_length(tables, pipe, i) + (
            0.0 if linear else (y[o + i] + y[o + n + i]) / pipe["speed"]
        )
        dydt[o + i] -= m * push
        dydt[o + n + i] += m * push


@njit
def accelerate_network_flow(t, y, dydt, out, handle):
    """Add the inertial forces of the accelerations of bodies to rates of flow in pipes and rigid columns.

    The forces for zero joint accelerations are left out, because these rates contain them. Where a joint load is an
    output (`loads_body` = 2), the fluid loads on bodies in `out` are replaced by those with the new rates and with the
    accelerations of bodies. Nothing is done if `dydt` is empty or there are no degrees of freedom.
    """
    tables = open_motion(handle)
    pipes, columns = tables.pipes, tables.columns
    if dydt.size == 0 or tables.freedoms.size == 0:
        return
    # Before the rates of flow change, with which these loads were added.
    fluid.add_all_fluid_loads(
        y, dydt, out, tables, JOINT_LOAD_READ, -1.0, layout.BIAS, layout.SPIN_BIAS
    )
    for k in range(pipes.size):
        if fluid.free_carrier(tables, pipes[k]["forcing"]) >= 0:
            accelerate_pipe_flow(y, dydt, out, tables, k)
    for k in range(columns.size):
        column, segment = columns[k], columns[k]["forcing"]
        if fluid.free_carrier(tables, segment) >= 0:
            acceleration = path_acceleration(
                out, tables, segment, fluid.column_path(y, tables, column)
            )
            dydt[column["y"]] -= (
                tables.settings[0]["rho"] * column["area"] / column["length"] * acceleration
            )
    fluid.add_all_fluid_loads(
        y, dydt, out, tables, JOINT_LOAD_READ, 1.0, layout.ACCELERATION, layout.SPIN_RATE
    )


@njit
def pipe_rate_limit(t, y, dydt, out, handle):
    """Raise out[RATE], the rate that limits steps [1/s], for bodies that are damped by waves in their pipes.

    The damping is rho A c at both ends of a pipe; rho : density, A : area, c : wave speed. The factored mass matrix
    must be in `scratch`.
    """
    if out[RATE] == RATE_UNWANTED:
        return
    tables = open_motion(handle)
    damping, at = 0.0, 7 * tables.freedoms.size
    for k in range(tables.pipes.size):
        pipe = tables.pipes[k]
        i = fluid.free_carrier(tables, pipe["forcing"])
        if i < 0:
            continue
        r, direction, _ = fluid.pipe_segment(tables, k)
        here = body_row(tables, i)
        p = plus(rotate(out, here + layout.ATTITUDE, r, 0), vector(out, here + layout.POSITION))
        clear_column(tables, at)
        add_body_force(out, tables, i, p, rotate(out, here + layout.ATTITUDE, direction, 0), at)
        damping += (
            2.0 * tables.settings[0]["rho"] * pipe["area"] * pipe["speed"] * mobility(tables, at)
        )
    out[RATE] = max(out[RATE], damping)
