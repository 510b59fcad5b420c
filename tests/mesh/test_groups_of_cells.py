"""Groups of cells, elevations of nodes and files .2dm: the same basin from any format, and faults by name."""

import numpy as np
import pytest
from pytest import approx
from reference.basins import model_of
from reference.grouped_meshes import FORMATS, GRASS, POINTS, QUADS, ROAD, TRIANGLES, sms, write
from reference.refusals import refused
from reference.scenes import scene

import fvsolve
from fvsolve.core.mesh import read
from fvsolve.errors import MeshError

SPREAD = {"road": 0.016, "grass": 0.035}


def pool(mesh, **keys) -> dict:
    own = {"type": "basin", "mesh": mesh, "level": 1.5, "elevation": 0.0, "bed": "nodes"} | keys
    case = scene({"pool": own}, {}, 2.0, {"scheme": "muscl"}, ["pool.depth@1.2,0.7"], every=0.5)
    return {key: table for key, table in case.items() if key != "links"}


def centres(cells) -> np.ndarray:
    """Centroids of triangles and parallelograms : float64[n, 2]."""
    return np.array([POINTS[cell, :2].mean(axis=0) for cell in cells])


def by_place(mesh, values) -> list:
    return sorted(zip(*mesh.centre.round(9).T.tolist(), np.asarray(values).tolist(), strict=True))


@pytest.mark.parametrize("form", FORMATS)
def test_each_cell_has_the_roughness_of_its_group_and_the_bed_of_its_nodes(form, tmp_path):
    """The bed is a plane, whose mean over a cell is its elevation at the centroid."""
    named = form != "2dm"
    given = SPREAD if named else {"1": 0.016, "2": 0.035}
    case = pool({"file": write(tmp_path / "mesh", form)}, manning={"groups": given})
    basin = model_of(case).meshed[0]
    at = centres([*QUADS, *TRIANGLES])
    rough = [SPREAD["road"] if k in ROAD else SPREAD["grass"] for k in range(len(at))]
    expected = sorted(zip(*at.round(9).T.tolist(), rough, strict=True))
    assert by_place(basin.mesh, basin.roughness) == expected
    assert basin.bed == approx(basin.mesh.centre @ (0.1, 0.2), rel=1e-14)
    names = ("inflow", "outflow") if named else ("1", "2")
    assert basin.mesh.patches == (*names, "wall")
    for name, x in zip(names, (0.0, 3.0), strict=True):
        middles = basin.mesh.middle[basin.mesh.patch(name)]
        assert sorted(map(tuple, middles)) == [(x, 0.5), (x, 1.5)]


def test_a_run_gives_equal_numbers_from_all_formats_and_from_its_resolved_case(tmp_path):
    """A bed at the bottom of still water: the run also keeps the lake at rest to the bit."""
    found = set()
    for form in FORMATS[1:]:
        folder = tmp_path / form.replace(" ", "-")
        case = pool({"file": write(tmp_path / "mesh", form)}, manning={"groups": SPREAD})
        case["nodes"]["pool"]["start"] = {"level": "1.5 + 0.01*x"}
        result = fvsolve.run(case, out=folder)
        again = fvsolve.run(folder / "case.toml", out=tmp_path / "again", force=True)
        assert np.array_equal(result["pool.depth@1.2,0.7"], again["pool.depth@1.2,0.7"])
        found.add(tuple(result["pool.depth@1.2,0.7"].round(12)))
    assert len(found) == 1


def test_water_over_the_bed_of_the_nodes_stays_at_rest(tmp_path):
    case = pool({"file": write(tmp_path / "mesh", "2dm")}, level=0.45)
    result = fvsolve.run(case)
    assert np.ptp(result["pool.depth@1.2,0.7"]) == 0.0 and result.ok


def test_strings_of_nodes_carry_flow(tmp_path):
    case = pool({"file": write(tmp_path / "mesh", "2dm, names")}, manning={"groups": SPREAD})
    case["nodes"]["pool"]["patches"] = {"inflow": {"discharge": 0.3}}
    result = fvsolve.run(case)
    assert result.ledger["mass"]["relative"] < 1e-12
    assert result.ledger["mass"]["by_node"]["pool.inflow"] == approx(600.0, rel=1e-9)


def test_infiltration_may_have_groups(tmp_path):
    soil = {"model": "constant", "rate": {"groups": {"road": 0.0, "grass": "36 mm/h"}}}
    case = pool({"file": write(tmp_path / "mesh", "msh 4.1")}, infiltration=soil)
    case["output"]["probes"] = ["pool.infiltrated"]
    assert fvsolve.run(case)["pool.infiltrated"][-1] == approx(1e-5 * 4.0 * 2.0, rel=1e-9)


FAULTS = {
    "group without value": (
        {"manning": {"groups": {"road": 0.016}}},
        "nodes.pool.manning: 7 of 9 cells have no value, first at x = 1.33333 m, y = 1.66667 m; expected values",
    ),
    "value without group": (
        {"manning": {"groups": SPREAD | {"gras": 0.03}}},
        'nodes.pool.manning: the mesh has no group of cells "gras"; did you mean "grass"?',
    ),
    "no groups": (
        {"manning": {"groups": {}}},
        "nodes.pool.manning.groups: has no groups; expected for example",
    ),
    "other key": (
        {"manning": {"groups": SPREAD, "of": 1}},
        "nodes.pool.manning.of: unknown key; expected only",
    ),
    "negative": (
        {"manning": {"groups": SPREAD | {"road": -1}}},
        "nodes.pool.manning.groups.road: -1 is out of range",
    ),
    "ignored": (
        {"mesh": {"ignore": ["inflw"]}},
        'mesh.ignore: no group of lines "inflw"; did you mean "inflow"?',
    ),
    "ignored words": (
        {"mesh": {"ignore": "inflow"}},
        'nodes.pool.mesh.ignore: "inflow" is not a list of names',
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_groups_name_the_group(name, tmp_path):
    keys, message = FAULTS[name]
    mesh = {"file": write(tmp_path / "mesh", "msh 2.2")} | keys.get("mesh", {})
    assert message in str(refused(pool(mesh, **{k: v for k, v in keys.items() if k != "mesh"})))


def test_a_rectangle_has_no_groups_and_no_nodes():
    case = pool(None, size=[2.0, 1.0], cells=[4, 2], manning={"groups": SPREAD})
    del case["nodes"]["pool"]["mesh"]
    error = str(refused(case))
    assert (
        "nodes.pool.bed: the mesh has no elevations of nodes; expected a mesh file with z" in error
    )
    assert 'nodes.pool.manning: the mesh has no group of cells "road"' in error


def test_ignored_groups_are_walls(tmp_path):
    path = write(tmp_path / "mesh", "msh 4.1", flat=True)
    assert read(path).patches == ("inflow", "outflow", "wall")
    mesh = read(path, ignored=["inflow"])
    assert mesh.patches == ("outflow", "wall") and mesh.length[mesh.patch("wall")].sum() == approx(
        8.0
    )


def test_elevations_need_the_key_of_the_bed_except_in_files_of_sms(tmp_path):
    with pytest.raises(
        MeshError, match='expected a mesh in one plane, z = constant, or bed = "nodes"'
    ):
        read(write(tmp_path / "mesh", "msh 2.2"))
    notes = read(write(tmp_path / "mesh", "2dm")).notes
    assert any('elevations of nodes in the file: ignored; bed = "nodes"' in note for note in notes)


def test_regions_are_the_cells_of_the_file_in_any_order(tmp_path):
    for form in FORMATS[1:]:
        mesh = read(write(tmp_path / "mesh", form), heights=True)
        for name, cells in (("road", ROAD), ("grass", GRASS)):
            expected = centres([[*QUADS, *TRIANGLES][k] for k in cells])
            found = mesh.centre[mesh.regions[name]]
            assert sorted(map(tuple, found.round(9))) == sorted(map(tuple, expected.round(9)))


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("E3T 4 ", "E6T 4 ", "E6T is not read; expected E3T and E4Q"),
        ("NS -12", "NS 12", "the last node string has no end; expected a negative number"),
        ("ND 12 ", "ND 13 ", "there is no node 12; expected a line ND for each node"),
        ("ND 12 ", "ND 11 ", "two nodes have the number 11"),
        ("ND 12 3.00000000e+00 2.0 ", "ND 12 3.00000000e+00 ", "fewer than three coordinates"),
        ("E4Q 1 1 2 6 5 1", "E4Q 1 1 2", "a cell has 2 nodes; expected 4"),
        ("ND 12 3.0", "ND 12 3,0", "a number is missing or is not valid"),
    ],
)
def test_faults_of_a_file_of_sms_name_the_line(old, new, message, tmp_path):
    text = sms(names=False)
    assert old in text
    (tmp_path / "mesh.2dm").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(MeshError) as caught:
        read(tmp_path / "mesh.2dm")
    assert message in str(caught.value)
