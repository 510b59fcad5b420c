"""Model of a case in compiled form: names become indices, laws become codes, data become flat arrays."""

from fvsolve.assembly.model_draft import PipeMesh
from fvsolve.model.build import build, vary
from fvsolve.model.model import Model, State
from fvsolve.model.run_data import RunData

__all__ = ["Model", "PipeMesh", "RunData", "State", "build", "vary"]
