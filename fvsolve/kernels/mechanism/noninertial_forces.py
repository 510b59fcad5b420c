"""Inertial and gravity forces on the fluid in pipes, rigid columns and tanks of moving bodies.

The drive of a segment of fluid from r1 to r2 is the work of these forces along it per unit mass [J/kg]. In axes of the
body it is

    (g - a_o) . (r2 - r1) - W' . w + (|W x r2|^2 - |W x r1|^2) / 2,  w = integral of r x dr along it

a_o : acceleration of the origin of the body; W, W' : its angular velocity and angular acceleration. This is Lagrange's
equation ((70) of docs/course.md) for fluid that slides along a given path. Coriolis forces are perpendicular to the
path. The initial steady state already balances the part of gravity at the start.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import NO_WEIGHT, STATUS, TANK, WHERE
from fvsolve.kernels.mechanism.body_layout import (
    ATTITUDE,
    BIAS,
    SPIN,
    SPIN_BIAS,
    VELOCITY,
    body_row,
    cross,
    dot,
    rotate_back,
    write_vector,
)
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tanks import tank_level

BODY_GRAVITY, BODY_SPIN, BODY_SPIN_RATE, BODY_VELOCITY = (
    0,
    3,
    6,
    9,
)  # in scratch: g - a_o, W, W' and velocity of the origin, in axes of a body
THIN_LAYER = 1e-6  # thickness of a layer added at the surface to test if fluid has weight there [m]


@njit
def set_body_motion(tables, out, i, wide, spin):
    """Write g - a_o, W, W' and the velocity of the origin of body i, in its own axes, to scratch[:12].

    g : acceleration of gravity; a_o : acceleration of its origin; W, W' : its angular velocity and acceleration
    wide, spin : offsets of a_o and W' in the data of the body in `out`
    """
    here, motion = body_row(tables, i), tables.scratch
    b, w, e, v = here + wide, here + SPIN, here + spin, here + VELOCITY
    down = -tables.settings[0]["gravity"]
    write_vector(motion, BODY_GRAVITY, *rotate_back(out, here + ATTITUDE, -out[b], -out[b + 1], down - out[b + 2]))
    write_vector(motion, BODY_SPIN, *rotate_back(out, here + ATTITUDE, out[w], out[w + 1], out[w + 2]))
    write_vector(motion, BODY_SPIN_RATE, *rotate_back(out, here + ATTITUDE, out[e], out[e + 1], out[e + 2]))
    write_vector(motion, BODY_VELOCITY, *rotate_back(out, here + ATTITUDE, out[v], out[v + 1], out[v + 2]))


@njit
def speed_squared(motion, x, y, z):
    """Square of the speed of rotation at r = (x, y, z), |W x r|^2 [m2/s2]; W : angular velocity of the body.

    motion : `scratch` after `set_body_motion`
    """
    u, v, w = cross(motion, BODY_SPIN, x, y, z)
    return u * u + v * v + w * w


@njit
def segment_drive(motion, r1, r2, wx, wy, wz):
    """Work of gravity and inertial forces per mass along a segment of fluid from r1 to r2 [J/kg].

    (wx, wy, wz) : integral of r x dr along the segment; motion : `scratch` after `set_body_motion`
    """
    drive = dot(motion, BODY_GRAVITY, r2[0] - r1[0], r2[1] - r1[1], r2[2] - r1[2]) - dot(
        motion, BODY_SPIN_RATE, wx, wy, wz
    )
    return drive + 0.5 * (speed_squared(motion, r2[0], r2[1], r2[2]) - speed_squared(motion, r1[0], r1[1], r1[2]))


@njit
def set_segment_drives(t, y, dydt, out, handle):
    """Write the work of gravity and inertial forces per mass along each moving segment of fluid to `out` [J/kg].

    The values are for q'' = 0 (zero joint accelerations), minus those of gravity at the start.
    """
    tables = open_tables(handle)
    segments, at, last = tables.moving_segments, tables.layout[0]["moving_segment"], -1
    for k in range(segments.size):
        segment = segments[k]
        if segment["body"] != last:
            last = segment["body"]
            set_body_motion(tables, out, last, BIAS, SPIN_BIAS)
        w = segment["swept"]
        out[at + k] = (
            segment_drive(tables.scratch, segment["start"], segment["end"], w[0], w[1], w[2]) - segment["rest"]
        )


@njit
def bottom_pressure_per_density(tables, out, segment, level):
    """Integral of dp / density from the surface to the bottom of a tank on a body [J/kg].

    At constant density it is the gauge pressure at the bottom over density. Joint accelerations are taken as zero.
    segment : row of the tank in `moving_segments`; level : depth along the z axis of the body [m]
    `scratch` is overwritten by `set_body_motion`.
    """
    set_body_motion(tables, out, segment["body"], BIAS, SPIN_BIAS)
    motion, r = tables.scratch, segment["start"]
    x, y, z = r[0], r[1], r[2]
    squares = speed_squared(motion, x, y, z + level) - speed_squared(motion, x, y, z)
    return -(
        level * (motion[BODY_GRAVITY + 2] - (motion[BODY_SPIN_RATE] * y - motion[BODY_SPIN_RATE + 1] * x))
        + 0.5 * squares
    )


@njit
def moving_tank_pressures(t, y, dydt, out, handle):
    """Write the pressures at the bottoms of tanks on bodies, as deviations from the initial steady state.

    For the density law `linear`: p' = rho (bottom pressure over density - its value under gravity at the start). A tank
    whose fluid has no weight would lose the fluid: it ends the run (`mark_weightless`).
    """
    tables = open_tables(handle)
    nodes, rho = tables.nodes, tables.settings[0]["rho"]
    for i in range(nodes.size):
        node = nodes[i]
        if node["kind"] == TANK and node["moving_segment"] >= 0:
            segment, level = (
                tables.moving_segments[node["moving_segment"]],
                tank_level(node, tables.floats, rho, y[node["y"]]),
            )
            out[tables.layout[0]["pressure"] + i] = rho * (
                bottom_pressure_per_density(tables, out, segment, level) - segment["rest"]
            )
            mark_weightless(tables, out, i, segment, level)


@njit
def mark_weightless(tables, out, i, segment, level):
    """Write the status NO_WEIGHT if the fluid at the surface of the tank at node i has no weight.

    out[WHERE] is set to i plus the number of basins, because lower numbers denote basins.
    segment, level : see `bottom_pressure_per_density`
    """
    if not bottom_pressure_per_density(tables, out, segment, level + THIN_LAYER) > bottom_pressure_per_density(
        tables, out, segment, level
    ):
        out[STATUS], out[WHERE] = NO_WEIGHT, tables.basins.size + i


@njit
def moving_column_rates(t, y, dydt, out, handle):
    """Write the rates of the mass flow in all rigid columns [kg/s2], on bodies or not, without friction, to `dydt`.

    The rate is area / length times the driving pressure: deviation of the pressure difference of the ends, plus density
    times the drive in out[moving_segment], plus the constant `offset` of the column.
    """
    tables = open_tables(handle)
    columns, p, at = tables.columns, tables.layout[0]["pressure"], tables.layout[0]["moving_segment"]
    for k in range(columns.size):
        column, drive = columns[k], 0.0
        for m in range(column["moving_segments"] if column["moving_segment"] >= 0 else 0):
            drive += out[at + column["moving_segment"] + m]
        drop = out[p + column["from_node"]] - out[p + column["to_node"]] + tables.settings[0]["rho"] * drive
        dydt[column["y"]] = column["area"] / column["length"] * (drop + column["offset"])


@njit
def add_cell_drives(t, y, dydt, out, handle):
    """Add the drive of the cells of pipes on bodies to the rates of their waves, under the density law `linear`.

    Nothing is done if `dydt` is empty. The drive, in out[moving_segment], is the work of gravity and inertial forces
    along a cell per mass [J/kg], see `set_segment_drives`. It changes dM/dt by A rho / dx times the drive.
    M : mass flow, A : area, rho : density, dx : length of a cell
    """
    tables = open_tables(handle)
    pipes, rho, at = tables.pipes, tables.settings[0]["rho"], tables.layout[0]["moving_segment"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n, o, first = pipe["cells"], pipe["y"], pipe["moving_segment"]
        half = 0.5 * pipe["area"] * rho / pipe["dx"]
        for k in range(n if first >= 0 else 0):
            push = half * out[at + first + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push
