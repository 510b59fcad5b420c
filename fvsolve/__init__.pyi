"""Public names for type checkers and editors, which do not see names that are imported on first use."""

from fvsolve.case.case import Case as Case
from fvsolve.case.load import load as load
from fvsolve.core.model.build import build as build
from fvsolve.core.model.build import vary as vary
from fvsolve.core.model.model import Model as Model
from fvsolve.core.model.model import State as State
from fvsolve.core.run import Result as Result
from fvsolve.core.run import open_run as open_run
from fvsolve.core.run import run as run
from fvsolve.core.solve.advance import advance as advance
from fvsolve.core.solve.solve import initial_state as initial_state
from fvsolve.core.solve.solve import solve as solve
from fvsolve.core.steppers.ode import integrate as integrate
from fvsolve.core.steppers.tableau import tableau as tableau
from fvsolve.errors import CaseError as CaseError
from fvsolve.errors import FluidError as FluidError
from fvsolve.errors import FvsolveError as FvsolveError
from fvsolve.errors import RunError as RunError
from fvsolve.parts.own_limiters import register_limiter as register_limiter
from fvsolve.parts.plugins import register_part as register_part

__all__: list[str]
__version__: str
