"""Rotations: matrices, Euler angles, axis and angle, Euler parameters, and their rates; (30) to (58) of the course.

R is `R^a_b`, float64[3, 3]: it transforms components in axes b to those in axes a (35). Angles [rad], rates [rad/s].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Vector = Any  # three numbers, array-like
Matrix = np.ndarray
EDGE = 1e-12  # cosine of pitch, or sine of the second classical Euler angle, below which two angles are not separable


def skew(u: Vector) -> Matrix:
    """Skew-symmetric matrix of `u x`, (32): skew(u) @ v = u x v (33), (34)."""
    x, y, z = u
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unskew(matrix: Matrix) -> np.ndarray:
    """Vector of the skew-symmetric part of a matrix, inverse of `skew`."""
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def unit(u: Vector) -> np.ndarray:
    """Unit vector along u; nan if u is zero."""
    u = np.asarray(u, dtype=float)
    with np.errstate(invalid="ignore"):
        return u / np.linalg.norm(u)


def defect(matrix: Matrix) -> tuple[float, float]:
    """Deviation of a matrix from SO(3) (36): (greatest |entry| of R'R - I, determinant); (0, 1) for a rotation."""
    return float(np.abs(matrix.T @ matrix - np.eye(3)).max()), float(np.linalg.det(matrix))


def nearest(matrix: Matrix) -> Matrix:
    """Rotation nearest to a matrix in the Frobenius norm: its orthogonal polar factor."""
    u, _, v = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v


def about_x(phi: float) -> Matrix:
    """R_x(phi), (37)."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(theta: float) -> Matrix:
    """R_y(theta), (38)."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_z(psi: float) -> Matrix:
    """R_z(psi), (39)."""
    c, s = math.cos(psi), math.sin(psi)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def of_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Matrix:
    """R_z(yaw) R_y(pitch) R_x(roll), (40); its entry (1, 1) is cos(yaw) cos(pitch), misprinted in the summary."""
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def roll_pitch_yaw(rotation: Matrix) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of (40), pitch from -pi/2 to pi/2.

    At pitch +-pi/2 roll and yaw rotate about the same axis, and only yaw -+ roll is defined: yaw is set to 0. Near it
    both angles are sensitive to small changes, but their rotation is the given one.
    """
    level = math.hypot(rotation[0, 0], rotation[1, 0])  # cos(pitch)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0]) if level > EDGE else 0.0
    turned = about_z(-yaw) @ rotation  # R_y R_x
    return math.atan2(-turned[1, 2], turned[1, 1]), math.atan2(-rotation[2, 0], level), yaw


def of_zyz(psi: float, theta: float, phi: float) -> Matrix:
    """R_z(psi) R_y(theta) R_z(phi), the classical Euler angles (41)."""
    return about_z(psi) @ about_y(theta) @ about_z(phi)


def zyz(rotation: Matrix) -> tuple[float, float, float]:
    """(psi, theta, phi) of (41), theta from 0 to pi; at both limits only psi +- phi is defined: psi is set to 0."""
    tilt = math.hypot(rotation[0, 2], rotation[1, 2])  # sin(theta)
    psi = math.atan2(rotation[1, 2], rotation[0, 2]) if tilt > EDGE else 0.0
    turned = about_z(-psi) @ rotation  # R_y R_z
    return psi, math.atan2(tilt, rotation[2, 2]), math.atan2(turned[1, 0], turned[1, 1])


def of_axis(axis: Vector, angle: float) -> Matrix:
    """cos(angle) I + sin(angle) k x + (1 - cos(angle)) k k', (43); k : unit vector of `axis`, invariant (42)."""
    k = unit(axis)
    return math.cos(angle) * np.eye(3) + math.sin(angle) * skew(k) + (1.0 - math.cos(angle)) * np.outer(k, k)


def axis_angle(rotation: Matrix) -> tuple[np.ndarray, float]:
    """(axis, angle) of (43), angle from 0 to pi; the axis of the identity is x."""
    e = euler_parameters(rotation)
    length = float(np.linalg.norm(e[1:]))
    axis = e[1:] / length if length else np.array([1.0, 0.0, 0.0])
    return axis, 2.0 * math.atan2(length, e[0])


def of_euler_parameters(e: Any) -> Matrix:
    """I + 2 eta eps x + 2 eps x eps x, (45), of e = (eta, eps), normalised first: a rotation even if e has drifted."""
    eta, *eps = unit(e)
    cross = skew(eps)
    return np.eye(3) + 2.0 * eta * cross + 2.0 * cross @ cross


def euler_parameters(rotation: Matrix) -> np.ndarray:
    """(eta, eps) of (44), eta = cos(angle / 2) not negative, eps = axis sin(angle / 2) : float64[4].

    Computed from the column of 4 e e' with the largest diagonal entry, to avoid division by a small number.
    """
    r, trace = rotation, np.trace(rotation)
    four = np.empty((4, 4))
    four[0, 0] = 1.0 + trace
    four[0, 1:] = four[1:, 0] = 2.0 * unskew(r)
    four[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    e = unit(four[:, np.argmax(np.diag(four))])
    return -e if e[0] < 0.0 else e


def transform(rotation: Matrix, origin: Vector) -> Matrix:
    """T^a_b of (46), (47) : float64[4, 4], from R^a_b and the position of the origin of b in axes a."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, origin
    return result


def inverse(transformation: Matrix) -> Matrix:
    """T^b_a of T^a_b: R' and -R' r."""
    back = transformation[:3, :3].T
    return transform(back, -back @ transformation[:3, 3])


def angular_velocity(rotation: Matrix, rate: Matrix) -> np.ndarray:
    """w^a_ab with w x = R' R^T, (48), from a rotation and its derivative; R^T w is w^b_ab, in axes b (49)."""
    return unskew(rate @ rotation.T)


def rotation_rate(rotation: Matrix, w: Vector) -> Matrix:
    """dR/dt = (w^a x) R, first form of (49); with w in axes b it is R (w^b x), second form."""
    return skew(w) @ rotation


def jacobian_roll_pitch_yaw(pitch: float, yaw: float) -> Matrix:
    """E with w^a_ab = E (roll', pitch', yaw'): the axes of (51) after the preceding rotations, (53).

    det E = cos(pitch). So its inverse, needed to integrate the angles, grows like 1 / cos(pitch).
    """
    before = about_z(yaw)
    return np.column_stack([before @ about_y(pitch)[:, 0], before[:, 1], [0.0, 0.0, 1.0]])


def jacobian_zyz(psi: float, theta: float) -> Matrix:
    """E with w^a_ab = E (psi', theta', phi'), (53); det E = -sin(theta)."""
    before = about_z(psi)
    return np.column_stack([[0.0, 0.0, 1.0], before[:, 1], before @ about_y(theta)[:, 2]])


def euler_parameters_rate(e: Any, w: Vector) -> np.ndarray:
    """de/dt from w = w^b_ab: eta' = -eps . w / 2, eps' = (eta w + eps x w) / 2, derived from (44) and (49).

    eta^2 + eps . eps stays constant, whatever its value.
    """
    eta, eps, w = e[0], np.asarray(e[1:], dtype=float), np.asarray(w, dtype=float)
    return 0.5 * np.concatenate([[-eps @ w], eta * w + np.cross(eps, w)])


def derivative(rotation: Matrix, u: Vector, rate: Vector, w: Vector) -> np.ndarray:
    """du^a/dt = R (du^b/dt + w^b x u^b), (54), (55): rate : derivative in axes b; u, w : in axes b."""
    return rotation @ (np.asarray(rate, dtype=float) + np.cross(w, u))


def deviation(rotation: Matrix, desired: Matrix) -> Matrix:
    """R~ = R R_d', (56): rotation, in axes a, from the desired attitude R_d to the present attitude R."""
    return rotation @ desired.T


def deviation_velocity(turn: Matrix, w: Vector, desired: Vector) -> np.ndarray:
    """w~ with dR~/dt = (w~ x) R~, (58): w - R~ w_d, both in axes a; (57) omits R~, valid near R~ = I."""
    return np.asarray(w, dtype=float) - turn @ np.asarray(desired, dtype=float)
