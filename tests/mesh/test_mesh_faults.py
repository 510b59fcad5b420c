"""Faulty meshes: each fault has its message, with the cell."""

import math

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.meshes import MSH4, SQUARE, TWO, write

from fvsolve.errors import CaseError, MeshError
from fvsolve.mesh import read, read_mesh, rectangle

UNIT = dict(size=(1.0, 1.0), cells=(4, 4))
BAD_RECTANGLES = {
    "size: [1, 0]; expected two positive lengths": dict(size=(1, 0)),
    "cells: [4, 2.5]; expected two whole numbers": dict(cells=(4, 2.5)),
    "origin: [nan, 0]; expected the two coordinates": dict(origin=(math.nan, 0)),
    "grading: [0, 1]; expected two positive ratios": dict(grading=(0, 1)),
    "grading: [2, 1] with cells [1, 4]; expected 1 along an axis": dict(cells=(1, 4), grading=(2, 1)),
    "grading: [1e+40, 1]: the smallest cells vanish": dict(origin=(1.0, 0.0), grading=(1e40, 1)),
    "holes[0]: [0, 0, 0, 1]; expected [x0, y0, x1, y1]": dict(holes=[(0, 0, 0, 1)]),
    "holes[0]: x1 = 0.3 m is on no grid line; nearest x: 0.25 and 0.5 m": dict(holes=[(0, 0, 0.3, 1)]),
    "holes[0]: y1 = 2 m is on no grid line; nearest y: 1 m": dict(holes=[(0, 0, 0.5, 2)]),
    "holes: the holes leave 2 pieces that share no face": dict(holes=[(0.25, 0, 0.5, 1)]),
    "holes: the holes leave no cell": dict(holes=[(0, 0, 1, 1)]),
    'patches.a: unknown side "wets"; expected west, east, south, north; did you mean "west"?': dict(
        patches={"a": "wets"}
    ),
    "patches.a: 0.2 to 0.5 m does not consist of whole faces of the west side; nearest is 0.25 to 0.5 m": dict(
        patches={"a": ("west", 0.2, 0.5)}
    ),
    "holes[0]: [0, 0, 1e-12, 1] contains no cells; expected x0 and x1": dict(holes=[(0, 0, 1e-12, 1)]),
    "patches.a: 0 to 1e-12 m does not consist of whole faces of the west side; nearest is 0 to 0.25 m": dict(
        patches={"a": ("west", 0.0, 1e-12)}
    ),
    "patches.a: 0.3 to 0.31 m does not consist of whole faces of the west side; nearest is 0.25 to 0.5 m": dict(
        patches={"a": ("west", 0.3, 0.31)}
    ),
    "patches.a: [0.5, 0.25]; expected two coordinates along the west side [m], the first below the second": dict(
        patches={"a": ("west", 0.5, 0.25)}
    ),
    'patches.b: overlaps "a" on the west side, about 0.625 to 0.875 m': dict(
        patches={"a": ("west", 0.5, 1.0), "b": "west"}
    ),
    "patches.a: 0 to 1 m on the west side runs along a hole; expected a span within 0 to 0.5 m": dict(
        holes=[(0, 0.5, 0.25, 1)], patches={"a": ("west", 0.0, 1.0)}
    ),
    "patches.a: the holes remove the whole west side": dict(holes=[(0, 0, 0.5, 1)], patches={"a": "west"}),
}


@pytest.mark.parametrize("message", BAD_RECTANGLES)
def test_bad_rectangles(message):
    with pytest.raises(MeshError) as caught:
        rectangle(**(UNIT | BAD_RECTANGLES[message]))
    assert message in str(caught.value) and len(caught.value.faults) == 1


def test_all_faults_at_once():
    with pytest.raises(CaseError) as caught:
        rectangle(**UNIT, patches={"a": "top", "b": ("west", 0.1, 1.0)}, holes=[(0.5, 0, 0.75, 1)])
    assert [fault.place for fault in caught.value.faults] == ["holes", "patches.a", "patches.b"]


GRID = dict(points=SQUARE, cells=TWO)
HANGING = dict(points=[*SQUARE, (1, 0.5)], cells=[[0, 1, 4, 3], [1, 2, 6], [2, 5, 6], [5, 4, 6]])
TWICE = [*SQUARE, (1, 0), (1, 1)]  # second copy of the line between the squares
BAD_FILES = {
    "cells: 1 of 2 cells: cell 1 at (1.55, 0.3) m have coincident corners": dict(
        points=[*SQUARE[:2], (2, 0), (0, 1), (1, 1), (1.6, 0.6)], cells=[TWO[0], [1, 2, 5, 5]]
    ),
    "cells: 1 of 2 cells: cell 1 at (1.5, 0.5) m cross themselves": dict(points=SQUARE, cells=[TWO[0], [1, 2, 4, 5]]),
    "cells: 1 of 2 cells: cell 1 at (1.3, 0.375) m are not convex": dict(
        points=[*SQUARE[:5], (1.2, 0.5)], cells=[TWO[0], [1, 2, 5, 4]]
    ),
    "cells: 1 of 3 cells: cell 0 at (1, 0) m have no area": dict(points=SQUARE, cells=[[0, 1, 2], *TWO]),
    "cells: some cells overlap at the face from (1, 1) m to (1, 0) m: cell 0 at (1.16667, 0.5) m and cell 1": dict(
        points=[*SQUARE, (1.5, 0.5)], cells=[[1, 6, 4], *TWO]
    ),
    "both lie on one side of the face": dict(points=[*SQUARE[:5], (0.5, 0.5)], cells=[[0, 1, 4, 3], [0, 1, 5]]),
    "(4 such faces): cell 0 at (0.5, 0.5) m and cell 1 at (0.5, 0.5) m and cell 2 at": dict(
        points=SQUARE, cells=[TWO[0]] * 3
    ),
    "boundary: at 1 place faces have the corner of another cell between their ends: cell 3 at (0.5, 0.5) m": HANGING,
    "boundary: at 1 place faces coincide but are not connected: cell 0 at (0.5, 0.5) m and cell 1": dict(
        points=TWICE, cells=[TWO[0], [6, 2, 5, 7]]
    ),
    "the cells are in 2 pieces that share no face: 2 in the piece of cell 1 at (0.5, 0.5) m, 1 in the piece": dict(
        points=[*SQUARE, (5, 0), (6, 0), (6, 1)], cells=[[6, 7, 8], *TWO]
    ),
    "groups.in: lines that are not boundary faces: 1 of 1; the line from (1, 0) m to (1, 1) m lies between": dict(
        **GRID, groups={"in": [1, 4]}
    ),
    "groups.in: lines that are not boundary faces: 1 of 2; the line from (0, 0) m to (1, 1) m is not a side": dict(
        **GRID, groups={"in": [[0, 3], [0, 4]]}
    ),
    "a line ends at a point that belongs to no cell": dict(points=[*SQUARE, (9, 9)], cells=TWO, groups={"in": [0, 6]}),
    'groups.out: faces shared with "in": 1, first the face from (0, 1) m to (0, 0) m': dict(
        **GRID, groups={"in": [0, 3], "out": [[3, 0], [0, 1]]}
    ),
    "points: z runs from 0 to 0.2 m; cell 1 has a point in the upper half of this range; expected a mesh": dict(
        points=[(x, y, 0.2 * (x > 1)) for x, y in SQUARE], cells=TWO
    ),
    "z = constant; y is constant: turn the mesh": dict(points=[(x, 0, y) for x, y in SQUARE], cells=TWO),
    "cells: there are no two-dimensional cells (2 line); expected triangle and quad": dict(
        points=SQUARE, cells=[], groups={"in": [[0, 1], [1, 2]]}
    ),
    "points: 1 of 6 has invalid coordinates (not a number, or too large), first point 5": dict(
        points=[*SQUARE[:5], (math.nan, 1)], cells=TWO
    ),
}


@pytest.mark.parametrize("message", BAD_FILES)
def test_bad_files(tmp_path, message):
    path = write(tmp_path / "bad.msh", **BAD_FILES[message])
    with pytest.raises(MeshError) as caught:
        read(path)
    assert message in str(caught.value) and len(caught.value.faults) == 1
    assert str(caught.value).startswith("bad.msh: 1 fault\n")


def test_a_boundary_that_crosses_itself(tmp_path):
    """A strip of quads turns round and crosses its own beginning."""
    ring = [(r * math.cos(w), r * math.sin(w)) for w in np.arange(9) * 0.9 for r in (1.0, 2.0)]
    cells = [[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2] for k in range(8)]
    with pytest.raises(MeshError, match=r"places faces cross each other: cell \d at .* and cell \d at"):
        read(write(tmp_path / "ring.msh", ring, cells))
    assert read(write(tmp_path / "ring.msh", ring, cells[:6])).area.sum() == approx(6 * 1.5 * math.sin(0.9))


def test_a_thin_wall_may_be_named(tmp_path, monkeypatch):
    points = [*SQUARE, (0, 2), (1, 2), (2, 2), (1, 0)]  # two cells above two, the lower two separate
    cells = [[0, 1, 4, 3], [9, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    mesh = read(write(tmp_path / "wall.msh", points, cells, {"baffle": [1, 4]}))
    assert mesh.length[mesh.patch("baffle")].tolist() == [1.0] and mesh.inner == 3
    with pytest.raises(MeshError, match="at 1 place faces coincide .* a group of lines that marks the face as a thin"):
        read(write(tmp_path / "none.msh", points, cells))
    monkeypatch.setattr(read_mesh, "BLOCK", 1)  # as for a long boundary
    assert read(tmp_path / "wall.msh").inner == 3
    with pytest.raises(MeshError, match="at 1 or more places faces coincide"):
        read(tmp_path / "none.msh")


def test_faults_of_several_kinds_come_together(tmp_path):
    points = [*SQUARE, (0, 2), (1, 2)]
    cells = [[0, 4, 1, 3], [1, 2, 5, 4], [1, 2, 5, 4], [3, 4, 7, 7]]
    with pytest.raises(MeshError) as caught:
        read(write(tmp_path / "bad.msh", points, cells))
    found = [fault.message for fault in caught.value.faults]
    assert [word in text for word, text in zip(["coincident", "cross", "overlap"], found, strict=True)] == [True] * 3


def test_files_that_hold_no_plane_mesh(tmp_path, capsys):
    def fault(name, **options):
        with pytest.raises(MeshError) as caught:
            read(tmp_path / name, **options)
        return str(caught.value)

    (tmp_path / "pool.msh").write_text(MSH4[: len(MSH4) // 2])
    assert "pool.msh: 1 fault\n  meshio cannot read the file (" in fault("pool.msh")
    assert 'there is no such file; did you mean "pool.msh"?' in fault("pol.msh")
    (tmp_path / "pool.dxf").write_text("0\n")
    assert "expected a name that ends in " in fault("pool.dxf") and ".msh" in fault("pool.dxf")
    (tmp_path / "empty.vtk").write_text("")
    assert "empty.vtk: 1 fault\n  meshio cannot read the file (" in fault("empty.vtk")
    cube = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    meshio.Mesh(cube, [("tetra", [[0, 1, 2, 3]]), ("triangle", [[0, 1, 2]])]).write(tmp_path / "solid.vtk")
    assert "cells: the file has three-dimensional cells (1 tetra, 1 triangle)" in fault("solid.vtk")
    six = np.array([(0, 0, 0), (2, 0, 0), (0, 2, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    meshio.Mesh(six, [("triangle6", [[0, 1, 2, 3, 4, 5]])]).write(tmp_path / "six.vtk")
    assert "cells: triangle6 cannot be used (1 triangle6)" in fault("six.vtk")
    assert "Mesh.ElementOrder = 1" in fault("six.vtk")
    (tmp_path / "saved-all.msh").write_text(
        MSH4.replace("1 2 5\n", "").replace("1 0 0 0 0 1 0 1 7 0", "1 0 0 0 0 1 0 0 0")
    )
    assert "Mesh.SaveAll = 0" in fault("saved-all.msh")
    assert capsys.readouterr() == ("", "")


def test_a_group_without_lines_is_told(tmp_path):
    (tmp_path / "four.msh").write_text(
        MSH4.replace('1 7 "in"', '1 7 "in"\n1 9 "rim"').replace("Names\n3\n", "Names\n4\n")
    )
    with pytest.raises(MeshError, match="groups.rim: the group contains no line of the file; .*Mesh.SaveAll"):
        read(tmp_path / "four.msh")


def test_a_cell_that_names_no_point(tmp_path):
    (tmp_path / "lost.vtk").write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\n"
        "CELLS 1 4\n3 0 1 7\nCELL_TYPES 1\n5\n"
    )
    with pytest.raises(
        MeshError, match="cells: number 0 refers to a point that is not in the file; the file has 3 points"
    ):
        read(tmp_path / "lost.vtk")
