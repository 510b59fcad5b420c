"""Basins that ride on bodies: what their axes do to what is in them. Knows rows of tables; knows no flux.

In axes of the basin, z along its normal, r = (x, y, 0) from its origin, which moves with acceleration a and turns at W
(65): u_t + u.grad u + g_n grad(h + bed + phi) = - 2 W_z x u - dW_z/dt x r, with G = R' ((0, 0, -g) - a), g_n = -G_z and

    g_n phi = - G_x x - G_y y - ((W_y^2 + W_z^2) x^2 - 2 W_x W_y x y + (W_x^2 + W_z^2) y^2) / 2

So tilt, accelerations and centrifugal forces are a bed that moves, phi stands where the bed stands, and water that
rests in the frame rests to round-off. Left out are what columns feel along z but at the origin, and vertical momentum:
both of the order of angle times depth over wave length.
"""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.mechanism.room import ATTITUDE, BIAS, SPIN, SPIN_BIAS, cross, row_of, turned
from fvsolve.kernels.records import NO_WEIGHT, RATE, STATUS, WHERE

AT, TURN = 0, 3  # numbers of a frame: place of its origin and attitude, by rows, in axes of its body,
GX, GY, GN, WX, WY, WZ, WZ_RATE = range(12, 19)  # G, g_n, W and dW_z/dt in its own axes,
SURFACE = 19  # offsets in `plane`: of surfaces as drawn, and of places of columns and rows, or of cells
PLACES = 20
FRAME = 21  # numbers


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
    plane[at + WZ_RATE] = seen_along(out, row, plane, axes, 2, out[e], out[e + 1], out[e + 2])


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


@njit
def turn_water(t, y, dydt, out, handle):
    """Add Coriolis and Euler forces to rates of flow."""
    tables = open_tables(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        twice, euler = 2.0 * plane[basin["frame"] + WZ], plane[basin["frame"] + WZ_RATE]
        out[RATE] = max(out[RATE], abs(twice))
        if dydt.size == 0 or (twice == 0.0 and euler == 0.0):
            continue
        n, o, nx, places = basin["n"], basin["y"], basin["nx"], int(plane[basin["frame"] + PLACES])
        for i in range(n):
            x = plane[places + (i if nx == 0 else i % nx)]
            z = plane[places + (n + i if nx == 0 else nx + i // nx)]
            depth = max(plane[basin["plan"] + i] + y[o + i], 0.0)
            dydt[o + n + i] += twice * y[o + 2 * n + i] + euler * depth * z
            dydt[o + 2 * n + i] -= twice * y[o + n + i] + euler * depth * x
