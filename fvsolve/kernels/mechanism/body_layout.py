"""Layout of the rows of bodies in `out`, and vector operations on them.

Row i begins at layout["body"] + BODY_OUT i. All vectors are in axes of the world. The reference point o of a tree is
the centre of mass of a free root, or the position of the joint of any other root. So sums over a tree do not suffer
from cancellation. q'' are the accelerations of freedoms, joint accelerations that forces determine.
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
    """Offset of the row of body i."""
    return tables.layout[0]["body"] + BODY_OUT * i


@njit
def nearest_free_body(tables, i):
    """First body with freedoms on the way from body i to its root; -1 if there is none."""
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    return i


@njit(forceinline=True)
def freedom_path(tables, i):
    """(offset in `integers` of the freedoms that move body i, from the root on; their number); i : has freedoms."""
    last = tables.freedoms[tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"] - 1]
    return last["path"], last["depth"] + 1


@njit(forceinline=True)
def dot(a, i, x, y, z):
    """Scalar product of the vector at a[i] and (x, y, z)."""
    return a[i] * x + a[i + 1] * y + a[i + 2] * z


@njit(forceinline=True)
def cross(a, i, x, y, z):
    """Vector product of the vector at a[i] and (x, y, z) (34)."""
    return a[i + 1] * z - a[i + 2] * y, a[i + 2] * x - a[i] * z, a[i] * y - a[i + 1] * x


@njit(forceinline=True)
def freedom_velocity(work, s, x, y, z):
    """Velocity at (x, y, z) from o by unit rate of a freedom with S at scratch[s]."""
    u, v, w = cross(work, s, x, y, z)
    return work[s + 3] + u, work[s + 4] + v, work[s + 5] + w


@njit(forceinline=True)
def rotate(out, r, v, k):
    """Vector v[k:k+3] in axes of a body, transformed to axes of the world: R v, R at out[r] (35)."""
    x, y, z = v[k], v[k + 1], v[k + 2]
    return dot(out, r, x, y, z), dot(out, r + 3, x, y, z), dot(out, r + 6, x, y, z)


@njit(forceinline=True)
def rotate_back(out, r, x, y, z):
    """Vector (x, y, z) in axes of the world, transformed to axes of a body: R' v, R at out[r]."""
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
    """Add a force [N] to a body, at r from its origin [m]; all in axes of the world."""
    out[row + FORCE] += fx
    out[row + FORCE + 1] += fy
    out[row + FORCE + 2] += fz
    out[row + TORQUE] += ry * fz - rz * fy
    out[row + TORQUE + 1] += rz * fx - rx * fz
    out[row + TORQUE + 2] += rx * fy - ry * fx


@njit(forceinline=True)
def add_torque(out, row, x, y, z):
    """Add a torque [N m] to a body."""
    out[row + TORQUE] += x
    out[row + TORQUE + 1] += y
    out[row + TORQUE + 2] += z
