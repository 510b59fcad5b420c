"""Frames that move: position, attitude and motion of bodies in the array `out`, and the loads on them.

Fluid on a body reads its motion here, and adds its force. A feature computes the motion. The data of body i begin at
layout["body"] + BODY_OUT i. All vectors are in axes of the world. Jointed bodies form trees. The reference point o of a
tree is the centre of mass of its root if the root is a free body, else the position of the joint of the root. So sums
over a tree do not suffer from cancellation. q'' are the accelerations of the degrees of freedom, which forces
determine; R is the rotation matrix from axes of the body to axes of the world.

The data of basin b begin at layout["tank"] + TANK_OUT b; all are 0 for a basin that is not on a body.

Arguments of the kernels here: here, row : offset in `out` of the data of a body; own : these data.
"""

from fvsolve.core.kernels.dtypes import BODY_OUT
from fvsolve.core.kernels.vectors import add_vector
from fvsolve.jit import njit

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

# data of a basin
# sums over cells of mass times 1, x, y, x^2, x y, y^2 [kg, kg m, kg m2]; x, y in axes of the basin
MOMENTS = 0
# unit vectors of the x, y and z axes of the basin, in axes of the world
EAST, NORTH, NORMAL = 6, 9, 12
BASIN_ARM = 15  # position of the origin of the basin from o, in axes of the world [m]
# force [N] and torque about its origin [N m] of the water for q'' = 0, in axes of the basin
BASIN_LOAD = 18


@njit(forceinline=True)
def body_row(tables, i):
    """Index in `out` of the first number of body i."""
    return tables.layout[0]["body"] + BODY_OUT * i


@njit(forceinline=True)
def add_force(out, row, rx, ry, rz, fx, fy, fz):
    """Add a force (fx, fy, fz) [N] to the sums FORCE and TORQUE of a body, in axes of the world.

    (rx, ry, rz) : point of application minus origin of the body [m]
    """
    add_vector(out, row + FORCE, (fx, fy, fz))
    add_vector(out, row + TORQUE, (ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx))


@njit(forceinline=True)
def add_torque(out, row, x, y, z):
    """Add a torque (x, y, z) [N m] to the sum TORQUE of a body."""
    add_vector(out, row + TORQUE, (x, y, z))
