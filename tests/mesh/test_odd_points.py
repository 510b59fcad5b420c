"""Points outside a mesh: just outside, so far away that distances overflow, infinite, and nan."""

from __future__ import annotations

import math

import pytest

from fvsolve.mesh import rectangle
from fvsolve.mesh.mesh import MeshPoints


@pytest.mark.parametrize("x", [1e300, -1e300, 1e155, math.inf, math.nan, 1.0 + 1e-6])
def test_a_point_far_off_lies_in_no_cell(x):
    points = MeshPoints(rectangle((1.0, 1.0), (4, 4)))
    assert points.cell(x, 0.5) == points.cell(0.5, x) == -1
    assert points.cell(1.0, 1.0) == 15
