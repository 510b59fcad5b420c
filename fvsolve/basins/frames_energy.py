"""Energy of water that rides on bodies, as the world has it. Knows the tables; adds nothing up over time.

Of columns as point masses on the bed, weight at mid depth: T = M V^2 / 2 + V . (W x S + Q) + W . I W / 2 + W_z H + sum
of rho q^2 / (2 h), U = M g z - d . (S, lever), d gravity in axes of the basin, V velocity of its origin; M, S, I the
moments of mass, Q and H momentum and its moment relative to the basin. A body brings -(F . V + T . W) with the load
that it feels; see `frames`. What is known of the origin's acceleration along the normal, a, weighs on the water and not
on columns that rise: a d/dt (sum of dm h / 2) is taken from it by the law, and may be given back.
"""

from fvsolve.basins.energy import row_of as energy_row
from fvsolve.basins.frames import AT, DOWN, GN, WX, WY, WZ, ground, place_of
from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.room import (
    ACCELERATION,
    ATTITUDE,
    BIAS,
    PLACE,
    SPIN,
    SPIN_BIAS,
    TURNING,
    VELOCITY,
    cross,
    dot,
    row_of,
    turned,
)
from fvsolve.kernels.mechanism.tanks import EAST, LOAD, MOMENTS, TANK_OUT

THIN = 1e-6  # depth below which velocities fade [m]


@njit(forceinline=True)
def share_of(depth):
    """Velocity over flow of water so deep [1/m]."""
    wet = max(depth, THIN)
    return 2.0 * depth / (depth * depth + wet * wet)


@njit
def origin_moves(tables, basin, b, out):
    """Velocity of a basin's origin, in its own axes."""
    row, tank = row_of(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    x, y, z = turned(out, row + ATTITUDE, tables.plane[basin["frame"] + AT : basin["frame"] + AT + 3], 0)
    u, v, w = cross(out, row + SPIN, x, y, z)
    u, v, w = u + out[row + VELOCITY], v + out[row + VELOCITY + 1], w + out[row + VELOCITY + 2]
    e = tank + EAST
    return dot(out, e, u, v, w), dot(out, e + 3, u, v, w), dot(out, e + 6, u, v, w)


@njit
def origin_gathers(tables, basin, b, out):
    """Accelerations of a basin's origin and of its turning, solved ones, in its own axes."""
    row, tank = row_of(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    x, y, z = turned(out, row + ATTITUDE, tables.plane[basin["frame"] + AT : basin["frame"] + AT + 3], 0)
    u, v, w = cross(out, row + SPIN, x, y, z)
    cx, cy, cz = cross(out, row + SPIN, u, v, w)
    tx, ty, tz = cross(out, row + TURNING, x, y, z)
    a, t, e = row + ACCELERATION, row + TURNING, tank + EAST
    x, y, z = out[a] + cx + tx, out[a + 1] + cy + ty, out[a + 2] + cz + tz
    return (
        dot(out, e, x, y, z), dot(out, e + 3, x, y, z), dot(out, e + 6, x, y, z),
        dot(out, e, out[t], out[t + 1], out[t + 2]),
        dot(out, e + 3, out[t], out[t + 1], out[t + 2]),
        dot(out, e + 6, out[t], out[t + 1], out[t + 2]),
    )  # fmt: skip


@njit
def felt(tables, basin, b, out):
    """Force and torque on the body as it moves: those with joints held, and what gives way along the normal."""
    row, tank = row_of(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    x, y, z = turned(out, row + ATTITUDE, tables.plane[basin["frame"] + AT : basin["frame"] + AT + 3], 0)
    wx, wy, wz = (
        out[row + TURNING] - out[row + SPIN_BIAS], out[row + TURNING + 1] - out[row + SPIN_BIAS + 1],
        out[row + TURNING + 2] - out[row + SPIN_BIAS + 2],
    )  # fmt: skip
    ax = out[row + ACCELERATION] - out[row + BIAS] + wy * z - wz * y
    ay = out[row + ACCELERATION + 1] - out[row + BIAS + 1] + wz * x - wx * z
    az = out[row + ACCELERATION + 2] - out[row + BIAS + 2] + wx * y - wy * x
    e, m = tank + EAST, tank + MOMENTS
    a, c, d = dot(out, e + 6, ax, ay, az), -dot(out, e + 3, wx, wy, wz), dot(out, e, wx, wy, wz)
    push = out[m] * a + out[m + 1] * c + out[m + 2] * d
    east = out[m + 2] * a + out[m + 4] * c + out[m + 5] * d
    north = out[m + 1] * a + out[m + 3] * c + out[m + 4] * d
    f = tank + LOAD
    return out[f], out[f + 1], out[f + 2] - push, out[f + 3] - east, out[f + 4] + north, out[f + 5]


@njit
def add_power(t, y, dydt, out, handle, power):
    """What bodies bring to the water in them, and its rate of storage."""
    tables = open_tables(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        at, row = basin["frame"], energy_row(tables, power, b)
        vx, vy, vz = origin_moves(tables, basin, b, out)
        wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
        fx, fy, fz, tx, ty, tz = felt(tables, basin, b, out)
        power[row] -= fx * vx + fy * vy + fz * vz + tx * wx + ty * wy + tz * wz
        power[row + 3] = gained(tables, basin, b, y, dydt, out, vx, vy, vz)
        power[row + 4] = (plane[at + GN] + plane[at + DOWN + 2]) * rising(tables, basin, y, dydt)


@njit
def rising(tables, basin, y, dydt):
    """d/dt of the sum of dm h / 2 [kg m/s]."""
    plane, total, n, o = tables.plane, 0.0, basin["n"], basin["y"]
    for i in range(n):
        total += plane[basin["area"] + i] * max(plane[basin["plan"] + i] + y[o + i], 0.0) * dydt[o + i]
    return tables.settings[0]["rho"] * total


@njit
def gained(tables, basin, b, y, dydt, out, vx, vy, vz):
    """d/dt (T + U) [W]."""
    plane, n, o, at, rho = tables.plane, basin["n"], basin["y"], basin["frame"], tables.settings[0]["rho"]
    m, wx, wy, wz = tables.layout[0]["tank"] + TANK_OUT * b, plane[at + WX], plane[at + WY], plane[at + WZ]
    ax, ay, az, bx, by, bz = origin_gathers(tables, basin, b, out)
    qx = qy = turn = fx = fy = spin = inner = lever = high = 0.0
    dx = dy = dxx = dxy = dyy = 0.0
    for i in range(n):
        x, z = place_of(plane, basin, i)
        per, depth = rho * plane[basin["area"] + i], max(plane[basin["plan"] + i] + y[o + i], 0.0)
        p, q, more = y[o + n + i], y[o + 2 * n + i], per * dydt[o + i]
        dp, dq, share, bed = dydt[o + n + i], dydt[o + 2 * n + i], share_of(depth), ground(plane, basin, i)
        u, v = share * p, share * q
        inner += per * (u * dp + v * dq) - 0.5 * more * (u * u + v * v)
        qx, qy, turn = qx + per * p, qy + per * q, turn + per * (x * q - z * p)
        fx, fy, spin = fx + per * dp, fy + per * dq, spin + per * (x * dq - z * dp)
        dx, dy, dxx, dxy, dyy = dx + more * x, dy + more * z, dxx + more * x * x, dxy + more * x * z, dyy + more * z * z
        lever, high = lever + per * depth * (bed + 0.5 * depth), high + more * (bed + depth)
    mass, sx, sy, xx, xy, yy = out[m], out[m + 1], out[m + 2], out[m + 3], out[m + 4], out[m + 5]
    ax, ay, az = ax - (wy * vz - wz * vy), ay - (wz * vx - wx * vz), az - (wx * vy - wy * vx)  # of its parts
    px, py, pz = mass * vx + qx - wz * sy, mass * vy + qy + wz * sx, mass * vz + wx * sy - wy * sx
    total = px * ax + py * ay + pz * az
    total += (
        vx * (fx - bz * sy - wz * dy) + vy * (fy + bz * sx + wz * dx) + vz * (bx * sy - by * sx + wx * dy - wy * dx)
    )
    total += (yy * wx - xy * wy) * bx + (xx * wy - xy * wx) * by + (xx + yy) * wz * bz
    total += 0.5 * (dyy * wx * wx - 2.0 * dxy * wx * wy + dxx * wy * wy + (dxx + dyy) * wz * wz)
    total += bz * turn + wz * spin + inner
    gx, gy, gz = plane[at + DOWN], plane[at + DOWN + 1], plane[at + DOWN + 2]
    total -= mass * (gx * vx + gy * vy + gz * vz) + gx * dx + gy * dy + gz * high
    return total + (wy * gz - wz * gy) * sx + (wz * gx - wx * gz) * sy + (wx * gy - wy * gx) * lever


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """T + U [J], in place of what a basin that stands still would hold."""
    tables = open_tables(handle)
    plane, rho = tables.plane, tables.settings[0]["rho"]
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        n, o, at, m = basin["n"], basin["y"], basin["frame"], tables.layout[0]["tank"] + TANK_OUT * b
        vx, vy, vz = origin_moves(tables, basin, b, out)
        wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
        qx = qy = turn = inner = lever = 0.0
        for i in range(n):
            x, z = place_of(plane, basin, i)
            per, depth = rho * plane[basin["area"] + i], max(plane[basin["plan"] + i] + y[o + i], 0.0)
            p, q = y[o + n + i], y[o + 2 * n + i]
            inner += 0.5 * per * share_of(depth) * (p * p + q * q)
            qx, qy, turn = qx + per * p, qy + per * q, turn + per * (x * q - z * p)
            lever += per * depth * (ground(plane, basin, i) + 0.5 * depth)
        mass, sx, sy, xx, xy, yy = out[m], out[m + 1], out[m + 2], out[m + 3], out[m + 4], out[m + 5]
        total = 0.5 * mass * (vx * vx + vy * vy + vz * vz)
        total += vx * (qx - wz * sy) + vy * (qy + wz * sx) + vz * (wx * sy - wy * sx)
        total += 0.5 * (yy * wx * wx - 2.0 * xy * wx * wy + xx * wy * wy + (xx + yy) * wz * wz) + wz * turn + inner
        row = row_of(tables, basin["body"])
        x, z, high = turned(out, row + ATTITUDE, plane[at + AT : at + AT + 3], 0)
        total += mass * tables.settings[0]["gravity"] * (out[row + PLACE + 2] + high)
        stored[stored.size - tables.basins.size + b] = total - (
            plane[at + DOWN] * sx + plane[at + DOWN + 1] * sy + plane[at + DOWN + 2] * lever
        )
