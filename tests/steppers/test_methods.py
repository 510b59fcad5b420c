"""Arguments that `integrate` accepts and refuses; the steps are tested in steppers/test_stepped_methods.py."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.steppers.ode import integrate
from fvsolve.steppers.tableau import METHODS


def test_a_function_that_numba_refuses_gives_the_same_steps():
    def python_only(t, y):
        return [{"a": v}["a"] * complex(-1, 0).real for v in y]

    @njit
    def compiled(t, y):
        return -y

    times = [0.0, 0.5, 2.0]
    assert np.array_equal(
        integrate(python_only, [1.0, 2.0], times, rtol=1e-8), integrate(compiled, [1.0, 2.0], times, rtol=1e-8)
    )


@pytest.mark.parametrize("python", [False, True])
def test_a_constant_with_a_default_is_no_row_to_fill(python):
    """f(t, y, rate=2) has two arguments and a constant, unlike f(t, y, dydt)."""

    def decay(t, y, rate=2.0):
        return np.array([-rate * one for one in (y.tolist() if python else y)])  # numba has no `tolist`

    end = integrate(decay, [1.0], [0.0, 1.0], "rk4", step=0.01)[-1, 0]
    assert end == pytest.approx(math.exp(-2.0), abs=1e-8)


def test_a_users_array_is_a_method_everywhere():
    fvsolve.tableau("ralston-test", text="""
        0   |
        2/3 | 2/3
        ----+--------
            | 1/4  3/4
    """)  # fmt: skip
    try:
        errors = [abs(integrate(lambda t, y: -y, [1.0], [0.0, 1.0], "ralston-test", step=h)[-1, 0] - math.exp(-1))
                  for h in (0.1, 0.05)]  # fmt: skip
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
def test_integrate_refuses_what_it_cannot_do(settings, wanted):
    with pytest.raises(FvsolveError, match=wanted):
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], **settings)


def test_integrate_stops_where_the_solution_ends():
    with pytest.raises(FvsolveError, match="dormand-prince stopped at t = 1"):
        integrate(lambda t, y: y * y, [1.0], [0.0, 2.0])
