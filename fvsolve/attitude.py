"""Rotations: matrices, Euler angles, axis and angle, Euler parameters, and their rates.

Numbers (30) to (58) are equations of docs/course.md. A rotation matrix R, or `R^a_b`, is float64[3, 3] and transforms
components in axes b to components in axes a (35). R' is its transpose, R_d a desired attitude, w an angular velocity.
Angles are in [rad], rates in [rad/s]; `u x` is the skew-symmetric matrix of the cross product with u.
"""

import math
from typing import Any

import numpy as np

Vector = Any  # three numbers, array-like
Matrix = np.ndarray
# cosine of pitch, or sine of the second classical Euler angle, below which two angles are not separable
EDGE = 1e-12


def skew(u: Vector) -> Matrix:
    """Skew-symmetric matrix of the cross product (docs/course.md, 32 to 34): skew(u) @ v = u x v."""
    x, y, z = u
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unskew(matrix: Matrix) -> np.ndarray:
    """Vector of the skew-symmetric part of a matrix : float64[3]. It is the inverse of `skew`."""
    return 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )


def unit(u: Vector) -> np.ndarray:
    """Unit vector along u; nan if u is zero."""
    u = np.asarray(u, dtype=float)
    with np.errstate(invalid="ignore"):
        return u / np.linalg.norm(u)


def defect(matrix: Matrix) -> tuple[float, float]:
    """Deviation of a matrix R from a rotation matrix (docs/course.md, 36).

    Returns (greatest magnitude of an entry of R'R - I, determinant of R), which is (0, 1) for a rotation.
    """
    return float(np.abs(matrix.T @ matrix - np.eye(3)).max()), float(np.linalg.det(matrix))


def nearest(matrix: Matrix) -> Matrix:
    """Rotation matrix nearest to a matrix M in the Frobenius norm; it is the polar factor of M if det M is positive."""
    u, _, v = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v


def about_x(phi: float) -> Matrix:
    """Rotation matrix R_x(phi) about the x axis by the angle phi [rad] (docs/course.md, 37)."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(theta: float) -> Matrix:
    """Rotation matrix R_y(theta) about the y axis by the angle theta [rad] (docs/course.md, 38)."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_z(psi: float) -> Matrix:
    """Rotation matrix R_z(psi) about the z axis by the angle psi [rad] (docs/course.md, 39)."""
    c, s = math.cos(psi), math.sin(psi)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def of_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rotation matrix R_z(yaw) R_y(pitch) R_x(roll) from angles [rad] (docs/course.md, 40).

    Its first entry is cos(yaw) cos(pitch), misprinted in the summary of the course.
    """
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def roll_pitch_yaw(rotation: Matrix) -> tuple[float, float, float]:
    """Angles (roll, pitch, yaw) [rad] of a rotation matrix (docs/course.md, 40), with pitch from -pi/2 to pi/2.

    At a pitch of +-pi/2 roll and yaw rotate about the same axis, and only yaw -+ roll is defined: yaw is set to 0. Near
    this pitch, roll and yaw are sensitive to small changes, but `of_roll_pitch_yaw` still gives the rotation back.
    """
    level = math.hypot(rotation[0, 0], rotation[1, 0])  # cos(pitch)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0]) if level > EDGE else 0.0
    turned = about_z(-yaw) @ rotation  # R_y R_x
    return math.atan2(-turned[1, 2], turned[1, 1]), math.atan2(-rotation[2, 0], level), yaw


def of_zyz(psi: float, theta: float, phi: float) -> Matrix:
    """Rotation matrix R_z(psi) R_y(theta) R_z(phi) of the classical Euler angles [rad] (docs/course.md, 41)."""
    return about_z(psi) @ about_y(theta) @ about_z(phi)


def zyz(rotation: Matrix) -> tuple[float, float, float]:
    """Classical Euler angles (psi, theta, phi) [rad] of a rotation matrix (docs/course.md, 41), theta from 0 to pi.

    At theta = 0 or pi only psi +- phi is defined: psi is set to 0.
    """
    tilt = math.hypot(rotation[0, 2], rotation[1, 2])  # sin(theta)
    psi = math.atan2(rotation[1, 2], rotation[0, 2]) if tilt > EDGE else 0.0
    turned = about_z(-psi) @ rotation  # R_y R_z
    return psi, math.atan2(tilt, rotation[2, 2]), math.atan2(turned[1, 0], turned[1, 1])


def of_axis(axis: Vector, angle: float) -> Matrix:
    """Rotation matrix about an axis by an angle [rad]: cos(angle) I + sin(angle) k x + (1 - cos(angle)) k k'.

    k is the unit vector of `axis`, which the rotation does not change, and `k x` the matrix of the cross product with k
    (docs/course.md, 42 and 43).
    """
    k = unit(axis)
    return (
        math.cos(angle) * np.eye(3)
        + math.sin(angle) * skew(k)
        + (1.0 - math.cos(angle)) * np.outer(k, k)
    )


def axis_angle(rotation: Matrix) -> tuple[np.ndarray, float]:
    """Axis and angle of a rotation matrix (docs/course.md, 43) : (unit vector float64[3], angle from 0 to pi [rad]).

    The axis of the identity is x.
    """
    e = euler_parameters(rotation)
    length = float(np.linalg.norm(e[1:]))
    axis = e[1:] / length if length else np.array([1.0, 0.0, 0.0])
    return axis, 2.0 * math.atan2(length, e[0])


def of_euler_parameters(e: Any) -> Matrix:
    """Rotation matrix of the Euler parameters e = (eta, eps): I + 2 eta eps x + 2 (eps x)(eps x) (docs/course.md, 45).

    `eps x` is the matrix of the cross product with eps. The parameters are normalised first, so that the result is a
    rotation even if e has drifted.
    """
    eta, *eps = unit(e)
    cross = skew(eps)
    return np.eye(3) + 2.0 * eta * cross + 2.0 * cross @ cross


def euler_parameters(rotation: Matrix) -> np.ndarray:
    """Euler parameters e = (eta, eps) of a rotation matrix (docs/course.md, 44) : float64[4].

    eta = cos(angle / 2) is not negative; eps = axis sin(angle / 2). They are computed from the column of 4 e e' with
    the largest diagonal entry, to avoid division by a small number.
    """
    r, trace = rotation, np.trace(rotation)
    four = np.empty((4, 4))
    four[0, 0] = 1.0 + trace
    four[0, 1:] = four[1:, 0] = 2.0 * unskew(r)
    four[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    e = unit(four[:, np.argmax(np.diag(four))])
    return -e if e[0] < 0.0 else e


def transform(rotation: Matrix, origin: Vector) -> Matrix:
    """Homogeneous transformation T^a_b from axes b to axes a (docs/course.md, 46 and 47) : float64[4, 4].

    rotation : R^a_b, from components in axes b to components in axes a
    origin : position of the origin of axes b, in axes a
    """
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, origin
    return result


def inverse(transformation: Matrix) -> Matrix:
    """Inverse T^b_a of a homogeneous transformation T^a_b : float64[4, 4].

    With the rotation R and the origin r of T^a_b, its rotation is R' (transpose) and its origin -R' r.
    """
    back = transformation[:3, :3].T
    return transform(back, -back @ transformation[:3, 3])


def angular_velocity(rotation: Matrix, rate: Matrix) -> np.ndarray:
    """Angular velocity w [rad/s] of axes b relative to axes a, in axes a : float64[3], with w x = dR/dt R'.

    rotation : R^a_b; rate : dR/dt; R' is the transpose, and `w x` the matrix of the cross product with w
    (docs/course.md, 48). The product R' w is the angular velocity in axes b (49).
    """
    return unskew(rate @ rotation.T)


def rotation_rate(rotation: Matrix, w: Vector) -> Matrix:
    """Derivative dR/dt = (w x) R of a rotation matrix R (docs/course.md, 49, first form); w is in axes a [rad/s].

    `w x` is the matrix of the cross product with w. With w in axes b the derivative is R (w x), the second form.
    """
    return skew(w) @ rotation


def jacobian_roll_pitch_yaw(pitch: float, yaw: float) -> Matrix:
    """Matrix E that gives the angular velocity w = E (roll', pitch', yaw') in axes a (docs/course.md, 53).

    Primes are rates. The columns of E are the axes of rotation (51) after the preceding rotations. Its determinant is
    cos(pitch), so its inverse, which is needed to integrate the angles, grows like 1 / cos(pitch).
    """
    before = about_z(yaw)
    return np.column_stack([before @ about_y(pitch)[:, 0], before[:, 1], [0.0, 0.0, 1.0]])


def jacobian_zyz(psi: float, theta: float) -> Matrix:
    """Matrix E that gives the angular velocity w = E (psi', theta', phi') in axes a (docs/course.md, 53).

    psi, theta, phi are classical Euler angles, see `zyz`; primes are rates. det E = -sin(theta)
    """
    before = about_z(psi)
    return np.column_stack([[0.0, 0.0, 1.0], before[:, 1], before @ about_y(theta)[:, 2]])


def euler_parameters_rate(e: Any, w: Vector) -> np.ndarray:
    """Derivative of Euler parameters e = (eta, eps) : float64[4] [1/s], from the angular velocity w in axes b [rad/s].

    deta/dt = -eps . w / 2, deps/dt = (eta w + eps x w) / 2, derived from (44) and (49) of docs/course.md. The sum
    eta^2 + eps . eps stays constant, whatever its value.
    """
    eta = e[0]
    eps = np.asarray(e[1:], dtype=float)
    w = np.asarray(w, dtype=float)
    return 0.5 * np.concatenate([[-eps @ w], eta * w + np.cross(eps, w)])


def derivative(rotation: Matrix, u: Vector, rate: Vector, w: Vector) -> np.ndarray:
    """Derivative in axes a of a vector u given in axes b: R (du/dt + w x u) (docs/course.md, 54 and 55).

    rotation : R^a_b; rate : du/dt, the derivative in axes b; w : angular velocity of b relative to a, in axes b [rad/s]
    """
    return rotation @ (np.asarray(rate, dtype=float) + np.cross(w, u))


def deviation(rotation: Matrix, desired: Matrix) -> Matrix:
    """Deviation R R_d' of an attitude R from a desired attitude R_d, as a rotation matrix (docs/course.md, 56).

    It is the rotation, in axes a, from the desired to the present attitude.
    """
    return rotation @ desired.T


def deviation_velocity(turn: Matrix, w: Vector, desired: Vector) -> np.ndarray:
    """Angular velocity w - turn w_d of the deviation `turn` (docs/course.md, 58), in axes a [rad/s].

    turn : deviation of an attitude from a desired attitude, see `deviation`
    w, desired : angular velocities w of the body and w_d of its desired attitude, in axes a
    Equation (57) omits the factor `turn`; this is valid only for a deviation near the identity.
    """
    return np.asarray(w, dtype=float) - turn @ np.asarray(desired, dtype=float)
