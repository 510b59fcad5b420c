"""Plane meshes: rectangles, and files read through meshio."""

from fvsolve.core.mesh.mesh import Grid, Mesh, Quality, quality
from fvsolve.core.mesh.read_mesh import read
from fvsolve.core.mesh.rectangles import rectangle

__all__ = ["Grid", "Mesh", "Quality", "quality", "read", "rectangle"]
