"""Moments of the mass of water in a basin and of its rates, against sums over the cells, without compilation."""

from types import SimpleNamespace

import numpy as np
import pytest

from fvsolve.basins import frame_forces
from fvsolve.basins.basin_frames import CELL_POSITIONS, REST_LEVEL, REST_SURFACE

WIDE, LONG, DENSITY, THICKNESS, LEVEL = 4, 3, 998.0, 0.7, 0.25
N = WIDE * LONG


@pytest.mark.parametrize("deep", [True, False])
@pytest.mark.parametrize("grid", [True, False])
def test_moments_are_sums_over_cells(monkeypatch, deep, grid):
    """deep : water with a free surface, else a liquid of constant thickness; grid : rows of cells, else any mesh"""
    for name in ("mass_factor", "row_sums"):
        monkeypatch.setattr(frame_forces, name, getattr(frame_forces, name).py_func)
    random = np.random.default_rng(8)
    columns, lines = random.normal(0.0, 2.0, WIDE), random.normal(0.0, 2.0, LONG)
    x, y = np.tile(columns, LONG), np.repeat(lines, WIDE)
    area, rest, surface = random.uniform(0.5, 2.0, (3, N))
    h, qx, qy, dh, dx, dy = random.normal(0.0, 0.1, (6, N))
    places = np.concatenate([columns, lines] if grid else [x, y])
    frame = np.zeros(1 + max(CELL_POSITIONS, REST_LEVEL, REST_SURFACE))
    frame[REST_LEVEL] = LEVEL
    start = frame.size + places.size
    frame[CELL_POSITIONS], frame[REST_SURFACE] = frame.size, start + 2 * N
    basin = {"n": N, "y": 0, "frame": 0, "deep": int(deep), "thickness": THICKNESS, "area": start, "plan": start + N,
             "nx": WIDE if grid else 0, "ny": LONG if grid else 0}  # fmt: skip
    tables = SimpleNamespace(plane=np.concatenate([frame, places, area, rest, surface]), settings=[{"rho": DENSITY}])
    found = frame_forces.mass_moments.py_func(
        tables, basin, np.concatenate([h, qx, qy]), np.concatenate([dh, dx, dy]), 0, 0.0, 0.0, 0.0
    )

    per = (DENSITY if deep else THICKNESS) * area
    mass, rate = per * (rest + h), per * dh
    height = surface - rest + LEVEL + 0.5 * (rest + h) if deep else 0.0 * x
    wanted = [
        *(np.sum(mass * one) for one in (np.ones(N), x, y, x * x, x * y, y * y, height)),
        *(np.sum(rate * one) for one in (x, y, x * x, x * y, y * y)),
        *(np.sum(per * one) for one in (qx, qy, x * qy - y * qx, dx, dy, x * dy - y * dx)),
    ]
    assert found == pytest.approx(wanted, rel=1e-12)
