"""Files of Gmsh: the same groups from each version of MSH, as text and binary, and clear faults.

The files in `gmsh/` are by Gmsh 4.15: a rectangle of 10 m by 4 m of curves 1 to 6, with the groups west, of curve 5 and
the reversed curve 6, and east, of curves 2 and 3. `-a` is text, `-b` binary.
"""

import re
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from reference.meshes import SQUARE, TWO, write
from reference.scenes import scene

import fvsolve
from fvsolve.core.mesh import read
from fvsolve.errors import MeshError

GMSH = Path(__file__).parent / "gmsh"
FORMS = ("2.2-a", "2.2-b", "4.0-a", "4.1-a", "4.1-b")


def lengths(mesh) -> dict[str, float]:
    return {name: float(mesh.length[mesh.patch(name)].sum()) for name in mesh.patches}


def fault(path) -> str:
    with pytest.raises(MeshError) as caught:
        read(path)
    return str(caught.value)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["plain", "parts"])
def test_all_forms_of_a_file_give_the_same_patches(kind, form):
    """`parts` is cut in two partitions, so that the groups belong to entities of the partitions."""
    mesh = read(GMSH / f"{kind}-{form}.msh")
    assert mesh.patches == ("west", "east", "wall")
    assert lengths(mesh) == approx({"west": 4.0, "east": 4.0, "wall": 20.0}, rel=1e-12)
    assert mesh.middle[mesh.patch("west")][:, 0] == approx(
        0.0, abs=1e-12
    ) and mesh.area.sum() == approx(40.0)
    assert not any("number instead of a name" in note for note in mesh.notes)


# a curve of a group, of 4.0 and 4.1
CURVE = re.compile(r"^(\d) (\S+ \S+ \S+ \S+ \S+ \S+) 1 -?([12]) ", re.MULTILINE)


@pytest.mark.parametrize("form", ["4.0-a", "4.1-a"])
@pytest.mark.parametrize("signs", [*product(("", "-"), repeat=4)])
def test_reversed_curves_belong_to_their_group(form, signs, tmp_path):
    turn = dict(zip("2356", signs, strict=True))
    text = (GMSH / f"plain-{form}.msh").read_text()
    text, count = CURVE.subn(
        lambda match: f"{match[1]} {match[2]} 1 {turn[match[1]]}{match[3]} ", text
    )
    (tmp_path / "turned.msh").write_text(text)
    assert count == 4 and lengths(read(tmp_path / "turned.msh")) == approx(
        {"west": 4.0, "east": 4.0, "wall": 20.0}
    )


def test_the_flow_through_a_patch_with_a_reversed_curve_is_that_of_msh_2():
    """The scene of the fault, with fewer cells: half of the inflow was lost."""

    def flow(form):
        patches = {"west": {"stage": 0.6}, "east": {"stage": 0.5}}
        pool = {
            "type": "basin",
            "mesh": {"file": str(GMSH / f"plain-{form}.msh")},
            "level": 0.5,
            "bed": 0.0,
            "patches": patches,
        }
        return fvsolve.run(scene({"b": pool}, {}, 3.0, {"scheme": "upwind"}, ["b.west.flow"]))[
            "b.west.flow"
        ]

    one, other = flow("2.2-a"), flow("4.1-b")
    assert other == approx(one, rel=1e-9) and one[-1] > 0.5


@pytest.mark.parametrize(
    "name", ["all-4.1-a", "para-4.1-b", "z-4.1-b", "points-4.1-a", "surf2-4.1-a"]
)
def test_other_content_of_a_file_changes_nothing(name):
    """All curves saved, parameters of points, another plane, a group of points, a surface in two groups."""
    assert lengths(read(GMSH / f"{name}.msh")) == approx({"west": 4.0, "east": 4.0, "wall": 20.0})


@pytest.mark.parametrize("form", ["2.2-a", "4.0-a", "4.1-a", "4.1-b"])
def test_a_curve_in_two_groups_is_a_fault_in_each_version(form):
    """MSH 2.2 contains its lines twice."""
    assert 'groups.again: faces shared with "west": 1, first the face from (0, 4) m' in fault(
        GMSH / f"two-{form}.msh"
    )


@pytest.mark.parametrize("form", ["2.2-a", "4.1-a"])
def test_a_curve_and_a_surface_may_have_groups_of_the_same_name(form):
    mesh = read(GMSH / f"samename-{form}.msh")
    assert lengths(mesh) == approx({"west": 4.0, "water": 4.0, "wall": 20.0})
    assert not any("number instead of a name" in note for note in mesh.notes)


def test_a_group_between_cells_is_ignored_with_a_note(tmp_path):
    mesh = read(GMSH / "break-4.1-a.msh")
    assert lengths(mesh) == approx({"west": 4.0, "east": 4.0, "wall": 20.0})
    assert mesh.notes[0].startswith(
        'the lines of the group "breakline" lie between cells: ignored; `walls` of'
    )
    wall = read(GMSH / "break-4.1-a.msh", walls=["breakline"])
    assert wall.length[wall.groups["breakline"]].sum() == approx(4.0)
    mixed = write(tmp_path / "mixed.msh", SQUARE, TWO, {"in": [[1, 4], [0, 3]]})
    assert "groups.in: lines that are not boundary faces: 1 of 2" in fault(mixed)


FAULTS = {
    "order2-4.1-b": "line3, triangle6 cannot be used (4 line3, 26 triangle6); expected triangle and quad; Gmsh: Mesh",
    "nosurf-4.1-a": "no two-dimensional cells (4 line); .* it writes only those; add one of the surface",
    "volume-4.1-a": "the file has three-dimensional cells (4 line, 26 triangle, 122 tetra)",
    "pieces-4.1-a": "the cells are in 2 pieces that share no face: 26 in the piece",
}


@pytest.mark.parametrize("name", FAULTS)
def test_meshes_that_cannot_be_used_are_named(name):
    head, _, tail = FAULTS[name].partition(" .* ")
    text = fault(GMSH / f"{name}.msh")
    assert head in text and tail in text


def test_damaged_files_are_faults_in_bounded_time(tmp_path):
    """Each byte of a file replaced, or its rest cut off, and a megabyte of one sign in each section."""
    rng, path = np.random.default_rng(59), tmp_path / "m.msh"
    for form in ("4.0-a", "4.1-a", "4.1-b"):
        good = (GMSH / f"plain-{form}.msh").read_bytes()
        for _ in range(100):
            data = bytearray(good)
            for at in rng.integers(len(data), size=rng.choice([1, 10])):
                data[at] = rng.integers(256)
            path.write_bytes(data[: rng.integers(len(data))] if rng.random() < 0.3 else data)
            try:
                assert len(read(path).cells) > 0
            except MeshError as error:
                assert len(str(error)) < 3000
    good = (GMSH / "plain-4.1-a.msh").read_text()
    start = time.process_time()
    for sign, section in product(" 9,\n#$", ("Entities", "Nodes", "Elements")):
        path.write_text(good.replace(f"${section}\n", f"${section}\n{sign * 10**6}", 1))
        try:
            read(path)
        except MeshError as error:
            assert len(str(error)) < 3000
    assert time.process_time() - start < 18 * 5.0


@pytest.mark.parametrize(
    "name, sign",
    [("a.node", " "), ("a.su2", "7"), ("a.su2", "a\n"), ("a.msh", " "), ("a.vtk", "#")],
)
def test_texts_that_are_no_meshes_are_refused_in_bounded_time(name, sign, tmp_path):
    (tmp_path / name).write_text(sign * 10**6)
    start = time.process_time()
    assert f"{name}: 1 fault" in fault(tmp_path / name) and len(fault(tmp_path / name)) < 1000
    assert time.process_time() - start < 10.0
