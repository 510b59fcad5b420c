"""Steps that return to the state from which they began: found in a cycle, not on smooth or oscillating solutions."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fvsolve.core.steppers import loop_records
from fvsolve.core.steppers.hidden_stiffness import WINDOW, has_returned

A = np.array([
    [0, 0, 0, 0, 0, 0], [1 / 5, 0, 0, 0, 0, 0], [3 / 40, 9 / 40, 0, 0, 0, 0], [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
])  # fmt: skip


def windows_in(rates, start, lengths, size=1e-6, scale=1.0):
    """Ends of windows at which steps of Dormand and Prince have returned; rates : function (t, y) -> float64[n]"""
    y, t, found = np.array(start, dtype=float), 0.0, []
    run = SimpleNamespace(
        returns=np.zeros((2, y.size)),
        state=np.zeros(1, loop_records.STATE),
        control=np.zeros(1, loop_records.CONTROL),
        scale=np.full(y.size, scale),
        k=np.zeros((7, y.size)),
        y=np.zeros((2, y.size)),
    )
    run.control["size"] = size
    nodes = A.sum(axis=1)
    for h in lengths:
        for i in range(7):
            run.k[i] = rates(t + nodes[i] * h, y + h * A[i] @ run.k[:6])
        run.y[0], run.y[1] = y, y + h * A[6] @ run.k[:6]
        found.append(getattr(has_returned, "py_func", has_returned)(run, h, 0, 1))
        y, t = run.y[1].copy(), t + h
    assert not any(flag for k, flag in enumerate(found) if (k + 1) % WINDOW)
    return any(found)


def steep_tanks(t, y):
    """Flow between two tanks near one level, steep at zero, beside a tank that fills steadily."""
    flow = math.copysign(abs(y[0]) ** 0.54, y[0]) if abs(y[0]) > 1e-3 else y[0] / 1e-3**0.46
    return np.array([-flow, flow, 5.0])


@pytest.mark.parametrize("length", [0.35, 0.3, 0.25])
def test_a_cycle_that_repeats_itself_is_detected(length):
    """The difference of levels stays where stages cancel each other, though its rate is not zero."""
    linear = windows_in(lambda t, y: np.array([-y[0]]), [1e-3], [0.1] * 100)
    assert windows_in(steep_tanks, [0.01, 0.0, 0.0], [length] * 200) and not linear


def test_a_state_of_fixed_error_scale_that_rests_has_not_returned():
    """A negative scale is the size of its error, whatever its value: here the value is as great."""
    assert not windows_in(lambda t, y: np.array([1e-17]), [1.0], [0.1] * 40, scale=-1.0)


SMOOTH = {
    "decay": (lambda t, y: -y, [1.0]),
    "growth": (lambda t, y: 0.5 * y, [1.0]),
    "oscillation": (lambda t, y: np.array([y[1], -y[0]]), [1.0, 0.0]),
    "forced": (lambda t, y: np.array([math.sin(3.0 * t)]), [0.0]),
    "forced away from zero": (lambda t, y: np.array([math.sin(3.0 * t) + 0.2]), [0.0]),
    "at rest": (lambda t, y: np.zeros(2), [1.0, -1.0]),
    "slow decay to a level": (lambda t, y: np.array([0.3 - 3.0 * y[0]]), [1.0]),
}


@pytest.mark.parametrize("pace", [0.02, 0.2, 0.7])
@pytest.mark.parametrize("name", SMOOTH)
def test_steps_that_follow_a_solution_do_not_return(name, pace):
    rates, start = SMOOTH[name]
    steady, varied = [pace] * 200, [pace * (1.0 + 0.6 * math.sin(2.0 * k)) for k in range(200)]
    assert not windows_in(rates, start, steady) and not windows_in(rates, start, varied)
