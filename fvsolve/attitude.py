"""Rotations, how they are said and how they turn. Knows (30) to (58) of the course; knows no body and no case.

R is `R^a_b`, float64[3, 3]: it turns what axes b see into what axes a see (35). Angles [rad], rates [rad/s].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Vector = Any  # three numbers, as numpy reads them
Matrix = np.ndarray
EDGE = 1e-12  # cosine of pitch, or sine of the second of classical angles, below which two angles are one


def skew(u: Vector) -> Matrix:
    """The matrix that `u x` is, (32): skew(u) @ v = u x v (33), (34)."""
    x, y, z = u
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unskew(matrix: Matrix) -> np.ndarray:
    """The vector of a skew-symmetric matrix, of any other that of its skew part."""
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def unit(u: Vector) -> np.ndarray:
    """A vector of length 1 along u; nan of none."""
    u = np.asarray(u, dtype=float)
    with np.errstate(invalid="ignore"):
        return u / np.linalg.norm(u)


def defect(matrix: Matrix) -> tuple[float, float]:
    """How far a matrix is from SO(3) (36): the largest entry of R'R - I, and the determinant, 1 of a rotation."""
    return float(np.abs(matrix.T @ matrix - np.eye(3)).max()), float(np.linalg.det(matrix))


def nearest(matrix: Matrix) -> Matrix:
    """The rotation nearest to a matrix in the sum of squares: its orthogonal factor."""
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
    """R_z(yaw) R_y(pitch) R_x(roll), (40); its entry (1, 1) is cos(yaw) cos(pitch), which the summary misprints."""
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def roll_pitch_yaw(rotation: Matrix) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of (40), pitch from -pi/2 to pi/2.

    At pitch +-pi/2 roll and yaw turn about one line, and only yaw -+ roll is there: yaw is 0, all is roll. Next to it
    both swing fast, but their rotation is the given one.
    """
    level = math.hypot(rotation[0, 0], rotation[1, 0])  # cos(pitch)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0]) if level > EDGE else 0.0
    turned = about_z(-yaw) @ rotation  # R_y R_x
    return math.atan2(-turned[1, 2], turned[1, 1]), math.atan2(-rotation[2, 0], level), yaw


def of_zyz(psi: float, theta: float, phi: float) -> Matrix:
    """R_z(psi) R_y(theta) R_z(phi), the classical Euler angles (41)."""
    return about_z(psi) @ about_y(theta) @ about_z(phi)


def zyz(rotation: Matrix) -> tuple[float, float, float]:
    """(psi, theta, phi) of (41), theta from 0 to pi; at both ends only psi +- phi is there: psi is 0, all is phi."""
    tilt = math.hypot(rotation[0, 2], rotation[1, 2])  # sin(theta)
    psi = math.atan2(rotation[1, 2], rotation[0, 2]) if tilt > EDGE else 0.0
    turned = about_z(-psi) @ rotation  # R_y R_z
    return psi, math.atan2(tilt, rotation[2, 2]), math.atan2(turned[1, 0], turned[1, 1])


def of_axis(axis: Vector, angle: float) -> Matrix:
    """cos(angle) I + sin(angle) k x + (1 - cos(angle)) k k', (43), k of length 1 along `axis`, which stays (42)."""
    k = unit(axis)
    return math.cos(angle) * np.eye(3) + math.sin(angle) * skew(k) + (1.0 - math.cos(angle)) * np.outer(k, k)


def axis_angle(rotation: Matrix) -> tuple[np.ndarray, float]:
    """(axis, angle) of (43), angle from 0 to pi; no rotation is one by 0 about x."""
    e = euler_parameters(rotation)
    length = float(np.linalg.norm(e[1:]))
    axis = e[1:] / length if length else np.array([1.0, 0.0, 0.0])
    return axis, 2.0 * math.atan2(length, e[0])


def of_euler_parameters(e: Any) -> Matrix:
    """I + 2 eta eps x + 2 eps x eps x, (45), of e = (eta, eps) over its length: a rotation where e has drifted too."""
    eta, *eps = unit(e)
    cross = skew(eps)
    return np.eye(3) + 2.0 * eta * cross + 2.0 * cross @ cross


def euler_parameters(rotation: Matrix) -> np.ndarray:
    """(eta, eps) of (44), eta = cos(angle / 2) not negative, eps = axis sin(angle / 2) : float64[4].

    The column of 4 e e' whose diagonal is largest, so that no small number is divided by.
    """
    r, trace = rotation, np.trace(rotation)
    four = np.empty((4, 4))
    four[0, 0] = 1.0 + trace
    four[0, 1:] = four[1:, 0] = 2.0 * unskew(r)
    four[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    e = unit(four[:, np.argmax(np.diag(four))])
    return -e if e[0] < 0.0 else e


def transform(rotation: Matrix, place: Vector) -> Matrix:
    """T^a_b of (46), (47) : float64[4, 4], of R^a_b and where the origin of b lies in axes a."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, place
    return made


def inverse(made: Matrix) -> Matrix:
    """T^b_a of T^a_b: R' and -R' r."""
    back = made[:3, :3].T
    return transform(back, -back @ made[:3, 3])


def angular_velocity(rotation: Matrix, rate: Matrix) -> np.ndarray:
    """w^a_ab with w x = R' R^T, (48), of a rotation and its derivative; R^T w is the one in b, w^b_ab (49)."""
    return unskew(rate @ rotation.T)


def rotation_rate(rotation: Matrix, w: Vector) -> Matrix:
    """dR/dt = (w^a x) R, the first of (49); of w in b it is R (w^b x), the second."""
    return skew(w) @ rotation


def jacobian_roll_pitch_yaw(pitch: float, yaw: float) -> Matrix:
    """E with w^a_ab = E (roll', pitch', yaw'): the axes of (51) after the turns before them, (53).

    det E = cos(pitch): its inverse, which angles would be integrated by, is as large as 1 / cos(pitch).
    """
    before = about_z(yaw)
    return np.column_stack([before @ about_y(pitch)[:, 0], before[:, 1], [0.0, 0.0, 1.0]])


def jacobian_zyz(psi: float, theta: float) -> Matrix:
    """E with w^a_ab = E (psi', theta', phi'), (53); det E = -sin(theta)."""
    before = about_z(psi)
    return np.column_stack([[0.0, 0.0, 1.0], before[:, 1], before @ about_y(theta)[:, 2]])


def euler_parameters_rate(e: Any, w: Vector) -> np.ndarray:
    """de/dt of w^b_ab: eta' = -eps . w / 2, eps' = (eta w + eps x w) / 2, which (44) and (49) make of each other.

    It keeps eta^2 + eps . eps, whatever that is.
    """
    eta, eps, w = e[0], np.asarray(e[1:], dtype=float), np.asarray(w, dtype=float)
    return 0.5 * np.concatenate([[-eps @ w], eta * w + np.cross(eps, w)])


def derivative(rotation: Matrix, u: Vector, rate: Vector, w: Vector) -> np.ndarray:
    """du^a/dt = R (du^b/dt + w^b x u^b), (54): of a vector that is seen from b and whose rate there is `rate`; (55)."""
    return rotation @ (np.asarray(rate, dtype=float) + np.cross(w, u))


def deviation(rotation: Matrix, wanted: Matrix) -> Matrix:
    """R~ = R R_d', (56): the turn, in axes a, from the attitude that is wanted to the one that is."""
    return rotation @ wanted.T


def deviation_velocity(turn: Matrix, w: Vector, wanted: Vector) -> np.ndarray:
    """w~ with dR~/dt = (w~ x) R~, (58): w - R~ w_d, of both in axes a; (57) leaves out R~, which holds near R~ = I."""
    return np.asarray(w, dtype=float) - turn @ np.asarray(wanted, dtype=float)
