"""Relaxation variables without compilation: velocity of unsteady friction, energy that a viscoelastic wall stores."""

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, scene
from scipy.integrate import quad

import fvsolve
from fvsolve.core.kernels.relaxation import creep_energy, creep_power, velocity_change

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
    assert found == pytest.approx(
        REFERENCE * ((FLOW + 5.5) / (mass + 2.5 / SPEED) - FLOW / mass), rel=1e-12
    )


def test_in_a_cell_the_mean_of_flow_over_mass_counts():
    place, mass = np.arange(CELLS) - 2.0, np.full(CELLS, 30.0)
    found = changes(mass, 105.0 * place, 5.0 * place)  # linear along the pipe
    for i in range(1, CELLS - 1):
        mean = quad(
            lambda x: (FLOW + 100.0 * x) / (30.0 + 0.1 * x), place[i] - 0.5, place[i] + 0.5
        )[0]
        assert found[i] == pytest.approx(REFERENCE * (mean - FLOW / 30.0), rel=1e-6)


WALL = {
    "youngs_modulus": 1.4e9,
    "thickness": 0.01,
    "creep": {"compliance": [4e-10, 2e-10], "time": [0.05, 0.5]},
}


def test_the_rate_of_stored_energy_is_the_derivative_of_the_stored_energy():
    main = pipe("top", "end", 100.0, 0.1, 0.0, 5, wall=WALL)
    del main["wave_speed"]
    nodes, numerics = {"top": lake(30.0), "end": junction()}, {"method": "rk4", "courant": 0.5}
    model = fvsolve.build(fvsolve.load(scene(nodes, {"main": main}, 1.0, numerics)))
    row, settings, floats = model.tables.pipes[0], model.tables.settings[0], model.tables.floats
    profile = model.tables.profile
    y, rates = np.random.default_rng(6).standard_normal((2, model.y_size))
    per, lag = 1e-3, np.zeros(row["cells"])
    low, high = (
        creep_energy.py_func(settings, floats, profile, row, y + sign * per * rates)
        for sign in (-1.0, 1.0)
    )
    taken, rate = creep_power.py_func(settings, floats, profile, row, lag, y, rates)
    # a quadratic form: the difference is exact
    assert rate == pytest.approx((high - low) / (2.0 * per), rel=1e-9)
    assert taken > 0.0
