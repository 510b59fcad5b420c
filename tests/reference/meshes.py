"""Small meshes, meshes of triangles and mesh files; descriptions of a mesh that any order of its cells gives."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import meshio
import numpy as np
from scipy.spatial import Delaunay

from fvsolve.core.mesh import rectangle

SQUARE = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]  # two unit squares side by side
TWO = [[0, 1, 4, 3], [1, 2, 5, 4]]


def write(path, points, cells, groups=None, **options):
    """Write a mesh file of cells (lists of three or four points) and named lines, and return its path.

    Lines without a name are in group 0.
    """
    groups = groups or {}
    points = np.asarray(points, float)
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    lines = [
        (np.reshape(ends, (-1, 2)), k + 1 if name else 0)
        for k, (name, ends) in enumerate(groups.items())
    ]
    blocks = [("line", ends) for ends, _ in lines]
    tags = [np.full(len(ends), tag) for ends, tag in lines]
    for kind, count in (("triangle", 3), ("quad", 4)):
        chosen = [cell for cell in cells if len(cell) == count]
        if chosen:
            blocks.append((kind, np.array(chosen)))
            tags.append(np.full(len(chosen), 99))
    names = {name: np.array([k + 1, 1]) for k, name in enumerate(groups) if name}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags} if path.suffix == ".msh" else {}
    if path.suffix == ".msh":
        options = {"file_format": "gmsh22", "binary": False} | options
    meshio.Mesh(points, blocks, cell_data=data, field_data=names).write(path, **options)
    return path


def corner_lists(mesh):
    return [[p for p in cell if p >= 0] for cell in mesh.cells.tolist()]


def delaunay(seed=3, count=60):
    """Random points in the unit square with its corners, and their Delaunay triangles."""
    points = np.vstack(
        [[(0, 0), (1, 0), (0, 1), (1, 1)], np.random.default_rng(seed).random((count, 2))]
    )
    return points, Delaunay(points).simplices


def shaken(seed=5):
    """Points and cells of a 6 x 5 grid with displaced inner points.

    The cells are quadrilaterals that are not parallelograms; every third is cut into two triangles.
    """
    mesh = rectangle((3.0, 2.0), (6, 5), origin=(-1.0, 0.5))
    points = mesh.points.copy()
    inside = (points > points.min(0) + 1e-9).all(1) & (points < points.max(0) - 1e-9).all(1)
    points[inside] += np.random.default_rng(seed).uniform(-0.1, 0.1, (inside.sum(), 2))
    cells = [[c] if k % 3 else [c[:3], [c[0], *c[2:]]] for k, c in enumerate(mesh.cells.tolist())]
    return points, sum(cells, [])


def sets(mesh):
    """Sorted lists of cells and of faces, described by their positions."""
    cells = sorted(zip(*mesh.centre.round(12).T, mesh.area.round(12), strict=True))
    beyond = np.where(mesh.right >= 0, 0, mesh.right)
    turn = np.where(mesh.right < 0, 1.0, np.sign(mesh.normal @ (1.0, math.pi)))[:, None]
    faces = np.column_stack([mesh.middle, mesh.normal * turn, mesh.length, beyond]).round(12)
    return cells, sorted(map(tuple, faces + 0.0))


MSH4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 7 "in"
1 8 "out"
2 1 "water"
$EndPhysicalNames
$Entities
0 2 1 0
1 0 0 0 0 1 0 1 7 0
2 2 0 0 2 1 0 1 8 0
1 0 0 0 2 1 0 1 1 0
$EndEntities
$Nodes
1 6 1 60
2 1 0 6
10
20
30
40
50
60
0 0 0
1 0 0
2 0 0
0 1 0
1 1 0
2 1 0
$EndNodes
$Elements
3 4 1 4
1 1 1 1
1 10 40
1 2 1 1
4 30 60
2 1 3 2
2 10 20 50 40
3 20 30 60 50
$EndElements
"""


Box = tuple[float, float, float, float]


def triangles(
    size: Sequence[float], spacing: float, holes: Sequence[Box] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Points float64[p, 2] and anticlockwise triangles int[n, 3] of a rectangle with rectangular holes [m].

    Edges of the rectangle and of the holes are divided evenly; the inner points form a lattice of equilateral
    triangles.
    """
    outlines = [(0.0, 0.0, *size), *holes]
    edge = np.unique(
        np.round(np.concatenate([around(box, spacing) for box in outlines]), 9), axis=0
    )
    x, y = np.meshgrid(
        np.arange(0.0, size[0], spacing),
        np.arange(0.0, size[1], 0.5 * np.sqrt(3.0) * spacing),
        indexing="ij",
    )
    x = x + 0.5 * spacing * (np.arange(x.shape[1]) % 2)
    inner = np.column_stack([x.ravel(), y.ravel()])
    near = np.abs(inner[:, None, :] - edge[None]).max(axis=2).min(axis=1)
    keep = (near > 0.55 * spacing) & inside(inner, outlines[0])
    for hole in holes:
        keep &= ~inside(inner, hole)
    points = np.concatenate([edge, inner[keep]])
    cells = Delaunay(points).simplices
    middle = points[cells].mean(axis=1)
    for hole in holes:
        cells = cells[~inside(middle, hole)]
        middle = points[cells].mean(axis=1)
    a, b, c = (points[cells[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells = np.where((area < 0.0)[:, None], cells[:, [0, 2, 1]], cells)
    return points, cells[np.abs(area) > 1e-9 * spacing**2]


def around(box: Box, spacing: float) -> np.ndarray:
    """Points along the edges of a box at a distance of about `spacing`."""
    x = np.linspace(box[0], box[2], max(2, round((box[2] - box[0]) / spacing) + 1))
    y = np.linspace(box[1], box[3], max(2, round((box[3] - box[1]) / spacing) + 1))
    rows = [np.column_stack([x, np.full(x.size, at)]) for at in (box[1], box[3])]
    columns = [np.column_stack([np.full(y.size, at), y]) for at in (box[0], box[2])]
    return np.concatenate([*rows, *columns])


def inside(points: np.ndarray, box: Box) -> np.ndarray:
    """True at points inside a box, without its edge."""
    x, y = points.T
    return (x > box[0] + 1e-9) & (x < box[2] - 1e-9) & (y > box[1] + 1e-9) & (y < box[3] - 1e-9)


def boundary(cells: np.ndarray) -> np.ndarray:
    """Edges that belong to exactly one triangle : int[k, 2]."""
    edges = np.sort(np.concatenate([cells[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return found[count == 1]


def write_msh(
    path: Path, points: np.ndarray, cells: np.ndarray, groups: dict[str, Callable]
) -> None:
    """Write a Gmsh file of triangles.

    groups : name -> predicate of the midpoints (x, y) of boundary edges; the first group whose predicate is true
    applies
    """
    import meshio

    lines = boundary(cells)
    x, y = points[lines].mean(axis=1).T
    tag = np.full(len(lines), len(groups) + 1)
    for k, rule in reversed(list(enumerate(groups.values()))):
        tag[rule(x, y)] = k + 1
    names = [*groups, "wall"]
    field = {name: np.array([k + 1, 1]) for k, name in enumerate(names)} | {
        "cells": np.array([len(names) + 1, 2])
    }
    tags = [tag, np.full(len(cells), len(names) + 1)]
    meshio.Mesh(
        np.column_stack([points, np.zeros(len(points))]),
        [("line", lines), ("triangle", cells)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data=field,
    ).write(path, file_format="gmsh22", binary=False)


BLOCKS = ((18.0, 6.0, 24.0, 12.0), (18.0, 18.0, 24.0, 24.0), (33.0, 12.0, 39.0, 18.0))


def flood_plain(path: Path) -> None:
    """Write the mesh of cases/flooding.toml: 60 m by 30 m, three houses, west edge `breach`, east edge `drain`."""
    points, cells = triangles((60.0, 30.0), 1.5, BLOCKS)
    groups = {
        "breach": lambda x, y: (x < 1e-6) & (np.abs(y - 15.0) < 3.0),
        "drain": lambda x, y: (x > 60.0 - 1e-6) & (np.abs(y - 15.0) < 5.0),
    }
    write_msh(path, points, cells, groups)
