"""Steps of attitudes: tops with closed solutions, invariants that Gauss methods keep, and the failure of angles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj

from fvsolve import attitude as at
from fvsolve import integrate

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
    off = [np.abs(momentum(one) - momentum(y[0])).max() for one in y]
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
        pairs = [(end[:4] @ end[:4], 1.0), (end[4:] @ (INERTIA * end[4:]), begun @ (INERTIA * begun))]
        pairs.append((np.linalg.norm(INERTIA * end[4:]), np.linalg.norm(INERTIA * begun)))
        off[method] = max(abs(one / other - 1.0) for one, other in pairs)
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
        by_parameters = integrate(lambda t, y: at.euler_parameters_rate(y, turn), e, [0.0, end], "rk4", step=h)[-1]
        found = at.of_roll_pitch_yaw(*by_angles), at.of_euler_parameters(by_parameters)
        return [np.abs(one - exact).max() for one in found]

    (far, whole), (near, same) = errors(0.3, h), errors(0.01, h)
    assert far < 1e-7 and near > 1e-3 and near > 1e4 * far
    assert whole == pytest.approx(same, rel=0.1) and same < 1e-9
    assert errors(0.3, 2 * h)[0] / far > 10.0  # the order remains away from the pole
