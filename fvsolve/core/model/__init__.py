"""Model of a case in compiled form: names become indices, laws become codes, data become flat arrays."""

from fvsolve.core.assembly.model_draft import PipeMesh
from fvsolve.core.model.build import build, vary
from fvsolve.core.model.model import Model, State
from fvsolve.core.model.run_data import RunData

__all__ = ["Model", "PipeMesh", "RunData", "State", "build", "vary"]
