"""The rate of energy that a viscoelastic wall stores is the derivative of what it stores."""

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, scene

import fvsolve
from fvsolve.kernels.relaxation import creep_energy, creep_power

WALL = {"youngs_modulus": 1.4e9, "thickness": 0.01, "creep": {"compliance": [4e-10, 2e-10], "time": [0.05, 0.5]}}


def test_the_rate_of_stored_energy_is_the_derivative_of_the_stored_energy():
    main = pipe("top", "end", 100.0, 0.1, 0.0, 5, wall=WALL)
    del main["wave_speed"]
    nodes, numerics = {"top": lake(30.0), "end": junction()}, {"method": "rk4", "courant": 0.5}
    model = fvsolve.build(fvsolve.load(scene(nodes, {"main": main}, 1.0, numerics)))
    row, settings, floats = model.tables.pipes[0], model.tables.settings[0], model.tables.floats
    profile = model.tables.profile
    y, rates = np.random.default_rng(6).standard_normal((2, model.y_size))
    per, lag = 1e-3, np.zeros(row["cells"])
    low, high = (creep_energy.py_func(settings, floats, profile, row, y + sign * per * rates) for sign in (-1.0, 1.0))
    taken, rate = creep_power.py_func(settings, floats, profile, row, lag, y, rates)
    assert rate == pytest.approx((high - low) / (2.0 * per), rel=1e-9)  # a quadratic form: the difference is exact
    assert taken > 0.0
