"""Plane meshes: Green's and Euler's theorems, order of points, points outside, and faults, each with its message."""

import math

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.meshes import MSH4, SQUARE, TWO, corner_lists, delaunay, sets, shaken, write
from scipy.spatial import ConvexHull

from fvsolve.core.mesh import quality, read, read_mesh, rectangle
from fvsolve.core.mesh.mesh import MeshPoints
from fvsolve.errors import CaseError, MeshError

EPS = np.finfo(float).eps


@pytest.fixture
def meshes(tmp_path):
    """Meshes by name : (mesh, area of the domain [m2], number of holes)."""
    triangles, mixed = (
        read(write(tmp_path / f"{name}.msh", *made))
        for name, made in (("t", delaunay()), ("m", shaken()))
    )
    return {
        "rectangle": (rectangle((2.0, 1.0), (7, 4), origin=(1e3, -1e3)), 2.0, 0),
        "graded": (rectangle((2.0, 1.0), (7, 4), grading=(5.0, 0.3)), 2.0, 0),
        "corner": (rectangle((2.0, 1.0), (8, 4), holes=[(1.0, 0.5, 2.0, 1.0)]), 1.5, 0),
        "ring": (rectangle((3.0, 3.0), (6, 6), holes=[(1.0, 1.0, 2.0, 2.0)]), 8.0, 1),
        "triangles": (triangles, ConvexHull(triangles.points).volume, 0),
        "mixed": (mixed, 6.0, 0),
    }


KINDS = ["rectangle", "graded", "corner", "ring", "triangles", "mixed"]


def around(mesh, of_face):
    """Sum of the outflow over the faces of each cell."""
    out = np.zeros((len(mesh.cells), *of_face.shape[1:]))
    np.add.at(out, mesh.left, of_face)
    np.subtract.at(out, mesh.right[: mesh.inner], of_face[: mesh.inner])
    return out


@pytest.mark.parametrize("kind", KINDS)
def test_cells_fill_the_domain_and_close(meshes, kind):
    mesh, area, holes = meshes[kind]
    reach = np.abs(mesh.points).max()
    assert mesh.area.sum() == approx(area, rel=1e-13 * max(reach, 1.0)) and mesh.area.min() > 0
    assert np.abs(around(mesh, mesh.normal * mesh.length[:, None])).max() < 8 * EPS * reach
    assert len(mesh.points) - len(mesh.left) + len(mesh.cells) == 1 - holes


@pytest.mark.parametrize("kind", KINDS)
def test_greens_theorem_gives_areas_and_centroids(meshes, kind):
    """From faces: areas by div (x, 0), first moments by div (x^2/2, 0) and div (0, y^2/2) with Simpson's rule."""
    mesh, _, _ = meshes[kind]
    flux = (mesh.middle * (1.0, 0.0) * mesh.normal).sum(1) * mesh.length
    reach = np.abs(mesh.points).max()
    assert around(mesh, flux) == approx(mesh.area, abs=16 * EPS * reach**2)
    origin = mesh.points.mean(0)
    a, b, m = (
        p - origin
        for p in (mesh.points[mesh.ends[:, 0]], mesh.points[mesh.ends[:, 1]], mesh.middle)
    )
    square = (a**2 + 4 * m**2 + b**2) / 6
    moment = around(mesh, 0.5 * square * mesh.normal * mesh.length[:, None])
    assert moment == approx(mesh.area[:, None] * (mesh.centre - origin), abs=16 * EPS * reach**2)


@pytest.mark.parametrize("kind", KINDS)
def test_faces_stand_in_order_and_look_from_left_to_right(meshes, kind):
    mesh, _, _ = meshes[kind]
    inner = slice(0, mesh.inner)
    assert (mesh.right[: mesh.inner] > mesh.left[: mesh.inner]).all() and (
        mesh.right[mesh.inner :] < 0
    ).all()
    across = mesh.centre[mesh.right[inner]] - mesh.centre[mesh.left[inner]]
    assert ((across * mesh.normal[inner]).sum(1) > 0).all()
    assert (((mesh.middle - mesh.centre[mesh.left]) * mesh.normal).sum(1) > 0).all()
    assert np.hypot(*mesh.normal.T) == approx(1.0, rel=2 * EPS)
    along = np.diff(mesh.points[mesh.ends], axis=1)[:, 0]
    assert (mesh.normal[:, 0] * along[:, 1] - mesh.normal[:, 1] * along[:, 0] > 0).all()


def test_rectangles_are_exact():
    mesh = rectangle((1.0, 0.7), (3, 7), grading=(2.0, 1.0), origin=(0.1, 0.2))
    x, y, index = mesh.grid.x, mesh.grid.y, mesh.grid.index
    assert (index == np.arange(21).reshape(7, 3)).all()
    cx, cy = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    assert (mesh.centre[index] == np.stack([cx, cy], axis=2)).all()
    assert (mesh.area[index] == np.outer(np.diff(y), np.diff(x))).all()
    assert set(map(tuple, np.abs(mesh.normal))) == {(1.0, 0.0), (0.0, 1.0)}
    assert not np.signbit(mesh.normal[mesh.normal == 0]).any()


def test_spacings_grow_geometrically():
    mesh = rectangle((2.0, 1.0), (5, 1), grading=(16.0, 1.0))
    step = np.diff(mesh.grid.x)
    assert step[1:] / step[:-1] == approx(2.0) and step.sum() == approx(2.0)
    assert quality(mesh).ratio == approx(2.0)


def test_the_same_rectangle_from_a_file(tmp_path):
    made = rectangle(
        (2.0, 1.0), (6, 4), grading=(3.0, 1.0), patches={"in": ("west", 0.25, 0.75), "out": "east"}
    )
    groups = {name: made.ends[made.patch(name)] for name in ("in", "out")}
    back = read(write(tmp_path / "r.msh", made.points, corner_lists(made), groups))
    assert back.grid is None and back.patches == made.patches == ("in", "out", "wall")
    order = np.lexsort(back.centre.T)  # cells of a file are renumbered
    for name in ("cells", "area", "centre"):
        assert np.array_equal(getattr(back, name)[order], getattr(made, name)), name
    assert np.array_equal(back.points, made.points) and sets(back) == sets(made)


def test_order_of_points_cells_and_corners_does_not_matter(tmp_path):
    rng = np.random.default_rng(11)
    points, cells = shaken()
    outer = read(write(tmp_path / "a.msh", points, cells))
    west = outer.ends[outer.middle[:, 0] == points[:, 0].min()]
    one = read(write(tmp_path / "b.msh", points, cells, {"west": west}))
    place = rng.permutation(len(points))
    moved = np.empty_like(points)
    moved[place] = points
    turned = [
        np.roll(place[cells[c]], rng.integers(4))[:: rng.choice([1, -1])]
        for c in rng.permutation(len(cells))
    ]
    other = read(write(tmp_path / "c.msh", moved, turned, {"west": place[west][::-1, ::-1]}))
    assert sets(one) == sets(other) and one.patches == other.patches
    assert any("were clockwise: reversed" in note for note in other.notes) and len(west) == 5


def test_quality_of_known_shapes(tmp_path):
    points = [(0, 0), (1, 0), (0.5, math.sqrt(0.75)), (2, 0)]
    mesh = read(write(tmp_path / "t.msh", points, [[0, 1, 2], [1, 3, 2]]))
    found = quality(mesh)
    assert (
        found.angle == approx(math.pi / 6)
        and mesh.centre[found.sharpest, 0] > 1.0
        and found.ratio == approx(1.0)
    )
    assert found.smallest == approx(math.sqrt(3) / 4) and found.largest == approx(math.sqrt(3) / 4)
    alone = quality(rectangle((2.0, 3.0), (1, 1)))
    assert (alone.ratio, alone.steepest, alone.largest) == (1.0, -1, 6.0) and alone.angle == approx(
        math.pi / 2
    )


def test_patches_and_holes_of_a_rectangle():
    mesh = rectangle(
        (3.0, 2.0),
        (6, 4),
        origin=(1.0, 0.0),
        holes=[(2.5, 1.0, 4.0, 2.0)],
        patches={
            "in": ("west", 0.5, 1.5),
            "top": "north",
            "wall": ("south", 1.0, 2.0),
            "out": "east",
        },
    )
    assert mesh.patches == ("in", "top", "out", "wall") and mesh.grid.index[3, 3] == -1
    assert mesh.middle[mesh.patch("in")].tolist() == [[1.0, 0.75], [1.0, 1.25]]
    # the part of the side without the hole
    assert mesh.middle[mesh.patch("top")][:, 0].tolist() == [1.25, 1.75, 2.25]
    assert mesh.middle[mesh.patch("out")].tolist() == [[4.0, 0.25], [4.0, 0.75]]
    # the perimeter does not change with a corner cut out
    assert mesh.length[mesh.inner :].sum() == 10.0
    with pytest.raises(ValueError):
        mesh.patch("outlet")


def test_decimals_near_a_line_mean_it():
    third = rectangle((1.0, 1.0), (3, 1), patches={"a": ("south", 0.333333, 1)})
    assert third.middle[third.patch("a")][:, 0] == approx([0.5, 5 / 6])


def test_notes_state_defaults_that_the_file_leaves_out(tmp_path):
    plain = read(write(tmp_path / "plain.msh", [*SQUARE, (7, 7)], [TWO[0], TWO[1][::-1]]))
    assert plain.notes == (
        "points in the file that belong to no cell: 1 of 7, ignored",
        "1 of 2 cells: cell 1 at (1.5, 0.5) m were clockwise: reversed",
        'the file contains no named group of lines: the patch of all 6 boundary faces is "wall"',
    )
    some = read(write(tmp_path / "some.msh", SQUARE, TWO, {"in": [0, 3], "": [2, 5]}))
    assert some.patches == ("in", "wall")
    assert some.notes == ('boundary faces in no group: 5 of 6; their patch is "wall"',)
    every = {"wall": [[0, 1], [1, 2], [5, 4], [4, 3]], "ends": [[0, 3], [2, 5]]}
    full = read(write(tmp_path / "full.msh", SQUARE, TWO, every))
    assert full.notes == () and full.patches == ("ends", "wall")
    assert full.length[full.patch("wall")].size == 4


@pytest.mark.parametrize("factor, note", [(1e4, 'unit = "mm"'), (1e-4, 'unit = "km"'), (1.0, None)])
def test_a_strange_size_hints_at_another_unit(tmp_path, factor, note):
    path = write(tmp_path / "far.msh", factor * np.array(SQUARE), TWO)
    hints = [text for text in read(path).notes if "another unit" in text]
    assert [note in text for text in hints] == ([True] if note else [])
    assert not any("another unit" in text for text in read(path, unit="ft").notes)


def test_the_unit_of_a_file(tmp_path):
    path = write(tmp_path / "mm.msh", 1e3 * np.array(SQUARE), TWO)
    mesh = read(path, unit="mm")
    assert mesh.points.tolist() == [list(p) for p in SQUARE] and mesh.area.tolist() == [1.0, 1.0]
    with pytest.raises(
        MeshError, match='mm.msh: 1 fault\n  unit: "bar" is a pressure; expected a length'
    ):
        read(path, unit="bar")
    bad = write(tmp_path / "bad.msh", 1e3 * np.array(SQUARE), [TWO[0], [1, 2, 4, 5]])
    with pytest.raises(MeshError, match=r"cell 1 at \(1500, 500\) mm"):
        read(bad, unit="mm")


def test_formats_give_the_same_mesh(tmp_path):
    # format of Gmsh's manual, with gaps between the numbers of points
    (tmp_path / "four.msh").write_text(MSH4)
    four = read(tmp_path / "four.msh")
    groups = {"in": [0, 3], "out": [2, 5]}
    two = read(write(tmp_path / "two.msh", SQUARE, TWO, groups))
    binary = read(write(tmp_path / "binary.msh", SQUARE, TWO, groups, binary=True))
    assert four.patches == two.patches == binary.patches == ("in", "out", "wall")
    assert four.middle[four.patch("in")].tolist() == [[0.0, 0.5]]
    assert four.middle[four.patch("out")].tolist() == [[2.0, 0.5]]
    assert sets(four) == sets(two) == sets(binary)
    for suffix in ("vtk", "vtu", "mesh", "inp"):
        other = read(write(tmp_path / f"other.{suffix}", SQUARE, TWO))
        assert other.patches == ("wall",) and sets(other)[0] == sets(two)[0]


def test_numbered_groups_are_patches_by_number(tmp_path):
    lines = meshio.Mesh(
        np.array(SQUARE, float),
        [("line", [[0, 3], [2, 5]]), ("quad", TWO)],
        cell_data={"medit:ref": [np.array([4, 0]), np.array([1, 1])]},
    )
    lines.write(tmp_path / "ref.mesh")
    mesh = read(tmp_path / "ref.mesh")
    assert mesh.patches == ("4", "wall") and mesh.middle[mesh.patch("4")].tolist() == [[0.0, 0.5]]
    assert (
        "groups of lines with a number instead of a name in the file: their patches are named 4"
        in mesh.notes
    )


@pytest.mark.parametrize("x", [1e300, -1e300, 1e155, math.inf, math.nan, 1.0 + 1e-6])
def test_a_point_far_off_lies_in_no_cell(x):
    points = MeshPoints(rectangle((1.0, 1.0), (4, 4)))
    assert points.cell(x, 0.5) == points.cell(0.5, x) == -1
    assert points.cell(1.0, 1.0) == 15


UNIT = dict(size=(1.0, 1.0), cells=(4, 4))
BAD_RECTANGLES = {
    "size: [1, 0]; expected two positive lengths": dict(size=(1, 0)),
    "cells: [4, 2.5]; expected two whole numbers": dict(cells=(4, 2.5)),
    "origin: [nan, 0]; expected the two coordinates": dict(origin=(math.nan, 0)),
    "grading: [0, 1]; expected two positive ratios": dict(grading=(0, 1)),
    "grading: [2, 1] with cells [1, 4]; expected 1 along an axis": dict(
        cells=(1, 4), grading=(2, 1)
    ),
    "grading: [1e+40, 1]: the smallest cells vanish": dict(origin=(1.0, 0.0), grading=(1e40, 1)),
    "holes[0]: [0, 0, 0, 1]; expected [x0, y0, x1, y1]": dict(holes=[(0, 0, 0, 1)]),
    "holes[0]: x1 = 0.3 m is on no grid line; nearest x: 0.25 and 0.5 m": dict(
        holes=[(0, 0, 0.3, 1)]
    ),
    "holes[0]: y1 = 2 m is on no grid line; nearest y: 1 m": dict(holes=[(0, 0, 0.5, 2)]),
    "holes: the holes leave 2 pieces that share no face": dict(holes=[(0.25, 0, 0.5, 1)]),
    "holes: the holes leave no cell": dict(holes=[(0, 0, 1, 1)]),
    'patches.a: unknown side "wets"; expected west, east, south, north; did you mean "west"?': dict(
        patches={"a": "wets"}
    ),
    "patches.a: 0.2 to 0.5 m does not consist of whole faces of the west side; nearest is 0.25 to 0.5 m": dict(
        patches={"a": ("west", 0.2, 0.5)}
    ),
    "holes[0]: [0, 0, 1e-12, 1] contains no cells; expected x0 and x1": dict(
        holes=[(0, 0, 1e-12, 1)]
    ),
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
    "patches.a: the holes remove the whole west side": dict(
        holes=[(0, 0, 0.5, 1)], patches={"a": "west"}
    ),
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
    "cells: 1 of 2 cells: cell 1 at (1.5, 0.5) m cross themselves": dict(
        points=SQUARE, cells=[TWO[0], [1, 2, 4, 5]]
    ),
    "cells: 1 of 2 cells: cell 1 at (1.3, 0.375) m are not convex": dict(
        points=[*SQUARE[:5], (1.2, 0.5)], cells=[TWO[0], [1, 2, 5, 4]]
    ),
    "cells: 1 of 3 cells: cell 0 at (1, 0) m have no area": dict(
        points=SQUARE, cells=[[0, 1, 2], *TWO]
    ),
    "cells: some cells overlap at the face from (1, 1) m to (1, 0) m: cell 0 at (1.16667, 0.5) m and cell 1": dict(
        points=[*SQUARE, (1.5, 0.5)], cells=[[1, 6, 4], *TWO]
    ),
    "both lie on one side of the face": dict(
        points=[*SQUARE[:5], (0.5, 0.5)], cells=[[0, 1, 4, 3], [0, 1, 5]]
    ),
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
    "groups.in: lines that are not boundary faces: 1 of 2; the line from (1, 0) m to (1, 1) m lies between": dict(
        **GRID, groups={"in": [[1, 4], [0, 3]]}
    ),
    "groups.in: lines that are not boundary faces: 1 of 2; the line from (0, 0) m to (1, 1) m is not a side": dict(
        **GRID, groups={"in": [[0, 3], [0, 4]]}
    ),
    "a line ends at a point that belongs to no cell": dict(
        points=[*SQUARE, (9, 9)], cells=TWO, groups={"in": [0, 6]}
    ),
    'groups.out: faces shared with "in": 1, first the face from (0, 1) m to (0, 0) m': dict(
        **GRID, groups={"in": [0, 3], "out": [[3, 0], [0, 1]]}
    ),
    "points: z runs from 0 to 0.2 m; cell 1 has a point in the upper half of this range; expected a mesh": dict(
        points=[(x, y, 0.2 * (x > 1)) for x, y in SQUARE], cells=TWO
    ),
    "z = constant; y is constant: turn the mesh": dict(
        points=[(x, 0, y) for x, y in SQUARE], cells=TWO
    ),
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
    with pytest.raises(
        MeshError, match=r"places faces cross each other: cell \d at .* and cell \d at"
    ):
        read(write(tmp_path / "ring.msh", ring, cells))
    assert read(write(tmp_path / "ring.msh", ring, cells[:6])).area.sum() == approx(
        6 * 1.5 * math.sin(0.9)
    )


def test_a_thin_wall_may_be_named(tmp_path, monkeypatch):
    # two cells above two, the lower two separate
    points = [*SQUARE, (0, 2), (1, 2), (2, 2), (1, 0)]
    cells = [[0, 1, 4, 3], [9, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    mesh = read(write(tmp_path / "wall.msh", points, cells, {"baffle": [1, 4]}))
    assert mesh.length[mesh.patch("baffle")].tolist() == [1.0] and mesh.inner == 3
    with pytest.raises(
        MeshError,
        match="at 1 place faces coincide .* a group of lines that marks the face as a thin",
    ):
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
    assert [
        word in text for word, text in zip(["coincident", "cross", "overlap"], found, strict=True)
    ] == [True] * 3


def test_files_that_hold_no_plane_mesh(tmp_path, capsys):
    def fault(name, **options):
        with pytest.raises(MeshError) as caught:
            read(tmp_path / name, **options)
        return str(caught.value)

    (tmp_path / "pool.msh").write_text(MSH4[: len(MSH4) // 2])
    assert (
        'pool.msh: 1 fault\n  the file cannot be read (the section "$Entities" has no end; '
        in fault("pool.msh")
    )
    assert 'there is no such file; did you mean "pool.msh"?' in fault("pol.msh")
    (tmp_path / "pool.dxf").write_text("0\n")
    assert "expected a name that ends in " in fault("pool.dxf") and ".msh" in fault("pool.dxf")
    (tmp_path / "empty.vtk").write_text("")
    assert "empty.vtk: 1 fault\n  meshio cannot read the file (" in fault("empty.vtk")
    cube = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    meshio.Mesh(cube, [("tetra", [[0, 1, 2, 3]]), ("triangle", [[0, 1, 2]])]).write(
        tmp_path / "solid.vtk"
    )
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


def test_a_group_without_lines_is_reported(tmp_path):
    (tmp_path / "four.msh").write_text(
        MSH4.replace('1 7 "in"', '1 7 "in"\n1 9 "rim"').replace("Names\n3\n", "Names\n4\n")
    )
    with pytest.raises(
        MeshError, match="groups.rim: the group contains no line of the file; .*Mesh.SaveAll"
    ):
        read(tmp_path / "four.msh")


def test_a_cell_that_names_no_point(tmp_path):
    (tmp_path / "lost.vtk").write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\n"
        "CELLS 1 4\n3 0 1 7\nCELL_TYPES 1\n5\n"
    )
    with pytest.raises(
        MeshError,
        match="cells: number 0 refers to a point that is not in the file; the file has 3 points",
    ):
        read(tmp_path / "lost.vtk")
