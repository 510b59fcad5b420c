"""The package's own methods by name, explicit, implicit and linearly implicit. Knows no time loop."""

from fvsolve.steppers import explicit, implicit, rosenbrock  # noqa: F401  (declare them)
from fvsolve.steppers.tableau import METHODS

AUTO = "auto"  # in place of a method: `automatic.py` chooses

__all__ = ["AUTO", "METHODS"]
