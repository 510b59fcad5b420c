"""Coriolis and Euler forces on the water in basins on bodies, its load on the bodies, and its energy.

Momentum terms of the frame (`basin_frames`) are added to rates of flow. If forces move the body, its acceleration is
solved together with that of the water in its basins. Lagrange's equations ((70) of docs/course.md) are those of columns
that are point masses at mid depth and slide along the bed. The force along the bed depends on the state alone, so the
rates of flow are first computed for zero joint accelerations. The load of the water on the body then follows from its
rate of momentum (`mass_moments`). Along the normal it acts by its mass and moments, together with the inertia of bodies
(`kernels.moving_frames`). After the accelerations are solved, the rates of flow are corrected for them
(`correct_for_bodies`). A liquid is a layer of this kind without height. The total momentum is conserved to the order of
the method.

In axes of the basin the kinetic and potential energies are

    T = M V^2 / 2 + V . (W x S + Q) + W . I W / 2 + W_z H + sum over cells of rho area q^2 / (2 h)
    U = M g z - d . (S_x, S_y, lever)

M : mass; V : velocity of the origin of the basin; W : angular velocity; S, I : first and second moments of mass
Q, H : momentum relative to the basin, and its moment about z; q, h : flow per width and depth of a cell
g, z : gravity, height of the origin; d : gravity in axes of the basin; lever : sum of mass times height above the
    origin

A liquid has no lever, and its stored energy in its own axes is that of `liquid_energy`. A body that is loaded with
force F and torque T supplies the power -(F . V + T . W). The acceleration a of the origin along the normal, for zero
joint accelerations, changes the weight of the water, but does not act on columns that rise. So the model dissipates
a d/dt (sum of mass h / 2), which may be negative.

Arguments: y : states; rates, first : array of rates, and index of the first rate of the basin in it; own : 1 to include
the deviation of depth from rest, 0 for the depth at rest; twice : 2 W_z [1/s]; euler, turn : Euler term dW_z/dt [1/s2].
"""

from fvsolve.core.kernels import moving_frames as body
from fvsolve.core.kernels.dtypes import LAW_LINEAR, RATE, TANK_OUT
from fvsolve.core.kernels.moving_frames import BASIN_ARM, BASIN_LOAD, EAST, MOMENTS, body_row
from fvsolve.core.kernels.vectors import cross, dot, rotate, rotate_back, write_vector
from fvsolve.features.basins import basin_frames as frame
from fvsolve.features.basins.basin_frames import (
    CELL_POSITIONS,
    FRAME_GRAVITY,
    bed_height,
    cell_position,
)
from fvsolve.features.basins.basin_output import basin_first_row
from fvsolve.features.basins.free_surface.surface_energy import velocity_factor
from fvsolve.features.basins.tables import open_basins
from fvsolve.jit import inline, njit


@njit
def add_frame_forces(t, y, dydt, out, handle):
    """Add Coriolis and Euler forces to the rates of flow in basins on bodies, and loads of the water to the bodies.

    Under the density law `linear`, the inertia of a liquid is its inertia at rest. Loads are added only where column
    `loads_body` is 1: forces move the body, a probe observes the load of a joint, or energy is computed. The Coriolis
    rate 2 W_z raises out[RATE], which limits the step. If `dydt` is empty, the rates are those in `tables.work`.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        twice = 2.0 * tables.plane[basin["frame"] + frame.WZ]
        euler = tables.plane[basin["frame"] + frame.AZ]
        out[RATE] = max(out[RATE], abs(twice))
        to, first = (dydt, basin["y"]) if dydt.size > 0 else (tables.work, basin["boundary_rates"])
        own = 0.0 if basin["deep"] == 0 and tables.settings[0]["law"] == LAW_LINEAR else 1.0
        if (twice != 0.0 or euler != 0.0) and (basin["loads_body"] == 0 or basin["nx"] == 0):
            accelerate_flow(tables.plane, basin, y, to, first, own, twice, 0.0, 0.0, euler)
        if basin["loads_body"] == 1:
            load_body(tables, basin, b, y, to, first, own, twice, euler, out)


@njit
def correct_for_bodies(t, y, dydt, out, handle):
    """Correct the rates of flow in basins on bodies for the accelerations of the joints of these bodies.

    The inertia is that at the present depth or density, under all density laws.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        ax, ay, az, wx, wy, wz = extra_accelerations(tables, basin, out)
        (x_part, y_part, _), (_, _, turn) = (
            in_axes(tables, b, out, ax, ay, az),
            in_axes(tables, b, out, wx, wy, wz),
        )
        if x_part == 0.0 and y_part == 0.0 and turn == 0.0:
            continue
        accelerate_flow(tables.plane, basin, y, dydt, basin["y"], 1.0, 0.0, -x_part, -y_part, turn)


@njit
def accelerate_flow(plane, basin, y, rates, first, own, twice, east, north, turn):
    """Add twice (q_y, -q_x) + depth (east + turn Y, north - turn X) to the rates of the flow (q_x, q_y) of all cells.

    depth : depth of water [m], or density of a liquid [kg/m3]; (X, Y) : position of the cell [m]
    east, north : uniform acceleration [m/s2]
    """
    n = basin["n"]
    o = basin["y"]
    p = basin["plan"]
    places = int(plane[basin["frame"] + CELL_POSITIONS])
    for row in range(basin["ny"]):
        accelerate_row(plane, basin, y, rates, first, row, own, twice, east, north, turn)
    for i in range(n if basin["nx"] == 0 else 0):
        depth = max(plane[p + i] + own * y[o + i], 0.0)
        rates[first + n + i] += twice * y[o + 2 * n + i] + depth * (
            east + turn * plane[places + n + i]
        )
        rates[first + 2 * n + i] += (
            depth * (north - turn * plane[places + i]) - twice * y[o + n + i]
        )


@njit
def accelerate_row(plane, basin, y, rates, first, row, own, twice, east, north, turn):
    """Add the terms of `accelerate_flow` to the rates of row `row` of the cells of a grid."""
    n = basin["n"]
    nx = basin["nx"]
    places = int(plane[basin["frame"] + CELL_POSITIONS])
    at, level = row * nx, plane[places + nx + row]
    a = basin["y"] + at
    p = basin["plan"] + at
    to = first + n + at
    state = y[a : a + nx], y[a + n : a + n + nx], y[a + 2 * n : a + 2 * n + nx]
    accelerate_arrays(
        plane[places : places + nx],
        plane[p : p + nx],
        state,
        own,
        twice,
        east + turn * level,
        north,
        turn,
        rates[to : to + nx],
        rates[to + n : to + n + nx],
    )


@inline
def accelerate_arrays(x, rest, state, own, twice, east, north, turn, rate_x, rate_y):
    """Add the terms of `accelerate_flow` to the rates rate_x, rate_y of a row of cells, given by its arrays.

    x : positions; rest : depths at rest; state : deviations from them, and flows along x and y
    east : uniform acceleration plus turn y of the row
    """
    dh, qx, qy = state
    for i in range(rate_x.size):
        depth = max(rest[i] + own * dh[i], 0.0)
        rate_x[i] += twice * qy[i] + depth * east
        rate_y[i] += depth * (north - turn * x[i]) - twice * qx[i]


@njit
def basin_offset(tables, basin, out):
    """Vector from the origin of the body to the origin of the basin, in axes of the world [m]."""
    at = basin["frame"] + frame.ORIGIN
    return rotate(
        out, body_row(tables, basin["body"]) + body.ATTITUDE, tables.plane[at : at + 3], 0
    )


@njit(forceinline=True)
def mass_factor(tables, basin):
    """Mass per area over the stored quantity: density [kg/m3] if that is a depth, thickness [m] for a liquid."""
    return tables.settings[0]["rho"] if basin["deep"] == 1 else basin["thickness"]


@njit(fastmath={"reassoc"})
def row_sums(deep, per_area, level, x, area, rest, surface, state, rates):
    """Sums over a row of cells: moments of mass, of its rate, of flow and of the rate of flow, and mass times height.

    Returns 13 sums in this order: mass times 1, x, x^2; rate of mass times 1, x, x^2; flow along x; flow along y times
    1, x; the same three sums of the rates of flow; mass times height of its centre (0 if not `deep`).
    deep : True for water with a free surface; per_area : result of `mass_factor`
    level : height of the level at rest above the origin; surface : undisturbed surface above this level
    x, area : positions and areas of cells; rest : depth or density at rest
    state, rates : deviation of depth or density, flows along x and y; their rates
    The compiler may reorder these sums, so that it can use vector instructions.
    """
    (h, qx, qy), (dh, dx, dy) = state, rates
    r0 = r1 = r2 = d0 = d1 = d2 = p0 = v0 = v1 = p1 = f0 = f1 = g0 = 0.0
    for i in range(h.size):
        depth, per = max(rest[i] + h[i], 0.0), per_area * area[i]
        mass = per * depth
        mass_rate = per * dh[i]
        v = per * qy[i]
        dv = per * dy[i]
        r0 = r0 + mass
        r1 = r1 + mass * x[i]
        r2 = r2 + mass * x[i] * x[i]
        d0 = d0 + mass_rate
        d1 = d1 + mass_rate * x[i]
        d2 = d2 + mass_rate * x[i] * x[i]
        p0 = p0 + per * qx[i]
        v0 = v0 + v
        v1 = v1 + v * x[i]
        p1 = p1 + per * dx[i]
        f0 = f0 + dv
        f1 = f1 + dv * x[i]
        if deep:
            g0 += mass * (surface[i] - rest[i] + level + 0.5 * depth)
    return r0, r1, r2, d0, d1, d2, p0, v0, v1, p1, f0, f1, g0


@njit
def mass_moments(tables, basin, y, rates, first, own, twice, euler):
    """Sums over the cells of a basin, in axes of the basin: 18 numbers.

    In this order: moments 1, x, y, xx, xy, yy of mass; sum of mass times height along the normal; moments x, y, xx, xy,
    yy of the rate of mass; momentum along x and y, its moment about z; rates of these three. Units are kg, m and s.

    On grids the Coriolis and Euler terms of `accelerate_flow` are added to `rates` here, row by row; on other meshes
    `add_frame_forces` has added them.
    """
    plane = tables.plane
    n = basin["n"]
    o = basin["y"]
    per_area = mass_factor(tables, basin)
    m = sx = sy = xx = xy = yy = lever = 0.0
    dx = dy = dxx = dxy = dyy = 0.0
    qx = qy = turn = fx = fy = spin = 0.0
    nx, places = basin["nx"], int(plane[basin["frame"] + CELL_POSITIONS])
    level, deep = plane[basin["frame"] + frame.REST_LEVEL], basin["deep"] == 1
    surface = int(plane[basin["frame"] + frame.REST_SURFACE])
    rows, wide = (basin["ny"], nx) if nx > 0 else (n, 1)
    for row in range(rows):
        z, at = plane[places + (nx if nx > 0 else n) + row], row * wide
        a = o + at
        b = first + at
        x = places + (0 if nx > 0 else row)
        if nx > 0 and (twice != 0.0 or euler != 0.0):
            accelerate_row(plane, basin, y, rates, first, row, own, twice, 0.0, 0.0, euler)
        state = (y[a : a + wide], y[a + n :], y[a + 2 * n :])
        change = (rates[b:], rates[b + n :], rates[b + 2 * n :])
        r0, r1, r2, d0, d1, d2, p0, v0, v1, p1, f0, f1, g0 = row_sums(
            deep,
            per_area,
            level,
            plane[x : x + wide],
            plane[basin["area"] + at :],
            plane[basin["plan"] + at :],
            plane[surface + at :],
            state,
            change,
        )
        m = m + r0
        sx = sx + r1
        sy = sy + r0 * z
        lever = lever + g0
        xx = xx + r2
        xy = xy + r1 * z
        yy = yy + r0 * z * z
        dx = dx + d1
        dy = dy + d0 * z
        dxx = dxx + d2
        dxy = dxy + d1 * z
        dyy = dyy + d0 * z * z
        qx = qx + p0
        qy = qy + v0
        turn = turn + v1 - p0 * z
        fx = fx + p1
        fy = fy + f0
        spin = spin + f1 - p1 * z
    return m, sx, sy, xx, xy, yy, lever, dx, dy, dxx, dxy, dyy, qx, qy, turn, fx, fy, spin


@njit
def load_body(tables, basin, b, y, rates, first, own, twice, euler, out):
    """Add the force and torque of the water in basin b for zero joint accelerations to the forces on its body.

    The moments of mass, axes, origin and load of the basin are written to `out`, see `kernels.moving_frames`.
    """
    m, sx, sy, xx, xy, yy, lever, dx, dy, dxx, dxy, dyy, qx, qy, turn, fx, fy, spin = mass_moments(
        tables, basin, y, rates, first, own, twice, euler
    )
    plane, at = tables.plane, basin["frame"]
    gx = plane[at + frame.GX]
    gy = plane[at + frame.GY]
    gz = -plane[at + frame.GN]
    wx = plane[at + frame.WX]
    wy = plane[at + frame.WY]
    wz = plane[at + frame.WZ]
    ax = plane[at + frame.AX]
    ay = plane[at + frame.AY]
    az = plane[at + frame.AZ]
    # force: M G - W' x S - W x (W x S + S' + Q) - Q'
    px = qx + dx - wz * sy
    py = qy + dy + wz * sx
    pz = wx * sy - wy * sx
    hx = m * gx + az * sy - (wy * pz - wz * py) - fx
    hy = m * gy - az * sx - (wz * px - wx * pz) - fy
    hz = m * gz - (ax * sy - ay * sx) - (wx * py - wy * px)
    # torque: S x G + lever n x g - I W' - I' W - H' - W x (I W + H)
    lx = yy * wx - xy * wy
    ly = xx * wy - xy * wx
    lz = (xx + yy) * wz + turn
    down_x, down_y = plane[at + FRAME_GRAVITY], plane[at + FRAME_GRAVITY + 1]
    tx = (
        sy * gz - lever * down_y - (yy * ax - xy * ay) - (dyy * wx - dxy * wy) - (wy * lz - wz * ly)
    )
    ty = (
        -sx * gz
        + lever * down_x
        - (xx * ay - xy * ax)
        - (dxx * wy - dxy * wx)
        - (wz * lx - wx * lz)
    )
    tz = sx * gy - sy * gx - (xx + yy) * az - (dxx + dyy) * wz - spin - (wx * ly - wy * lx)
    row, tank = body_row(tables, basin["body"]), tables.layout[0]["tank"] + TANK_OUT * b
    rx, ry, rz = basin_offset(tables, basin, out)
    write_vector(out, tank + MOMENTS, m, sx, sy)
    write_vector(out, tank + MOMENTS + 3, xx, xy, yy)
    for k in range(3):
        axis = plane[at + frame.AXES + k : at + frame.AXES + 9 : 3]
        write_vector(out, tank + EAST + 3 * k, *rotate(out, row + body.ATTITUDE, axis, 0))
    arm = row + body.ARM
    write_vector(out, tank + BASIN_ARM, out[arm] + rx, out[arm + 1] + ry, out[arm + 2] + rz)
    write_vector(out, tank + BASIN_LOAD, hx, hy, hz)
    write_vector(out, tank + BASIN_LOAD + 3, tx, ty, tz)
    body.add_force(out, row, rx, ry, rz, *rotate_back(out, tank + EAST, hx, hy, hz))
    body.add_torque(out, row, *rotate_back(out, tank + EAST, tx, ty, tz))


@njit
def extra_accelerations(tables, basin, out):
    """Acceleration of the origin of a basin and angular acceleration, minus their values for zero joint accelerations.

    The result is six numbers in axes of the world [m/s2, rad/s2].
    """
    row = body_row(tables, basin["body"])
    rx, ry, rz = basin_offset(tables, basin, out)
    s = row + body.SPIN_RATE
    e = row + body.SPIN_BIAS
    a = row + body.ACCELERATION
    o = row + body.BIAS
    wx = out[s] - out[e]
    wy = out[s + 1] - out[e + 1]
    wz = out[s + 2] - out[e + 2]
    ax = out[a] - out[o]
    ay = out[a + 1] - out[o + 1]
    az = out[a + 2] - out[o + 2]
    return ax + wy * rz - wz * ry, ay + wz * rx - wx * rz, az + wx * ry - wy * rx, wx, wy, wz


@njit
def in_axes(tables, b, out, x, y, z):
    """Vector (x, y, z) of the world in axes of basin b : three numbers."""
    e = tables.layout[0]["tank"] + TANK_OUT * b + EAST
    return dot(out, e, x, y, z), dot(out, e + 3, x, y, z), dot(out, e + 6, x, y, z)


@njit
def origin_velocity(tables, basin, b, out):
    """Velocity (x, y, z) of the origin of basin b, in axes of the basin [m/s]."""
    row = body_row(tables, basin["body"])
    x, y, z = basin_offset(tables, basin, out)
    u, v, w = cross(out, row + body.SPIN, x, y, z)
    k = row + body.VELOCITY
    return in_axes(tables, b, out, u + out[k], v + out[k + 1], w + out[k + 2])


@njit
def origin_acceleration(tables, basin, b, out):
    """Acceleration [m/s2] and angular acceleration [rad/s2] of the origin of basin b, in its own axes: six numbers."""
    row = body_row(tables, basin["body"])
    x, y, z = basin_offset(tables, basin, out)
    u, v, w = cross(out, row + body.SPIN, x, y, z)
    cx, cy, cz = cross(out, row + body.SPIN, u, v, w)
    tx, ty, tz = cross(out, row + body.SPIN_RATE, x, y, z)
    a, t = row + body.ACCELERATION, row + body.SPIN_RATE
    ax, ay, az = in_axes(
        tables, b, out, out[a] + cx + tx, out[a + 1] + cy + ty, out[a + 2] + cz + tz
    )
    bx, by, bz = in_axes(tables, b, out, out[t], out[t + 1], out[t + 2])
    return ax, ay, az, bx, by, bz


@njit
def body_load(tables, basin, b, out):
    """Force [N] and torque [N m] of the water of basin b on its body, in axes of the basin: six numbers.

    They are the load for zero accelerations of joints, plus the inertial load along the normal that the accelerations
    of joints cause.
    """
    ax, ay, az, wx, wy, wz = extra_accelerations(tables, basin, out)
    tank = tables.layout[0]["tank"] + TANK_OUT * b
    m, f = tank + MOMENTS, tank + BASIN_LOAD
    (_, _, a), (d, c, _) = in_axes(tables, b, out, ax, ay, az), in_axes(tables, b, out, wx, wy, wz)
    normal_force = out[m] * a - out[m + 1] * c + out[m + 2] * d
    moment_x = out[m + 2] * a - out[m + 4] * c + out[m + 5] * d
    moment_y = out[m + 1] * a - out[m + 3] * c + out[m + 4] * d
    return (
        out[f],
        out[f + 1],
        out[f + 2] - normal_force,
        out[f + 3] - moment_x,
        out[f + 4] + moment_y,
        out[f + 5],
    )


@njit
def add_power(t, y, dydt, out, handle, power):
    """Add the power that bodies supply to the water in their basins to `power` [W].

    The rate of storage and the power that the model dissipates are written to the entries of `basin_output` too.
    """
    tables = open_basins(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        at, row = basin["frame"], basin_first_row(tables, power, b)
        vx, vy, vz = origin_velocity(tables, basin, b, out)
        wx = plane[at + frame.WX]
        wy = plane[at + frame.WY]
        wz = plane[at + frame.WZ]
        fx, fy, fz, tx, ty, tz = body_load(tables, basin, b, out)
        power[row] -= fx * vx + fy * vy + fz * vz + tx * wx + ty * wy + tz * wz
        own = 0.0 if basin["deep"] == 1 else power[row + 3]
        power[row + 3] = own + energy_rate(tables, basin, b, y, dydt, out, vx, vy, vz)
        power[row + 4] = (plane[at + frame.GN] + plane[at + FRAME_GRAVITY + 2]) * rise_moment(
            tables, basin, y, dydt
        )


@njit
def rise_moment(tables, basin, y, dydt):
    """Time derivative of the sum over cells of mass times depth / 2 [kg m/s]; 0 for a liquid."""
    plane = tables.plane
    total = 0.0
    n = basin["n"]
    o = basin["y"]
    for i in range(n if basin["deep"] == 1 else 0):
        total += (
            plane[basin["area"] + i] * max(plane[basin["plan"] + i] + y[o + i], 0.0) * dydt[o + i]
        )
    return tables.settings[0]["rho"] * total


@njit
def energy_rate(tables, basin, b, y, dydt, out, vx, vy, vz):
    """Rate of kinetic and potential energy of the water in basin b [W]; vx, vy, vz : result of `origin_velocity`.

    For a liquid the energy in its own axes, see `liquid_energy`, is left out.
    """
    plane = tables.plane
    n = basin["n"]
    o = basin["y"]
    at = basin["frame"]
    per_area = mass_factor(tables, basin)
    m = tables.layout[0]["tank"] + TANK_OUT * b + MOMENTS
    wx = plane[at + frame.WX]
    wy = plane[at + frame.WY]
    wz = plane[at + frame.WZ]
    ax, ay, az, bx, by, bz = origin_acceleration(tables, basin, b, out)
    qx = qy = turn = fx = fy = spin = own_rate = lever = high = 0.0
    dx = dy = dxx = dxy = dyy = 0.0
    for i in range(n):
        x, z = cell_position(plane, basin, i)
        per = per_area * plane[basin["area"] + i]
        depth = max(plane[basin["plan"] + i] + y[o + i], 0.0)
        p = y[o + n + i]
        q = y[o + 2 * n + i]
        mass_rate = per * dydt[o + i]
        dp, dq = dydt[o + n + i], dydt[o + 2 * n + i]
        qx = qx + per * p
        qy = qy + per * q
        turn = turn + per * (x * q - z * p)
        fx = fx + per * dp
        fy = fy + per * dq
        spin = spin + per * (x * dq - z * dp)
        dx, dy = dx + mass_rate * x, dy + mass_rate * z
        dxx = dxx + mass_rate * x * x
        dxy = dxy + mass_rate * x * z
        dyy = dyy + mass_rate * z * z
        if basin["deep"] == 1:
            share, bed = velocity_factor(depth), bed_height(plane, basin, i)
            u, v = share * p, share * q
            own_rate += per * (u * dp + v * dq) - 0.5 * mass_rate * (u * u + v * v)
            lever = lever + per * depth * (bed + 0.5 * depth)
            high = high + mass_rate * (bed + depth)
    mass = out[m]
    sx = out[m + 1]
    sy = out[m + 2]
    xx = out[m + 3]
    xy = out[m + 4]
    yy = out[m + 5]
    # of its parts
    ax = ax - (wy * vz - wz * vy)
    ay = ay - (wz * vx - wx * vz)
    az = az - (wx * vy - wy * vx)
    px = mass * vx + qx - wz * sy
    py = mass * vy + qy + wz * sx
    pz = mass * vz + wx * sy - wy * sx
    total = px * ax + py * ay + pz * az
    fz = bx * sy - by * sx + wx * dy - wy * dx
    total += vx * (fx - bz * sy - wz * dy) + vy * (fy + bz * sx + wz * dx) + vz * fz
    total += (yy * wx - xy * wy) * bx + (xx * wy - xy * wx) * by + (xx + yy) * wz * bz
    total += 0.5 * (dyy * wx * wx - 2.0 * dxy * wx * wy + dxx * wy * wy + (dxx + dyy) * wz * wz)
    total += bz * turn + wz * spin + own_rate
    gx = plane[at + FRAME_GRAVITY]
    gy = plane[at + FRAME_GRAVITY + 1]
    gz = plane[at + FRAME_GRAVITY + 2]
    total -= mass * (gx * vx + gy * vy + gz * vz) + gx * dx + gy * dy + gz * high
    return total + (wy * gz - wz * gy) * sx + (wz * gx - wx * gz) * sy + (wx * gy - wy * gx) * lever


@njit
def add_stored(t, y, dydt, out, handle, stored):
    """Write the kinetic plus potential energy [J] of the water in basins on bodies to `stored`.

    The potential energy is zero at elevation 0. For a liquid the result is added to the entry of `stored`, the energy
    of the liquid in axes of the basin. For water with a free surface it replaces the entry.
    """
    tables = open_basins(handle)
    plane = tables.plane
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] < 0:
            continue
        n = basin["n"]
        o = basin["y"]
        at = basin["frame"]
        m = tables.layout[0]["tank"] + TANK_OUT * b
        per_area = mass_factor(tables, basin)
        vx, vy, vz = origin_velocity(tables, basin, b, out)
        wx = plane[at + frame.WX]
        wy = plane[at + frame.WY]
        wz = plane[at + frame.WZ]
        qx = qy = turn = inner = lever = 0.0
        for i in range(n):
            x, z = cell_position(plane, basin, i)
            per = per_area * plane[basin["area"] + i]
            depth = max(plane[basin["plan"] + i] + y[o + i], 0.0)
            p, q = y[o + n + i], y[o + 2 * n + i]
            qx = qx + per * p
            qy = qy + per * q
            turn = turn + per * (x * q - z * p)
            if basin["deep"] == 1:
                inner += 0.5 * per * velocity_factor(depth) * (p * p + q * q)
                lever += per * depth * (bed_height(plane, basin, i) + 0.5 * depth)
        mass = out[m]
        sx = out[m + 1]
        sy = out[m + 2]
        xx = out[m + 3]
        xy = out[m + 4]
        yy = out[m + 5]
        total = 0.5 * mass * (vx * vx + vy * vy + vz * vz)
        total += vx * (qx - wz * sy) + vy * (qy + wz * sx) + vz * (wx * sy - wy * sx)
        total += (
            0.5 * (yy * wx * wx - 2.0 * xy * wx * wy + xx * wy * wy + (xx + yy) * wz * wz)
            + wz * turn
            + inner
        )
        row = body_row(tables, basin["body"])
        height = out[row + body.POSITION + 2] + basin_offset(tables, basin, out)[2]
        total += mass * tables.settings[0]["gravity"] * height
        gx = plane[at + FRAME_GRAVITY]
        gy = plane[at + FRAME_GRAVITY + 1]
        gz = plane[at + FRAME_GRAVITY + 2]
        total -= gx * sx + gy * sy + gz * lever
        k = stored.size - tables.basins.size + b
        stored[k] = total + (0.0 if basin["deep"] == 1 else stored[k])
