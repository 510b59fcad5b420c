"""Limiters differ from each other in every kernel that uses one; an unknown code gives nan."""

from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fvsolve.core.assembly.scheme_codes import CODES
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels import reconstruction
from fvsolve.core.kernels.reconstruction import by_limiter, limited
from fvsolve.features.basins import advection
from fvsolve.features.basins.free_surface import surface_rows as shallow_rows
from fvsolve.features.basins.liquid import grid_nonlinear, liquid_sides
from fvsolve.features.scalars.kernels import scalar_transport

CELLS, NONE = 40, 99


def waves(count: int) -> list[np.ndarray]:
    """Rows of cells that are steep enough to be limited in some places, and smooth in others."""
    x = np.linspace(0.0, 6.0, CELLS)
    return [2.0 + np.sin(x + k) + 0.1 * np.cos(9.0 * x + k) for k in range(count)]


def pipe_faces(code: int, backward: int) -> np.ndarray:
    found, settings = np.zeros(CELLS - 5), np.zeros(1, rec.SETTINGS)
    settings["limiter"] = code
    reconstruction.faces(settings[0], rec.MUSCL, 1e-9, backward, waves(1)[0], found)
    return found


def pipe_scalars(code: int) -> np.ndarray:
    found = np.zeros(CELLS)
    by_limiter(scalar_transport.inner_slopes, code, waves(1)[0], found)
    return found[1:-1]


def single_face(code: int) -> np.ndarray:
    b, c, d = waves(3)
    return np.array(
        [reconstruction.value_muscl(code, *three) for three in zip(b, c, d, strict=True)]
    )


def carried(code: int) -> np.ndarray:
    """Rates of a scalar in the water of a grid with random flows."""
    n = 8
    rng, rate = np.random.default_rng(4), np.zeros(n * n)
    flows, c, outside = rng.normal(size=2 * n * (n + 1)), rng.random(n * n), rng.random(4 * n)
    ones, work = np.ones(n), np.zeros(advection.second_order_work(n, n))
    grid = advection.AdvectionGrid(n, n, 0, n, ones, ones)
    flows = advection.GridFlows(1.0, flows[: n * (n + 1)], flows[n * (n + 1) :], outside)
    advection.second_order_rates(rec.MUSCL, code, grid, 0, n, flows, c, work, rate)
    return rate


def liquid_faces(code: int) -> np.ndarray:
    found = np.zeros(CELLS)
    liquid_sides.faces(rec.MUSCL, code, 1e-9, *waves(5), found)
    return found


def liquid_carried(code: int) -> np.ndarray:
    found = np.zeros(CELLS)
    grid_nonlinear.faces_upwind(rec.MUSCL, code, 1e-9, *waves(8), found)
    return found


def shallow_sides(code: int, kerbs: float) -> np.ndarray:
    rng, found = np.random.default_rng(7), np.zeros(shallow_rows.PUSH + CELLS)
    rows = [np.zeros(shallow_rows.NORTH + CELLS) for _ in range(3)]
    for row in rows:
        for at in (0, shallow_rows.SURFACE, shallow_rows.EAST, shallow_rows.NORTH):
            row[at : at + CELLS] = rng.random(CELLS)
    shallow_rows.put_limited(rec.MUSCL, code, kerbs, CELLS, *rows, found)
    return found


KERNELS = {
    "pipe": lambda code: pipe_faces(code, 0),
    "pipe, backward": lambda code: pipe_faces(code, 1),
    "pipe ends, cavities": single_face,
    "scalars in pipes": pipe_scalars,
    "scalars on grids": carried,
    "liquid on grids": liquid_faces,
    "liquid on grids, momentum": liquid_carried,
    "free surface on grids": lambda code: shallow_sides(code, 0.0),
    "free surface on grids, kerbs": lambda code: shallow_sides(code, 1.0),
}


@pytest.mark.parametrize("kernel", KERNELS)
def test_no_limiter_is_another_in_any_kernel(kernel):
    found = {name: KERNELS[kernel](code) for name, code in CODES.items()}
    assert all(np.all(np.isfinite(values)) for values in found.values())
    for one, other in combinations(found, 2):
        assert np.abs(found[one] - found[other]).max() > 1e-3, (one, other)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_code_that_is_no_limiter_gives_nan_and_never_another(kernel):
    assert np.any(np.isnan(KERNELS[kernel](NONE)))


def test_a_pair_of_half_slopes_is_two_slopes():
    """One division gives both half slopes."""
    a, b, c, d = (row - 2.0 for row in waves(4))
    for limiter in (
        reconstruction.minmod,
        reconstruction.van_leer,
        reconstruction.monotonized_central,
    ):
        for four in zip(a, b, c, d, strict=True):
            one, two = reconstruction.half_slopes(limiter, *four)
            assert one == pytest.approx(0.5 * reconstruction.slope(limiter, *four[:2]), rel=1e-15)
            assert two == pytest.approx(0.5 * reconstruction.slope(limiter, *four[2:]), rel=1e-15)


def test_constant_values_have_no_slope():
    assert_array_equal([limited(rec.FLAT, 1.0, 2.0), limited(rec.FLAT, -1.0, 2.0)], 0.0)
