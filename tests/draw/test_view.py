"""Pictures of networks and basins show the parts of the case at their positions."""

import json
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from reference.scenes import lake, pipe, scene, valve

import fvsolve
from fvsolve.core.run.plot_scene import scene_of
from fvsolve.parts.nodes_and_links import Link, Node
from fvsolve.report.draw import field_canvas
from fvsolve.report.draw.network_picture import NetworkPicture, place_labels
from fvsolve.report.draw.scene import Projection, choose_projection, round_scale
from fvsolve.report.draw.sheet import OTHER_LINK, OTHER_NODE, SYMBOLS, strokes, symbol_of

TOWN = {
    "works": (0, 0, 30),
    "market": (900, 0, 10),
    "mill": (1200, -300, 5),
    "tower": (1800, 400, 45),
}


def town(**units) -> dict:
    nodes = {
        "works": lake(60.0),
        "tower": lake(55.0),
        "market": {"type": "junction"},
        "mill": {"type": "junction"},
    }
    for name, (x, y, z) in TOWN.items():
        nodes[name] |= {"position": [x, y], "elevation": z}
    links = {
        "trunk": pipe("works", "market", 900.0, 0.3, 1000.0, 6),
        "lane": pipe("market", "mill", 430.0, 0.3, 1000.0, 3),
        "rise": valve("mill", "tower", 0.01),
    }
    made = scene(
        nodes, links, 0.01, {"scheme": "upwind", "method": "euler", "courant": 0.9}, every=0.01
    )
    made["output"] |= {"fields": 1, "units": units}
    return made


def drawn(case, out, field="pressure") -> tuple[NetworkPicture, set[str]]:
    """Picture of a network and all texts on it."""
    from matplotlib.text import Text

    run = fvsolve.run(case, out=out)
    frames = run._frames()[-1:]
    network = NetworkPicture(
        scene_of(run.case, "a $town$", field, [(frames[0][0], [frames[0][1]])], 0), film=True
    )
    network.show(0)
    return network, {text.get_text() for text in network.sheet.figure.findobj(Text)}


def test_a_network_is_drawn_with_its_names_units_and_how_much_heights_are_stretched(tmp_path):
    network, said = drawn(town(pressure="psig", length="ft", flow="l/s"), tmp_path / "run")
    assert {*TOWN, "trunk", "lane", "rise"} <= said and {"reservoir", "junction", "valve"} <= said
    assert {"x [ft]", "y [ft]", "z [ft]", "pressure [psig]", "a $town$"} <= said
    # 0.4 * 1800 m / 40 m = 18, rounded down
    assert any("heights enlarged 10 times" in one for one in said)
    psi = 0.45359237 * 9.80665 / 0.0254**2
    # from 0 at the works to 55 m at the mill
    low, high = (1e3 * 9.80665 * h / psi for h in (30.0 - 30.0, 60.0 - 5.0))
    assert low <= network.limits[0] < network.limits[1] <= high


def test_lumped_parts_are_drawn_without_a_field(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fvs("run", "two-tanks", "--no-pictures")
    code, out, err = fvs("view", "runs/two-tanks")
    assert (code, err) == (0, "") and Path(out.strip()).name == "view-parts.png"
    assert Path(out.strip()).read_bytes().startswith(b"\x89PNG")
    case = fvsolve.load("two-tanks")
    said = {part.name: part.kinds[0] for part in scene_of(case, "", "parts", [], 0).parts}
    assert said == {name: part.kind for name, part in {**case.nodes, **case.links}.items()}
    code, _, err = fvs("view", "runs/two-tanks", "--field", "head")
    assert code == 2 and "no frames to draw" in err
    fvs("run", "two-tanks", "--no-pictures", "--force")
    assert not list(tmp_path.rglob("*.png"))  # pictures of the run before are deleted


def test_numbers_are_printed_in_the_units_of_the_output_and_margins_as_differences(
    fvs, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    units = 'output.units={pressure="psig",head="ft",length="ft",time="min",velocity="ft/s",level="ft",flow="gpm"}'
    _, said, _ = fvs(
        "run", "pumping-main", "--no-pictures", "--set", units, "--set", "numerics.end=1"
    )
    found = json.loads(Path("runs/pumping-main/summary.json").read_text())["verdicts"]
    assert [one["unit"] for one in found] == ["psig", "psig"]
    for one in found:
        assert f"margin {one['margin']:.6g} psi\n" in said.replace("psi;", "psi\n")
    # 2400 m = 7874.02 ft
    assert "at 7874.02 ft, 0 min)" in said and "finished at t = 0.0166667 min" in said
    _, said, _ = fvs("check", "pumping-main", "--set", units)
    assert "196.85" in said and " m]" not in said.replace("[min]", "") and "elevation [ft]" in said
    _, said, _ = fvs("check", "two-tanks", "--set", units)
    assert "mm/s" not in said and said.count(" ft/s") >= 2


def test_names_cover_neither_each_other_nor_symbols_and_names_without_space_are_left_out():
    at = [(10.0 * k, 50.0) for k in range(1, 10)]
    found = place_labels(
        at,
        [(30.0, 8.0)] * 9,
        [4.0] * 9,
        [(x - 2, y - 2, x + 2, y + 2) for x, y in at],
        np.zeros((0, 2)),
        (0, 0, 100, 100),
    )
    boxes = [(x, y, x + 30.0, y + 8.0) for x, y in filter(None, found)]
    assert 2 <= len(boxes) < 9 and found[0] is not None
    for i, a in enumerate(boxes):
        assert not any(
            a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3] for b in boxes[:i]
        )
        assert not any(
            a[0] < x + 2 and x - 2 < a[2] and a[1] < y + 2 and y - 2 < a[3] for x, y in at
        )


def test_a_line_is_followed_in_profile_a_level_plan_from_above_and_all_else_aslant_to_scale():
    line = np.array([(0.0, 0, 3), (30, 40, 9), (60, 80, 1)])
    assert np.ptp(choose_projection(line).on_sheet(line), axis=0) == approx([100.0, 8.0])
    assert choose_projection(np.array([(0.0, 0, 3), (30, 0, 3), (30, 40, 3)])).kind == "plan"
    one = choose_projection(np.array([(0.0, 0, 0), (100, 0, 0), (0, 100, 4)]))
    assert (one.kind, one.rise, round_scale(0.0999)) == ("aslant", 10.0, 0.05)
    across = Projection("aslant", 3.0)
    ends = across.on_sheet([(0, 0, 0), (5, 0, 0), (0, 5, 0), (0, 0, 2)])
    east, north, up = np.linalg.norm(ends[1:] - ends[0], axis=1) / (5.0, 5.0, 6.0)
    # orthographic projection of three axes (Gauss)
    assert east**2 + north**2 + up**2 == approx(2.0)


def test_every_kind_of_part_has_a_symbol_and_a_new_kind_that_of_its_base():
    kinds = {**Node.kinds, **Link.kinds}
    assert set(kinds) - {"pipe"} <= set(SYMBOLS)
    assert len(set(SYMBOLS.values())) == len(SYMBOLS)
    assert symbol_of(("gate-valve", "valve"), True) == SYMBOLS["valve"]
    assert (symbol_of(("new",), True), symbol_of(("new",), False)) == (OTHER_LINK, OTHER_NODE)
    for symbol in (*SYMBOLS.values(), OTHER_LINK, OTHER_NODE):
        points = np.concatenate([np.array(one) for _, one, _ in strokes(symbol)])
        assert 0.25 < np.abs(points).max() <= 1.01


@pytest.fixture
def bowl():
    """Mesh, shore radius [m] and cell size [m] of a lake in a round bowl of slope 0.1, 40 x 40 cells over 8 m."""
    pyvista = pytest.importorskip("pyvista")
    n, radius, slope = 40, 3.0, 0.1
    x, y = np.meshgrid(np.linspace(-4.0, 4.0, n + 1), np.linspace(-4.0, 4.0, n + 1))
    mesh = pyvista.StructuredGrid(x, y, slope * np.hypot(x, y)).cast_to_unstructured_grid()
    middle = mesh.cell_centers().points
    bed = slope * np.hypot(middle[:, 0], middle[:, 1])
    depth = np.maximum(slope * radius - bed, 0.0)
    mesh.cell_data["depth"], mesh.cell_data["surface"], mesh.cell_data["bed"] = (
        depth,
        bed + depth,
        bed,
    )
    return mesh, radius, 8.0 / n


def test_the_shore_is_where_the_surface_touches_the_bed_to_a_part_of_a_cell(bowl):
    mesh, radius, cell = bowl
    found = field_canvas.water_mesh(mesh, 1.0, ("depth",))
    shore = np.vstack(field_canvas.boundary_loops(found))
    off = np.hypot(shore[:, 0], shore[:, 1]) - radius
    assert len(shore) > 60 and np.abs(off).max() < 0.15 * cell
    assert np.asarray(found.points)[:, 2] == approx(np.full(found.n_points, 0.1 * radius), abs=1e-6)


def test_the_shore_of_a_basin_on_a_body_is_as_good_in_its_own_axes(bowl):
    mesh, radius, cell = bowl
    turn, place = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]), (3.0, 4.0, 5.0)
    mesh.points = mesh.points @ turn.T + place
    mesh.cell_data["normal"] = np.tile(turn[:, 2], (mesh.n_cells, 1))
    shore = (
        np.vstack(field_canvas.boundary_loops(field_canvas.water_mesh(mesh, 1.0, ()))) - place
    ) @ turn
    assert np.abs(np.hypot(shore[:, 0], shore[:, 1]) - radius).max() < 0.15 * cell
    assert shore[:, 2] == approx(np.full(len(shore), 0.1 * radius), abs=1e-3)


def test_holes_of_a_basin_and_blocks_on_its_bed_are_houses(bowl):
    mesh, _, _ = bowl
    middle = mesh.cell_centers().points
    inside = (np.abs(middle[:, 0] - 2.0) < 0.5) & (np.abs(middle[:, 1]) < 0.5)
    walls, roof = field_canvas.buildings(mesh.extract_cells(~inside), 2.0)
    assert roof.area == approx(1.0, rel=0.1) and (walls.bounds[5], roof.bounds[4]) == (2.0, 2.0)
    assert not field_canvas.buildings(mesh, 2.0) and not field_canvas.raised_cells(mesh).any()
    at = np.asarray(mesh.points)
    at[(np.abs(at[:, 0] - 2.0) < 0.45) & (np.abs(at[:, 1]) < 0.45), 2] += 3.0
    mesh.points = at
    rises = field_canvas.raised_cells(mesh)
    assert inside[rises].sum() >= 16 and rises.sum() <= 40


def test_walls_of_a_basin_are_lines_at_their_crests_on_the_faces():
    """Faces nearest to x = 2.4 m, and a wall of two points along y = 1 m, shifted with their basin."""
    walls = {
        "levee": {"line": [[2.4, 0.0], [2.4, 3.0]], "crest": 0.7},
        "kerb": {"line": [[0, 1], [4, 1]], "crest": 0.2},
    }
    pool = {
        "type": "basin",
        "size": [4.0, 3.0],
        "cells": [4, 3],
        "level": 0.5,
        "elevation": 2.0,
        "position": [10.0, 20.0],
        "walls": walls,
    }
    case = fvsolve.load(scene({"pool": pool}, {}, 1.0, {"courant": 0.9}, ["pool.volume"]))
    levee, kerb = scene_of(case, "", "depth", [(0.0, [])], 0).walls
    found = sorted(tuple(sorted(map(tuple, face))) for face in levee.round(9).tolist())
    assert found == [((12.0, 20.0 + k, 2.7), (12.0, 21.0 + k, 2.7)) for k in range(3)]
    assert (
        kerb.shape == (4, 2, 3)
        and np.ptp(kerb[..., 0]) == 4.0
        and (kerb[..., 1:] == (21.0, 2.2)).all()
    )
