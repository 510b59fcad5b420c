"""Accelerated frame of reference of a basin on a body, and the potential of its inertial and gravity forces.

In the axes of the basin, z is along its normal and r = (x, y, 0) is the distance from its middle. The middle has the
acceleration a, the axes rotate at the angular velocity W, and R is the rotation matrix of the axes. The equation of
motion of the water with velocity u ((65) of docs/course.md) is

    u_t + u.grad u + grad(p) / rho + grad(phi) = - 2 W_z x u - dW_z/dt x r,  G = R' ((0, 0, -g) - a)
    phi = - G_x x - G_y y - ((W_y^2 + W_z^2) x^2 - 2 W_x W_y x y + (W_x^2 + W_z^2) y^2) / 2

The water below a free surface has the weight g_n = -G_z per mass along the normal, and phi / g_n is added to the bed
elevation: tilt, accelerations and centrifugal forces act like a moving bed. In a liquid, phi is added to the
reconstructed pressure (`liquid.liquid_rates`). So water at rest in the frame stays at rest to round-off. Neglected are
accelerations along z away from the origin, and vertical momentum: both are of the order of angle times depth over wave
length.
"""

from fvsolve.core.kernels.dtypes import NO_WEIGHT, STATUS, WHERE
from fvsolve.core.kernels.moving_frames import ATTITUDE, BIAS, SPIN, SPIN_BIAS, body_row
from fvsolve.core.kernels.vectors import cross, rotate
from fvsolve.features.basins.tables import GN, open_basins
from fvsolve.jit import inline, njit

# Places of the numbers of a frame in `plane`, from the offset basin["frame"].
ORIGIN, AXES = 0, 3  # position of the origin and rotation matrix (by rows) in the axes of the body
# G, g_n (GN of the kernels), W and dW/dt in the axes of the basin
GX, GY, _, WX, WY, WZ, AX, AY, AZ = range(12, 21)
# offset in `plane` of the undisturbed surface above the level at rest [m]: 0, or a bed above it
REST_SURFACE = 21
CELL_POSITIONS = 22  # offset in `plane` of the positions of columns and rows of a grid, or of cells
FRAME_GRAVITY = 23  # gravity alone, three numbers
REST_LEVEL = 26  # level of the water at rest above the origin [m]
# liquid: offset in `work` of potentials; positions of grid lines or of sides of cells follow those of the cells
POTENTIALS = 27
FRAME_SIZE = 28  # number of numbers


@njit
def set_frames(t, y, dydt, out, handle):
    """Compute the motion of the frames of all basins on bodies, and tilt the beds of those with a free surface.

    The status is set to NO_WEIGHT if the water of such a basin has no weight along the normal of its bed.
    """
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        if basin["frame"] >= 0:
            set_frame(tables, basin, out)
            if basin["deep"] == 1:
                if not tables.plane[basin["frame"] + GN] > 0.0:
                    out[STATUS], out[WHERE] = NO_WEIGHT, b
                tilt_bed(tables.plane, basin)


@njit
def frame_component(out, row, plane, at, k, x, y, z):
    """Component of the vector (x, y, z), given in axes of the world, along axis k of the frame of a basin.

    k : 0, 1 or 2 for the x, y or z axis; row : offset of the body of the basin in `out`
    plane[at] : first entry of the rotation matrix of the frame in axes of the body, by rows
    """
    ax, ay, az = rotate(out, row + ATTITUDE, plane[at + k : at + k + 7 : 3], 0)
    return ax * x + ay * y + az * z


@njit
def set_frame(tables, basin, out):
    """Compute the motion of the frame of a basin, and write it in axes of the basin to `tables.plane`.

    The entries are gravity minus acceleration of the origin [m/s2], angular velocity [rad/s], angular acceleration
    [rad/s2], and gravity alone [m/s2]. The component of the first vector along the normal is written with the opposite
    sign (entry GN). The accelerations are those for zero accelerations of all joints.
    """
    plane = tables.plane
    at = basin["frame"]
    row = body_row(tables, basin["body"])
    rx, ry, rz = rotate(out, row + ATTITUDE, plane[at : at + 3], 0)
    ex, ey, ez = cross(out, row + SPIN_BIAS, rx, ry, rz)
    vx, vy, vz = cross(out, row + SPIN, rx, ry, rz)
    cx, cy, cz = cross(out, row + SPIN, vx, vy, vz)
    b = row + BIAS
    s = row + SPIN
    e = row + SPIN_BIAS
    gx, gy = -(out[b] + ex + cx), -(out[b + 1] + ey + cy)
    weight = -tables.settings[0]["gravity"]
    gz = weight - (out[b + 2] + ez + cz)
    axes = at + AXES
    plane[at + GX] = frame_component(out, row, plane, axes, 0, gx, gy, gz)
    plane[at + GY] = frame_component(out, row, plane, axes, 1, gx, gy, gz)
    plane[at + GN] = -frame_component(out, row, plane, axes, 2, gx, gy, gz)
    for k in range(3):
        plane[at + WX + k] = frame_component(
            out, row, plane, axes, k, out[s], out[s + 1], out[s + 2]
        )
        plane[at + AX + k] = frame_component(
            out, row, plane, axes, k, out[e], out[e + 1], out[e + 2]
        )
        plane[at + FRAME_GRAVITY + k] = frame_component(out, row, plane, axes, k, 0.0, 0.0, weight)


@njit(forceinline=True)
def potential_coefficients(plane, at, per):
    """Coefficients (fx, fy, xx, xy, yy) of the potential phi of the frame at plane[at], multiplied by `per`.

    per phi = x (fx + xx x + xy y) + y (fy + yy y); phi : potential of inertial and gravity forces [J/kg]
    """
    wx = plane[at + WX]
    wy = plane[at + WY]
    wz = plane[at + WZ]
    fx, fy = -per * plane[at + GX], -per * plane[at + GY]
    return fx, fy, -0.5 * per * (wy * wy + wz * wz), per * wx * wy, -0.5 * per * (wx * wx + wz * wz)


@njit
def tilt_bed(plane, basin):
    """Write the surface at rest of a basin [m], tilted by its frame: undisturbed surface plus potential over gravity.

    The undisturbed surface is 0 (the level at rest), or the height of the bed above that level. The depth at rest is
    constant, so the bed is tilted by the same heights. Gravity is that along the normal, the potential that of the
    frame.
    """
    at, n = basin["frame"], basin["n"]
    to, drawn = basin["plan"] + n, int(plane[at + REST_SURFACE])
    add_potential(plane, basin, 1.0 / plane[at + GN], plane[drawn : drawn + n], plane[to : to + n])


@njit
def add_potential(plane, basin, per, values, lifted):
    """Write values of all cells of a basin plus `per` times the potential of its frame [J/kg] to `lifted`."""
    n = basin["n"]
    nx = basin["nx"]
    at = int(plane[basin["frame"] + CELL_POSITIONS])
    phi = potential_coefficients(plane, basin["frame"], per)
    if nx == 0:
        add_potential_points(phi, plane[at : at + n], plane[at + n : at + 2 * n], values, lifted)
    else:
        add_potential_rows(
            phi, plane[at : at + nx], plane[at + nx : at + nx + basin["ny"]], values, lifted
        )


@njit
def add_potential_points(phi, x, y, values, lifted):
    """Write values plus the potential at the points (x, y) to `lifted`; if `values` is None, the potential alone.

    phi : result of `potential_coefficients`
    """
    fx, fy, xx, xy, yy = phi
    for i in range(lifted.size):
        rise = x[i] * (fx + xx * x[i] + xy * y[i]) + y[i] * (fy + yy * y[i])
        lifted[i] = rise if values is None else values[i] + rise


@njit
def add_potential_rows(phi, x, y, values, lifted):
    """Write values (or None) plus the potential at the cells of a grid with columns at x and rows at y to `lifted`."""
    fx, fy, xx, xy, yy = phi
    for j in range(y.size):
        a, z = j * x.size, (j + 1) * x.size
        base = None if values is None else values[a:z]
        add_potential_row(x, base, fx + xy * y[j], xx, y[j] * (fy + yy * y[j]), lifted[a:z])


@inline
def add_potential_row(x, values, slope, xx, constant, lifted):
    """Write values plus the potential at a row of cells to `lifted`; if `values` is None, the potential alone.

    The potential is x (slope + xx x) + constant, at the positions x of the cells along the row.
    """
    for i in range(lifted.size):
        rise = x[i] * (slope + xx * x[i]) + constant
        lifted[i] = rise if values is None else values[i] + rise


@njit(forceinline=True)
def cell_position(plane, basin, i):
    """Centre (x, y) of cell i in the axes of its basin [m]."""
    n = basin["n"]
    nx = basin["nx"]
    places = int(plane[basin["frame"] + CELL_POSITIONS])
    if nx == 0:
        return plane[places + i], plane[places + n + i]
    return plane[places + i % nx], plane[places + nx + i // nx]


@njit(forceinline=True)
def bed_height(plane, basin, i):
    """Height of the bed of cell i above the origin of its basin [m]."""
    at = basin["frame"]
    return (
        plane[int(plane[at + REST_SURFACE]) + i] - plane[basin["plan"] + i] + plane[at + REST_LEVEL]
    )
