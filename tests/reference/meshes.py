"""Small meshes and mesh files, and descriptions of a mesh that are independent of the order of its cells."""

import math

import meshio
import numpy as np
from scipy.spatial import Delaunay

from fvsolve.mesh import rectangle

SQUARE = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]  # two unit squares side by side
TWO = [[0, 1, 4, 3], [1, 2, 5, 4]]


def write(path, points, cells, groups=None, **options):
    """Write a mesh file of cells (lists of three or four points) and named lines, and return its path.

    Lines without a name are in group 0.
    """
    groups = groups or {}
    points = np.asarray(points, float)
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    lines = [(np.reshape(ends, (-1, 2)), k + 1 if name else 0) for k, (name, ends) in enumerate(groups.items())]
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
    points = np.vstack([[(0, 0), (1, 0), (0, 1), (1, 1)], np.random.default_rng(seed).random((count, 2))])
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
