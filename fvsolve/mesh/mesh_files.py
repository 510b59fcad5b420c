"""Content of a mesh file as arrays, read by meshio (the only module that imports it for reading)."""

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

PLANE = {"triangle": 3, "quad": 4}
IGNORED = {"vertex", "line", *PLANE}
TAGS = ("gmsh:physical", "medit:ref", "su2:tag")  # names of group numbers in the formats


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
    beyond = [
        Fault(
            place,
            f"number {int(rows[0])} refers to a point that is not in the file; the file has {len(points)} points",
        )
        for place, table, least in (("cells", content.cells, -1), ("lines", content.lines, 0))
        if (rows := np.flatnonzero(_bad_rows(table, least, len(points)))).size
    ]
    if beyond:
        raise MeshError(beyond, path.name)
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


def _bad_rows(table: np.ndarray, least: int, points: int) -> np.ndarray:
    low = np.where(np.arange(table.shape[1]) == 3, least, 0)
    return np.any((table < low) | (table >= points), axis=1)


def _groups(file_mesh: Any) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """(name -> numbers of the lines of each group, notes on groups that have only a number in the file)."""
    name_of = {int(tag): name for name, (tag, dimension) in _named_groups(file_mesh.field_data)}
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


def _named_groups(field_data: Any) -> Iterable[tuple[str, np.ndarray]]:
    """Yield (name, (number, dimension)) for each group of lines that has a name in the file."""
    for name, entry in (field_data or {}).items():
        if np.shape(entry) == (2,) and int(entry[1]) == 1:
            yield name, entry


def _tagged_lines(cell_data: Any, k: int) -> Iterable[tuple[int, np.ndarray]]:
    """Yield (number of the group, indices of its lines in the block) for each group in block k, a block of lines.

    The number 0 stands for no group.
    """
    for key in TAGS:
        if key in cell_data:
            tags = np.asarray(cell_data[key][k]).astype(np.int64)
            for tag in np.unique(tags[tags != 0]):
                yield int(tag), np.flatnonzero(tags == tag)
