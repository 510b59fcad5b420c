"""Size of the error of a state: scale + |y|, or a fixed size, which a negative scale states."""

from types import SimpleNamespace

import numpy as np
import pytest

from fvsolve.core.steppers import erk, loop_records, newton, run_handle
from fvsolve.core.steppers.step_operations import error_scale

SCALE, Y = np.array([-2.0, 0.5]), np.array([1.9, -1.5])
SIZES = np.array([2.0, 2.0])


def python(function):
    """Function as Python, without compilation."""
    return getattr(function, "py_func", function)


def test_a_negative_scale_is_a_fixed_size():
    assert [python(error_scale)(scale, y) for scale, y in zip(SCALE, Y, strict=True)] == [*SIZES]


def test_the_spectral_radius_weighs_states_by_the_sizes_of_their_errors():
    rates, states = np.array([4.0, 20.0]), np.array([1.0, 0.5])
    expected = np.linalg.norm(rates / SIZES) / np.linalg.norm(states / SIZES)
    assert erk.quotient(rates, np.zeros(2), Y + states, Y, SCALE) == pytest.approx(
        expected, rel=1e-14
    )


def test_the_smoothed_error_weighs_states_by_the_sizes_of_their_errors(monkeypatch):
    """With a matrix that leaves the error as it is, the norm is that of h sum e_j k_j over the sizes."""
    monkeypatch.setattr(newton, "renew_at_start", lambda *_: None)
    monkeypatch.setattr(run_handle, "call_factor", lambda *_: 0)
    monkeypatch.setattr(run_handle, "call_solve", lambda *_: None)
    run = SimpleNamespace(
        k=np.array([[3.0, -1.0]]),
        increment=np.zeros(2),
        rate=np.zeros(2),
        y=np.array([Y, Y]),
        scale=SCALE,
        control=np.zeros(1, loop_records.CONTROL),
        state=np.zeros(1, loop_records.STATE),
        newton=np.zeros(1, loop_records.NEWTON),
        calls=np.zeros(20),
        structure=None,
        jacobian=None,
        factors=None,
    )
    run.control["size"] = 1e-3
    found = python(newton.smoothed_error)(None, run, 0.0, 0.1, 0, 1, np.array([1.0]), 1.0)
    assert found == pytest.approx(
        np.linalg.norm(0.1 * run.k[0] / SIZES) / 1e-3 / np.sqrt(2.0), rel=1e-14
    )
