"""Velocity from which unsteady friction follows under laws other than `linear`, without compilation."""

import numpy as np
import pytest
from scipy.integrate import quad

from fvsolve.kernels.relaxation import velocity_change

CELLS, SPEED, FLOW, REFERENCE = 7, 1100.0, 12.0, 31.0
PIPE = {"speed": SPEED, "flow": FLOW, "center": 0, "area": 1.0}


def changes(mass, forward, backward) -> np.ndarray:
    result = np.empty(CELLS)
    velocity_change.py_func({"rho": REFERENCE}, None, mass, PIPE, forward, backward, result)
    return result


def test_without_waves_the_velocity_is_that_of_the_steady_state_to_the_bit():
    mass = np.linspace(30.0, 32.0, CELLS)
    assert not changes(mass, np.zeros(CELLS), np.zeros(CELLS)).any()


def test_uniform_waves_change_the_velocity_to_flow_over_mass():
    mass = np.linspace(30.0, 32.0, CELLS)
    found = changes(mass, np.full(CELLS, 4.0), np.full(CELLS, -1.5))
    assert found == pytest.approx(REFERENCE * ((FLOW + 5.5) / (mass + 2.5 / SPEED) - FLOW / mass), rel=1e-12)


def test_in_a_cell_the_mean_of_flow_over_mass_counts():
    place, mass = np.arange(CELLS) - 2.0, np.full(CELLS, 30.0)
    found = changes(mass, 105.0 * place, 5.0 * place)  # linear along the pipe
    for i in range(1, CELLS - 1):
        mean = quad(lambda x: (FLOW + 100.0 * x) / (30.0 + 0.1 * x), place[i] - 0.5, place[i] + 0.5)[0]
        assert found[i] == pytest.approx(REFERENCE * (mean - FLOW / 30.0), rel=1e-6)
