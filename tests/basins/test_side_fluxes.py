"""Flux of a liquid through moving sides of cells, under the density law `linear`, without compilation."""

import numpy as np
import pytest

from fvsolve.basins.cell_sides import BLOCK, MEASURES, NX, NY, REACH
from fvsolve.basins.liquid.liquid_mesh import ROWS, add_side_linear, add_side_linear_moving

SOUND, DENSITY = 1200.0, 998.0
RATE_MASS, RATE_X, RATE_Y = (slice(k * BLOCK, (k + 1) * BLOCK) for k in (3, 4, 5))  # rows of the scratch of a block


def block(random) -> tuple[np.ndarray, ...]:
    """Directions, reach, deviation of pressure over wave speed, and both flows of the cells of a block."""
    angle = random.uniform(0.0, 2.0 * np.pi, BLOCK)
    return np.cos(angle), np.sin(angle), random.uniform(0.5, 2.0, BLOCK), *random.normal(0.0, 50.0, (3, BLOCK))


def measures(nx, ny, reach) -> np.ndarray:
    geometry = np.zeros(MEASURES * BLOCK)
    for k, values in ((NX, nx), (NY, ny), (REACH, reach)):
        geometry[k * BLOCK : (k + 1) * BLOCK] = values
    return geometry


def test_a_uniform_liquid_passes_a_moving_side_by_its_flux_less_what_the_side_sweeps():
    """Flux of mass m - speed rho, and of momentum p n - speed (mx, my), with p = c^2 (rho - rho_0) and m along n."""
    random = np.random.default_rng(3)
    nx, ny, reach, w, mx, my = block(random)
    speed, scratch = random.uniform(-3.0, 3.0, BLOCK), np.zeros(ROWS * BLOCK)
    scratch[: 3 * BLOCK] = np.concatenate([w, mx, my])
    add_side_linear_moving.py_func(SOUND, DENSITY, w, mx, my, measures(nx, ny, reach), scratch, speed)
    mass = mx * nx + my * ny - speed * (DENSITY + w / SOUND)
    pressure = SOUND * w
    assert scratch[RATE_MASS] == pytest.approx(-reach * mass, rel=1e-12)
    assert scratch[RATE_X] == pytest.approx(-reach * (pressure * nx - speed * mx), rel=1e-10)
    assert scratch[RATE_Y] == pytest.approx(-reach * (pressure * ny - speed * my), rel=1e-10)


def test_a_moving_side_of_no_speed_is_a_fixed_side():
    random = np.random.default_rng(4)
    nx, ny, reach, *inside = block(random)
    beyond, found = random.normal(0.0, 50.0, 3 * BLOCK), []
    for add, own, more in ((add_side_linear, (), ()), (add_side_linear_moving, (DENSITY,), (np.zeros(BLOCK),))):
        scratch = np.zeros(ROWS * BLOCK)
        scratch[: 3 * BLOCK] = beyond
        add.py_func(SOUND, *own, *inside, measures(nx, ny, reach), scratch, *more)
        found.append(np.concatenate([scratch[rows] for rows in (RATE_MASS, RATE_X, RATE_Y)]))
    assert found[1] == pytest.approx(found[0], rel=1e-12)
