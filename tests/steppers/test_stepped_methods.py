"""Compiled steps of every method against its stability function and order, and the arguments of `integrate`."""

import math

import numpy as np
import pytest
from numba import njit

import fvsolve
from fvsolve.core.steppers import METHODS, analyse, integrate, seen_frequency
from fvsolve.errors import FvsolveError

NAMES = [name for name, method in METHODS.items() if name == method.name]
ADAPTIVE = [name for name in NAMES if METHODS[name].adaptive]

RANDOM = np.random.default_rng(59)
RADIUS, TURN = 2.5 * np.sqrt(RANDOM.random(200)), 2.0 * np.pi * RANDOM.random(200)
# Left half plane, without poles of R; on a grid, so that difference quotients of f are exact.
LAMBDA = (
    -np.ceil(np.abs(64 * RADIUS * np.cos(TURN))) / 64
    + 1j * np.round(64 * RADIUS * np.sin(TURN)) / 64
)
GROWTH, TURNING = LAMBDA.real.copy(), LAMBDA.imag.copy()


@njit
def test_system(t, y):
    """Rates of y' = lambda y for 200 values of lambda, real parts first."""
    x, z = y[:200], y[200:]
    return np.concatenate((GROWTH * x - TURNING * z, TURNING * x + GROWTH * z))


test_system.__test__ = False


@njit
def pendulum(t, y):
    """Rates of a driven pendulum: nonlinear and non-autonomous, so that all order conditions contribute."""
    return np.array([y[1], -np.sin(y[0]) + 0.3 * np.cos(t)])


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return integrate(pendulum, [1.0, 0.2], [0.0, 4.0], "dormand-prince", step=1e-3)[-1]


@pytest.mark.parametrize("name", NAMES)
def test_a_single_step_of_the_test_system_is_the_stability_function(name):
    start = np.concatenate((np.ones(200), np.zeros(200)))
    end = integrate(test_system, start, [0.0, 1.0], name, step=1.0)[-1]
    wanted = analyse(name).stability_function(LAMBDA)
    assert end[:200] + 1j * end[200:] == pytest.approx(wanted, rel=1e-13, abs=1e-13)


# Numbers of steps over four seconds, for which the leading error term dominates higher terms and rounding.
STEPS = {
    1: (160, 320),
    2: (40, 80),
    3: (40, 80),
    4: (40, 80),
    5: (48, 96),
    6: (16, 32),
    7: (24, 40),
    9: (8, 12),
}


@pytest.mark.parametrize("name", NAMES)
def test_fixed_steps_show_the_order(name, truth):
    p = METHODS[name].order
    steps = 4.0 / np.array(STEPS[p])
    errors = [
        np.linalg.norm(integrate(pendulum, [1.0, 0.2], [0.0, 4.0], name, step=h)[-1] - truth)
        for h in steps
    ]
    assert math.log(errors[0] / errors[1]) / math.log(steps[0] / steps[1]) == pytest.approx(
        p, abs=0.1 * p
    )


@pytest.mark.parametrize("name", ADAPTIVE)
def test_error_control_stays_near_its_tolerance(name, truth):
    """The error of a step, of order h^(q+1), is rtol, so the total error is of order rtol^(q / (q + 1))."""
    q = METHODS[name].control_order - 1
    for rtol in (1e-4, 1e-8):
        error = np.linalg.norm(
            integrate(pendulum, [1.0, 0.2], [0.0, 4.0], name, rtol=rtol)[-1] - truth
        )
        assert 1e-4 * rtol < error < 3.0 * rtol ** (q / (q + 1))


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "name", ["rk4", "ssp-rk3", "implicit-midpoint", "trapezoid", "gauss-4", "lobatto-iiia-6"]
)
@pytest.mark.parametrize("fast", [1.5, 40.0, 1000.0])
def test_a_fast_oscillation_is_seen_at_the_predicted_frequency(name, fast):
    """A numerical oscillation has the predicted frequency for all omega h, also beyond the Nyquist frequency pi / h."""
    h, n = 0.1, 60
    omega = min(fast, 0.9 * analyse(name).imaginary_interval) / h

    @njit
    def oscillator(t, y):
        return np.array([-omega * y[1], omega * y[0]])

    y = integrate(oscillator, [1.0, 0.0], h * np.arange(n + 1), name, step=h)
    turned = np.unwrap(np.angle(y[:, 0] + 1j * y[:, 1]))
    seen = abs(turned[-1] - turned[0]) / (n * h)
    assert seen == pytest.approx(seen_frequency(name, omega, h), rel=1e-9)
    if analyse(name).a_stable and fast > math.pi:
        assert seen < math.pi / h < omega


def test_a_function_that_numba_refuses_gives_the_same_steps():
    def python_only(t, y):
        return [{"a": v}["a"] * complex(-1, 0).real for v in y]

    @njit
    def compiled(t, y):
        return -y

    times = [0.0, 0.5, 2.0]
    assert np.array_equal(
        integrate(python_only, [1.0, 2.0], times, rtol=1e-8),
        integrate(compiled, [1.0, 2.0], times, rtol=1e-8),
    )


@pytest.mark.parametrize("python", [False, True])
def test_a_constant_with_a_default_is_no_row_to_fill(python):
    """f(t, y, rate=2) has two arguments and a constant, unlike f(t, y, dydt)."""

    def decay(t, y, rate=2.0):
        # numba has no `tolist`
        return np.array([-rate * one for one in (y.tolist() if python else y)])

    end = integrate(decay, [1.0], [0.0, 1.0], "rk4", step=0.01)[-1, 0]
    assert end == pytest.approx(math.exp(-2.0), abs=1e-8)


def test_a_users_array_is_a_method_everywhere():
    fvsolve.tableau(
        "ralston-test",
        text="""
        0   |
        2/3 | 2/3
        ----+--------
            | 1/4  3/4
    """,
    )
    try:
        errors = [
            abs(
                integrate(lambda t, y: -y, [1.0], [0.0, 1.0], "ralston-test", step=h)[-1, 0]
                - math.exp(-1)
            )
            for h in (0.1, 0.05)
        ]
        assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    finally:
        del METHODS["ralston-test"]


@pytest.mark.parametrize(
    "settings, wanted",
    [
        (dict(method="rk5"), 'no method named "rk5"; did you mean "rk4"'),
        (dict(method="rk4"), "rk4 has no error estimate; give step"),
        (dict(rtol=1e-6, step=0.1), "both set the step"),
        (dict(step=-1.0), "not a positive number"),
        (dict(rtol=math.nan), "not a positive number"),
    ],
)
def test_integrate_refuses_impossible_settings(settings, wanted):
    with pytest.raises(FvsolveError, match=wanted):
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], **settings)


def test_integrate_stops_where_the_solution_ends():
    with pytest.raises(FvsolveError, match="dormand-prince stopped at t = 1"):
        integrate(lambda t, y: y * y, [1.0], [0.0, 2.0])
