"""Rotations compared with SciPy, the matrix exponential and differences."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fvsolve import attitude as at

STEP = 1e-5
RANDOM = [*np.random.default_rng(15).uniform(-3.0, 3.0, (20, 3))]
TURNS = [*RANDOM, np.zeros(3), *np.pi * np.eye(3), *(np.pi - 1e-9) * np.eye(3), np.array([1e-9, -2e-9, 1e-10])]


def same(found, wanted, far=1e-14):
    assert_allclose(found, wanted, rtol=0, atol=far)


def derivative(of, t: float):
    """Derivative by differences of fourth order in the step."""
    near, far = (of(t + k * STEP) - of(t - k * STEP) for k in (1, 2))
    return (8 * near - far) / (12 * STEP)


def path(angles: np.ndarray, t: float) -> np.ndarray:
    """Three angles that change at different rates."""
    return angles + t * np.array([0.7, -0.4, 1.1])


@pytest.mark.parametrize("v", RANDOM[:5])
def test_the_skew_form_is_the_cross_product_32_to_34(v):
    u = v[::-1] + 0.3
    same(at.skew(v) @ u, np.cross(v, u))
    same(at.unskew(at.skew(v)), v, 0)
    same(at.skew(v).T, -at.skew(v), 0)


def test_coordinates_turn_and_turn_back_35_and_36():
    a_b, b_c = (at.of_zyz(*angles) for angles in RANDOM[:2])
    u, v = RANDOM[2], RANDOM[3]
    same(a_b.T @ (a_b @ v), v)
    same(at.skew(a_b @ u), a_b @ at.skew(u) @ a_b.T)  # the last equation of (35), reversed
    same((a_b @ b_c) @ v, a_b @ (b_c @ v))
    same(at.defect(a_b @ b_c), (0.0, 1.0))
    same(at.defect(np.diag([1.0, 1.0, -2.0])), (3.0, -2.0))


@pytest.mark.parametrize("angles", RANDOM)
def test_every_form_is_scipy_s(angles):
    same(at.about_x(angles[0]), Rotation.from_euler("x", angles[0]).as_matrix())
    same(at.about_y(angles[0]), Rotation.from_euler("y", angles[0]).as_matrix())
    same(at.about_z(angles[0]), Rotation.from_euler("z", angles[0]).as_matrix())
    same(at.of_roll_pitch_yaw(*angles), Rotation.from_euler("ZYX", angles[::-1]).as_matrix())
    same(at.of_zyz(*angles), Rotation.from_euler("ZYZ", angles).as_matrix())
    length = np.linalg.norm(angles)
    same(at.of_axis(angles, length), Rotation.from_rotvec(angles).as_matrix())
    e = np.array([*angles, 0.4])
    same(at.of_euler_parameters(3.0 * e), Rotation.from_quat(e, scalar_first=True).as_matrix())


@pytest.mark.parametrize("turn", TURNS)
def test_axis_and_angle_are_the_exponential_43_and_turn_nothing_on_the_axis_42(turn):
    angle = np.linalg.norm(turn)
    found = at.of_axis(turn if angle else [1.0, 0.0, 0.0], angle)
    same(found, expm(at.skew(turn)), 1e-13)  # the rounding of expm grows with the angle
    same(found @ turn, turn)


@pytest.mark.parametrize("turn", TURNS)
def test_every_form_comes_back(turn):
    rotation = Rotation.from_rotvec(turn).as_matrix()
    e = at.euler_parameters(rotation)
    same(at.of_euler_parameters(e), rotation)
    assert e[0] >= 0.0 and abs(np.linalg.norm(e) - 1.0) < 1e-15
    same(abs(e @ Rotation.from_rotvec(turn).as_quat(scalar_first=True)), 1.0)
    same(at.of_axis(*at.axis_angle(rotation)), rotation)
    same(at.axis_angle(rotation)[1], Rotation.from_rotvec(turn).magnitude())
    same(at.of_roll_pitch_yaw(*at.roll_pitch_yaw(rotation)), rotation)
    same(at.of_zyz(*at.zyz(rotation)), rotation)


@pytest.mark.parametrize("delta", [0.0, 1e-15, 1e-10, 1e-6, 0.1])
@pytest.mark.parametrize("side", [1, -1])
def test_angles_next_to_their_singularity_say_the_same_rotation(delta, side):
    up = at.of_roll_pitch_yaw(0.4, side * (np.pi / 2 - delta), 1.1)
    same(at.of_roll_pitch_yaw(*at.roll_pitch_yaw(up)), up)
    flat = at.of_zyz(0.4, delta if side > 0 else np.pi - delta, 1.1)
    same(at.of_zyz(*at.zyz(flat)), flat)


def test_at_the_singularity_yaw_is_zero_and_roll_has_it_all():
    roll, pitch, yaw = at.roll_pitch_yaw(at.of_roll_pitch_yaw(0.4, np.pi / 2, 1.1))
    same((roll, pitch, yaw), (0.4 - 1.1, np.pi / 2, 0.0))
    same(at.zyz(at.of_zyz(0.4, 0.0, 1.1)), (0.0, 0.0, 1.5))


def test_the_nearest_rotation_is_the_orthogonal_factor():
    rotation = at.of_zyz(*RANDOM[0])
    stretch = np.diag([1.01, 0.98, 1.002])
    turned = at.of_zyz(*RANDOM[1])
    same(at.nearest(rotation @ turned @ stretch @ turned.T), rotation)


def test_homogeneous_transforms_join_and_undo_46_and_47():
    ab, bc = (at.transform(at.of_zyz(*RANDOM[k]), RANDOM[k + 5]) for k in (0, 1))
    point = RANDOM[9]
    inner = bc[:3, :3] @ point + bc[:3, 3]
    same((ab @ bc @ [*point, 1.0])[:3], ab[:3, :3] @ inner + ab[:3, 3])
    same(at.inverse(ab) @ ab, np.eye(4))


@pytest.mark.parametrize("angles", RANDOM[:6])
def test_a_rotation_turns_by_its_angular_velocity_48_and_49(angles):
    rotation, rate = at.of_zyz(*angles), derivative(lambda t: at.of_zyz(*path(angles, t)), 0.0)
    w = at.angular_velocity(rotation, rate)
    same(rate @ rotation.T, at.skew(w), 1e-10)  # skew: (48) has a solution
    same(at.rotation_rate(rotation, w), rate, 1e-10)
    same(rotation @ at.skew(rotation.T @ w), rate, 1e-10)


@pytest.mark.parametrize("angles", RANDOM[:6])
def test_composed_rotations_add_their_angular_velocities_51_to_53(angles):
    rates = np.array([0.7, -0.4, 1.1])
    for of, jacobian in (
        (lambda a: at.of_zyz(*a), at.jacobian_zyz(angles[0], angles[1])),
        (lambda a: at.of_roll_pitch_yaw(*a), at.jacobian_roll_pitch_yaw(angles[1], angles[2])),
    ):
        rate = derivative(lambda t, of=of: of(path(angles, t)), 0.0)
        same(jacobian @ rates, at.angular_velocity(of(angles), rate), 1e-10)
    same(np.linalg.det(at.jacobian_roll_pitch_yaw(angles[1], angles[2])), np.cos(angles[1]))
    same(np.linalg.det(at.jacobian_zyz(angles[0], angles[1])), -np.sin(angles[1]))


@pytest.mark.parametrize("angles", RANDOM[:6])
def test_euler_parameters_turn_with_the_body(angles):
    w = np.array([0.3, -1.2, 0.8])  # in the body, constant
    e = at.euler_parameters(at.of_zyz(*angles))
    rate = at.euler_parameters_rate(e, w)
    turn = derivative(lambda t: at.of_euler_parameters(e + t * rate), 0.0)
    same(turn, at.of_euler_parameters(e) @ at.skew(w), 1e-10)
    same(e @ rate, 0.0, 1e-15)


def test_a_vector_seen_from_turning_axes_54_and_55():
    def u(t):
        return np.array([t, t * t - 1.0, np.sin(t)])

    def rotation(t):
        return at.of_zyz(*path(RANDOM[0], t))

    t = 0.3
    w = at.angular_velocity(rotation(t), derivative(rotation, t))
    wanted = derivative(lambda t: rotation(t) @ u(t), t)
    within = rotation(t).T @ w
    same(at.derivative(rotation(t), u(t), derivative(u, t), within), wanted, 1e-9)
    seen = rotation(t) @ derivative(u, t)
    same(seen + np.cross(w, rotation(t) @ u(t)), wanted, 1e-9)


def test_a_deviation_turns_by_w_less_the_turned_w_d_56_to_58():
    def one(t):
        return at.of_zyz(*path(RANDOM[0], t))

    def wanted(t):
        return at.of_zyz(*path(RANDOM[1], -2.0 * t))

    w, w_d = (at.angular_velocity(of(0.0), derivative(of, 0.0)) for of in (one, wanted))
    turn = at.deviation(one(0.0), wanted(0.0))
    rate = derivative(lambda t: at.deviation(one(t), wanted(t)), 0.0)
    same(turn @ wanted(0.0), one(0.0))
    same(at.rotation_rate(turn, at.deviation_velocity(turn, w, w_d)), rate, 1e-10)
    assert np.abs(at.rotation_rate(turn, w - w_d) - rate).max() > 0.1  # (57) as printed


def test_it_wants_no_scipy():
    code = "import sys, fvsolve.parts.attitude_keys; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
