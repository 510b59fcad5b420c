"""Plane meshes: rectangles, and files read through meshio."""

from fvsolve.mesh.mesh import Grid, Mesh, Quality, quality
from fvsolve.mesh.read_mesh import read
from fvsolve.mesh.rectangles import rectangle

__all__ = ["Grid", "Mesh", "Quality", "quality", "read", "rectangle"]
