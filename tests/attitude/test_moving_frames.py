"""Positions, velocities and accelerations of points in moving axes (59) to (68), by differences and by symbols."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fvsolve import attitude as at

STEP = 2e-3
TIMES = [0.0, 0.4, 1.7]


def along(of, t: float, times: int = 1):
    """First derivative, or for times = 2 the second, by differences of eighth order in the step."""
    weights = {1: (4 / 5, -1 / 5, 4 / 105, -1 / 280), 2: (8 / 5, -1 / 5, 8 / 315, -1 / 560)}[times]
    sign = (-1) ** times
    sides = [of(t + k * STEP) + sign * of(t - k * STEP) for k in range(1, 5)]
    middle = -205 / 72 * of(t) if times == 2 else 0.0
    return (sum(w * one for w, one in zip(weights, sides, strict=True)) + middle) / STEP**times


def rotation(t: float) -> np.ndarray:
    """R^i_b of axes that roll, pitch and yaw at different and changing rates."""
    return at.of_roll_pitch_yaw(0.3 + np.sin(t), 0.5 * np.cos(2 * t), t + 0.2 * t * t)


def origin(t: float) -> np.ndarray:
    return np.array([np.sin(t), t**3 / 6, np.cos(2 * t)])


def within(t: float) -> np.ndarray:
    """Position of a bead that slides in the body, in axes of the body."""
    return np.array([0.4 + 0.1 * t * t, np.sin(3 * t), -0.2 * t])


def place(t: float) -> np.ndarray:
    """Position of the bead in axes i (59), (60)."""
    return origin(t) + rotation(t) @ within(t)


def spin(t: float) -> np.ndarray:
    """Angular velocity w^i_ib (48)."""
    return at.angular_velocity(rotation(t), along(rotation, t))


def shares(t: float) -> dict[str, np.ndarray]:
    """Terms of (65) after that of the origin, in axes i."""
    w, r = spin(t), rotation(t) @ within(t)
    slide, pull = (rotation(t) @ along(within, t, times) for times in (1, 2))
    return {
        "relative": pull,
        "coriolis": 2 * np.cross(w, slide),
        "transversal": np.cross(along(spin, t), r),
        "centripetal": np.cross(w, np.cross(w, r)),
    }


@pytest.mark.parametrize("t", TIMES)
def test_a_velocity_is_the_sum_of_those_of_origin_body_and_rotation_61_62(t):
    slide = at.derivative(rotation(t), within(t), along(within, t), rotation(t).T @ spin(t))
    assert_allclose(along(origin, t) + slide, along(place, t), atol=1e-10)
    fixed = at.derivative(rotation(t), within(t), np.zeros(3), rotation(t).T @ spin(t))  # (67)
    assert_allclose(along(lambda s: rotation(s) @ within(t), t), fixed, atol=1e-10)


@pytest.mark.parametrize("t", TIMES)
def test_an_acceleration_is_the_sum_of_its_five_shares_63_65(t):
    assert_allclose(along(origin, t, 2) + sum(shares(t).values()), along(place, t, 2), atol=1e-8)


@pytest.mark.parametrize("t", TIMES)
def test_both_forms_of_an_acceleration_are_the_same_65_66(t):
    def velocity_in_b(s):
        return rotation(s).T @ along(origin, s)

    first = along(origin, t, 2)
    second = rotation(t) @ along(velocity_in_b, t) + np.cross(spin(t), along(origin, t))
    assert_allclose(second, first, atol=1e-8)


def test_both_forms_follow_from_55_in_symbols_65_66():
    """(65) and (66) are (55) of (55) of the position, for any motion, term by term in axes b."""
    sympy = pytest.importorskip(
        "sympy", reason="symbols are a second proof of what differences show"
    )
    t = sympy.symbols("t")
    # v of the origin
    w, v, r = (sympy.Matrix([sympy.Function(f"{name}{k}")(t) for k in "xyz"]) for name in "wvr")

    def seen_from_i(u):
        return u.diff(t) + w.cross(u)

    behind = r.diff(t, 2) + 2 * w.cross(r.diff(t)) + w.diff(t).cross(r) + w.cross(w.cross(r))
    exact = seen_from_i(v + seen_from_i(r))
    for form in (seen_from_i(v) + behind, v.diff(t) + w.cross(v) + behind):  # (65), (66)
        assert (exact - form).expand() == sympy.zeros(3, 1)
    assert (seen_from_i(w) - w.diff(t)).expand() == sympy.zeros(3, 1)  # (64): equal from both axes


@pytest.mark.parametrize("t", TIMES)
def test_angular_acceleration_is_the_first_derivative_from_either_axes_64(t):
    """The second derivative, which the summary of the course prints, has another unit and differs."""
    from_i = along(spin, t)
    from_b = rotation(t) @ along(lambda s: rotation(s).T @ spin(s), t)
    assert_allclose(from_b, from_i, atol=1e-7)
    assert np.abs(along(spin, t, 2) - from_i).max() > 0.1


@pytest.mark.parametrize("t", TIMES)
def test_torque_turns_the_moment_of_momentum_68(t):
    # of a body, in its axes
    inertia = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.3], [-0.2, 0.3, 4.0]])

    def moment(s):
        return rotation(s) @ inertia @ rotation(s).T @ spin(s)

    w = rotation(t).T @ spin(t)
    alpha = rotation(t).T @ along(spin, t)
    torque = inertia @ alpha + np.cross(w, inertia @ w)
    assert_allclose(rotation(t) @ torque, along(moment, t), atol=1e-7)
