"""A case made ready: names are indices, laws are codes, data are flat arrays."""

from fvsolve.model.build import build
from fvsolve.model.model import Model, PipeMesh, State

__all__ = ["Model", "PipeMesh", "State", "build"]
