"""Basins in studies: orders, patterns of Jacobians and implicit steps, limits of steps, energy, dispersion."""

from __future__ import annotations

import numpy as np
import pytest
from pytest import approx
from truth.scenes import pipe, reservoir, scene

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.model.basins import FreeSurface
from fvsolve.studies.accuracy.cells import counts, keys, scaled
from fvsolve.studies.accuracy.order import order
from fvsolve.studies.accuracy.plane import lowered
from fvsolve.studies.accuracy.refine import plan, resolutions

PLANE = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2", "courant": 0.9}
SLOSH = "1 + 0.05*cos(0.3141592653589793*x) + 0.03*cos(0.6283185307179586*y)"  # of 10 m by 5 m


def pool(cells, level: str | None = None, size=(10.0, 5.0), depth: float = 1.0, **more) -> dict:
    start = {} if level is None else {"start": {"level": level}}
    return {"type": "basin", "size": list(size), "cells": list(cells), "level": depth, **start, **more}


def alone(basin: dict, end: float, **numerics) -> dict:
    return scene({"pool": basin}, {}, end, PLANE | numerics, every=end / 20)


def built(case: dict):
    return fvsolve.build(fvsolve.load(case))


# order ----------------------------------------------------------------------------------------------------------


def test_errors_of_a_smooth_slosh_fall_at_the_order_of_the_scheme():
    found = order(alone(pool((40, 20), SLOSH), 1.2), levels=4)
    assert found.kind == "richardson" and [row.level.cells for row in found.rows] == [800, 3200, 12800, 51200]
    fit = found.fits["pool at the end: depth"]
    assert fit["L1"].order == approx(2.0, abs=0.25) and fit["L2"].order == approx(2.0, abs=0.25)
    first = order(alone(pool((40, 20), SLOSH), 1.2, scheme="upwind", method="euler"), levels=4)
    assert first.fits["pool at the end: depth"]["L1"].order == approx(1.0, abs=0.2)
    assert found.plain()["rows"][1]["set"]["nodes.pool.cells"] == [80, 40]


def test_a_finer_run_judges_as_rows_judge_each_other():
    case = alone(pool((20, 10), SLOSH), 1.2)
    by_rows, finer = order(case, levels=5), order(case, levels=3, against="finer")
    for k in range(3):
        name = "pool at the end: flow_y"
        assert finer.rows[k].errors[name]["L1"] == approx(by_rows.rows[k].errors[name]["L1"], rel=0.1)


def test_a_broken_dam_is_of_first_order_in_the_mean_and_the_note_says_why():
    found = order(alone(pool((50, 2), "where(x < 5, 1, 0.4)", size=(10.0, 0.4)), 0.6), levels=4)
    assert found.fits["pool at the end: depth"]["L1"].order == approx(1.0, abs=0.1)
    assert any("the start jumps" in note and "about 1 in L1" in note for note in found.notes)


def test_steps_alone_are_refined_on_one_mesh():
    found = order(alone(pool((20, 10), SLOSH), 1.2), refine="time", levels=4)
    assert found.fits["pool at the end: depth"]["L1"].order == approx(2.0, abs=0.15)
    assert len({row.level.cells for row in found.rows}) == 1


def test_cells_of_pipes_and_basins_double_together_in_both_directions():
    still = PLANE | {"initial": "rest"}
    nodes = {"lake": reservoir(2e5), "pool": pool((4, 6), patches={"in": {"side": "west"}})}
    case = fvsolve.load(scene(nodes, {"main": pipe("lake", "pool.in", 50.0, 0.1, 1000.0, 10)}, 0.1, still))
    assert resolutions(case)["nodes.pool.cells"] == "both"
    rows = plan(case, levels=3).levels
    assert [row.set["nodes.pool.cells"] for row in rows] == [[4, 6], [8, 12], [16, 24]]
    assert [row.set["links.main.cells"] for row in rows] == [10, 20, 40] and rows[2].cells == 16 * 24 + 40
    one = plan(case, key="nodes.pool.cells", levels=2).levels[1]
    assert one.set["nodes.pool.cells"] == [8, 12] and one.set["links.main.cells"] == 10
    assert keys(scaled(counts(case), 0.5)) == {"links.main.cells": 5, "nodes.pool.cells": [2, 3]}


def test_what_a_basin_holds_is_the_same_on_coarser_cells():
    """Averages keep contents to rounding, graded and holed too, and are those of the function to high order."""
    for more in ({}, {"grading": [3.0, 0.5]}, {"holes": [[2.5, 1.25, 5.0, 2.5]]}):
        cases = [fvsolve.load(alone(pool(cells, **more), 1.0)) for cells in ((48, 32), (24, 16))]
        fine, coarse = (FreeSurface(case, "pool") for case in cases)
        value = np.cos(0.3 * fine.x) * np.exp(0.2 * fine.y)
        found = lowered(fine, value[None], coarse)[0]
        assert found @ coarse.mesh.area == approx(value @ fine.mesh.area, rel=1e-14)
        wanted = np.cos(0.3 * coarse.x) * np.exp(0.2 * coarse.y)
        assert np.abs(found - wanted).max() < 5e-3


def test_a_mesh_from_a_file_has_no_finer_one(tmp_path):
    import meshio

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    meshio.write(tmp_path / "square.vtu", meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]))
    basin = {"type": "basin", "mesh": {"file": str(tmp_path / "square.vtu")}, "level": 1.0}
    case = fvsolve.load(scene({"pool": basin}, {}, 1.0, PLANE))
    with pytest.raises(FvsolveError, match="the mesh of pool is a file, which nothing refines"):
        plan(case, "both")
