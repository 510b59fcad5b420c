"""Reading of a mesh from a file, with all checks; clockwise cells are reversed, with a note."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.errors import Fault, MeshError
from fvsolve.mesh.edges import edges_of
from fvsolve.mesh.mesh import WALL, Mesh
from fvsolve.mesh.mesh_checks import Sketch, assign_patches, contact_faults, overlap_faults, piece_faults, shape_faults
from fvsolve.mesh.mesh_files import Content, load_file
from fvsolve.mesh.shapes import assemble
from fvsolve.units import find

PLANE_TOLERANCE = 1e-6  # of the extent: allowed range of z
FAR = 1e100  # beyond it fourth powers overflow
LARGE, SMALL = 1e4, 1e-3  # extents that suggest another unit [m]


def read(path: str | Path, unit: str = "m") -> Mesh:
    """Read a plane mesh from a file of any format of meshio, with coordinates in `unit`.

    Triangles and quadrilaterals are cells, renumbered so that neighbours are close; physical groups of lines are
    patches. The file, its coordinates, its cells and its boundary are checked in this order; MeshError is raised with
    all faults of the first of these checks that fails.
    """
    path = Path(path)
    factor = _factor(unit, path)
    content = load_file(path)
    faults = _place_faults(content, unit)
    if faults:
        raise MeshError(faults, path.name)
    used, renumbered = np.unique(np.append(content.cells, -1), return_inverse=True)  # -1 comes first
    cells = renumbered[:-1].reshape(-1, 4) - 1
    notes = list(content.notes)
    spare = len(content.points) + 1 - used.size
    if spare:
        notes.append(f"points in the file that belong to no cell: {spare} of {len(content.points)}, ignored")
    lines = _renumber(content.lines, used[1:])
    sketch = Sketch(content.points[used[1:], :2], cells, unit)
    faults, bad, clockwise = shape_faults(sketch)
    cells[clockwise] = _reversed(cells[clockwise])
    if clockwise.any():
        notes.append(f"{sketch.list(np.flatnonzero(clockwise))} were clockwise: reversed")
    number = np.flatnonzero(~bad)
    edges = edges_of(cells[number], len(sketch.points))
    faults += overlap_faults(sketch, edges, number)
    if faults:
        raise MeshError(faults, path.name)
    faults, names, patch = assign_patches(sketch, edges, lines, content.groups)
    touching = contact_faults(sketch, edges, patch >= 0)
    faults += touching or piece_faults(sketch, edges)
    if faults:
        raise MeshError(faults, path.name)
    notes += _notes(sketch, factor, patch, bool(content.groups))
    cells = cells[edges.order(len(cells))]
    sketch, edges = Sketch(sketch.points, cells, unit), edges_of(cells, len(sketch.points))
    patch = assign_patches(sketch, edges, lines, content.groups)[2]
    patch = np.where(patch < 0, len(names) - 1, patch)
    return assemble(factor * sketch.points, cells, edges, names, patch, notes=notes)


def _factor(unit: str, path: Path) -> float:
    """Length of `unit` [m]; raises MeshError for an unknown unit."""
    try:
        return find(unit, "length").read("1")
    except ValueError as error:
        raise MeshError([Fault("unit", str(error))], path.name) from None


def _place_faults(content: Content, unit: str) -> list[Fault]:
    """List with the fault of points with invalid coordinates, or not in one plane z = constant; else empty."""
    used = np.unique(content.cells[content.cells >= 0])
    points = content.points[used]
    invalid = used[~(np.abs(points) < FAR).all(axis=1)]  # nan too
    if invalid.size:
        return [
            Fault(
                "points",
                f"{invalid.size} of {used.size} {'has' if invalid.size == 1 else 'have'} invalid coordinates "
                "(not a number, or too large), "
                f"first point {invalid[0]}",
            )
        ]
    extent = np.ptp(points, axis=0)
    near = PLANE_TOLERANCE * extent.max()
    if extent[2] <= near:
        return []
    far = content.points[:, 2] - points[:, 2].min() > 0.5 * extent[2]
    cell = int(np.argmax(far[content.cells].any(axis=1)))
    span = f"{points[:, 2].min():.6g} to {points[:, 2].max():.6g} {unit}"
    text = f"z runs from {span}; cell {cell} has a point in the upper half of this range"
    constant = "".join(
        f"; {axis} is constant: turn the mesh" for axis, e in zip("xy", extent, strict=False) if e <= near
    )
    return [Fault("points", f"{text}; expected a mesh in one plane, z = constant{constant}")]


def _renumber(lines: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Ends of lines as positions in the sorted array `used` of point numbers; -1 for a point that is not in it."""
    spot = np.minimum(np.searchsorted(used, lines), used.size - 1)
    return np.where(used[spot] == lines, spot, -1)


def _reversed(cells: np.ndarray) -> np.ndarray:
    quad = cells[:, [0, 3, 2, 1]]
    triangle = cells[:, [0, 2, 1, 3]]
    return np.where(cells[:, 3:] < 0, triangle, quad)


def _notes(sketch: Sketch, factor: float, patch: np.ndarray, grouped: bool) -> list[str]:
    """Notes on boundary faces without a group, and on an extent that suggests another unit.

    factor : length of the unit of the file [m]; patch : int64[outer]  patch of each boundary face, -1 without a group
    grouped : True if the file contains groups of lines
    """
    notes = []
    unnamed = int((patch < 0).sum())
    if not grouped:
        notes.append(
            f'the file contains no named group of lines: the patch of all {unnamed} boundary faces is "{WALL}"'
        )
    elif unnamed:
        notes.append(f'boundary faces in no group: {unnamed} of {patch.size}; their patch is "{WALL}"')
    extent = factor * np.ptp(sketch.points, axis=0).max()
    if sketch.unit == "m" and not SMALL <= extent <= LARGE:
        guess = 'unit = "mm"' if extent > LARGE else 'unit = "km"'
        notes.append(
            f"the mesh is {extent:.6g} m across: is the file in another unit? Then state the unit, perhaps {guess}"
        )
    return notes
