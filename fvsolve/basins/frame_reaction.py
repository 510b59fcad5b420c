"""Force and torque of the water in a basin on its body for zero joint accelerations, and its moments of mass."""

from fvsolve.basins.basin_frames import (
    AX,
    AXES,
    AY,
    AZ,
    CELL_POSITIONS,
    FRAME_GRAVITY,
    GN,
    GX,
    GY,
    ORIGIN,
    REST_LEVEL,
    REST_SURFACE,
    WX,
    WY,
    WZ,
)
from fvsolve.basins.frame_momentum import accelerate_row
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import TANK_OUT
from fvsolve.kernels.mechanism.body_layout import (
    ACCELERATION,
    ARM,
    ATTITUDE,
    BASIN_ARM,
    BASIN_LOAD,
    BIAS,
    EAST,
    MOMENTS,
    SPIN_BIAS,
    SPIN_RATE,
    add_force,
    add_torque,
    body_row,
)
from fvsolve.kernels.mechanism.vectors import rotate, rotate_back, write_vector


@njit
def basin_offset(tables, basin, out):
    """Vector from the origin of the body to the origin of the basin, in axes of the world [m]."""
    at = basin["frame"] + ORIGIN
    return rotate(out, body_row(tables, basin["body"]) + ATTITUDE, tables.plane[at : at + 3], 0)


@njit(forceinline=True)
def mass_factor(tables, basin):
    """Mass per area over the stored quantity: density [kg/m3] if that is a depth, thickness [m] for a liquid."""
    return tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"]


@njit(fastmath={"reassoc"})
def row_sums(deep, per_area, level, x, area, rest, surface, h, qx, qy, dh, dx, dy):
    """Sums over a row of cells: moments of mass, of its rate, of flow and of the rate of flow, and mass times height.

    Returns 13 sums in this order: mass times 1, x, x^2; rate of mass times 1, x, x^2; flow along x; flow along y times
    1, x; the same three sums of the rates of flow; mass times height of its centre (0 if not `deep`).
    deep : True for water with a free surface; per_area : result of `mass_factor`
    level : height of the level at rest above the origin; surface : undisturbed surface above this level
    x, area : positions and areas of cells; rest : depth or density at rest
    h, qx, qy : deviation of depth or density, flows; dh, dx, dy : their rates
    The compiler may reorder these sums, so that it can use vector instructions.
    """
    r0 = r1 = r2 = d0 = d1 = d2 = p0 = v0 = v1 = p1 = f0 = f1 = g0 = 0.0
    for i in range(h.size):
        depth, per = max(rest[i] + h[i], 0.0), per_area * area[i]
        mass, mass_rate, v, dv = per * depth, per * dh[i], per * qy[i], per * dy[i]
        r0, r1, r2 = r0 + mass, r1 + mass * x[i], r2 + mass * x[i] * x[i]
        d0, d1, d2 = d0 + mass_rate, d1 + mass_rate * x[i], d2 + mass_rate * x[i] * x[i]
        p0, v0, v1 = p0 + per * qx[i], v0 + v, v1 + v * x[i]
        p1, f0, f1 = p1 + per * dx[i], f0 + dv, f1 + dv * x[i]
        if deep:
            g0 += mass * (surface[i] - rest[i] + level + 0.5 * depth)
    return r0, r1, r2, d0, d1, d2, p0, v0, v1, p1, f0, f1, g0


@njit
def mass_moments(tables, basin, y, rates, first, own, twice, euler):
    """Sums over the cells of a basin, in axes of the basin: 18 numbers.

    In this order: moments 1, x, y, xx, xy, yy of mass; sum of mass times height along the normal; moments x, y, xx, xy,
    yy of the rate of mass; momentum along x and y, its moment about z; rates of these three. Units are kg, m and s.

    rates, first, own, twice, euler : as rates, first, own, twice, turn for `accelerate_flow`. On grids its Coriolis and
    Euler terms are added to `rates` here, row by row; on other meshes `frame_forces.add_frame_forces` has added them.
    """
    plane, n, o, per_area = tables.plane, basin["n"], basin["y"], mass_factor(tables, basin)
    m = sx = sy = xx = xy = yy = lever = 0.0
    dx = dy = dxx = dxy = dyy = 0.0
    qx = qy = turn = fx = fy = spin = 0.0
    nx, places = basin["nx"], int(plane[basin["frame"] + CELL_POSITIONS])
    level, deep = plane[basin["frame"] + REST_LEVEL], basin["deep"] == 1
    surface, rows, wide = int(plane[basin["frame"] + REST_SURFACE]), basin["ny"] if nx > 0 else n, nx if nx > 0 else 1
    for row in range(rows):
        z, at = plane[places + (nx if nx > 0 else n) + row], row * wide
        a, b, x = o + at, first + at, places + (0 if nx > 0 else row)
        if nx > 0 and (twice != 0.0 or euler != 0.0):
            accelerate_row(plane, basin, y, rates, first, row, own, twice, 0.0, 0.0, euler)
        r0, r1, r2, d0, d1, d2, p0, v0, v1, p1, f0, f1, g0 = row_sums(
            deep, per_area, level, plane[x : x + wide], plane[basin["area"] + at :], plane[basin["plan"] + at :],
            plane[surface + at :], y[a : a + wide], y[a + n :], y[a + 2 * n :], rates[b:], rates[b + n :],
            rates[b + 2 * n :],
        )  # fmt: skip
        m, sx, sy, lever = m + r0, sx + r1, sy + r0 * z, lever + g0
        xx, xy, yy = xx + r2, xy + r1 * z, yy + r0 * z * z
        dx, dy, dxx, dxy, dyy = dx + d1, dy + d0 * z, dxx + d2, dxy + d1 * z, dyy + d0 * z * z
        qx, qy, turn = qx + p0, qy + v0, turn + v1 - p0 * z
        fx, fy, spin = fx + p1, fy + f0, spin + f1 - p1 * z
    return m, sx, sy, xx, xy, yy, lever, dx, dy, dxx, dxy, dyy, qx, qy, turn, fx, fy, spin


@njit
def load_body(tables, basin, b, y, rates, first, own, twice, euler, out):
    """Add the force and torque of the water in basin b for zero joint accelerations to the forces on its body.

    The moments of mass, axes, origin and load of the basin are written to `out`, see `kernels.mechanism.body_layout`.
    rates, first, own, twice, euler : as for `mass_moments`
    """
    m, sx, sy, xx, xy, yy, lever, dx, dy, dxx, dxy, dyy, qx, qy, turn, fx, fy, spin = mass_moments(
        tables, basin, y, rates, first, own, twice, euler
    )
    plane, at = tables.plane, basin["frame"]
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
    tx = (
        sy * gz
        - lever * plane[at + FRAME_GRAVITY + 1]
        - (yy * ax - xy * ay)
        - (dyy * wx - dxy * wy)
        - (wy * lz - wz * ly)
    )
    ty = (
        -sx * gz + lever * plane[at + FRAME_GRAVITY] - (xx * ay - xy * ax) - (dxx * wy - dxy * wx) - (wz * lx - wx * lz)
    )
    tz = sx * gy - sy * gx - (xx + yy) * az - (dxx + dyy) * wz - spin - (wx * ly - wy * lx)
    body, tank = body_row(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    rx, ry, rz = basin_offset(tables, basin, out)
    write_vector(out, tank + MOMENTS, m, sx, sy)
    write_vector(out, tank + MOMENTS + 3, xx, xy, yy)
    for k in range(3):
        write_vector(
            out, tank + EAST + 3 * k, *rotate(out, body + ATTITUDE, plane[at + AXES + k : at + AXES + 9 : 3], 0)
        )
    write_vector(out, tank + BASIN_ARM, out[body + ARM] + rx, out[body + ARM + 1] + ry, out[body + ARM + 2] + rz)
    write_vector(out, tank + BASIN_LOAD, hx, hy, hz)
    write_vector(out, tank + BASIN_LOAD + 3, tx, ty, tz)
    add_force(out, body, rx, ry, rz, *rotate_back(out, tank + EAST, hx, hy, hz))
    add_torque(out, body, *rotate_back(out, tank + EAST, tx, ty, tz))


@njit(forceinline=True)
def vector_difference(out, i, j):
    """Vector of three numbers at out[i] minus the vector at out[j]."""
    return out[i] - out[j], out[i + 1] - out[j + 1], out[i + 2] - out[j + 2]


@njit
def extra_accelerations(tables, basin, out):
    """Acceleration of the origin of a basin and angular acceleration, minus their values for zero joint accelerations.

    The result is six numbers in axes of the world [m/s2, rad/s2].
    """
    row = body_row(tables, basin["body"])
    rx, ry, rz = basin_offset(tables, basin, out)
    wx, wy, wz = vector_difference(out, row + SPIN_RATE, row + SPIN_BIAS)
    ax, ay, az = vector_difference(out, row + ACCELERATION, row + BIAS)
    return ax + wy * rz - wz * ry, ay + wz * rx - wx * rz, az + wx * ry - wy * rx, wx, wy, wz
