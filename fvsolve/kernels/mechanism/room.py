"""Where in `out` it stands what is known of a body, and vectors there. Knows offsets; knows no law.

Row i begins at layout["body"] + BODY_OUT i. All in axes of the world; the point of reference o of a tree is the centre
of mass of a free root, the joint's place of another: what is summed over a tree is then no small difference.
"""

from fvsolve.jit import njit
from fvsolve.kernels.records import BODY_OUT

ATTITUDE = 0  # R, by rows
PLACE = 9  # of the body's origin [m]
VELOCITY = 12  # of the body's origin [m/s]
SPIN = 15  # angular velocity [rad/s]
BIAS = 18  # acceleration of the origin without those of joints that forces decide [m/s2]
SPIN_BIAS = 21  # and angular acceleration [rad/s2]
ACCELERATION = 24  # of the origin, and
TURNING = 27  # angular acceleration, once they are solved
FORCE = 30  # of all that pushes it, weight included [N], and
TORQUE = 33  # about its origin [N m]
ARM = 36  # place less o [m]
STREAM = 39  # velocity that its axes have at o [m/s]
APPARENT = 42  # d/dt of that without accelerations of joints [m/s2]


@njit(forceinline=True)
def row_of(tables, i):
    """Where the row of body i begins."""
    return tables.layout[0]["body"] + BODY_OUT * i


@njit
def carrier(tables, i):
    """The body nearest to body i on the way to its root that forces move; -1 for none."""
    while i >= 0 and tables.bodies[i]["freedoms"] == 0:
        i = tables.bodies[i]["parent"]
    return i


@njit(forceinline=True)
def path_of(tables, i):
    """Where in `integers` the freedoms that move body i stand, from the root on, and how many; i : a `carrier`."""
    last = tables.freedoms[tables.bodies[i]["freedom"] + tables.bodies[i]["freedoms"] - 1]
    return last["path"], last["depth"] + 1


@njit(forceinline=True)
def dot(a, i, x, y, z):
    """Product of the vector at a[i] and another."""
    return a[i] * x + a[i + 1] * y + a[i + 2] * z


@njit(forceinline=True)
def cross(a, i, x, y, z):
    """Vector product of the vector at a[i] and another (34)."""
    return a[i + 1] * z - a[i + 2] * y, a[i + 2] * x - a[i] * z, a[i] * y - a[i + 1] * x


@njit(forceinline=True)
def given(work, s, x, y, z):
    """Velocity at (x, y, z) from o that a freedom gives, its S at scratch[s]."""
    u, v, w = cross(work, s, x, y, z)
    return work[s + 3] + u, work[s + 4] + v, work[s + 5] + w


@njit(forceinline=True)
def turned(out, r, v, k):
    """The vector v[k:k+3] of a body as the world sees it: R v, R at out[r] (35)."""
    x, y, z = v[k], v[k + 1], v[k + 2]
    return dot(out, r, x, y, z), dot(out, r + 3, x, y, z), dot(out, r + 6, x, y, z)


@njit(forceinline=True)
def back(out, r, x, y, z):
    """A vector of the world as a body sees it: R' v."""
    return (
        out[r] * x + out[r + 3] * y + out[r + 6] * z,
        out[r + 1] * x + out[r + 4] * y + out[r + 7] * z,
        out[r + 2] * x + out[r + 5] * y + out[r + 8] * z,
    )


@njit(forceinline=True)
def put(out, k, x, y, z):
    """Write a vector."""
    out[k], out[k + 1], out[k + 2] = x, y, z


@njit(forceinline=True)
def add_force(out, row, rx, ry, rz, fx, fy, fz):
    """Add a force [N] on a body at r from its origin, in axes of the world [m]."""
    out[row + FORCE] += fx
    out[row + FORCE + 1] += fy
    out[row + FORCE + 2] += fz
    out[row + TORQUE] += ry * fz - rz * fy
    out[row + TORQUE + 1] += rz * fx - rx * fz
    out[row + TORQUE + 2] += rx * fy - ry * fx


@njit(forceinline=True)
def add_torque(out, row, x, y, z):
    """Add a torque [N m] on a body."""
    out[row + TORQUE] += x
    out[row + TORQUE + 1] += y
    out[row + TORQUE + 2] += z
