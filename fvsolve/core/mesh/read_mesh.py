"""Reading of a mesh from a file, with all checks; clockwise cells are reversed, with a note.

meshio reads all formats except those of Gmsh 4, see `gmsh_files.py`.

Each fault is an entry of an error message. Boundary faces may touch at their common ends only; pairs of faces that
touch elsewhere are searched.
"""

import contextlib
import io
import re
import warnings
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from fvsolve.core.mesh.gmsh_files import (
    GmshMesh,
    line_names,
    read_gmsh_4,
    sections,
    surface_names,
)
from fvsolve.core.mesh.mesh import (
    CROWDED,
    WALL,
    Edges,
    Mesh,
    assemble,
    corners,
    cross,
    edges_of,
    key_of,
)
from fvsolve.core.mesh.sms_files import SmsMesh, read_sms
from fvsolve.core.mesh.surface_groups import surface_groups
from fvsolve.errors import Fault, MeshError, did_you_mean, listing
from fvsolve.units import find, show

LEAST_HEIGHT = 1e-8  # of the longest side: smaller sides and heights count as zero
MAX_CELLS = 3
CONTACT_DISTANCE = 1e-6  # of a face's length: distance of a contact
BLOCK = 1 << 14  # number of segments per pass; the search ends after a pass with contacts


@dataclass(frozen=True, eq=False)
class Sketch:
    """Mesh while it is read, with coordinates in the unit of the file; methods return texts on its places."""

    points: np.ndarray
    cells: np.ndarray
    unit: str

    def centre(self, c: int) -> np.ndarray:
        """Mean of the corners of cell c."""
        return self.points[[p for p in self.cells[c] if p >= 0]].mean(axis=0)

    def show(self, c: int) -> str:
        """Text like 'cell 7 at (0.31, 0.52) m'."""
        return f"cell {c} at {self.at(self.centre(c))}"

    def at(self, point: np.ndarray) -> str:
        """Text like '(0.31, 0.52) m'."""
        return f"({point[0]:.6g}, {point[1]:.6g}) {self.unit}"

    def face(self, ends: Sequence[int]) -> str:
        """Text like 'the face from (0, 0) m to (0.5, 0) m'."""
        return f"the face from {self.at(self.points[ends[0]])} to {self.at(self.points[ends[1]])}"

    def list(self, cells: np.ndarray) -> str:
        """Text like '2 of 40 cells: cell 7 at ..., cell 9 at ...', with a list of at most MAX_CELLS cells."""
        texts = [self.show(c) for c in cells[:MAX_CELLS]] + (
            ["..."] if len(cells) > MAX_CELLS else []
        )
        return f"{len(cells)} of {len(self.cells)} cells: {', '.join(texts)}"


def shape_faults(sketch: Sketch) -> tuple[list[Fault], np.ndarray, np.ndarray]:
    """(faults of single cells, bool[n] True for cells with a fault, bool[n] True for clockwise cells).

    A cell without a fault is clockwise if it has a right turn at a corner.
    """
    turn, _, side = corners(sketch.points, sketch.cells)
    long = side.max(axis=1, keepdims=True)
    left, right = turn > LEAST_HEIGHT * long**2, turn < -LEAST_HEIGHT * long**2
    quad = sketch.cells[:, 3] >= 0
    has_left = left.any(axis=1)
    has_right = right.any(axis=1)
    flat = (side <= LEAST_HEIGHT * long).any(axis=1)
    concave = quad & has_left & has_right
    tests = {
        "have coincident corners; expected three or four different corners: a collapsed quad is a triangle": flat,
        "cross themselves; expected corners in order around the cell": quad
        & (left.sum(1) == 2)
        & (right.sum(1) == 2),
        "are not convex; expected every corner below 180 degrees: split them into triangles": concave,
        "have no area; expected corners that do not lie on one line": ~has_left & ~has_right,
    }
    faults, bad = [], np.zeros(len(quad), bool)
    for text, failing in tests.items():
        failing = np.flatnonzero(failing & ~bad)
        bad[failing] = True
        if failing.size:
            faults.append(Fault("cells", f"{sketch.list(failing)} {text}"))
    return faults, bad, has_right


def overlap_faults(sketch: Sketch, edges: Edges, number: np.ndarray) -> list[Fault]:
    """List with the fault of faces that more than two cells share, or two cells on the same side; else empty.

    number : int64[:]  numbers of the cells of `edges` in the file
    """
    crowded = np.flatnonzero(edges.mate == CROWDED)
    faces = np.unique(edges.key[crowded])
    if not faces.size:
        return []
    at = crowded[edges.key[crowded] == faces[0]]
    cells = np.sort(number[edges.cell[at]])
    cell_texts = " and ".join(sketch.show(c) for c in cells[:MAX_CELLS])
    reason = (
        "more than two cells share the face"
        if cells.size > 2
        else "both lie on one side of the face"
    )
    more = f" ({faces.size} such faces)" if faces.size > 1 else ""
    where = sketch.face((edges.start[at[0]], edges.stop[at[0]]))
    remedy = "expected one cell on each side; is a surface meshed twice, or in two physical groups (MSH 2.2)?"
    return [
        Fault("cells", f"some cells overlap at {where}{more}: {cell_texts}, {reason}; {remedy}")
    ]


def contact_faults(sketch: Sketch, edges: Edges, named: np.ndarray) -> list[Fault]:
    """List with a fault for each kind of contact of boundary faces other than at their ends; empty without contacts.

    Two coincident faces are the sides of a thin wall if a group contains one of them, and then are not a fault.
    named : bool[outer]  True for boundary faces in a group
    """
    start = edges.start[edges.outer]
    stop = edges.stop[edges.outer]
    cell = edges.cell[edges.outer]
    contact_pairs, complete = contacts(sketch.points[start], sketch.points[stop], named)
    texts = {
        "same": "coincide but are not connected: {cell} and {neighbour} at {face}; expected one set of points "
        "there (Gmsh: Coherence), or a group of lines that marks the face as a thin wall",
        "middle": "have the corner of another cell between their ends: {cell} and {neighbour} at {face}; "
        "expected faces that touch at their ends only",
        "cross": "cross each other: {cell} and {neighbour} at {face}; expected a boundary that does not cross itself",
    }
    faults = []
    for kind, pairs in contact_pairs.items():
        if len(pairs):
            i, j = pairs[0]
            text = texts[kind].format(
                cell=sketch.show(cell[i]),
                neighbour=sketch.show(cell[j]),
                face=sketch.face((start[i], stop[i])),
            )
            number = len(np.unique(pairs[:, 0])) if kind == "middle" else len(pairs)
            places = f"at {number}{'' if complete else ' or more'} place{'' if number == 1 and complete else 's'} faces"
            faults.append(Fault("boundary", f"{places} {text}"))
    return faults


def contacts(a: np.ndarray, b: np.ndarray, thin: np.ndarray) -> tuple[dict[str, np.ndarray], bool]:
    """(pairs of segments that touch other than at common ends, by kind; True if all segments were searched).

    a, b : float64[k, 2]  ends of the segments; thin : bool[k]  True for segments that may coincide with another
    The pairs are {"same": int64[m, 2], "middle": int64[m, 2], "cross": int64[m, 2]}. same : both ends coincide, and
    neither segment is thin; middle : an end of the second segment lies within the first; cross : the segments intersect
    The search stops after a block of BLOCK segments in which it has found pairs.
    """
    middle, length = 0.5 * (a + b), np.hypot(*(b - a).T)
    tree = cKDTree(middle)
    for first in range(0, len(a), BLOCK):
        pairs = _touching(
            a, b, *_pairs(tree, middle, length, np.arange(first, min(first + BLOCK, len(a))))
        )
        pairs["same"] = pairs["same"][~thin[pairs["same"]].any(axis=1)]
        if any(map(len, pairs.values())):
            break
    return pairs, first + BLOCK >= len(a)


def _pairs(
    tree: cKDTree, middle: np.ndarray, length: np.ndarray, block: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers i, j of pairs of segments that may touch: two arrays.

    Segment i is in `block` and not shorter than j, and the distance between their middles is below the length of i.
    tree, middle, length : of all segments
    """
    near = tree.query_ball_point(
        middle[block], (1.0 + CONTACT_DISTANCE) * length[block], return_sorted=False
    )
    i = np.repeat(block, np.fromiter(map(len, near), np.int64, len(near)))
    j = np.concatenate(near).astype(np.int64)
    valid = (length[j] < length[i]) | ((length[j] == length[i]) & (i < j))
    return i[valid], j[valid]


def _touching(a: np.ndarray, b: np.ndarray, i: np.ndarray, j: np.ndarray) -> dict[str, np.ndarray]:
    near = CONTACT_DISTANCE * np.hypot(*(b[i] - a[i]).T)
    same = (_distance(a[i], b[j]) <= near) & (_distance(b[i], a[j]) <= near)
    same |= (_distance(a[i], a[j]) <= near) & (_distance(b[i], b[j]) <= near)
    within_i = _within(a, b, i, a[j]) | _within(a, b, i, b[j])
    within_j = _within(a, b, j, a[i]) | _within(a, b, j, b[i])
    through = _on_both_sides(a, b, i, j) & _on_both_sides(a, b, j, i)
    pairs, reverse = np.stack([i, j], axis=1), np.stack([j, i], axis=1)
    return {
        "same": pairs[same],
        "middle": np.concatenate([pairs[within_i], reverse[within_j]]),
        "cross": pairs[through],
    }


def _distance(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.hypot(*(p - q).T)


def _within(a: np.ndarray, b: np.ndarray, i: np.ndarray, p: np.ndarray) -> np.ndarray:
    """True where the point p lies on segment i, away from its ends. a, b : ends of all segments"""
    along, to = b[i] - a[i], p - a[i]
    square = np.sum(along * along, axis=1)
    share = np.sum(along * to, axis=1) / square
    near = np.abs(cross(along, to)) <= CONTACT_DISTANCE * square
    return (CONTACT_DISTANCE < share) & (share < 1.0 - CONTACT_DISTANCE) & near


def _on_both_sides(a: np.ndarray, b: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """True where the ends of segment j lie on different sides of the line through segment i.

    a, b : ends of all segments
    """
    along = b[i] - a[i]
    least = CONTACT_DISTANCE * np.sum(along * along, axis=1)
    start, stop = cross(along, a[j] - a[i]), cross(along, b[j] - a[i])
    return ((start > least) & (stop < -least)) | ((start < -least) & (stop > least))


def piece_faults(sketch: Sketch, edges: Edges) -> list[Fault]:
    """List with the fault of a mesh of several parts without a common face; empty if there is one part."""
    piece = edges.pieces(len(sketch.cells))
    size, first = np.bincount(piece), np.unique(piece, return_index=True)[1]
    if size.size == 1:
        return []
    listed = [
        f"{size[k]} in the piece of {sketch.show(first[k])}"
        for k in np.argsort(-size, kind="stable")[:MAX_CELLS]
    ]
    more = ", ..." if size.size > MAX_CELLS else ""
    text = f"the cells are in {size.size} pieces that share no face: {', '.join(listed)}{more}"
    return [Fault("cells", f"{text}; expected one piece: write each piece to its own file")]


def assign_patches(
    sketch: Sketch, edges: Edges, lines: np.ndarray, groups: Mapping[str, np.ndarray]
) -> tuple[list[Fault], list[str], np.ndarray]:
    """Assign a patch to each boundary edge, by the groups of lines in the file.

    lines : int64[k, 2]  points of the lines; groups : name -> numbers of its lines
    Returns (faults, names of patches, int64[outer] patch of each boundary edge, -1 for edges in no group).
    """
    names = [*(name for name in groups if name != WALL), WALL]
    keys = edges.key[edges.outer]
    order = np.argsort(keys)
    patch, faults = np.full(keys.size, -1), []
    for name, members in groups.items():
        place = f"groups.{name}"
        if not members.size:
            remedy = "expected lines of the boundary (Gmsh: try Mesh.SaveAll = 0; 1 leaves out groups in MSH 2.2)"
            faults.append(Fault(place, f"the group contains no line of the file; {remedy}"))
            continue
        member_keys = key_of(lines[members], len(sketch.points))
        spot = order[np.minimum(np.searchsorted(keys, member_keys, sorter=order), keys.size - 1)]
        missing = keys[spot] != member_keys
        if missing.any():
            text = f"lines that are not boundary faces: {missing.sum()} of {members.size}"
            location = _line_location(sketch, edges, lines[members][missing][0])
            faults.append(
                Fault(
                    place,
                    f"{text}; {location}; expected a curve of the boundary, or `group` of a wall",
                )
            )
        spot = spot[~missing]
        taken = spot[(patch[spot] >= 0) & (patch[spot] != names.index(name))]
        if taken.size:
            others = listing(f'"{names[k]}"' for k in np.unique(patch[taken]))
            first = edges.outer[taken[0]]
            where = sketch.face((edges.start[first], edges.stop[first]))
            text = f"faces shared with {others}: {taken.size}, first {where}; expected each face in one group"
            faults.append(Fault(place, text))
        patch[spot] = names.index(name)
    return faults, names, patch


def _outline(
    groups: Mapping[str, np.ndarray],
    lines: np.ndarray,
    edges: Edges,
    count: int,
    walls: Collection[str],
) -> tuple[dict[str, np.ndarray], list[str]]:
    """(groups of lines on the boundary, notes on groups that are ignored, since all their lines lie between cells).

    lines : int64[k, 2]  points of the lines; count : number of points; walls : names of groups that are walls
    """
    inner = np.setdiff1d(edges.key, edges.key[edges.outer])
    outline, notes = {}, []
    for name, members in groups.items():
        if (
            members.size
            and name not in walls
            and np.isin(key_of(lines[members], count), inner).all()
        ):
            text = f'the lines of the group "{name}" lie between cells: ignored'
            notes.append(
                f'{text}; `walls` of the basin may name it, for example {{ bank = {{ group = "{name}" }} }}'
            )
        elif name not in walls:
            outline[name] = members
    return outline, notes


def _line_location(sketch: Sketch, edges: Edges, ends: np.ndarray) -> str:
    """Text with the location of a line that is not a boundary face. ends : int64[2]  its points, -1 if in no cell"""
    if (ends < 0).any():
        return "a line ends at a point that belongs to no cell"
    where = sketch.face(ends).removeprefix("the face ")
    inside = np.isin(key_of(ends[None], len(sketch.points)), edges.key).any()
    return f"the line {where} {'lies between two cells' if inside else 'is not a side of a cell'}"


SMS = ".2dm"  # suffix of the mesh files of SMS
NODES = "nodes"  # value of the key `bed` that gives the elevations of nodes
PLANE = {"triangle": 3, "quad": 4}
IGNORED = {"vertex", "line", *PLANE}
TAGS = ("gmsh:physical", "medit:ref", "su2:tag")  # names of group numbers in the formats

GMSH_REMEDY = "Gmsh: try Mesh.MshFileVersion = 4.1 and Mesh.SaveParametric = 0"
PLANE_TOLERANCE = 1e-6  # of the extent: allowed range of z
FAR = 1e100  # beyond it fourth powers overflow
SOLID_FORMATS = (".node", ".ele")
# characters of a line of a file, and of the warnings of meshio
LONGEST_LINE, MOST_PRINTED = 10_000, 10_000
LONGEST_TEXT = 300  # greatest length of a text of meshio in a message [characters]
LARGE, SMALL = 1e4, 1e-3  # extents that suggest another unit [m]


@dataclass(frozen=True, eq=False)
class Content:
    """Content of a mesh file.

    points : float64[p, 3]  coordinates in the unit of the file
    cells : int64[n, 4]  points of cells, -1 last in a triangle
    lines : int64[k, 2]  points of lines; groups : name -> int64[:] numbers of lines, in the order of the file
    notes : remarks about the file for the user; regions : name of a group of cells -> int64[:] its cells
    """

    points: np.ndarray
    cells: np.ndarray
    lines: np.ndarray
    groups: dict[str, np.ndarray]
    notes: tuple[str, ...]
    regions: dict[str, np.ndarray]


def read(
    path: str | Path,
    unit: str = "m",
    walls: Collection[str] = (),
    heights: bool = False,
    ignored: Collection[str] = (),
) -> Mesh:
    """Read a plane mesh from a file of any format of meshio, with coordinates in `unit`.

    Triangles and quadrilaterals are cells, renumbered so that neighbours are close; physical groups of lines are
    patches, except `walls`: names of groups whose lines may lie between cells. Another group, all of whose lines lie
    between cells, is ignored, with a note, and so are the groups of lines `ignored`.
    heights : True to read the elevations z of nodes, which otherwise must be constant, except in .2dm files
    The file, its coordinates, its cells and its boundary are checked in this order; MeshError is raised with all faults
    of the first of these checks that fails.
    """
    path = Path(path)
    try:
        factor = find(unit, "length").read("1")
    except ValueError as error:
        raise MeshError([Fault("unit", str(error))], path.name) from None
    content = _checked_content(path, unit, heights, ignored)
    used, cells, lines, notes = _used_points(content)
    sketch = Sketch(content.points[used[1:], :2], cells, unit)
    faults, bad, clockwise = shape_faults(sketch)
    quads, triangles = cells[clockwise][:, [0, 3, 2, 1]], cells[clockwise][:, [0, 2, 1, 3]]
    cells[clockwise] = np.where(cells[clockwise, 3:] < 0, triangles, quads)
    if clockwise.any():
        notes.append(f"{sketch.list(np.flatnonzero(clockwise))} were clockwise: reversed")
    number = np.flatnonzero(~bad)
    edges = edges_of(cells[number], len(sketch.points))
    faults += overlap_faults(sketch, edges, number)
    if faults:
        raise MeshError(faults, path.name)
    outline, remarks = _outline(content.groups, lines, edges, len(sketch.points), walls)
    notes += remarks
    faults, names, patch = assign_patches(sketch, edges, lines, outline)
    chains = {
        name: key_of(lines[members], len(sketch.points))
        for name, members in content.groups.items()
        if name not in outline
    }
    for name, keys in chains.items():
        if (missing := ~np.isin(keys, edges.key)).any():
            where = _line_location(sketch, edges, lines[content.groups[name]][missing][0])
            faults.append(
                Fault(f"groups.{name}", f"{where}; expected sides of cells, as the group is a wall")
            )
    touching = contact_faults(sketch, edges, patch >= 0)
    faults += touching or piece_faults(sketch, edges)
    if faults:
        raise MeshError(faults, path.name)
    notes += _notes(sketch, factor, patch, bool(content.groups))
    order = edges.order(len(cells))
    cells = cells[order]
    rank = np.argsort(order)
    sketch, edges = Sketch(sketch.points, cells, unit), edges_of(cells, len(sketch.points))
    patch = assign_patches(sketch, edges, lines, outline)[2]
    patch = np.where(patch < 0, len(names) - 1, patch)
    mesh = assemble(factor * sketch.points, cells, edges, names, patch, notes=notes)
    between = key_of(mesh.ends[: mesh.inner], len(sketch.points))
    return replace(
        mesh,
        groups={name: np.flatnonzero(np.isin(between, keys)) for name, keys in chains.items()},
        regions={name: np.sort(rank[members]) for name, members in content.regions.items()},
        heights=factor * content.points[used[1:], 2] if heights else None,
    )


def _checked_content(path: Path, unit: str, heights: bool, ignored: Collection[str]) -> Content:
    """Content of a mesh file without the groups of lines `ignored`; arguments as for `read`. Raises MeshError."""
    content = load_file(path)
    if heights:
        faults = _coordinate_faults(content)
    else:
        content = _flattened(content, path)
        faults = _place_faults(content, unit)
    faults += [
        Fault("ignore", f"no group of lines {show(name)}{did_you_mean(name, content.groups)}")
        for name in ignored
        if name not in content.groups
    ]
    if faults:
        raise MeshError(faults, path.name)
    groups = {name: own for name, own in content.groups.items() if name not in ignored}
    return replace(content, groups=groups)


def _used_points(content: Content) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """(-1 and numbers of the points of cells, cells and lines with new numbers of these points, notes).

    The number of a point that belongs to no cell is -1 in lines.
    """
    # -1 comes first
    used, renumbered = np.unique(np.append(content.cells, -1), return_inverse=True)
    cells = renumbered[:-1].reshape(-1, 4) - 1
    notes = list(content.notes)
    spare = len(content.points) + 1 - used.size
    if spare:
        notes.append(
            f"points in the file that belong to no cell: {spare} of {len(content.points)}, ignored"
        )
    spot = np.minimum(np.searchsorted(used[1:], content.lines), used.size - 2)
    lines = np.where(used[1:][spot] == content.lines, spot, -1)
    return used, cells, lines, notes


def _flattened(content: Content, path: Path) -> Content:
    """Content without the elevations of a file .2dm, whose nodes always have elevations; other content unchanged."""
    if path.suffix.lower() != SMS or np.ptp(content.points[:, 2]) == 0.0:
        return content
    points = np.column_stack([content.points[:, :2], np.zeros(len(content.points))])
    note = 'elevations of nodes in the file: ignored; bed = "nodes" makes them the bed'
    return replace(content, points=points, notes=(*content.notes, note))


def _coordinate_faults(content: Content) -> list[Fault]:
    """List with the fault of points with invalid coordinates; else empty."""
    used = np.unique(content.cells[content.cells >= 0])
    points = content.points[used]
    invalid = used[~(np.abs(points) < FAR).all(axis=1)]  # nan too
    if not invalid.size:
        return []
    text = f"{invalid.size} of {used.size} {'has' if invalid.size == 1 else 'have'} invalid coordinates"
    return [Fault("points", f"{text} (not a number, or too large), first point {invalid[0]}")]


def _place_faults(content: Content, unit: str) -> list[Fault]:
    """List with the fault of points with invalid coordinates, or not in one plane z = constant; else empty."""
    if faults := _coordinate_faults(content):
        return faults
    used = np.unique(content.cells[content.cells >= 0])
    points = content.points[used]
    extent = np.ptp(points, axis=0)
    near = PLANE_TOLERANCE * extent.max()
    if extent[2] <= near:
        return []
    far = content.points[:, 2] - points[:, 2].min() > 0.5 * extent[2]
    cell = int(np.argmax(far[content.cells].any(axis=1)))
    span = f"{points[:, 2].min():.6g} to {points[:, 2].max():.6g} {unit}"
    text = f"z runs from {span}; cell {cell} has a point in the upper half of this range"
    level = [axis for axis, e in zip("xy", extent, strict=False) if e <= near]
    constant = "".join(f"; {axis} is constant: turn the mesh" for axis in level)
    remedy = constant or f", or bed = {show(NODES)}"
    return [Fault("points", f"{text}; expected a mesh in one plane, z = constant{remedy}")]


def _notes(sketch: Sketch, factor: float, patch: np.ndarray, grouped: bool) -> list[str]:
    """Notes on boundary faces without a group, and on an extent that suggests another unit.

    factor : length of the unit of the file [m]; patch : int64[outer]  patch of each boundary face, -1 without a group
    grouped : True if the file contains groups of lines
    """
    notes = []
    unnamed = int((patch < 0).sum())
    if not grouped:
        text = f'the patch of all {unnamed} boundary faces is "{WALL}"'
        notes.append(f"the file contains no named group of lines: {text}")
    elif unnamed:
        notes.append(
            f'boundary faces in no group: {unnamed} of {patch.size}; their patch is "{WALL}"'
        )
    extent = factor * np.ptp(sketch.points, axis=0).max()
    if sketch.unit == "m" and not SMALL <= extent <= LARGE:
        guess = 'unit = "mm"' if extent > LARGE else 'unit = "km"'
        text = f"the mesh is {extent:.6g} m across: is the file in another unit?"
        notes.append(f"{text} Then state the unit, perhaps {guess}")
    return notes


def load_file(path: Path) -> Content:
    """Triangles, quadrilaterals and named lines of a mesh file.

    Raises MeshError if the file is missing, cannot be read, or contains no plane mesh.
    """
    file_mesh, notes = _read_file(path)
    kinds: dict[str, int] = {}
    for block in file_mesh.cells:
        kinds[block.type] = kinds.get(block.type, 0) + len(block.data)
    faults = _bad_kinds({kind: count for kind, count in kinds.items() if count})
    points = np.zeros((len(file_mesh.points), 3))
    shape = np.shape(file_mesh.points)
    if len(shape) == 2 and shape[1] in (2, 3):
        points[:, : shape[1]] = file_mesh.points
    else:
        faults.append(
            Fault(
                "points", f"an array of shape {shape}; expected two or three coordinates per point"
            )
        )
    if faults:
        raise MeshError(faults, path.name)
    cells = [_padded(block.data) for block in file_mesh.cells if block.type in PLANE]
    lines = [block.data for block in file_mesh.cells if block.type == "line"]
    groups, unnamed = _groups(file_mesh)
    content = Content(
        points,
        np.concatenate(cells).astype(np.int64),
        np.concatenate(lines).astype(np.int64) if lines else np.empty((0, 2), np.int64),
        groups,
        (*notes, *unnamed),
        surface_groups(file_mesh, PLANE, TAGS),
    )
    for place, table, least in (("cells", content.cells, -1), ("lines", content.lines, 0)):
        low = np.where(np.arange(table.shape[1]) == 3, least, 0)
        rows = np.flatnonzero(np.any((table < low) | (table >= len(points)), axis=1))
        if rows.size:
            text = f"number {int(rows[0])} refers to a point that is not in the file; the file has {len(points)} points"
            faults.append(Fault(place, text))
    if faults:
        raise MeshError(faults, path.name)
    return content


def _read_file(path: Path) -> tuple[Any, tuple[str, ...]]:
    """(`GmshMesh` or mesh object of meshio, messages that meshio printed).

    Raises MeshError for a missing or unreadable file.
    """
    if not path.is_file():
        near = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
        raise MeshError(
            [Fault("", f"there is no such file{did_you_mean(path.name, near)}")], str(path)
        )
    if path.suffix.lower() == SMS:
        try:
            return read_sms(path), ()
        except (OSError, ValueError) as error:
            raise MeshError([Fault("", f"the file cannot be read ({error})")], path.name) from None
    if path.suffix.lower() != ".msh":
        return _read_by_meshio(path)
    try:
        data = path.read_bytes()
        if (result := read_gmsh_4(data)) is not None:
            return result, ()
    except (OSError, ValueError) as error:
        raise MeshError(
            [Fault("", f"the file cannot be read ({error}); {GMSH_REMEDY}")], path.name
        ) from None
    file_mesh, notes = _read_by_meshio(path)
    with contextlib.suppress(ValueError):  # meshio keeps one of two groups of the same name
        names = dict(sections(data)).get("PhysicalNames", b"")
        file_mesh.field_data = line_names(names)
        file_mesh.surface_names = surface_names(names)
    return file_mesh, notes


def _read_by_meshio(path: Path) -> tuple[Any, tuple[str, ...]]:
    """(mesh object of meshio, messages that meshio printed); raises MeshError for an unreadable file."""
    import meshio

    printed = BoundedText()
    try:
        if path.suffix.lower() in SOLID_FORMATS:  # meshio does not end at the end of such a file
            raise ValueError(
                "files of TetGen contain tetrahedra; expected a mesh of one plane surface"
            )
        if (
            path.suffix.lower() == ".su2"
            and max(map(len, path.read_bytes().split(b"\n"))) > LONGEST_LINE
        ):
            # meshio takes minutes to print it
            raise ValueError(f"a line has more than {LONGEST_LINE} characters")
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            file_mesh = meshio.read(path)
        return file_mesh, tuple(
            f"meshio: {_single_line(line)}"
            for line in printed.getvalue().split("Warning:")
            if line.strip()
        )
    except (Exception, SystemExit) as error:  # meshio calls exit, or raises errors of any type
        text = (
            printed.getvalue()
            if isinstance(error, SystemExit)
            else f"{type(error).__name__}: {error}"
        )
    text = _single_line(text)
    remedy = GMSH_REMEDY if path.suffix.lower() == ".msh" else ""
    known = sorted(meshio.extension_to_filetypes)
    if path.suffix.lower() not in known:
        remedy = f"expected a name that ends in {listing(known, 40)}"
    raise MeshError(
        [Fault("", "; ".join(filter(None, [f"meshio cannot read the file ({text})", remedy])))],
        path.name,
    )


class BoundedText(io.StringIO):
    """Text that a library prints; raises ValueError above `MOST_PRINTED` characters, as for a fault in each line."""

    def write(self, text: str) -> int:
        if self.tell() > MOST_PRINTED:
            raise ValueError(f"more than {MOST_PRINTED} characters of warnings: {self.getvalue()}")
        return super().write(text)


def _single_line(text: str) -> str:
    text = re.sub(r"\s+", " ", text).strip(" .").removeprefix("Error: ")
    return text if len(text) <= LONGEST_TEXT else text[:LONGEST_TEXT] + "..."


def _bad_kinds(kinds: dict[str, int]) -> list[Fault]:
    """List with the fault of a file with cells other than triangles and quadrilaterals, or without cells; else empty.

    kinds : type of cell -> number of cells
    """
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none"
    solid = [kind for kind in kinds if re.match("tetra|hexa|wedge|pyramid|polyhedron", kind)]
    other = [kind for kind in kinds if kind not in IGNORED and kind not in solid]
    expected = "expected triangle and quad"
    if solid:
        text = f"the file has three-dimensional cells ({counts})"
        return [Fault("cells", f"{text}; {expected}: a mesh of one plane surface")]
    if other:
        remedy = "Gmsh: Mesh.ElementOrder = 1" if re.search(r"\d", "".join(other)) else "split them"
        return [
            Fault("cells", f"{', '.join(other)} cannot be used ({counts}); {expected}; {remedy}")
        ]
    if not set(kinds) & set(PLANE):
        text = f"there are no two-dimensional cells ({counts}); {expected}; was the surface meshed?"
        remedy = " Gmsh: if there are physical groups, it writes only those; add one of the surface (Physical Surface)"
        return [Fault("cells", f"{text}{remedy}")]
    return []


def _padded(cells: np.ndarray) -> np.ndarray:
    return np.pad(
        np.asarray(cells, np.int64), ((0, 0), (0, 4 - cells.shape[1])), constant_values=-1
    )


def _groups(file_mesh: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """(name -> numbers of the lines of each group, notes on groups that have only a number in the file)."""
    if isinstance(file_mesh, SmsMesh):
        return file_mesh.strings, ()
    # name -> (number, dimension) of each group of lines that has a name
    field_data = file_mesh.field_data or {}
    name_of = {
        int(v[0]): name for name, v in field_data.items() if np.shape(v) == (2,) and int(v[1]) == 1
    }
    members: dict[str, list[np.ndarray]] = {name: [] for name in name_of.values()}
    unnamed: set[int] = set()
    first = 0
    for k, block in enumerate(file_mesh.cells):
        if block.type != "line":
            continue
        for name, sets in (getattr(file_mesh, "cell_sets", None) or {}).items():
            if not name.startswith("gmsh:") and sets[k] is not None and len(sets[k]):
                members.setdefault(name, []).append(first + np.asarray(sets[k], np.int64))
        first += len(block.data)
    for tag, lines in _tagged_lines(file_mesh):
        unnamed |= {tag} - set(name_of)
        members.setdefault(name_of.get(tag, str(tag)), []).append(lines)
    numbers = ", ".join(map(str, sorted(unnamed)))
    text = f"groups of lines with a number instead of a name in the file: their patches are named {numbers}"
    notes = (text,) if unnamed else ()
    empty = [np.empty(0, np.int64)]
    return {
        name: np.unique(np.concatenate(lines or empty)) for name, lines in members.items()
    }, notes


def _tagged_lines(file_mesh: Any) -> Iterable[tuple[int, np.ndarray]]:
    """Yield (number of a group, numbers of some of its lines).

    The number 0 stands for no group; in Gmsh's a negative number marks reversed lines.
    """
    if isinstance(file_mesh, GmshMesh):
        yield from file_mesh.groups.items()
        return
    first = 0
    for k, block in enumerate(file_mesh.cells):
        if block.type != "line":
            continue
        for key in TAGS:
            if key in file_mesh.cell_data:
                tags = np.asarray(file_mesh.cell_data[key][k]).astype(np.int64)
                tags = np.abs(tags) if key == "gmsh:physical" else tags
                for tag in np.unique(tags[tags != 0]):
                    yield int(tag), first + np.flatnonzero(tags == tag)
        first += len(block.data)
