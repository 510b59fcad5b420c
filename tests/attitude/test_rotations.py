"""Rotations compared with SciPy, the matrix exponential and differences; steps and probes of attitudes."""

import subprocess
import sys
from math import pi

import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference.scenes import scene
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

from fvsolve import attitude as at
from fvsolve import build, integrate, load

STEP = 1e-5
RANDOM = [*np.random.default_rng(15).uniform(-3.0, 3.0, (20, 3))]
TURNS = [
    *RANDOM,
    np.zeros(3),
    *np.pi * np.eye(3),
    *(np.pi - 1e-9) * np.eye(3),
    np.array([1e-9, -2e-9, 1e-10]),
]


def same(found, expected, far=1e-14):
    assert_allclose(found, expected, rtol=0, atol=far)


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
def test_angles_next_to_their_singularity_state_the_same_rotation(delta, side):
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
    expected = derivative(lambda t: rotation(t) @ u(t), t)
    within = rotation(t).T @ w
    same(at.derivative(rotation(t), u(t), derivative(u, t), within), expected, 1e-9)
    seen = rotation(t) @ derivative(u, t)
    same(seen + np.cross(w, rotation(t) @ u(t)), expected, 1e-9)


def test_a_deviation_turns_by_w_less_the_turned_w_d_56_to_58():
    def first_attitude(t):
        return at.of_zyz(*path(RANDOM[0], t))

    def second_attitude(t):
        return at.of_zyz(*path(RANDOM[1], -2.0 * t))

    w, w_d = (
        at.angular_velocity(of(0.0), derivative(of, 0.0))
        for of in (first_attitude, second_attitude)
    )
    turn = at.deviation(first_attitude(0.0), second_attitude(0.0))
    rate = derivative(lambda t: at.deviation(first_attitude(t), second_attitude(t)), 0.0)
    same(turn @ second_attitude(0.0), first_attitude(0.0))
    same(at.rotation_rate(turn, at.deviation_velocity(turn, w, w_d)), rate, 1e-10)
    assert np.abs(at.rotation_rate(turn, w - w_d) - rate).max() > 0.1  # (57) as printed


def test_scipy_is_not_imported():
    code = "import sys, fvsolve.parts.attitude_keys; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


INERTIA = np.array([1.0, 2.0, 3.0])
START = at.euler_parameters(at.of_axis([0.6, 0.8, 0.0], 0.6))


def free(t, y):
    """Rates of Euler parameters, and Euler's equations (68) without torque."""
    w = y[4:]
    return np.concatenate([at.euler_parameters_rate(y[:4], w), -np.cross(w, INERTIA * w) / INERTIA])


def momentum(y):
    """Moment of momentum in inertial axes."""
    return at.of_euler_parameters(y[:4]) @ (INERTIA * y[4:])


def test_a_free_top_turns_by_jacobis_functions():
    """(68) without torque, moments 1, 2, 3: w1 = a cn, w2 = b sn, w3 = c dn (Landau and Lifshitz, Mechanics, 37)."""
    i1, i2, i3 = INERTIA
    w1, w3 = 0.3, 1.2  # w2 = 0 at the start
    energy, square = i1 * w1**2 + i3 * w3**2, (i1 * w1) ** 2 + (i3 * w3) ** 2
    rate = np.sqrt((i3 - i2) * (square - energy * i1) / (i1 * i2 * i3))
    share = (i2 - i1) * (energy * i3 - square) / ((i3 - i2) * (square - energy * i1))
    b = np.sqrt((energy * i3 - square) / (i2 * (i3 - i2)))
    t = np.linspace(0.0, 20.0, 41)
    sn, cn, dn, _ = ellipj(rate * t, share)
    y = integrate(free, [*START, w1, 0.0, w3], t, "verner-7", rtol=1e-11)
    assert np.abs(y[:, 4:] - np.stack([w1 * cn, b * sn, w3 * dn], axis=1)).max() < 1e-9
    off = [np.abs(momentum(value) - momentum(y[0])).max() for value in y]
    assert max(off) < 1e-9  # the attitude is exact as well: this vector is constant


def test_a_heavy_symmetric_top_precesses_steadily():
    """Moments a, a, c, tilt theta, spin n along the axis: (c n - a p cos theta) p = m g l; R = Rz(p t) Rx Rz(s t)."""
    a, c, tilt, precession, weight = 1.0, 0.4, 0.7, 1.3, 2.0
    n = (weight / precession + a * precession * np.cos(tilt)) / c
    own = n - precession * np.cos(tilt)
    moments = np.array([a, a, c])

    def exact(t):
        return at.about_z(precession * t) @ at.about_x(tilt) @ at.about_z(own * t)

    def heavy(t, y):
        up = at.of_euler_parameters(y[:4])[2]
        torque = weight * np.array([up[1], -up[0], 0.0])
        rate = (torque - np.cross(y[4:], moments * y[4:])) / moments
        return np.concatenate([at.euler_parameters_rate(y[:4], y[4:]), rate])

    w = exact(0.0).T @ [0.0, 0.0, precession] + [0.0, 0.0, own]
    start, errors = np.concatenate([at.euler_parameters(exact(0.0)), w]), []
    for steps in (100, 200):
        end = integrate(heavy, start, [0.0, 5.0], "rk4", step=5.0 / steps)[-1]
        errors.append(np.abs(at.of_euler_parameters(end[:4]) - exact(5.0)).max())
    assert errors[1] < 1e-4 and errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)


def test_gauss_methods_keep_squares_and_rk4_does_not():
    """|e|^2, energy and the square of the moment of momentum are quadratic in the states."""
    off = {}
    for method in ("rk4", "gauss-4"):
        end = integrate(free, [*START, 0.3, 0.05, 1.2], [0.0, 40.0], method, step=0.1)[-1]
        begun = np.array([0.3, 0.05, 1.2])
        pairs = [
            (end[:4] @ end[:4], 1.0),
            (end[4:] @ (INERTIA * end[4:]), begun @ (INERTIA * begun)),
        ]
        pairs.append((np.linalg.norm(INERTIA * end[4:]), np.linalg.norm(INERTIA * begun)))
        off[method] = max(abs(value / other - 1.0) for value, other in pairs)
    assert off["gauss-4"] < 1e-11 and off["rk4"] > 1e-8


def test_angles_lose_their_order_next_to_their_pole_and_euler_parameters_know_none():
    """A body rolled by delta turns about its y axis, so its pitch passes 90 degrees at a distance of delta."""
    turn, h, end = np.array([0.0, 1.0, 0.0]), 0.02, 3.0

    def angles(t, y):
        rotation = at.of_roll_pitch_yaw(*y)
        return np.linalg.solve(at.jacobian_roll_pitch_yaw(y[1], y[2]), rotation @ turn)

    def errors(delta, h):
        exact = at.about_x(delta) @ at.about_y(end)
        e = at.euler_parameters(at.about_x(delta))
        by_angles = integrate(angles, [delta, 0.0, 0.0], [0.0, end], "rk4", step=h)[-1]
        by_parameters = integrate(
            lambda t, y: at.euler_parameters_rate(y, turn), e, [0.0, end], "rk4", step=h
        )[-1]
        found = at.of_roll_pitch_yaw(*by_angles), at.of_euler_parameters(by_parameters)
        return [np.abs(value - exact).max() for value in found]

    (far, whole), (near, same) = errors(0.3, h), errors(0.01, h)
    assert far < 1e-7 and near > 1e-3 and near > 1e4 * far
    assert whole == pytest.approx(same, rel=0.1) and same < 1e-9
    assert errors(0.3, 2 * h)[0] / far > 10.0  # the order remains away from the pole


ANGLES, PARAMETERS = ("roll", "pitch", "yaw"), ("eta", "eps_x", "eps_y", "eps_z")
KINDS = ("free", "fixed", "ball")
PITCHES = [
    0.3,
    -1.2,
    pi / 2 - 1e-6,
    pi / 2 - 1e-9,
    pi / 2 - 1e-14,
    pi / 2,
    -pi / 2,
    -pi / 2 + 1e-10,
]


def probed_attitudes(*attitudes: dict) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Name, angles and Euler parameters that probes of bodies read at the start, for each attitude and joint kind."""
    bodies = {
        f"b{k}_{kind}": {
            "type": "body",
            "mass": 1.0,
            "inertia": [1.0, 1.0, 1.0],
            "joint": {"kind": kind, "attitude": given},
        }
        for k, given in enumerate(attitudes)
        for kind in KINDS
    }
    probes = [f"{name}.{value}" for name in bodies for value in ANGLES + PARAMETERS]
    model = build(load(scene(bodies, {}, 1.0, {"method": "rk4", "step": 0.1}, probes)))
    read = model.observe(0.0, model.start).reshape(len(bodies), 7)
    return [(name, row[:3], row[3:]) for name, row in zip(bodies, read, strict=True)]


def test_angles_and_parameters_state_the_rotation_of_the_case():
    found = probed_attitudes(*({"roll": 0.4, "pitch": pitch, "yaw": 1.1} for pitch in PITCHES))
    for pitch, (name, angles, e) in zip(np.repeat(PITCHES, len(KINDS)), found, strict=True):
        expected = at.of_roll_pitch_yaw(0.4, pitch, 1.1)
        assert at.of_euler_parameters(e) == pytest.approx(expected, abs=1e-14), name
        # within 1e-12 of 90 deg yaw is 0
        assert at.of_roll_pitch_yaw(*angles) == pytest.approx(expected, abs=1e-13), name
        if abs(pitch) < 1.5:
            assert angles == pytest.approx([0.4, pitch, 1.1], abs=1e-14)


def test_at_the_pole_yaw_is_zero_as_the_page_states():
    for _, angles, _ in probed_attitudes({"roll": 0.4, "pitch": pi / 2, "yaw": 1.1}):
        assert angles == pytest.approx([0.4 - 1.1, pi / 2, 0.0], abs=1e-12)


FORMS = [
    {"zyz": [0.3, 2.0, -1.0]},
    {"axis": [0.6, 0.0, 0.8], "angle": 2.5},
    {"euler_parameters": [0.5, -0.5, 0.5, 0.5]},
    {"matrix": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]},
    {"axis": [0, 1, 0], "angle": "180 deg"},
]
WANTED = [
    at.of_zyz(0.3, 2.0, -1.0),
    at.of_axis([0.6, 0.0, 0.8], 2.5),
    at.of_euler_parameters([0.5, -0.5, 0.5, 0.5]),
    np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    np.diag([-1.0, 1.0, -1.0]),
]


def test_every_form_of_the_case_is_the_attitude_of_the_run():
    for (name, angles, e), expected in zip(
        probed_attitudes(*FORMS), np.repeat(WANTED, len(KINDS), axis=0), strict=True
    ):
        assert at.of_euler_parameters(e) == pytest.approx(expected, abs=1e-14), name
        assert at.of_roll_pitch_yaw(*angles) == pytest.approx(expected, abs=1e-14), name
