"""Energy of the water in basins on bodies, in the inertial frame.

Columns of water are point masses on the bed, at mid depth. In axes of the basin the kinetic and potential energies are

    T = M V^2 / 2 + V . (W x S + Q) + W . I W / 2 + W_z H + sum over cells of rho area q^2 / (2 h)
    U = M g z - d . (S_x, S_y, lever)

M : mass; V : velocity of the origin of the basin; W : angular velocity; S, I : first and second moments of mass
Q, H : momentum relative to the basin, and its moment about z; q, h : flow per width and depth of a cell
g, z : gravity, height of the origin; d : gravity in axes of the basin; lever : sum of mass times height above the
    origin

A liquid has no lever, and its stored energy in its own axes is that of `liquid_energy`. A body that is loaded with
force F and torque T supplies the power -(F . V + T . W); see `frame_reaction`. The acceleration a of the origin along
the normal, for zero joint accelerations, changes the weight of the water, but does not act on columns that rise. So the
model dissipates a d/dt (sum of mass h / 2), which may be negative.
"""

from fvsolve.basins.basin_energy import basin_first_row as energy_row
from fvsolve.basins.basin_frames import FRAME_GRAVITY, GN, WX, WY, WZ, bed_height, cell_position
from fvsolve.basins.frame_reaction import basin_offset, extra_accelerations, mass_factor
from fvsolve.basins.free_surface.surface_energy import velocity_factor
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import TANK_OUT
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    BASIN_LOAD,
    EAST,
    MOMENTS,
    POSITION,
    SPIN,
    SPIN_RATE,
    VELOCITY,
    body_row,
)
from fvsolve.kernels.mechanism.vectors import cross, dot
from fvsolve.kernels.table_handle import open_tables


@njit
def origin_velocity(tables, basin, b, out):
    """Velocity (x, y, z) of the origin of basin b, in axes of the basin [m/s]."""
    row, tank = body_row(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    x, y, z = basin_offset(tables, basin, out)
    u, v, w = cross(out, row + SPIN, x, y, z)
    u, v, w = u + out[row + VELOCITY], v + out[row + VELOCITY + 1], w + out[row + VELOCITY + 2]
    e = tank + EAST
    return dot(out, e, u, v, w), dot(out, e + 3, u, v, w), dot(out, e + 6, u, v, w)


@njit
def origin_acceleration(tables, basin, b, out):
    """Acceleration [m/s2] and angular acceleration [rad/s2] of the origin of basin b, in its own axes: six numbers."""
    row, tank = body_row(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    x, y, z = basin_offset(tables, basin, out)
    u, v, w = cross(out, row + SPIN, x, y, z)
    cx, cy, cz = cross(out, row + SPIN, u, v, w)
    tx, ty, tz = cross(out, row + SPIN_RATE, x, y, z)
    a, t, e = row + ACCELERATION, row + SPIN_RATE, tank + EAST
    x, y, z = out[a] + cx + tx, out[a + 1] + cy + ty, out[a + 2] + cz + tz
    return (
        dot(out, e, x, y, z), dot(out, e + 3, x, y, z), dot(out, e + 6, x, y, z),
        dot(out, e, out[t], out[t + 1], out[t + 2]),
        dot(out, e + 3, out[t], out[t + 1], out[t + 2]),
        dot(out, e + 6, out[t], out[t + 1], out[t + 2]),
    )  # fmt: skip


@njit
def body_load(tables, basin, b, out):
    """Force [N] and torque [N m] of the water of basin b on its body, in axes of the basin: six numbers.

    They are the load for zero accelerations of joints, plus the inertial load along the normal that the accelerations
    of joints cause.
    """
    ax, ay, az, wx, wy, wz = extra_accelerations(tables, basin, out)
    tank = tables.layout[0]["tank"] + TANK_OUT * b
    e, m = tank + EAST, tank + MOMENTS
    a, c, d = dot(out, e + 6, ax, ay, az), -dot(out, e + 3, wx, wy, wz), dot(out, e, wx, wy, wz)
    normal_force = out[m] * a + out[m + 1] * c + out[m + 2] * d
    moment_x = out[m + 2] * a + out[m + 4] * c + out[m + 5] * d
    moment_y = out[m + 1] * a + out[m + 3] * c + out[m + 4] * d
    f = tank + BASIN_LOAD
    return out[f], out[f + 1], out[f + 2] - normal_force, out[f + 3] - moment_x, out[f + 4] + moment_y, out[f + 5]


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power that bodies supply to the water in their basins to `power` [W].

    The rate of storage and the power that the model dissipates are written to the entries of `basin_energy` too.
    """
    tables = open_tables(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        at, row = basin["frame"], energy_row(tables, power, b)
        vx, vy, vz = origin_velocity(tables, basin, b, out)
        wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
        fx, fy, fz, tx, ty, tz = body_load(tables, basin, b, out)
        power[row] -= fx * vx + fy * vy + fz * vz + tx * wx + ty * wy + tz * wz
        own = 0.0 if basin["deep"] == 1 else power[row + 3]
        power[row + 3] = own + energy_rate(tables, basin, b, y, dydt, out, vx, vy, vz)
        power[row + 4] = (plane[at + GN] + plane[at + FRAME_GRAVITY + 2]) * rise_moment(tables, basin, y, dydt)


@njit
def rise_moment(tables, basin, y, dydt):
    """Time derivative of the sum over cells of mass times depth / 2 [kg m/s]; 0 for a liquid."""
    plane, total, n, o = tables.plane, 0.0, basin["n"], basin["y"]
    for i in range(n if basin["deep"] == 1 else 0):
        total += plane[basin["area"] + i] * max(plane[basin["plan"] + i] + y[o + i], 0.0) * dydt[o + i]
    return tables.settings[0]["rho"] * total


@njit
def energy_rate(tables, basin, b, y, dydt, out, vx, vy, vz):
    """Rate of kinetic and potential energy of the water in basin b [W]; vx, vy, vz : result of `origin_velocity`.

    For a liquid the energy in its own axes, see `liquid_energy`, is left out.
    """
    plane, n, o, at, per_area = tables.plane, basin["n"], basin["y"], basin["frame"], mass_factor(tables, basin)
    m, wx, wy, wz = tables.layout[0]["tank"] + TANK_OUT * b, plane[at + WX], plane[at + WY], plane[at + WZ]
    ax, ay, az, bx, by, bz = origin_acceleration(tables, basin, b, out)
    qx = qy = turn = fx = fy = spin = own_rate = lever = high = 0.0
    dx = dy = dxx = dxy = dyy = 0.0
    for i in range(n):
        x, z = cell_position(plane, basin, i)
        per, depth = per_area * plane[basin["area"] + i], max(plane[basin["plan"] + i] + y[o + i], 0.0)
        p, q, mass_rate = y[o + n + i], y[o + 2 * n + i], per * dydt[o + i]
        dp, dq = dydt[o + n + i], dydt[o + 2 * n + i]
        qx, qy, turn = qx + per * p, qy + per * q, turn + per * (x * q - z * p)
        fx, fy, spin = fx + per * dp, fy + per * dq, spin + per * (x * dq - z * dp)
        dx, dy, dxx, dxy, dyy = (
            dx + mass_rate * x,
            dy + mass_rate * z,
            dxx + mass_rate * x * x,
            dxy + mass_rate * x * z,
            dyy + mass_rate * z * z,
        )
        if basin["deep"] == 1:
            share, bed = velocity_factor(depth), bed_height(plane, basin, i)
            u, v = share * p, share * q
            own_rate += per * (u * dp + v * dq) - 0.5 * mass_rate * (u * u + v * v)
            lever, high = lever + per * depth * (bed + 0.5 * depth), high + mass_rate * (bed + depth)
    mass, sx, sy, xx, xy, yy = out[m], out[m + 1], out[m + 2], out[m + 3], out[m + 4], out[m + 5]
    ax, ay, az = ax - (wy * vz - wz * vy), ay - (wz * vx - wx * vz), az - (wx * vy - wy * vx)  # of its parts
    px, py, pz = mass * vx + qx - wz * sy, mass * vy + qy + wz * sx, mass * vz + wx * sy - wy * sx
    total = px * ax + py * ay + pz * az
    total += (
        vx * (fx - bz * sy - wz * dy) + vy * (fy + bz * sx + wz * dx) + vz * (bx * sy - by * sx + wx * dy - wy * dx)
    )
    total += (yy * wx - xy * wy) * bx + (xx * wy - xy * wx) * by + (xx + yy) * wz * bz
    total += 0.5 * (dyy * wx * wx - 2.0 * dxy * wx * wy + dxx * wy * wy + (dxx + dyy) * wz * wz)
    total += bz * turn + wz * spin + own_rate
    gx, gy, gz = plane[at + FRAME_GRAVITY], plane[at + FRAME_GRAVITY + 1], plane[at + FRAME_GRAVITY + 2]
    total -= mass * (gx * vx + gy * vy + gz * vz) + gx * dx + gy * dy + gz * high
    return total + (wy * gz - wz * gy) * sx + (wz * gx - wx * gz) * sy + (wx * gy - wy * gx) * lever


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Write the kinetic plus potential energy [J] of the water in basins on bodies to `stored`.

    The potential energy is zero at elevation 0. For a liquid the result is added to the entry of `stored`, the energy
    of the liquid in axes of the basin. For water with a free surface it replaces the entry.
    """
    tables = open_tables(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        n, o, at, m = basin["n"], basin["y"], basin["frame"], tables.layout[0]["tank"] + TANK_OUT * b
        per_area = mass_factor(tables, basin)
        vx, vy, vz = origin_velocity(tables, basin, b, out)
        wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
        qx = qy = turn = inner = lever = 0.0
        for i in range(n):
            x, z = cell_position(plane, basin, i)
            per, depth = per_area * plane[basin["area"] + i], max(plane[basin["plan"] + i] + y[o + i], 0.0)
            p, q = y[o + n + i], y[o + 2 * n + i]
            qx, qy, turn = qx + per * p, qy + per * q, turn + per * (x * q - z * p)
            if basin["deep"] == 1:
                inner += 0.5 * per * velocity_factor(depth) * (p * p + q * q)
                lever += per * depth * (bed_height(plane, basin, i) + 0.5 * depth)
        mass, sx, sy, xx, xy, yy = out[m], out[m + 1], out[m + 2], out[m + 3], out[m + 4], out[m + 5]
        total = 0.5 * mass * (vx * vx + vy * vy + vz * vz)
        total += vx * (qx - wz * sy) + vy * (qy + wz * sx) + vz * (wx * sy - wy * sx)
        total += 0.5 * (yy * wx * wx - 2.0 * xy * wx * wy + xx * wy * wy + (xx + yy) * wz * wz) + wz * turn + inner
        row = body_row(tables, basin["body"])
        total += mass * tables.settings[0]["gravity"] * (out[row + POSITION + 2] + basin_offset(tables, basin, out)[2])
        total -= (
            plane[at + FRAME_GRAVITY] * sx + plane[at + FRAME_GRAVITY + 1] * sy + plane[at + FRAME_GRAVITY + 2] * lever
        )
        k = stored.size - tables.basins.size + b
        stored[k] = total + (0.0 if basin["deep"] == 1 else stored[k])
