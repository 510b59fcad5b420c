"""Output of basins: probes at points, lines, flows through patches, frames, pictures, and the command `check`."""

import csv
import importlib.util
import json
import re

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.basins import PLANE, assert_equal_files, model_of, run_in_two_parts
from reference.meshes import delaunay, shaken, write
from reference.scenes import AMBIENT, GRAVITY, RHO, lake, pipe, ramp, reservoir, scene, valve
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import Delaunay

import fvsolve
from fvsolve.core.mesh import read, rectangle
from fvsolve.core.mesh.mesh import MeshPoints
from fvsolve.core.model import RunData
from fvsolve.core.output.fields import basin_geometry, grid_xml, split_blocks, write_frame
from fvsolve.core.run.plot_scene import lengths_of, unit_of
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.features.basins.basin_output import observe_dense_flows, observe_flows
from fvsolve.features.basins.liquid.liquid_patches import observe_liquid
from fvsolve.report.draw import field_canvas as of_view
from fvsolve.report.draw.scene import DrawnScene
from fvsolve.report.draw.sheet import PictureSheet, colour_range

FIELDS = ("depth", "surface", "bed", "u", "v", "speed")
SIZE, CELLS = (10.0, 4.0), (20, 8)


def pool(**more) -> dict:
    outlet = {"outlet": {"side": "east", "span": [1.0, 3.0]}}
    return {
        "type": "basin",
        "size": list(SIZE),
        "cells": list(CELLS),
        "level": 2.0,
        "patches": outlet,
        **more,
    }


def draining(probes, end=2.0, output=None, **more) -> dict:
    """Return a case of a basin that drains through a valve."""
    nodes = {"pool": pool(**more), "out": reservoir(AMBIENT)}
    links = {"tap": valve("pool.outlet", "out", 0.02, ramp(0.0, 1.0, 0.0, 1.0))}
    case = scene(nodes, links, end, PLANE, probes, 0.1)
    case["output"] |= output or {}
    return case


def liquid(probes, **more) -> dict:
    block = {"type": "basin", "physics": "liquid", "pressure": 5e5, "thickness": 0.02, **more}
    return scene({"block": block}, {}, 1e-3, PLANE, probes, 1e-4)


# points -----------------------------------------------------------------------------------------------------


def meshes(folder):
    yield rectangle((3.0, 2.0), (12, 9), grading=(3.0, 0.4))
    yield rectangle((4.0, 4.0), (16, 16), holes=[(1.0, 1.0, 2.0, 2.5)])
    yield read(write(folder / "shaken.msh", *shaken()))
    yield read(write(folder / "triangles.msh", *delaunay()))


def test_points_read_linear_fields_exactly_inside_and_no_value_beyond_those_of_the_cells(tmp_path):
    rng = np.random.default_rng(4)
    for mesh in meshes(tmp_path):
        points, hull, many = MeshPoints(mesh), Delaunay(mesh.centre), 0
        outer = np.unique(mesh.ends[mesh.inner :])
        linear = 1.0 + 2.0 * mesh.centre[:, 0] - 3.0 * mesh.centre[:, 1]
        low, high = mesh.points.min(0), mesh.points.max(0)
        for x, y in low + (high - low) * rng.random((300, 2)):
            cell = points.cell(x, y)
            if cell < 0:
                continue
            cells, weights = points.cell_weights(x, y)
            assert weights.min() > 0.0 and weights.sum() == approx(1.0, abs=1e-14)
            if not np.isin(mesh.cells[cell], outer).any() and hull.find_simplex((x, y)) >= 0:
                many += 1
                assert weights @ linear[cells] == approx(1.0 + 2.0 * x - 3.0 * y, abs=1e-12)
        assert many > 20
        for k, centre in enumerate(mesh.centre):
            assert points.cell(*centre) == k
            cells, weights = points.cell_weights(*centre)
            assert weights[cells == k] == approx(1.0, abs=1e-12)


def test_the_nearest_point_inside_is_nearest_and_inside():
    points = MeshPoints(rectangle((4.0, 4.0), (16, 16), holes=[(1.0, 1.0, 2.0, 2.5)]))
    for outside, inside in (
        ((-1.0, 2.0), (0.0, 2.0)),
        ((1.2, 1.6), (1.0, 1.6)),
        ((9.0, 9.0), (4.0, 4.0)),
    ):
        assert points.cell(*outside) == -1
        near = points.nearest(*outside)
        assert points.cell(*near) >= 0 and near == approx(inside, abs=1e-3)


# probes -----------------------------------------------------------------------------------------------------


def random_state(model, scale) -> np.ndarray:
    return scale * np.random.default_rng(5).standard_normal(model.y_size)


def bilinear(values: np.ndarray) -> RegularGridInterpolator:
    """Bilinear interpolation, at (y, x), of the values of the cells of `pool`."""
    nx, ny = CELLS
    axes = [(np.arange(n) + 0.5) * size / n for n, size in ((ny, SIZE[1]), (nx, SIZE[0]))]
    return RegularGridInterpolator(axes, values.reshape(ny, nx))


def test_probes_between_centres_are_bilinear_in_values_of_frames():
    """Probes over a partly dry bed equal SciPy's bilinear interpolation of the frame."""
    places = [(3.5, 1.2), (0.6, 3.3), (5.0, 2.0), (9.1, 0.3), (7.77, 2.9)]
    probes = [f"pool.{field}@{x},{y}" for x, y in places for field in FIELDS]
    case = draining(probes, bed="0.3*x", elevation=7.0)
    case["nodes"]["out"]["elevation"] = 7.0
    model = model_of(case)
    y = random_state(model, 0.3)
    found = dict(zip(probes, model.observe(0.0, y), strict=True))
    frame = model.fields(y, model.new_out())["pool"]
    assert (frame["depth"] == 0.0).sum() > 20
    u, v, _ = frame["velocity"].T
    for x, y in places:
        want = {
            name: float(bilinear(values)((y, x)))
            for name, values in {**frame, "u": u, "v": v}.items()
            if name != "velocity"
        }
        want["speed"] = np.hypot(want["u"], want["v"])
        for field in FIELDS:
            assert found[f"pool.{field}@{x},{y}"] == approx(want[field], rel=1e-12, abs=1e-13), (
                field
            )


def test_probes_of_a_liquid_read_its_frames_at_centres(tmp_path):
    """Probes at cell centres equal the frame on triangles and quadrilaterals of a file."""
    path = write(tmp_path / "block.msh", *shaken())
    mesh = read(path)
    cells = (3, 17, len(mesh.cells) - 1)
    probes = [
        f"block.{field}@{float(mesh.centre[k, 0])!r},{float(mesh.centre[k, 1])!r}"
        for k in cells
        for field in ("pressure", "u", "v", "speed")
    ]
    model = model_of(liquid(probes, mesh={"file": str(path)}))
    y = random_state(model, 1e-3)
    found = np.zeros(len(probes))
    slate = RunData(model)
    observe_liquid(0.0, y, model.new_out(), slate.handle, found)
    frame = model.fields(y, model.new_out())["block"]
    for k, values in zip(cells, found.reshape(-1, 4), strict=True):
        u, v, _ = frame["velocity"][k]
        assert values == approx([frame["pressure"][k], u, v, np.hypot(u, v)], rel=1e-11)
        assert values[0] - 5e5 == approx(2.2e9 / RHO * y[k], rel=1e-6)


def test_the_flow_of_a_patch_is_the_gain_of_the_basin():
    """The flow through the only patch is the sum of rates times areas, and that of the valve, also in thin water."""
    model = model_of(draining(["pool.outlet.flow", "tap.flow"], level=2e-3))
    area = SIZE[0] * SIZE[1] / (CELLS[0] * CELLS[1])
    flows = []
    for lower in (0.0, -1e-3, -1.4e-3, -1.9e-3, -2e-3):
        y = np.zeros(model.y_size)
        y[: model.meshed[0].n] = lower
        flow, asked = model.observe(1.5, y)
        assert flow == approx(model.rhs(1.5, y)[: model.meshed[0].n].sum() * area, rel=1e-9)
        assert -flow == approx(asked, rel=1e-12)
        flows.append(asked)
    assert sorted(flows, reverse=True) == flows and flows[0] > 0.0 and flows[-1] == 0.0


def test_the_flow_of_a_patch_has_the_density_of_its_place():
    """If density follows pressure, the flow is the mass flow over the density at the pressure of the patch."""
    case = liquid(
        ["block.hole.flow", "block.hole.pressure"], size=[1.0, 1.0], cells=[4, 4], pressure=2e7
    )
    case["nodes"]["block"]["patches"] = {"hole": {"side": "west"}}
    case["nodes"]["out"] = reservoir(AMBIENT)
    case["links"]["leak"] = valve("block.hole", "out", 1e-4)
    case["fluid"] = {**case["fluid"], "law": "log"}
    model = model_of(case)
    out, found = model.new_out(), np.zeros(2)
    node = model.node_names.index("block.hole")
    out[int(model.layout["net"]) + node] = -3.0
    out[int(model.layout["pressure"]) + node] = 3e7 - model.tables.nodes[node]["pressure"]
    slate = RunData(model)
    observe_flows(0.0, model.start, out, slate.handle, found)
    assert found[0] == approx(-3.0 / RHO, rel=1e-14)
    observe_dense_flows(0.0, model.start, out, slate.handle, found)
    assert found[0] == approx(-3.0 / (RHO * np.exp((3e7 - AMBIENT) / 2.2e9)), rel=1e-9)


def test_a_run_records_points_and_patches_and_claims_about_them():
    case = draining(["pool.outlet.flow", "pool.depth@5,2"], output={"units": {"level": "cm"}})
    case["expect"] = {
        "at(pool.depth@5,2, 0 s)": {"value": "2 m", "rtol": 1e-12},
        "max(pool.u@9.9,2)": {"value": "0.03 m/s", "atol": "0.03 m/s"},
    }
    run = fvsolve.run(case)
    assert [claim.ok for claim in run.expectations] == [True, True]
    assert run.units["pool.depth@5,2"] == "cm" and run["pool.depth@5,2"][0] == approx(
        200.0, rel=1e-12
    )
    whole = 0.5 * float(
        np.sum((run["pool.outlet.flow"][1:] + run["pool.outlet.flow"][:-1]) * np.diff(run.t))
    )
    mass = run.ledger["mass"]
    assert whole == approx((mass["final"] - mass["initial"]) / RHO, rel=1e-3)
    assert 0.0 < run.extremes["pool.u@9.9,2"].maximum < 0.06


NO_PROBES = {
    "pool.depth": 'a probe of a basin needs a point, for example "pool.depth@',
    "pool.depth@here": '"@here" is not a point x,y [m], or the name of a gauge of this basin; expected for example "@',
    "pool.depth@1": '"@1" is not a point x,y [m]',
    "pool.depth@nan,1": "nan, 1 is not a point",
    "pool.depth@11,2": "11,2 m lies outside the mesh or in a hole; the nearest point inside is 9.99",
    "pool.dept@1,1": 'pool is a basin, which has no "dept"; it has depth, surface, bed, u, v, speed, volume,',
    "pool.pressure@1,1": 'which has no "pressure"',
    "pool.outlet.depth": 'pool.outlet is a patch, which has no "depth"; it has pressure, gauge_pressure, head, flow',
    "pool.outlet.flow@1,2": "pool.outlet is a patch, and flow has no place along it; leave @1,2 out",
}


@pytest.mark.parametrize("probe", NO_PROBES)
def test_a_probe_that_means_no_point_is_refused(probe):
    with pytest.raises(CaseError, match=re.escape(NO_PROBES[probe])):
        fvsolve.load(draining([probe]))


def test_the_point_that_a_fault_names_is_taken():
    with pytest.raises(CaseError) as error:
        fvsolve.load(draining(["pool.depth@11,-3"]))
    near = str(error.value).rpartition(" ")[2]
    assert fvsolve.load(draining([f"pool.depth@{near}"])).probes[0].point == approx(
        (10.0, 0.0), abs=1e-3
    )


# lines ------------------------------------------------------------------------------------------------------

LINE = {"basin": "pool", "from": [0.25, 1.0], "to": ["9.75 m", 3.0], "points": 5}


def table(path) -> tuple[list[str], np.ndarray]:
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def test_lines_have_the_values_of_frames_at_their_points(tmp_path):
    case = draining([], output={"fields": 3, "lines": {"cut": LINE}, "units": {"velocity": "mm/s"}})
    assert fvsolve.run(case, out=tmp_path / "run", pictures=False).ok
    names = sorted(path.name for path in (tmp_path / "run" / "lines").iterdir())
    assert names == [f"cut-{k:06d}.csv" for k in range(4)]
    header, found = table(tmp_path / "run" / "lines" / "cut-000003.csv")
    assert header[:4] == ["distance [m]", "x [m]", "y [m]", "depth [m]"]
    assert header[4:] == ["surface [m]", "bed [m]", "u [mm/s]", "v [mm/s]", "speed [mm/s]"]
    assert found[:, 1:3] == approx(np.linspace((0.25, 1.0), (9.75, 3.0), 5), rel=1e-14)
    assert found[-1, 0] == approx(np.hypot(9.5, 2.0), rel=1e-14)
    frame = meshio.read(tmp_path / "run" / "fields" / "pool-000003.vtu").cell_data_dict
    u, v = frame["velocity"]["quad"][:, :2].T
    assert np.abs(v).max() > 0.0
    for column, values, unit in ((3, frame["depth"]["quad"], 1.0), (6, u, 1e-3), (7, v, 1e-3)):
        assert unit * found[:, column] == approx(bilinear(values)(found[:, [2, 1]]), rel=1e-12)
    assert found[:, 8] == approx(np.hypot(found[:, 6], found[:, 7]), rel=1e-12)


def test_lines_of_a_resumed_run_equal_those_of_the_uninterrupted_run(tmp_path):
    case = draining([], 30.0, {"fields": 12, "lines": {"cut": LINE}}, cells=[80, 40])
    late = "lines/cut-000012.csv"
    run_in_two_parts(
        case, tmp_path, 3.0, lambda run: (run / late).write_text("after the checkpoint")
    )
    assert_equal_files(tmp_path, [f"lines/cut-{k:06d}.csv" for k in range(13)])
    case["output"]["lines"] = {}
    assert fvsolve.run(
        case | {"numerics": case["numerics"] | {"end": 1.0}}, out=tmp_path / "run", force=True
    ).ok
    assert not list((tmp_path / "run").glob("lines/*"))


def test_a_line_that_lies_in_no_basin_is_refused():
    lines = {
        "a": LINE | {"basin": "pol"},
        "b": LINE | {"to": [12, 2]},
        "c": LINE | {"to": LINE["from"]},
        "d d": LINE,
    }
    with pytest.raises(CaseError) as error:
        fvsolve.load(draining([], output={"fields": 0, "lines": lines}))
    for says in (
        'output.lines.a.basin: no basin named "pol"; did you mean "pool"?',
        "output.lines.b.to: 12,2 m lies outside the mesh or in a hole; the nearest point inside is",
        "output.lines.c.to: is also the start of the line",
        '"d d" is not a valid name',
        "output.lines: are written with every frame, but `fields` is 0",
    ):
        assert says in str(error.value)


def test_a_line_across_a_hole_has_nothing_there(tmp_path):
    from fvsolve.core.output.csv_files import LineSampler

    case = fvsolve.load(
        liquid([], size=[4.0, 4.0], cells=[16, 16], holes=[[1.0, 1.0, 2.0, 2.5]])
        | {
            "output": {
                "every": 1e-4,
                "lines": {"cut": {"basin": "block", "from": [0, 2], "to": [4, 2], "points": 9}},
            }
        }
    )
    model = fvsolve.build(case)
    line = LineSampler(case.output.lines["cut"], model.meshed[0], case)
    rows = line.text(model.fields(model.start, model.new_out())["block"]).splitlines()
    # points at 1 m and 2 m are on the outline
    found = [float(row.split(",")[3]) for row in rows[1:]]
    assert found == approx([5e5, 5e5, 5e5, np.nan, *[5e5] * 5], rel=1e-12, nan_ok=True)


# frames -----------------------------------------------------------------------------------------------------


def test_a_frame_of_triangles_and_quads_opens_with_pyvista_and_meshio_and_knows_its_units(tmp_path):
    import pyvista
    from vtkmodules.vtkCommonCore import vtkDataArray

    path = write(tmp_path / "block.msh", *shaken())
    case = liquid([], mesh={"file": str(path)})
    model = model_of(case)
    basin = model.meshed[0]
    fields = model.fields(random_state(model, 1e-3), model.new_out())["block"]
    points, cells = basin_geometry(basin, np.zeros(2))
    data = {name: split_blocks(values, cells) for name, values in fields.items()}
    write_frame(tmp_path / "block.vtu", grid_xml(points, cells), data, basin.units)
    found, drawn = meshio.read(tmp_path / "block.vtu"), pyvista.read(tmp_path / "block.vtu")
    kinds = {block.type for block in found.cells}
    assert kinds == {"triangle", "quad"} and drawn.n_cells == basin.n
    assert np.array_equal(np.concatenate(found.cell_data["pressure"]), fields["pressure"])
    assert np.array_equal(drawn.cell_data["velocity"], fields["velocity"])
    assert np.allclose(drawn.compute_cell_sizes().cell_data["Area"], basin.mesh.area, rtol=1e-12)
    units = {
        name: drawn.GetCellData().GetArray(name).GetInformation().Get(vtkDataArray.UNITS_LABEL())
        for name in fields
    }
    assert units == {"pressure": "Pa", "velocity": "m/s"}
    case["output"]["units"] = {"pressure": "barg", "length": "ft"}
    asked = fvsolve.load(case)
    scene = DrawnScene("", unit_of(asked, "pressure"), *lengths_of(asked), [])
    shown = of_view.read_frame(tmp_path / "block.vtu", scene)
    assert shown["pressure"] == approx(
        1e-5 * (fields["pressure"] - asked.ambient_pressure), abs=1e-9
    )
    assert (scene.quantity.unit, scene.length.unit) == ("barg", "ft")
    assert np.asarray(shown.points)[:, :2] == approx(points[:, :2] / 0.3048, rel=1e-6)


def test_pipes_end_at_the_patches_of_a_basin_where_it_is_drawn(tmp_path):
    case = draining([], 0.01, {"fields": 1})
    case["nodes"]["pool"]["patches"]["inlet"] = {"side": "west"}
    case["nodes"]["lake"] = lake(2.0)
    case["links"]["main"] = pipe("lake", "pool.inlet", 20.0, 0.2, 1000.0, 10)
    for name, position in (("lake", [-20, 30]), ("pool", [5, 7]), ("out", [20, 9])):
        case["nodes"][name]["position"] = position
    assert fvsolve.run(case, out=tmp_path / "run").ok
    pipes = meshio.read(tmp_path / "run" / "fields" / "000001.vtu").points
    corners = meshio.read(tmp_path / "run" / "fields" / "pool-000001.vtu").points
    assert pipes[:2] == approx(np.array([[-20.0, 30.0, 0.0], [5.0, 9.0, 0.0]]))
    assert corners.min(0) == approx([5.0, 7.0, 0.0]) and corners.max(0) == approx([15.0, 11.0, 0.0])


# pictures ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "low, high",
    [(0.0, 1.0), (1.7888, 1.7901), (1.99, 1.990001), (101324.0, 101327.0), (2.0, 2.0), (0.0, 0.0), (-3e-6, 4e-6),
     (-1e-8, 1.0), (5e8, 5.00001e8), (0.99999, 100.0)],
)  # fmt: skip
def test_the_labels_of_a_bar_of_colours_differ(low, high):
    ends = colour_range(low, high)
    sheet = PictureSheet(film=True)
    labels = sheet.bar(ends, "pressure [bar]")
    assert len(set(labels)) == len(labels) >= 3 and ends[0] < ends[1]


def drawn(fvs, *arguments) -> str:
    code, out, err = fvs("view", *arguments)
    if "OpenGL" in err:
        pytest.skip(err)
    assert code == 0, err
    return out.strip()


@pytest.fixture
def dam(tmp_path, monkeypatch):
    """Run directory of a dam break with two frames."""
    monkeypatch.chdir(tmp_path)
    case = draining([], 0.5, {"fields": 1}, level=1.0, start={"level": "where(x < 5, 1, 0)"})
    fvsolve.run(case, out="dam", pictures=False)
    return "dam"


def test_view_draws_contours_and_magnitudes(dam, fvs):
    named = drawn(fvs, dam, "--field", "velocity")
    assert named.endswith("velocity.png")
    plain = open(named, "rb").read()
    lines = open(
        drawn(fvs, dam, "--field", "velocity", "--contours", "5", "--out", "b.png"), "rb"
    ).read()
    assert plain != lines and plain.startswith(b"\x89PNG")
    code, _, err = fvs("view", dam, "--field", "dept")
    assert code == 2 and "unknown field 'dept'; did you mean \"depth\"" in err
    assert "bed, depth, surface, velocity" in err


def test_view_animates_all_frames(dam, fvs):
    from PIL import Image

    with Image.open(drawn(fvs, dam, "--animate", "dam.gif")) as film:
        frames = []
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert len(frames) == 2
    bar = [frame[-60:, 30:430].std() for frame in frames]  # every frame has the colour bar
    assert min(bar) > 20.0 and np.abs(frames[1] - frames[0])[:400].max() > 50
    code, _, err = fvs("view", dam, "--animate", "dam.avi")
    assert code == 2 and "expected a file name that ends in .gif or .mp4" in err
    code, _, err = fvs("view", dam, "--animate", "dam.gif", "--time", "0 s")
    assert code == 2 and "--animate draws all times" in err


def test_view_writes_a_page_that_turns_or_names_the_package_to_install(dam, fvs, tmp_path):
    code, _, err = fvs("view", dam, "--out", tmp_path / "dam.html")
    if importlib.util.find_spec("trame_pyvista"):
        assert code == 0 and "vtk" in (tmp_path / "dam.html").read_text(encoding="utf-8")
    else:
        assert code == 2 and "pip install trame-pyvista" in err


def test_an_mp4_without_imageio_names_the_package_to_install(dam, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "imageio", None)
    with pytest.raises(FvsolveError, match="pip install imageio imageio-ffmpeg"):
        fvsolve.open_run(dam).animate("dam.mp4")


# check ------------------------------------------------------------------------------------------------------


def test_check_describes_basins(tmp_path, monkeypatch, fvs):
    monkeypatch.chdir(tmp_path)
    fvsolve.run(draining([], 0.1, bed="0.1*x"), out="run")
    code, out, _ = fvs("check", "run/case.toml", "--json")
    said = json.loads(out)
    one = said["basins"]["pool"]
    assert code == 0 and said["cells"] == one["cells"] == 160
    assert (one["physics"], one["path"], one["area"]) == ("free-surface", "grid", approx(40.0))
    assert one["depth"] == approx([2.0 - 0.975, 2.0 - 0.025])
    assert one["wave_speed"] == approx(np.sqrt(GRAVITY * np.array(one["depth"])))
    assert one["patches"]["outlet"] == {
        "faces": 4,
        "length": approx(2.0),
        "area": approx(1.0),
        "reflects": 1.0,
    }
    # at least its state, and depth and bed of the profile
    assert one["memory"] >= 8 * 160 * (3 + 2)
    code, out, _ = fvs("check", "run/case.toml")
    assert code == 0 and "pool.outlet" in out and "free-surface" in out and "1.025 to 1.975" in out


def test_keys_that_a_mesh_leaves_out_are_noted(tmp_path):
    points, cells = shaken()
    path = write(tmp_path / "mm.msh", 1e7 * np.array(points), cells)
    model = model_of(liquid([], mesh={"file": str(path)}))
    assert any(
        "basin block: the mesh is" in note.text and 'unit = "mm"' in note.text
        for note in model.warnings
    )
    assert any("the file contains no named group of lines" in note.text for note in model.warnings)


def test_a_summary_counts_the_cells_of_basins():
    assert fvsolve.run(draining([], 0.2)).summary["cells"] == 160


# open sides, and keys of basins -----------------------------------------------------------------------------


@pytest.mark.parametrize("physics", ["free-surface", "liquid"])
def test_rows_contain_the_flow_through_an_open_side(physics, tmp_path):
    """The flow through the open side, integrated over the rows, is the gain of the content."""
    sea = {"sea": {"side": "west", "boundary": "open"}}
    if physics == "liquid":
        case = liquid(
            ["block.sea.flow"],
            size=[1.0, 0.2],
            cells=[20, 2],
            patches=sea,
            start={"pressure": "1e5*x"},
        )
        case["output"]["every"] = 2e-6
    else:
        case = draining(
            ["pool.sea.flow"], 2.0, {"every": 0.01}, patches=sea, start={"level": "2 - 0.01*x"}
        )
        case["links"], case["nodes"] = {}, {"pool": case["nodes"]["pool"]}
    found = fvsolve.run(case)
    flow = found["pool.sea.flow" if physics == "free-surface" else "block.sea.flow"]
    assert np.ptp(flow[1:-1]) > 0.1 * np.abs(flow).max() > 0.0
    booked = found.summary["ledgers"]["mass"]["by_node"]
    assert RHO * np.trapezoid(flow, found.t) == approx(next(iter(booked.values())), rel=2e-3)


def sheet(**more) -> dict:
    """Return a case of a uniform stream that carries a dye."""
    one = {
        "type": "basin",
        "physics": "transport",
        "size": [2.0, 1.0],
        "cells": [16, 8],
        "scalars": {"dye": "x"},
        "velocity": {"expression": "constant", "u": "40 cm/s", "v": 0.0},
        **more,
    }
    ends = {"in": {"side": "west", "scalars": {"dye": 0.0}}, "out": {"side": "east"}}
    case = scene({"sheet": one | {"patches": ends}}, {}, 0.5, PLANE, ["sheet.dye@1,0.5"], 0.1)
    case["scalars"] = {"dye": {"unit": "g/l", "decay": "1800 1/h"}}
    return case


def test_a_line_has_scalars_and_a_velocity_by_name_its_parameters(tmp_path):
    """c = (x - u t) exp(-decay t) away from the inlet, with a decay of 1800 1/h."""
    case = sheet()
    case["numerics"]["courant"] = 0.2
    mid = {"basin": "sheet", "from": [1, 0.5], "to": [1.5, 0.5], "points": 3}
    case["output"] |= {"fields": 1, "lines": {"mid": mid}}
    fvsolve.run(case, out=tmp_path / "run")
    rows = list(csv.reader((tmp_path / "run/lines/mid-000001.csv").read_text().splitlines()))
    assert rows[0] == ["distance [m]", "x [m]", "y [m]", "dye [g/l]"]
    for _, x, _, dye in rows[1:]:
        assert float(dye) == approx((float(x) - 0.4 * 0.5) * np.exp(-0.25), rel=1e-3)


NO_VELOCITIES = {
    'nodes.sheet.velocity.speed: "fast" is not a number with a unit': {
        "expression": "swirl",
        "speed": "fast",
    },
    'velocity "shear" has no parameter y1; expected rate, u, y0': {
        "expression": "shear",
        "rate": 1,
        "y1": 0,
    },
    "nodes.sheet.velocity: has stream, u; expected velocity field: { u, v } or { stream }": {
        "stream": "y",
        "u": 1,
    },
    "nodes.sheet.velocity.centre: [0] has 1 values": {
        "expression": "rotation",
        "centre": [0],
        "angular_velocity": 1,
    },
}


@pytest.mark.parametrize("said", NO_VELOCITIES)
def test_a_velocity_that_is_none(said):
    with pytest.raises(FvsolveError) as caught:
        model_of(sheet(velocity=NO_VELOCITIES[said]))
    assert said in str(caught.value)


def test_quantities_of_a_basin():
    plain = liquid(
        [],
        size=[1.0, 1.0],
        cells=[2, 2],
        start={"pressure": 1e5, "u": 0.5, "v": "2*x"},
        patches={"soft": {"side": "west", "impedance": 2e6}},
    )
    named = json.loads(json.dumps(plain))
    named["nodes"]["block"] |= {
        "start": {"pressure": "1 bar", "u": "50 cm/s", "v": "2*x"},
        "patches": {"soft": {"side": "west", "impedance": "2 MPa s/m"}},
    }
    one, other = (fvsolve.load(case).nodes["block"] for case in (plain, named))
    assert one.patches["soft"].impedance == other.patches["soft"].impedance == 2e6
    at = np.array([0.3]), np.array([0.4])
    for field in ("pressure", "u", "v"):
        assert getattr(one.start, field).at(*at) == approx(
            getattr(other.start, field).at(*at), rel=1e-14
        )


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"level": "two"}, "nodes.pool.level"),
        ({"holes": "none"}, "nodes.pool.holes"),
        (
            {"bed": "0.5*(y"},
            'nodes.pool.bed: "0.5*(y" is not a formula of x and y: a bracket is not closed',
        ),
        ({"bed": "0.5*y)"}, "a closing bracket has no opening bracket"),
        ({"bed": "2*x y"}, '"2*x y" is not a formula of x and y: invalid syntax'),
        (
            {"bed": {"file": "bed.csv"}},
            'nodes.pool.bed.file: bed.csv, line 4: "deep" is not a number in column "z"',
        ),
    ],
)
def test_a_fault_in_a_basin_comes_once(changes, said, tmp_path):
    (tmp_path / "bed.csv").write_text("x,y,z\n# metres\n0,0,0\n1,0,deep\n0,1,0\n")
    case = draining(["pool.outlet.flow", "pool.depth@1,1"], **changes)
    case["output"]["lines"] = {"middle": {"basin": "pool", "from": [0, 2], "to": [10, 2]}}
    case["expect"] = {"max(pool.outlet.flow)": {"value": 0.0, "atol": 1.0}}
    if "bed" in changes and isinstance(changes["bed"], dict):
        case["nodes"]["pool"]["bed"] = {"file": str(tmp_path / "bed.csv")}
    with pytest.raises(CaseError) as caught:
        fvsolve.load(case)
    assert len(caught.value.faults) == 1 and said in str(caught.value)


def test_check_names_the_valve_that_sets_the_step():
    """Between equal levels the slope of the flow through a large valve limits the step, where the cells take its flow.

    They do in a basin with a moving wall. Where the flow passes through faces, their waves bound the slope.
    """
    nodes = {"pool": pool(), "pond": {"type": "tank", "area": 2.0, "level": 2.0}}
    case = scene(nodes, {"sluice": valve("pool.outlet", "pond", 0.5)}, 1.0, PLANE, [], 0.1)
    checks = model_of(case).checks
    assert checks["step_set_by"] == "one of pond, pool"
    case["nodes"]["pool"]["patches"] = {
        **case["nodes"]["pool"]["patches"],
        "paddle": {"side": "west", "travel": 0.0},
    }
    checks = model_of(case).checks
    assert checks["step_set_by"].startswith("links.sluice: ") and checks["step"] < 1e-4
    case["links"]["sluice"]["area"] = 1e-5
    assert model_of(case).checks["step_set_by"] == "one of pond, pool"
