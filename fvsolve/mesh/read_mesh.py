"""Reading of a mesh from a file by meshio, with all checks; clockwise cells are reversed, with a note."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.errors import Fault, MeshError, did_you_mean, listing
from fvsolve.mesh.mesh import WALL, Mesh, assemble, edges_of
from fvsolve.mesh.mesh_checks import Sketch, assign_patches, contact_faults, overlap_faults, piece_faults, shape_faults
from fvsolve.units import find

PLANE = {"triangle": 3, "quad": 4}
IGNORED = {"vertex", "line", *PLANE}
TAGS = ("gmsh:physical", "medit:ref", "su2:tag")  # names of group numbers in the formats

PLANE_TOLERANCE = 1e-6  # of the extent: allowed range of z
FAR = 1e100  # beyond it fourth powers overflow
LARGE, SMALL = 1e4, 1e-3  # extents that suggest another unit [m]


@dataclass(frozen=True, eq=False)
class Content:
    """Content of a mesh file.

    points : float64[p, 3]  coordinates in the unit of the file
    cells : int64[n, 4]  points of cells, -1 last in a triangle
    lines : int64[k, 2]  points of lines; groups : name -> int64[:] numbers of lines, in the order of the file
    notes : remarks about the file for the user
    """

    points: np.ndarray
    cells: np.ndarray
    lines: np.ndarray
    groups: dict[str, np.ndarray]
    notes: tuple[str, ...]


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
    spot = np.minimum(np.searchsorted(used[1:], content.lines), used.size - 2)
    lines = np.where(used[1:][spot] == content.lines, spot, -1)  # -1 for a point that belongs to no cell
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
        text = f"{invalid.size} of {used.size} {'has' if invalid.size == 1 else 'have'} invalid coordinates"
        return [Fault("points", f"{text} (not a number, or too large), first point {invalid[0]}")]
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


def load_file(path: Path) -> Content:
    """Triangles, quadrilaterals and named lines of a mesh file.

    Raises MeshError if the file is missing, cannot be read, or contains no plane mesh.
    """
    file_mesh, notes = _read_by_meshio(path)
    kinds: dict[str, int] = {}
    for block in file_mesh.cells:
        kinds[block.type] = kinds.get(block.type, 0) + len(block.data)
    faults = _bad_kinds({kind: count for kind, count in kinds.items() if count})
    points = np.zeros((len(file_mesh.points), 3))
    shape = np.shape(file_mesh.points)
    if len(shape) == 2 and shape[1] in (2, 3):
        points[:, : shape[1]] = file_mesh.points
    else:
        faults.append(Fault("points", f"an array of shape {shape}; expected two or three coordinates per point"))
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


def _read_by_meshio(path: Path) -> tuple[Any, tuple[str, ...]]:
    """(mesh object of meshio, messages that meshio printed); raises MeshError for a missing or unreadable file."""
    import meshio

    if not path.is_file():
        near = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
        raise MeshError([Fault("", f"there is no such file{did_you_mean(path.name, near)}")], str(path))
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file_mesh = meshio.read(path)
        return file_mesh, tuple(
            f"meshio: {_single_line(line)}" for line in printed.getvalue().split("Warning:") if line.strip()
        )
    except (Exception, SystemExit) as error:  # meshio calls exit, or raises errors of any type
        text = printed.getvalue() if isinstance(error, SystemExit) else f"{type(error).__name__}: {error}"
    text = _single_line(text)
    remedy = "Gmsh: try Mesh.SaveAll = 0, or Mesh.MshFileVersion = 2.2" if path.suffix == ".msh" else ""
    known = sorted(meshio.extension_to_filetypes)
    if path.suffix.lower() not in known:
        remedy = f"expected a name that ends in {listing(known, 40)}"
    raise MeshError([Fault("", "; ".join(filter(None, [f"meshio cannot read the file ({text})", remedy])))], path.name)


def _single_line(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip(" .").removeprefix("Error: ")


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
        return [Fault("cells", f"{', '.join(other)} cannot be used ({counts}); {expected}; {remedy}")]
    if not set(kinds) & set(PLANE):
        return [Fault("cells", f"there are no two-dimensional cells ({counts}); {expected}; was the surface meshed?")]
    return []


def _padded(cells: np.ndarray) -> np.ndarray:
    return np.pad(np.asarray(cells, np.int64), ((0, 0), (0, 4 - cells.shape[1])), constant_values=-1)


def _groups(file_mesh: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """(name -> numbers of the lines of each group, notes on groups that have only a number in the file)."""
    field_data = file_mesh.field_data or {}  # name -> (number, dimension) of each group of lines that has a name
    name_of = {int(v[0]): name for name, v in field_data.items() if np.shape(v) == (2,) and int(v[1]) == 1}
    members: dict[str, list[np.ndarray]] = {name: [] for name in name_of.values()}
    unnamed: set[int] = set()
    first = 0
    for k, block in enumerate(file_mesh.cells):
        if block.type != "line":
            continue
        for name, sets in (file_mesh.cell_sets or {}).items():
            if not name.startswith("gmsh:") and sets[k] is not None and len(sets[k]):
                members.setdefault(name, []).append(first + np.asarray(sets[k], np.int64))
        for tag, lines in _tagged_lines(file_mesh.cell_data, k):
            unnamed |= {tag} - set(name_of)
            members.setdefault(name_of.get(tag, str(tag)), []).append(first + lines)
        first += len(block.data)
    numbers = ", ".join(map(str, sorted(unnamed)))
    text = f"groups of lines with a number instead of a name in the file: their patches are named {numbers}"
    notes = (text,) if unnamed else ()
    empty = [np.empty(0, np.int64)]
    return {name: np.unique(np.concatenate(lines or empty)) for name, lines in members.items()}, notes


def _tagged_lines(cell_data: Any, k: int) -> Iterable[tuple[int, np.ndarray]]:
    """Yield (number of the group, indices of its lines in the block) for each group in block k, a block of lines.

    The number 0 stands for no group.
    """
    for key in TAGS:
        if key in cell_data:
            tags = np.asarray(cell_data[key][k]).astype(np.int64)
            for tag in np.unique(tags[tags != 0]):
                yield int(tag), np.flatnonzero(tags == tag)
