"""Checks of the cells and the boundary of a mesh; each fault is an entry of an error message.

Boundary faces may touch at their common ends only; pairs of faces that touch elsewhere are searched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fvsolve.errors import Fault, listing
from fvsolve.mesh.mesh import CROWDED, WALL, Edges, corners, cross, key_of

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
        texts = [self.show(c) for c in cells[:MAX_CELLS]] + (["..."] if len(cells) > MAX_CELLS else [])
        return f"{len(cells)} of {len(self.cells)} cells: {', '.join(texts)}"


def shape_faults(sketch: Sketch) -> tuple[list[Fault], np.ndarray, np.ndarray]:
    """(faults of single cells, bool[n] True for cells with a fault, bool[n] True for clockwise cells).

    A cell without a fault is clockwise if it has a right turn at a corner.
    """
    turn, _, side = corners(sketch.points, sketch.cells)
    long = side.max(axis=1, keepdims=True)
    left, right = turn > LEAST_HEIGHT * long**2, turn < -LEAST_HEIGHT * long**2
    quad = sketch.cells[:, 3] >= 0
    tests = {
        "have coincident corners; expected three or four different corners: a collapsed quad is a triangle": (
            side <= LEAST_HEIGHT * long
        ).any(axis=1),
        "cross themselves; expected corners in order around the cell": quad & (left.sum(1) == 2) & (right.sum(1) == 2),
        "are not convex; expected every corner below 180 degrees: split them into triangles": quad
        & left.any(axis=1)
        & right.any(axis=1),
        "have no area; expected corners that do not lie on one line": ~left.any(axis=1) & ~right.any(axis=1),
    }
    faults, bad = [], np.zeros(len(quad), bool)
    for text, failing in tests.items():
        failing = np.flatnonzero(failing & ~bad)
        bad[failing] = True
        if failing.size:
            faults.append(Fault("cells", f"{sketch.list(failing)} {text}"))
    return faults, bad, right.any(axis=1)


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
    reason = "more than two cells share the face" if cells.size > 2 else "both lie on one side of the face"
    more = f" ({faces.size} such faces)" if faces.size > 1 else ""
    where = sketch.face((edges.start[at[0]], edges.stop[at[0]]))
    remedy = "expected one cell on each side; is a surface meshed twice, or in two physical groups?"
    return [Fault("cells", f"some cells overlap at {where}{more}: {cell_texts}, {reason}; {remedy}")]


def contact_faults(sketch: Sketch, edges: Edges, named: np.ndarray) -> list[Fault]:
    """List with a fault for each kind of contact of boundary faces other than at their ends; empty without contacts.

    Two coincident faces are the sides of a thin wall if a group contains one of them, and then are not a fault.
    named : bool[outer]  True for boundary faces in a group
    """
    start, stop, cell = edges.start[edges.outer], edges.stop[edges.outer], edges.cell[edges.outer]
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
                cell=sketch.show(cell[i]), neighbour=sketch.show(cell[j]), face=sketch.face((start[i], stop[i]))
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
        pairs = _touching(a, b, *_pairs(tree, middle, length, np.arange(first, min(first + BLOCK, len(a)))))
        pairs["same"] = pairs["same"][~thin[pairs["same"]].any(axis=1)]
        if any(map(len, pairs.values())):
            break
    return pairs, first + BLOCK >= len(a)


def _pairs(tree: cKDTree, middle: np.ndarray, length: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers i, j of pairs of segments that may touch: two arrays.

    Segment i is in `block` and not shorter than j, and the distance between their middles is below the length of i.
    tree, middle, length : of all segments
    """
    near = tree.query_ball_point(middle[block], (1.0 + CONTACT_DISTANCE) * length[block], return_sorted=False)
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
    return (
        (CONTACT_DISTANCE < share)
        & (share < 1.0 - CONTACT_DISTANCE)
        & (np.abs(cross(along, to)) <= CONTACT_DISTANCE * square)
    )


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
        f"{size[k]} in the piece of {sketch.show(first[k])}" for k in np.argsort(-size, kind="stable")[:MAX_CELLS]
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
            remedy = "expected lines of the boundary (Gmsh: try Mesh.SaveAll = 0; 1 leaves out the groups of lines)"
            faults.append(Fault(place, f"the group contains no line of the file; {remedy}"))
            continue
        member_keys = key_of(lines[members], len(sketch.points))
        spot = order[np.minimum(np.searchsorted(keys, member_keys, sorter=order), keys.size - 1)]
        missing = keys[spot] != member_keys
        if missing.any():
            text = f"lines that are not boundary faces: {missing.sum()} of {members.size}"
            location = _line_location(sketch, edges, lines[members][missing][0])
            faults.append(Fault(place, f"{text}; {location}; expected a curve of the boundary"))
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


def _line_location(sketch: Sketch, edges: Edges, ends: np.ndarray) -> str:
    """Text with the location of a line that is not a boundary face. ends : int64[2]  its points, -1 if in no cell"""
    if (ends < 0).any():
        return "a line ends at a point that belongs to no cell"
    where = sketch.face(ends).removeprefix("the face ")
    inside = np.isin(key_of(ends[None], len(sketch.points)), edges.key).any()
    return f"the line {where} {'lies between two cells' if inside else 'is not a side of a cell'}"
