"""Model of a case in compiled form: names become indices, laws become codes, data become flat arrays."""

from fvsolve.model.build import build
from fvsolve.model.model import Model, PipeMesh, State
from fvsolve.model.slate import Slate
from fvsolve.model.vary import vary

__all__ = ["Model", "PipeMesh", "Slate", "State", "build", "vary"]
