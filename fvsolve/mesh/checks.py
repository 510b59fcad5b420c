"""What can be wrong with the cells and the boundary of a mesh, in words. Knows no files; repairs nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import Fault, listing
from fvsolve.mesh.contact import contacts
from fvsolve.mesh.edges import CROWDED, Edges, key_of
from fvsolve.mesh.mesh import WALL
from fvsolve.mesh.shapes import corners

FLAT = 1e-8  # of the longest side: sides and heights below it are none
SHOWN = 3


@dataclass(frozen=True, eq=False)
class Sketch:
    """A mesh as it is being read, in the file's unit."""

    points: np.ndarray
    cells: np.ndarray
    unit: str

    def centre(self, c: int) -> np.ndarray:
        """The mean of a cell's corners."""
        return self.points[[p for p in self.cells[c] if p >= 0]].mean(axis=0)

    def show(self, c: int) -> str:
        """'cell 7 at (0.31, 0.52) m'."""
        return f"cell {c} at {self.at(self.centre(c))}"

    def at(self, point: np.ndarray) -> str:
        """'(0.31, 0.52) m'."""
        return f"({point[0]:.6g}, {point[1]:.6g}) {self.unit}"

    def face(self, ends: Sequence[int]) -> str:
        """'the face from (0, 0) m to (0.5, 0) m'."""
        return f"the face from {self.at(self.points[ends[0]])} to {self.at(self.points[ends[1]])}"

    def list(self, cells: np.ndarray) -> str:
        """'3 of 40 cells: cell 7 at ..., cell 9 at ..., cell 12 at ...'."""
        named = [self.show(c) for c in cells[:SHOWN]] + (["..."] if len(cells) > SHOWN else [])
        return f"{len(cells)} of {len(self.cells)} cells: {', '.join(named)}"


def shape_faults(sketch: Sketch) -> tuple[list[Fault], np.ndarray, np.ndarray]:
    """(faults of single cells, bool[n] which cells are bad, bool[n] which turn right, sound ones clockwise)."""
    turn, _, side = corners(sketch.points, sketch.cells)
    long = side.max(axis=1, keepdims=True)
    left, right = turn > FLAT * long**2, turn < -FLAT * long**2
    quad = sketch.cells[:, 3] >= 0
    kinds = {
        "have corners in one place; wanted three or four apart: a collapsed quad is a triangle": (
            side <= FLAT * long
        ).any(axis=1),
        "cross themselves; wanted corners in order around the cell": quad & (left.sum(1) == 2) & (right.sum(1) == 2),
        "are not convex; wanted every corner below 180 degrees: split them into triangles": quad
        & left.any(axis=1)
        & right.any(axis=1),
        "have no area; wanted corners that do not lie on one line": ~left.any(axis=1) & ~right.any(axis=1),
    }
    faults, bad = [], np.zeros(len(quad), bool)
    for words, which in kinds.items():
        which = np.flatnonzero(which & ~bad)
        bad[which] = True
        if which.size:
            faults.append(Fault("cells", f"{sketch.list(which)} {words}"))
    return faults, bad, right.any(axis=1)


def overlap_faults(sketch: Sketch, edges: Edges, number: np.ndarray) -> list[Fault]:
    """Faces with more than two cells, or with two on one side; number : int64  the numbers of the cells of `edges`."""
    crowded = np.flatnonzero(edges.mate == CROWDED)
    faces = np.unique(edges.key[crowded])
    if not faces.size:
        return []
    at = crowded[edges.key[crowded] == faces[0]]
    cells = np.sort(number[edges.cell[at]])
    which = " and ".join(sketch.show(c) for c in cells[:SHOWN])
    many = "more than two cells share it" if cells.size > 2 else "both lie on one side of it"
    more = f" ({faces.size} such faces)" if faces.size > 1 else ""
    where = sketch.face((edges.start[at[0]], edges.stop[at[0]]))
    remedy = "wanted one cell on each side; is a surface meshed twice, or in two physical groups?"
    return [Fault("cells", f"they overlap at {where}{more}: {which}, {many}; {remedy}")]


def contact_faults(sketch: Sketch, edges: Edges, named: np.ndarray) -> list[Fault]:
    """Boundary faces that touch others elsewhere than at their ends; named : bool[outer]  in a group.

    Two faces in one place are the sides of a thin wall where a group names one of them.
    """
    start, stop, cell = edges.start[edges.outer], edges.stop[edges.outer], edges.cell[edges.outer]
    found, whole = contacts(sketch.points[start], sketch.points[stop], named)
    words = {
        "same": "lie in one place and do not hang together: {one} and {other} at {face}; wanted one set of points "
        "there (Gmsh: Coherence), or a group that names it as a thin wall",
        "middle": "have the corner of another cell between their ends: {one} and {other} at {face}; "
        "wanted faces that meet end to end",
        "cross": "cross each other: {one} and {other} at {face}; wanted a boundary that does not cross itself",
    }
    faults = []
    for kind, pairs in found.items():
        if len(pairs):
            i, j = pairs[0]
            said = words[kind].format(
                one=sketch.show(cell[i]), other=sketch.show(cell[j]), face=sketch.face((start[i], stop[i]))
            )
            number = len(np.unique(pairs[:, 0])) if kind == "middle" else len(pairs)
            many = f"at {number}{'' if whole else ' or more'} places faces"
            faults.append(Fault("boundary", f"{many} {said}"))
    return faults


def piece_faults(sketch: Sketch, edges: Edges) -> list[Fault]:
    """A mesh that does not hang together."""
    piece = edges.pieces(len(sketch.cells))
    size, first = np.bincount(piece), np.unique(piece, return_index=True)[1]
    if size.size == 1:
        return []
    listed = [f"{size[k]} with {sketch.show(first[k])}" for k in np.argsort(-size, kind="stable")[:SHOWN]]
    more = ", ..." if size.size > SHOWN else ""
    return [
        Fault(
            "cells",
            f"they are in {size.size} pieces that share no face: {', '.join(listed)}{more}; "
            "wanted one piece: give each a file of its own",
        )
    ]


def grouped(
    sketch: Sketch, edges: Edges, lines: np.ndarray, groups: Mapping[str, np.ndarray]
) -> tuple[list[Fault], list[str], np.ndarray]:
    """(faults, patch names, int64[outer] the patch of each outer edge, -1 where no group names it)."""
    names = [*(name for name in groups if name != WALL), WALL]
    keys = edges.key[edges.outer]
    order = np.argsort(keys)
    patch, faults = np.full(keys.size, -1), []
    for name, members in groups.items():
        place = f"groups.{name}"
        if not members.size:
            remedy = "wanted lines of the boundary; Gmsh leaves them out under Mesh.SaveAll = 1"
            faults.append(Fault(place, f"no line in the file is in it; {remedy}"))
            continue
        wanted = key_of(lines[members], len(sketch.points))
        spot = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), keys.size - 1)]
        missed = keys[spot] != wanted
        if missed.any():
            text = f"{missed.sum()} of {members.size} lines no face of the boundary"
            how = _beside(sketch, edges, lines[members][missed][0])
            faults.append(Fault(place, f"{text}: {how}; wanted a curve of the boundary"))
        spot = spot[~missed]
        taken = spot[(patch[spot] >= 0) & (patch[spot] != names.index(name))]
        if taken.size:
            others = listing(f'"{names[k]}"' for k in np.unique(patch[taken]))
            first = edges.outer[taken[0]]
            where = sketch.face((edges.start[first], edges.stop[first]))
            faults.append(Fault(place, f"shares {taken.size} faces with {others}, {where}; wanted each in one group"))
        patch[spot] = names.index(name)
    return faults, names, patch


def _beside(sketch: Sketch, edges: Edges, ends: np.ndarray) -> str:
    """Where a line lies that is no face of the boundary."""
    if (ends < 0).any():
        return "one ends in a point that no cell has"
    where = sketch.face(ends).removeprefix("the face ")
    inside = np.isin(key_of(ends[None], len(sketch.points)), edges.key).any()
    return f"the one {where} {'lies between two cells' if inside else 'is no side of a cell'}"
