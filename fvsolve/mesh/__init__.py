"""Plane meshes: rectangles, and files read through meshio."""

from fvsolve.mesh.mesh import Grid, Mesh
from fvsolve.mesh.mesh_quality import Quality, quality
from fvsolve.mesh.read_mesh import read
from fvsolve.mesh.rectangles import rectangle

__all__ = ["Grid", "Mesh", "Quality", "quality", "read", "rectangle"]
