"""Layout of the data of bodies in the array `out`, and operations on vectors in arrays.

The data of body i begin at layout["body"] + BODY_OUT i. All vectors are in axes of the world. Jointed bodies form
trees. The reference point o of a tree is the centre of mass of its root if the root is a free body, else the position
of the joint of the root. So sums over a tree do not suffer from cancellation. q'' are the accelerations of the degrees
of freedom, which forces determine; R is the rotation matrix from axes of the body to axes of the world.
"""

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import BODY_OUT

ATTITUDE = 0  # R, by rows
POSITION = 9  # position of the origin [m]
VELOCITY = 12  # velocity of the origin [m/s]
SPIN = 15  # angular velocity [rad/s]
BIAS = 18  # acceleration of the origin for q'' = 0 [m/s2]
SPIN_BIAS = 21  # angular acceleration for q'' = 0 [rad/s2]
ACCELERATION = 24  # acceleration of the origin, as solved [m/s2]
SPIN_RATE = 27  # angular acceleration, as solved [rad/s2]
FORCE = 30  # sum of all forces, with weight [N]
TORQUE = 33  # sum of all torques about the origin [N m]
ARM = 36  # position of the origin minus o [m]
VELOCITY_AT_O = 39  # velocity of the body-fixed axes at o [m/s]
BIAS_AT_O = 42  # its derivative for q'' = 0 [m/s2]


@njit(forceinline=True)
def body_row(tables, i):
    """Index in `out` of the first number of body i."""
    return tables.layout[0]["body"] + BODY_OUT * i


@njit
def nearest_free_body(tables, i):
    """First body with degrees of freedom on the way from body i, itself included, to the root of its tree; else -1."""
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    return i


@njit(forceinline=True)
def freedom_path(tables, i):
    """List of the degrees of freedom that move body i, from the root on: (its offset in `integers`, its length).

    Body i must have degrees of freedom.
    """
    last = tables.freedoms[tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"] - 1]
    return last["path"], last["depth"] + 1


@njit(forceinline=True)
def dot(a, i, x, y, z):
    """Scalar product of the vector at a[i] and (x, y, z)."""
    return a[i] * x + a[i + 1] * y + a[i + 2] * z


@njit(forceinline=True)
def cross(a, i, x, y, z):
    """Vector product of the vector at a[i] and (x, y, z)."""
    return a[i + 1] * z - a[i + 2] * y, a[i + 2] * x - a[i] * z, a[i] * y - a[i + 1] * x


@njit(forceinline=True)
def freedom_velocity(work, s, x, y, z):
    """Velocity of a point of a body per unit rate of one degree of freedom.

    (x, y, z) : position of the point from the reference point o (module docstring)
    s : offset in `work` of the angular velocity and the velocity at o per unit rate of that degree of freedom
    """
    u, v, w = cross(work, s, x, y, z)
    return work[s + 3] + u, work[s + 4] + v, work[s + 5] + w


@njit(forceinline=True)
def rotate(out, r, v, k):
    """Transform the vector v[k:k+3] from axes of a body to axes of the world; out[r] : its rotation matrix, by rows."""
    x, y, z = v[k], v[k + 1], v[k + 2]
    return dot(out, r, x, y, z), dot(out, r + 3, x, y, z), dot(out, r + 6, x, y, z)


@njit(forceinline=True)
def rotate_back(out, r, x, y, z):
    """Transform (x, y, z) from axes of the world to axes of a body; out[r] : rotation matrix of the body, by rows."""
    return (
        out[r] * x + out[r + 3] * y + out[r + 6] * z,
        out[r + 1] * x + out[r + 4] * y + out[r + 7] * z,
        out[r + 2] * x + out[r + 5] * y + out[r + 8] * z,
    )


@njit(forceinline=True)
def write_vector(out, k, x, y, z):
    """Write the vector (x, y, z) to out[k]."""
    out[k], out[k + 1], out[k + 2] = x, y, z


@njit(forceinline=True)
def add_force(out, row, rx, ry, rz, fx, fy, fz):
    """Add a force (fx, fy, fz) [N] to the sums FORCE and TORQUE of a body, in axes of the world.

    row : offset of the body in `out`; (rx, ry, rz) : point of application minus origin of the body [m]
    """
    out[row + FORCE] += fx
    out[row + FORCE + 1] += fy
    out[row + FORCE + 2] += fz
    out[row + TORQUE] += ry * fz - rz * fy
    out[row + TORQUE + 1] += rz * fx - rx * fz
    out[row + TORQUE + 2] += rx * fy - ry * fx


@njit(forceinline=True)
def add_torque(out, row, x, y, z):
    """Add a torque (x, y, z) [N m] to the sum TORQUE of a body; row : offset of the body in `out`."""
    out[row + TORQUE] += x
    out[row + TORQUE + 1] += y
    out[row + TORQUE + 2] += z
