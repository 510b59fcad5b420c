"""Energy of water and liquids on triangles and mixed meshes: it never grows, over rough beds and with flow through."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.face_fields import Field, G, march, triangles
from reference.meshes import corner_lists, delaunay, write

import fvsolve
from fvsolve.core.kernels.dtypes import LAW_LINEAR, MUSCL
from fvsolve.core.mesh import read, rectangle
from fvsolve.features.basins import cell_sides
from fvsolve.features.basins.free_surface.surface_mesh import MOST_OVERSHOOT
from fvsolve.features.basins.lower_motion import lower_mesh


def lake(field: Field, bed: np.ndarray, ripple: float, wide: float, end: float) -> list[float]:
    """Energy over that at the start, [depth e^2 g / 2 + depth |u|^2 / 2] summed over cells, of ripples on a lake."""
    plan, y = np.stack([-bed, 0.0 * bed]), np.zeros((3, bed.size))
    y[0] = ripple * np.random.default_rng(2).standard_normal(bed.size)
    y[0] -= y[0] @ field.area / field.area.sum()
    found = []

    def store(y):
        found.append(
            0.5 * field.area @ (G * y[0] ** 2 + (y[1] ** 2 + y[2] ** 2) / (plan[0] + y[0]))
        )

    store(y)
    march(lambda y: field.shallow(MUSCL, plan, y, wide=wide), y, end, 0.45, store)
    return [e / found[0] for e in found]


@pytest.mark.parametrize("wide", [1.0, MOST_OVERSHOOT], ids=["minmod", "van-leer"])
@pytest.mark.parametrize("shape", ["triangles", "mixed"])
def test_ripples_on_a_lake_over_a_rough_bed_die_away(shape, wide, tmp_path):
    """Energy rose without bound, as vortices of the size of triangles took it from the bed."""
    field = triangles(tmp_path, 12, 6, (6.0, 3.0), 0.3)
    if shape == "mixed":
        mesh = field.mesh
        grid = rectangle((6.0, 3.0), (12, 6))
        cells = [
            c
            for k, (p, q, r, s) in enumerate(corner_lists(grid))
            for c in ([[p, q, r, s]] if k % 3 == 0 else [[p, q, r], [p, r, s]])
        ]
        points = grid.points + 0.05 * np.sin(7.0 * grid.points[:, ::-1]) * (
            (grid.points > 0.1) & (grid.points < (5.9, 2.9))
        ).all(axis=1, keepdims=True)
        field = Field(read(write(tmp_path / "mixed.vtk", points, cells)))
        assert mesh.area.size != field.area.size
    bed = -1.5 + np.random.default_rng(7).uniform(-0.6, 0.6, field.area.size)
    energies = lake(field, bed, 1e-5, wide, 60.0)
    assert max(energies) < 1.001 and energies[-1] < 0.1


@pytest.mark.parametrize("seed", [3, 5, 7])
def test_no_wave_grows_on_sharp_triangles(seed, tmp_path):
    """Random Delaunay triangles with angles below 1 degree; the energy of a liquid between walls rose without bound."""
    field = Field(read(write(tmp_path / "sharp.vtk", *delaunay(seed))))
    y, found = np.random.default_rng(1).standard_normal((3, field.area.size)), []
    scale = np.array([10.0, 1.0, 1.0])[:, None]  # c r and m have one unit

    def store(y):
        found.append(float(np.sum(field.area * (scale * y) ** 2)))

    store(y)
    for _ in range(400):
        k, rate = field.liquid(LAW_LINEAR, MUSCL, y)
        step = 0.45 / rate
        one = y + step * k
        y = 0.5 * (y + one + step * field.liquid(LAW_LINEAR, MUSCL, one)[0])
        store(y)
    assert max(found) < 1.001 * found[0] and found[-1] < found[200]


def test_the_gradient_in_a_cell_extrapolates_to_its_sides_with_a_bounded_norm(tmp_path):
    """Singular values of the map from differences to neighbours to differences at sides, from the lowered weights."""
    for seed in (3, 5):
        mesh = read(write(tmp_path / "sharp.vtk", *delaunay(seed)))
        floats, integers = lower_mesh(mesh, cell_sides.STEEPEST)
        blocks = -(-mesh.area.size // cell_sides.BLOCK)
        size = blocks * integers[0] * cell_sides.MEASURES * cell_sides.BLOCK
        sides = floats[:size].reshape(blocks, integers[0], cell_sides.MEASURES, cell_sides.BLOCK)
        sides = np.moveaxis(sides, 3, 1).reshape(-1, integers[0], cell_sides.MEASURES)[
            : mesh.area.size
        ]
        to_side, weights = (sides[:, :, k : k + 2] for k in (cell_sides.DX, cell_sides.WX))
        norms = np.linalg.norm(to_side @ weights.swapaxes(1, 2), 2, axis=(1, 2))
        assert norms.max() == approx(cell_sides.STEEPEST, rel=1e-9) and norms.min() < 0.5


@pytest.mark.parametrize(
    "numerics", [{"limiter": "van-leer"}, {"limiter": "minmod"}, {"law": "log"}], ids=str
)
def test_flow_through_a_liquid_on_triangles_is_that_of_its_orifices(numerics, tmp_path):
    """Two equal orifices between heads of 23 and 17 m: 20 m in the pool, flow Cd A sqrt(2 g 3 m) to 0.1 %.

    The pool held waves of 190 m, because a mirror image of the flow beyond the patch gave it a gradient.
    """
    mesh = rectangle((2.0, 0.5), (8, 3))
    points = mesh.points.copy()
    inside = ((points > 1e-9) & (points < np.array([2.0, 0.5]) - 1e-9)).all(axis=1)
    points[inside] += np.random.default_rng(4).uniform(-0.03, 0.03, (inside.sum(), 2))
    cells = [
        c
        for k, (p, q, r, s) in enumerate(corner_lists(mesh))
        for c in ([[p, q, r, s]] if k % 5 == 0 else [[p, q, r], [p, r, s]])
    ]
    ends = mesh.points
    groups = {}
    for name, x in (("west", 0.0), ("east", 2.0)):
        side = np.flatnonzero(np.abs(ends[:, 0] - x) < 1e-9)
        side = side[np.argsort(ends[side, 1])]
        groups[name] = np.stack([side[:-1], side[1:]], axis=1)
    write(tmp_path / "pool.msh", points, cells, groups)
    orifice = {"type": "orifice", "area": 0.001, "discharge_coefficient": 0.6}
    law = numerics.get("law", "linear")
    case = {
        "fluid": {"name": "Water", "law": law},
        "nodes": {
            "a": {"type": "reservoir", "head": 23.0},
            "b": {"type": "reservoir", "head": 17.0},
            "pool": {
                "type": "basin",
                "physics": "liquid",
                "mesh": {"file": str(tmp_path / "pool.msh")},
                "pressure": "2.97 bar",
                "thickness": 0.05,
                "wave_speed": 1000.0,
            },
        },
        "links": {
            "in": orifice | {"from": "a", "to": "pool.west"},
            "out": orifice | {"from": "pool.east", "to": "b"},
        },
        "numerics": {"end": 1.0, "scheme": "muscl", "method": "ssp-rk2", "courant": 0.8}
        | {k: v for k, v in numerics.items() if k != "law"},
        "output": {
            "every": 0.01,
            "probes": ["in.flow", "out.flow", "pool.west.head", "pool.east.head"],
        },
    }
    found = fvsolve.run(case)
    flow = 0.6 * 0.001 * math.sqrt(2.0 * 9.80665 * 3.0)
    late = found.t > 0.5
    for name in ("in.flow", "out.flow"):
        assert found[name][late] == approx(flow, rel=1e-3)
    for name in ("pool.west.head", "pool.east.head"):
        assert found[name][late] == approx(20.0, abs=0.02)
