"""Basins that ride on bodies: what their axes do to what is in them. Knows rows of tables; knows no flux.

In axes of the basin, z along its normal, r = (x, y, 0) from its middle, which moves with acceleration a and turns at W
(65): u_t + u.grad u + g_n grad(h + bed + phi) = - 2 W_z x u - dW_z/dt x r, with G = R' ((0, 0, -g) - a), g_n = -G_z and

    g_n phi = - G_x x - G_y y - ((W_y^2 + W_z^2) x^2 - 2 W_x W_y x y + (W_x^2 + W_z^2) y^2) / 2

So tilt, accelerations and centrifugal forces are a bed that moves, phi stands where the bed stands, and water that
rests in the frame rests to round-off. Left out are what columns feel along z but at the origin, and vertical momentum:
both of the order of angle times depth over wave length.

Where forces move the body its acceleration is not known before that of its water. As Lagrange (70) has it for columns
that are point masses which slide along the bed, weight at mid depth: what pushes them along the bed hangs on the state
alone. So rates of flow are found first as if joints were held; water then loads the body by what its momentum lacks
(`load_bodies`), along the normal by its mass and moments beside those of bodies (`kernels.mechanism.tanks`); once
accelerations are solved, flow feels them (`follow_bodies`). Momentum of the whole is kept to the method's order: Ω x
the sum of x dm/dt in the load is that of mass fluxes.
"""

from fvsolve.jit import inner, njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.room import (
    ACCELERATION,
    ARM,
    ATTITUDE,
    BIAS,
    SPIN,
    SPIN_BIAS,
    TURNING,
    add_force,
    add_torque,
    cross,
    dot,
    put,
    row_of,
    turned,
)
from fvsolve.kernels.mechanism.tanks import ARM_OF, EAST, LOAD, MOMENTS, TANK_OUT
from fvsolve.kernels.records import NO_WEIGHT, RATE, STATUS, WHERE

AT, TURN = 0, 3  # numbers of a frame: place of its origin and attitude, by rows, in axes of its body,
GX, GY, GN, WX, WY, WZ, AX, AY, AZ = range(12, 21)  # G, g_n, W and dW/dt in its own axes,
SURFACE = 21  # offsets in `plane`: of surfaces as drawn, and of places of columns and rows, or of cells
PLACES = 22
DOWN = 23  # gravity alone, three numbers
LEVEL = 26  # of the water at rest above its origin [m]
FRAME = 27  # numbers


@njit
def set_frames(t, y, dydt, out, handle):
    """What all frames do now, and the bed with it."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] >= 0:
            set_frame(tables, basin, out)
            if not tables.plane[basin["frame"] + GN] > 0.0:
                out[STATUS], out[WHERE] = NO_WEIGHT, b
            tilt_bed(tables.plane, basin)


@njit
def seen_along(out, row, plane, at, k, x, y, z):
    """Part of a vector of the world along axis k of a frame whose attitude on its body stands at plane[at]."""
    ax, ay, az = turned(out, row + ATTITUDE, plane[at + k : at + k + 7 : 3], 0)
    return ax * x + ay * y + az * z


@njit
def set_frame(tables, basin, out):
    """G, W and dW_z/dt in axes of a basin."""
    plane, at, row = tables.plane, basin["frame"], row_of(tables, basin["body"])
    rx, ry, rz = turned(out, row + ATTITUDE, plane[at : at + 3], 0)
    ex, ey, ez = cross(out, row + SPIN_BIAS, rx, ry, rz)
    vx, vy, vz = cross(out, row + SPIN, rx, ry, rz)
    cx, cy, cz = cross(out, row + SPIN, vx, vy, vz)
    b, s, e = row + BIAS, row + SPIN, row + SPIN_BIAS
    gx, gy = -(out[b] + ex + cx), -(out[b + 1] + ey + cy)
    gz = -tables.settings[0]["gravity"] - (out[b + 2] + ez + cz)
    axes = at + TURN
    plane[at + GX] = seen_along(out, row, plane, axes, 0, gx, gy, gz)
    plane[at + GY] = seen_along(out, row, plane, axes, 1, gx, gy, gz)
    plane[at + GN] = -seen_along(out, row, plane, axes, 2, gx, gy, gz)
    for k in range(3):
        plane[at + WX + k] = seen_along(out, row, plane, axes, k, out[s], out[s + 1], out[s + 2])
        plane[at + AX + k] = seen_along(out, row, plane, axes, k, out[e], out[e + 1], out[e + 2])
        plane[at + DOWN + k] = seen_along(out, row, plane, axes, k, 0.0, 0.0, -tables.settings[0]["gravity"])


@njit
def tilt_bed(plane, basin):
    """Surfaces at rest, less the level, with phi."""
    at, n, nx = basin["frame"], basin["n"], basin["nx"]
    to, drawn, places = basin["plan"] + n, int(plane[at + SURFACE]), int(plane[at + PLACES])
    per = 1.0 / plane[at + GN]
    wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
    fx, fy = -per * plane[at + GX], -per * plane[at + GY]
    xx, xy, yy = -0.5 * per * (wy * wy + wz * wz), per * wx * wy, -0.5 * per * (wx * wx + wz * wz)
    if nx == 0:
        for i in range(n):
            x, y = plane[places + i], plane[places + n + i]
            plane[to + i] = plane[drawn + i] + (x * (fx + xx * x + xy * y) + y * (fy + yy * y))
        return
    for j in range(basin["ny"]):
        y = plane[places + nx + j]
        row, even, slope = j * nx, y * (fy + yy * y), fx + xy * y
        for i in range(nx):
            x = plane[places + i]
            plane[to + row + i] = plane[drawn + row + i] + (x * (slope + xx * x) + even)


@njit(forceinline=True)
def place_of(plane, basin, i):
    """Where the centre of cell i lies in axes of its basin [m]."""
    n, nx, places = basin["n"], basin["nx"], int(plane[basin["frame"] + PLACES])
    if nx == 0:
        return plane[places + i], plane[places + n + i]
    return plane[places + i % nx], plane[places + nx + i // nx]


@njit
def turn_water(t, y, dydt, out, handle):
    """Add Coriolis and Euler forces to rates of flow, and let bodies feel what is in them."""
    tables = open_tables(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        twice, euler = 2.0 * tables.plane[basin["frame"] + WZ], tables.plane[basin["frame"] + AZ]
        out[RATE] = max(out[RATE], abs(twice))
        to, first = (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["unused"])
        if twice != 0.0 or euler != 0.0:
            push_flow(tables.plane, basin, y, to, first, twice, 0.0, 0.0, euler)
        if basin["heavy"] == 1:
            load_body(tables, basin, b, y, to, first, out)


@njit
def push_flow(plane, basin, y, rates, first, twice, east, north, turn):
    """Add to rates of flow 2 W q and depth times a push that is even but for `turn` times the place."""
    n, o, nx, places = basin["n"], basin["y"], basin["nx"], int(plane[basin["frame"] + PLACES])
    rows, wide = (basin["ny"], nx) if nx > 0 else (1, n)
    for row in range(rows):
        at = row * wide
        a, z, p = o + at, o + at + wide, basin["plan"] + at
        x = plane[places : places + wide]
        if nx > 0:
            level = plane[places + nx + row]
            push_row(x, plane[p : p + wide], y[a:z], y[a + n : z + n], y[a + 2 * n : z + 2 * n], twice,
                     east + turn * level, north, turn, rates[first + n + at : first + n + at + wide],
                     rates[first + 2 * n + at : first + 2 * n + at + wide])  # fmt: skip
        else:
            for i in range(n):
                depth = max(plane[p + i] + y[o + i], 0.0)
                rates[first + n + i] += twice * y[o + 2 * n + i] + depth * (east + turn * plane[places + n + i])
                rates[first + 2 * n + i] += depth * (north - turn * x[i]) - twice * y[o + n + i]


@inner
def push_row(x, rest, dh, qx, qy, twice, east, north, turn, rate_x, rate_y):
    """`push_flow` of a row of cells of a grid."""
    for i in range(rate_x.size):
        depth = max(rest[i] + dh[i], 0.0)
        rate_x[i] += twice * qy[i] + depth * east
        rate_y[i] += depth * (north - turn * x[i]) - twice * qx[i]


@njit(forceinline=True)
def ground(plane, basin, i):
    """Height of the bed of cell i above the origin of its basin [m]."""
    at = basin["frame"]
    return plane[int(plane[at + SURFACE]) + i] - plane[basin["plan"] + i] + plane[at + LEVEL]


@njit
def load_body(tables, basin, b, y, rates, first, out):
    """Force and torque of the water in a basin on its body with joints held, and its moments along the normal."""
    plane, n, o, rho = tables.plane, basin["n"], basin["y"], tables.settings[0]["rho"]
    m = sx = sy = xx = xy = yy = lever = 0.0  # moments of mass, and of its weight along the normal
    dx = dy = dxx = dxy = dyy = 0.0  # their rates
    qx = qy = turn = fx = fy = spin = 0.0  # momentum, its moment about z, and their rates
    nx, places = basin["nx"], int(plane[basin["frame"] + PLACES])
    level = plane[basin["frame"] + LEVEL]
    surface, rows, wide = int(plane[basin["frame"] + SURFACE]), basin["ny"] if nx > 0 else n, nx if nx > 0 else 1
    for row in range(rows):
        z = plane[places + (nx if nx > 0 else n) + row]
        r0 = r1 = r2 = d0 = d1 = d2 = p0 = p1 = v0 = v1 = f0 = f1 = g0 = 0.0  # of a row: its cells have one y
        for k in range(wide):
            i = row * wide + k
            x, per = plane[places + (k if nx > 0 else row)], rho * plane[basin["area"] + i]
            depth = max(plane[basin["plan"] + i] + y[o + i], 0.0)
            mass, more = per * depth, per * rates[first + i]
            v, dv = per * y[o + 2 * n + i], per * rates[first + 2 * n + i]
            r0, r1, r2 = r0 + mass, r1 + mass * x, r2 + mass * x * x
            d0, d1, d2 = d0 + more, d1 + more * x, d2 + more * x * x
            p0, v0, v1 = p0 + per * y[o + n + i], v0 + v, v1 + v * x
            p1, f0, f1 = p1 + per * rates[first + n + i], f0 + dv, f1 + dv * x
            g0 += mass * (plane[surface + i] - plane[basin["plan"] + i] + level + 0.5 * depth)
        m, sx, sy, lever = m + r0, sx + r1, sy + r0 * z, lever + g0
        xx, xy, yy = xx + r2, xy + r1 * z, yy + r0 * z * z
        dx, dy, dxx, dxy, dyy = dx + d1, dy + d0 * z, dxx + d2, dxy + d1 * z, dyy + d0 * z * z
        qx, qy, turn = qx + p0, qy + v0, turn + v1 - p0 * z
        fx, fy, spin = fx + p1, fy + f0, spin + f1 - p1 * z
    at = basin["frame"]
    gx, gy, gz = plane[at + GX], plane[at + GY], -plane[at + GN]
    wx, wy, wz = plane[at + WX], plane[at + WY], plane[at + WZ]
    ax, ay, az = plane[at + AX], plane[at + AY], plane[at + AZ]
    # force: M G - W' x S - W x (W x S + S' + Q) - Q'
    px, py, pz = qx + dx - wz * sy, qy + dy + wz * sx, wx * sy - wy * sx
    hx = m * gx + az * sy - (wy * pz - wz * py) - fx
    hy = m * gy - az * sx - (wz * px - wx * pz) - fy
    hz = m * gz - (ax * sy - ay * sx) - (wx * py - wy * px)
    # torque: S x G + lever n x g - I W' - I' W - H' - W x (I W + H)
    lx, ly, lz = yy * wx - xy * wy, xx * wy - xy * wx, (xx + yy) * wz + turn
    tx = sy * gz - lever * plane[at + DOWN + 1] - (yy * ax - xy * ay) - (dyy * wx - dxy * wy) - (wy * lz - wz * ly)
    ty = -sx * gz + lever * plane[at + DOWN] - (xx * ay - xy * ax) - (dxx * wy - dxy * wx) - (wz * lx - wx * lz)
    tz = sx * gy - sy * gx - (xx + yy) * az - (dxx + dyy) * wz - spin - (wx * ly - wy * lx)
    body, tank = row_of(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    rx, ry, rz = turned(out, body + ATTITUDE, plane[at : at + 3], 0)
    put(out, tank + ARM_OF, out[body + ARM] + rx, out[body + ARM + 1] + ry, out[body + ARM + 2] + rz)
    for k in range(3):
        a, c, e = plane[at + TURN + k], plane[at + TURN + 3 + k], plane[at + TURN + 6 + k]
        x, z, v = out[body + ATTITUDE], out[body + ATTITUDE + 1], out[body + ATTITUDE + 2]
        out[tank + EAST + 3 * k] = x * a + z * c + v * e
        x, z, v = out[body + ATTITUDE + 3], out[body + ATTITUDE + 4], out[body + ATTITUDE + 5]
        out[tank + EAST + 3 * k + 1] = x * a + z * c + v * e
        x, z, v = out[body + ATTITUDE + 6], out[body + ATTITUDE + 7], out[body + ATTITUDE + 8]
        out[tank + EAST + 3 * k + 2] = x * a + z * c + v * e
    put(out, tank + LOAD, hx, hy, hz)
    put(out, tank + LOAD + 3, tx, ty, tz)
    put(out, tank + MOMENTS, m, sx, sy)
    put(out, tank + MOMENTS + 3, xx, xy, yy)
    e = tank + EAST
    add_force(out, body, rx, ry, rz,
              out[e] * hx + out[e + 3] * hy + out[e + 6] * hz,
              out[e + 1] * hx + out[e + 4] * hy + out[e + 7] * hz,
              out[e + 2] * hx + out[e + 5] * hy + out[e + 8] * hz)  # fmt: skip
    add_torque(out, body,
               out[e] * tx + out[e + 3] * ty + out[e + 6] * tz,
               out[e + 1] * tx + out[e + 4] * ty + out[e + 7] * tz,
               out[e + 2] * tx + out[e + 5] * ty + out[e + 8] * tz)  # fmt: skip


@njit(forceinline=True)
def beyond(out, i, j):
    """The vector at i less that at j."""
    return out[i] - out[j], out[i + 1] - out[j + 1], out[i + 2] - out[j + 2]


@njit
def follow_bodies(t, y, dydt, out, handle):
    """Let flow feel what the accelerations of its body are beyond those with joints held."""
    tables = open_tables(handle)
    plane = tables.plane
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        row, tank = row_of(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
        rx, ry, rz = turned(out, row + ATTITUDE, plane[basin["frame"] : basin["frame"] + 3], 0)
        wx, wy, wz = beyond(out, row + TURNING, row + SPIN_BIAS)
        ax, ay, az = beyond(out, row + ACCELERATION, row + BIAS)
        ax, ay, az = ax + wy * rz - wz * ry, ay + wz * rx - wx * rz, az + wx * ry - wy * rx
        e = tank + EAST
        east, north, turn = dot(out, e, ax, ay, az), dot(out, e + 3, ax, ay, az), dot(out, e + 6, wx, wy, wz)
        if east == 0.0 and north == 0.0 and turn == 0.0:
            continue
        push_flow(plane, basin, y, dydt, basin["y"], 0.0, -east, -north, turn)
